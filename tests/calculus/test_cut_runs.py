"""A search is exhaustive only where the scenario leaves out nothing that the contracts allow: not of functions, of
sequences, nor of first values."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.calculus import cut_off

from .make import make, node, outcomes

SOURCE = "context {{ F : NATURAL --> INTEGER; S : <INTEGER>; R : INTEGER --> BOOL; }}\n"

PLAN = """
connections: [{{from: a.v, to: a.last, delayed: true, initial: "{initial}"}}]
scenario: {{domains: {{{domains}}}, steps: 20}}
requirements:
  R: {{text: r, temporal: "always(({formula}))", supported_by: [a.G1]}}
"""


def verdict(
    folder: Path, output: str, guarantee: str, formula: str, domains: str, initial: str = "out.v == 0"
) -> Verdict:
    outputs = ", ".join(filter(None, ("v : INTEGER", output)))
    text = SOURCE.format() + node("a", "last : INTEGER", outputs, f"G: {guarantee}")
    plan = PLAN.format(initial=initial, domains=domains, formula=formula)
    found = outcomes(make(folder, text, plan))["R"]
    return found.verdict


@pytest.mark.parametrize(
    ("output", "guarantee", "formula", "domains", "expected"),
    [
        ("", "out.v == in.last", "a.v == 0", "", Verdict.CHECKED),
        ("", "0 <= out.v <= 2", "a.v <= 2", "out.v: [0, 1, 2]", Verdict.CHECKED),
        ("", "out.v >= 0", "a.v <= 2", "out.v: [0, 1, 2]", Verdict.TESTED),
        ("f : F", "out.v == out.f(1)", "a.v <= 2", "out.f: [0, 1, 2], NATURAL: [0, 1]", Verdict.TESTED),
        ("f : F", "out.v == 0 and out.f(1) == 1", "a.v <= 2", "out.f: [0, 1, 2], NATURAL: [0, 1]", Verdict.CHECKED),
        ("s : S", "length(out.s) == 1 and out.v == out.s(0)", "a.v <= 2", "INTEGER: [0, 1, 2]", Verdict.TESTED),
        ("s : S", "length(out.s) == 1 and out.v == out.s(0)", "a.v <= 2", "out.s: ['<0>', '<1>']", Verdict.TESTED),
        (
            "p : R",
            "(out.p(7) -> out.v == 9) and (not out.p(7) -> out.v == 0)",
            "a.v == 0",
            "out.p: [1]",
            Verdict.TESTED,
        ),
    ],
)
def test_outputs(tmp_path: Path, output: str, guarantee: str, formula: str, domains: str, expected: Verdict) -> None:
    assert verdict(tmp_path, output, guarantee, formula, domains) is expected


def test_inputs_that_leave_the_same_question_are_asked_about_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guarantee says the same for every value that is not negative."""
    asked: list[object] = []
    put = cut_off.put
    monkeypatch.setattr(cut_off, "put", lambda *given: (asked.append(given), put(*given))[1])
    guarantee = "(in.last >= 0 -> 0 <= out.v <= 6) and (in.last < 0 -> out.v == 7)"
    assert verdict(tmp_path, "", guarantee, "a.v <= 6", f"out.v: {[*range(7)]}") is Verdict.CHECKED
    assert len(asked) == 2, "one for all seven values, and one for the initial values"


@pytest.mark.parametrize(
    ("initial", "expected"),
    [
        ("out.v == 0", Verdict.CHECKED),
        ("0 <= out.v <= 2", Verdict.CHECKED),
        ("out.v >= 0", Verdict.TESTED),
        ("out.v != 5", Verdict.TESTED),
    ],
)
def test_first_values(tmp_path: Path, initial: str, expected: Verdict) -> None:
    found = verdict(tmp_path, "", "out.v == in.last", "a.v <= 2", "out.v: [0, 1, 2]", initial)
    assert found is expected
