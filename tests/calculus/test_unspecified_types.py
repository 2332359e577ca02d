"""Unspecified types in composed systems: what exists has to exist however many elements there are."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict

from .make import make, node, outcomes

LOOP = (
    "context { O : {}; P : {p(O), q}; }"
    + node("a", "x : O, u : P", "y : O, z : P", "G: out.y == in.x and out.z == in.u")
    + node("b", "y : O, z : P", "x : O, u : P", "G: out.x == in.y and out.u == in.z")
)

PLAN = """
connections:
  - {{from: a.y, to: b.y}}
  - {{from: a.z, to: b.z}}
  - {{from: b.x, to: a.x, delayed: true, initial: "{0}"}}
  - {{from: b.u, to: a.u, delayed: true, initial: "{1}"}}
"""


@pytest.mark.parametrize(
    ("first", "second", "verdict"),
    [
        ("out.x == out.x", "out.u == q", Verdict.PROVED),
        ("out.x == out.x", "out.u != q", Verdict.PROVED),
        ("exists(k in O | k != out.x)", "out.u == q", Verdict.REFUTED),
        ("forall(k in O | k == out.x)", "out.u == q", Verdict.REFUTED),
        ("out.x == out.x", "forall(k in O | out.u == p(k))", Verdict.REFUTED),
    ],
)
def test_first_values(tmp_path: Path, first: str, second: str, verdict: Verdict) -> None:
    found = outcomes(make(tmp_path, LOOP, PLAN.format(first, second)))
    (start,) = (outcome for name, outcome in found.items() if name.startswith("start."))
    assert start.verdict is verdict, start.summary
    if verdict is Verdict.PROVED:
        assert "certificate" in start.details, "the kernel says so too"
