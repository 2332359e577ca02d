"""A run that refutes is replayed; a check within a scenario says what it supposes of the values that it left out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from avow.base.verdict import HypothesisKind, Outcome, Verdict
from avow.calculus import model_checking
from avow.calculus.ltl import Lasso
from avow.calculus.node_outputs import Answerer
from avow.calculus.scenario import excluded
from avow.calculus.transition import Machine

from .make import make, node, outcomes

COUNTER = node(
    "count",
    "last : INTEGER, e : INTEGER",
    "n : INTEGER",
    "G: (in.last < 3 -> out.n == in.last + 1) and (in.last >= 3 -> out.n == 0)",
)
PLAN = (
    "connections: [{{from: count.n, to: count.last, delayed: true, initial: 0}}]\n"
    "scenario: {{domains: {{INTEGER: 0..3{more}}}{steps}}}\n"
    'requirements: {{R: {{text: test, temporal: "{property}"}}}}\n'
)


def settle(folder: Path, formula: str, more: str = "", text: str = COUNTER, steps: str = "") -> Outcome:
    return outcomes(make(folder, text, PLAN.format(property=formula, more=more, steps=steps)))["R"]


@pytest.mark.parametrize("property_", ["always count.n <= 2", "eventually always count.n == 0"])
def test_answers_that_no_contract_allows_refute_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, property_: str
) -> None:
    """A search that lets a node answer anything finds runs that break whatever one likes."""
    assert settle(tmp_path / "a", property_).verdict is Verdict.REFUTED
    honest = Answerer._solve
    monkeypatch.setattr(Answerer, "_solve", lambda self, inputs, free: honest(self, inputs, True))
    outcome = settle(tmp_path / "b", "always count.n != 2 or eventually count.n == 1 and always count.n < 3")
    assert outcome.verdict is not Verdict.REFUTED, outcome.summary


def test_a_memory_that_no_wire_carries_refutes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Machine, "_before", lambda self, memory: {"count.n@before": 2})
    outcome = settle(tmp_path, "next count.n == 2")
    assert outcome.verdict is not Verdict.REFUTED, outcome.summary


def test_a_wrong_verdict_of_the_search_is_not_taken_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(formula: Any, initial: Any, following: Any, holds: Any, *_: Any) -> Lasso:
        run = [initial[0]]
        while following(run[-1])[0] not in run:
            run.append(following(run[-1])[0])
        at = run.index(following(run[-1])[0])
        return Lasso(tuple(run), at)

    assert settle(tmp_path / "a", "always eventually count.n == 0").verdict is Verdict.CHECKED
    monkeypatch.setattr(model_checking, "violation", wrong)
    outcome = settle(tmp_path / "b", "always eventually count.n == 0")
    assert outcome.verdict is Verdict.UNKNOWN, outcome.summary
    assert "replayed it does not break" in outcome.summary


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("", "scenario.domains.INTEGER: it is one of 0, 1, 2, 3"),
        (", in.e: [0]", "scenario.domains.in.e: it is one of 0"),
        (", count.e: [0]", "scenario.domains.count.e: it is one of 0"),
        (", out.n: 0..3", "scenario.domains.out.n: it is one of 0, 1, 2, 3"),
    ],
)
def test_a_check_supposes_what_its_scenario_leaves_out(tmp_path: Path, more: str, told: str) -> None:
    outcome = settle(tmp_path, "always count.n <= 3", more)
    assert outcome.verdict is Verdict.CHECKED
    assert told in [h.text for h in outcome.rests_on]


def test_a_value_that_an_assumption_excludes_is_named(tmp_path: Path) -> None:
    plan = PLAN.format(property="always count.n <= 3", more=", in.e: [0, 11, 60]", steps="")
    plan += 'environment: {in.e: {assume: "in.e <= 10", because: test}}\n'
    system = make(tmp_path, COUNTER.replace("  guarantee", "  assume ( in.e < 50 )\n  guarantee"), plan)
    told = "scenario.domains.in.e: it is one of 0; the assumptions leave out 11, 60"
    assert told in [h.text for h in outcomes(system)["R"].rests_on]
    assert {d.code for d in excluded(system)} == {"PLAN137"}
    assert [d.message.split(" has ")[1] for d in excluded(system)] == [
        "11, 60, which this assumption never allows",
        "60, which this assumption never allows",
    ]


def test_of_a_search_cut_short_also_its_length(tmp_path: Path) -> None:
    outcome = settle(tmp_path, "always count.n <= 3", steps=", steps: 2")
    assert outcome.verdict is Verdict.TESTED
    assert any(h.name == "scenario.steps" for h in outcome.rests_on)


def test_a_range_that_leaves_nothing_out_is_no_assumption(tmp_path: Path) -> None:
    text = "context { Light : {red, green}; }\n" + node("lamp", "l : Light, b : BOOL", "x : BOOL", "G: out.x")
    for domain, told in (("in.l: [red, green]", False), ("in.l: [red]", True), ("BOOL: [TRUE]", True)):
        plan = f'scenario: {{domains: {{{domain}}}}}\nrequirements: {{R: {{text: t, temporal: "always lamp.x"}}}}\n'
        outcome = outcomes(make(tmp_path / domain[-4:-1], text, plan))["R"]
        assert outcome.verdict is Verdict.CHECKED
        assert any(h.kind is HypothesisKind.BOUND for h in outcome.rests_on) is told, outcome.rests_on
