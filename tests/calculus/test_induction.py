"""Induction over steps: what a step that does not keep a claim says, and what it does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Outcome, Verdict

from .make import make, node, outcomes

DELAYED = "connections: [{from: %s, to: %s, delayed: true, initial: %s}]\n"


def requirement(formula: str, plan: str = "") -> str:
    return f"{plan}requirements: {{R: {{text: test, formula: '{formula}'}}}}\n"


def counter(last: str, *clauses: str) -> str:
    return node("count", f"last : {last}", f"n : {last}", *clauses)


COUNT_UP = counter("INTEGER", "G: out.n == in.last + 1")
WIRE = DELAYED % ("count.n", "count.last", 0)


def values(outcome: Outcome, name: str) -> list[str]:
    assert outcome.counterexample is not None
    return [dict(step)[name] for step in outcome.counterexample.trace]


def test_a_state_that_is_reached_refutes_with_the_run(tmp_path: Path) -> None:
    found = outcomes(make(tmp_path, COUNT_UP, requirement("count.n < 4", WIRE)))["R"]
    assert found.verdict is Verdict.REFUTED
    assert values(found, "count.n") == ["1", "2", "3", "4"]
    assert found.details["run"] == 4


@pytest.mark.nightly
def test_a_state_that_is_not_shown_to_be_reached_refutes_nothing(tmp_path: Path) -> None:
    """n stays 0; but from 7, which is never reached, it would go on to 8. That it stays nobody is told who leaves out
    what has quantifiers."""
    text = counter("INTEGER", "G: forall(i in INTEGER | i == in.last -> (out.n == (if i < 5 then 0 else i + 1)))")
    found = outcomes(make(tmp_path, text, requirement("count.n < 9", WIRE)))["R"]
    assert found.verdict is Verdict.UNKNOWN
    assert found.summary.startswith("not inductive: R holds at the first step, but induction fails at ")
    assert "is not shown" in found.summary
    assert found.details["induction"] == "fails"
    assert found.counterexample is not None
    assert dict(found.counterexample.values)["count.n"] == "9"
    assert "if such a step is reached" in found.counterexample.explanation


@pytest.mark.parametrize(
    ("lag", "verdict"),
    [(2, Verdict.PROVED), (3, Verdict.PROVED)],
)
def test_induction_over_several_steps(tmp_path: Path, lag: int, verdict: Verdict) -> None:
    """n keeps what the first of a row of delays holds: how many steps induction needs is the row's length."""
    inputs = ", ".join(f"b{k} : INTEGER" for k in range(lag))
    outputs = ", ".join(f"c{k} : INTEGER" for k in range(lag))
    clauses = [f"G: out.c{k} == in.b{k - 1}" for k in range(1, lag)]
    text = node("row", inputs, outputs, *clauses, f"G: out.c0 == in.b{lag - 1}")
    edges = ", ".join(f"{{from: row.c{k}, to: row.b{k}, delayed: true, initial: 1}}" for k in range(lag))
    found = outcomes(make(tmp_path, text, requirement("row.c0 == 1", f"connections: [{edges}]\n")))["R"]
    assert found.verdict is verdict, found.summary
    if verdict is Verdict.PROVED:
        assert found.details["k"] == lag
        assert f"at the first {lag} steps" in found.summary


def side(text: str, claim: str = "in.n < 4") -> str:
    return text + node("use", "n : INTEGER", "", f"A small: {claim}")


def test_a_side_condition_is_refuted_by_a_run(tmp_path: Path) -> None:
    plan = "connections: [{from: count.n, to: count.last, delayed: true, initial: 0}]\n"
    found = outcomes(make(tmp_path, side(COUNT_UP), plan))["whole.use.small"]
    assert found.verdict is Verdict.REFUTED
    assert values(found, "count.n")[-1] == "4"
    assert "at step 4 of a run" in found.summary


@pytest.mark.nightly
def test_a_side_condition_that_is_not_inductive_is_unknown(tmp_path: Path) -> None:
    text = counter("INTEGER", "G: forall(i in INTEGER | i == in.last -> (i < 5 -> out.n == 0))")
    plan = "connections: [{from: count.n, to: count.last, delayed: true, initial: 0}]\n"
    found = outcomes(make(tmp_path / "one", side(text, "in.n != 12"), plan))["whole.use.small"]
    assert found.verdict is Verdict.UNKNOWN
    assert "not inductive" in found.summary
    assert found.details["induction"] == "fails"


MAP = "context { Route : NATURAL --> NATURAL; }\n"


def router(claim: str) -> str:
    """A plan of unknown length: which cell comes next is a function."""
    plan = node(
        "plan",
        "at : NATURAL, far : NATURAL",
        "route : Route",
        "G: out.route(0) == in.at and forall(i in NATURAL | i < in.far -> out.route(i + 1) <= out.route(i) + 1)",
    )
    return MAP + plan + node("go", "route : Route, far : NATURAL", "at : NATURAL", f"G: {claim}")


def test_a_run_over_the_scenario_refutes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from avow.calculus import requirements
    from avow.solving.questions import Entailment

    plan = (
        "connections: [{from: go.at, to: plan.at, delayed: true, initial: 0}]\n"
        "scenario: {domains: {NATURAL: 0..7, in.far: [2]}}\n"
    )
    monkeypatch.setattr(requirements, "implied", lambda *_, **__: Entailment(Verdict.UNKNOWN, reason="gave up"))
    fast = router("out.at == in.route(in.far)")
    found = outcomes(make(tmp_path / "fast", fast, requirement("go.at < 6", plan)))["R"]
    assert found.verdict is Verdict.REFUTED, "whatever the solver says"
    assert values(found, "go.at") == ["2", "4", "6"], "the shortest run"
    slow = router("out.at == in.route(in.far) or out.at == 0")
    found = outcomes(make(tmp_path / "slow", slow, requirement("go.at < 8", plan)))["R"]
    assert found.verdict is Verdict.UNKNOWN, "a search over a scenario proves nothing"
    assert "no run of the 8 kinds of steps looked at over the scenario makes it false" in found.summary
