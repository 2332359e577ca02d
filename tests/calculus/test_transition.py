"""Composed contracts, run and searched: what is decided, what is only tried, and what cannot be run at all."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from avow.calculus.scenario import CannotRun, world
from avow.calculus.transition import Machine
from avow.calculus.variables import frame
from avow.logic.values import show
from avow.system.plan import System
from avow.verdict import Verdict

from .make import make, node, outcomes

COUNTER = node(
    "count",
    "last : INTEGER",
    "n : INTEGER",
    "G: (in.last < 3 -> out.n == in.last + 1) and (in.last >= 3 -> out.n == 0)",
)
WIRES = (
    "connections: [{from: count.n, to: count.last, delayed: true, initial: 0}]\nscenario: {domains: {INTEGER: 0..3}}\n"
)


def requirement(text: str) -> str:
    return f'requirements: {{R: {{text: test, temporal: "{text}"}}}}\n'


def machine(system: System) -> Machine:
    return Machine(world(frame(system)))


@pytest.mark.parametrize(
    ("property_", "verdict"),
    [
        ("always count.n <= 3", Verdict.CHECKED),
        ("always eventually count.n == 0", Verdict.CHECKED),
        ("eventually always count.n == 0", Verdict.REFUTED),
        ("next next count.n == 3", Verdict.CHECKED),
        ("count.n != 0 until count.n == 3", Verdict.CHECKED),
        ("count.n <= 2 until count.n == 0", Verdict.REFUTED),
        ("always (count.n == 3 -> next count.n == 0)", Verdict.CHECKED),
        ("always (count.n == 3 <=> next count.n == 0)", Verdict.CHECKED),
        ("always (count.n == 3 -> next count.n == 1)", Verdict.REFUTED),
    ],
)
def test_a_counter(tmp_path: Path, property_: str, verdict: Verdict) -> None:
    found = outcomes(make(tmp_path, COUNTER, WIRES + requirement(property_)))["R"]
    assert found.verdict is verdict, found.summary
    if verdict is Verdict.CHECKED:
        assert found.details["exhaustive"] is True


def test_a_search_cut_short_is_not_checked(tmp_path: Path) -> None:
    plan = WIRES.replace("scenario: {", "scenario: {steps: 2, ")
    found = outcomes(make(tmp_path, COUNTER, plan + requirement("always count.n <= 3")))["R"]
    assert found.verdict is Verdict.TESTED
    assert "not exhaustive" in found.summary


def test_a_node_without_an_answer_stops_the_run(tmp_path: Path) -> None:
    text = COUNTER.replace("out.n == 0", "out.n == 0 and out.n == 1")
    system = make(tmp_path, text, WIRES + requirement("eventually always count.n == 0"))
    walk = machine(system).walk(Random(0), 10)
    assert [show(step.values["count.n"]) for step in walk.steps] == ["1", "2", "3"]
    assert walk.stuck is not None
    assert walk.stuck.genuine
    found = outcomes(system)["R"]
    assert found.verdict is Verdict.REFUTED
    assert "stuck after step 3" in found.summary
    assert (
        outcomes(make(tmp_path / "safe", text, WIRES + requirement("always count.n <= 3")))["R"].verdict
        is Verdict.CHECKED
    )


def test_a_scenario_without_the_value_refutes_nothing(tmp_path: Path) -> None:
    """The counter could go on to 3, but the scenario ends at 2: no fault of the contract."""
    plan = WIRES.replace("0..3", "0..2")
    found = outcomes(make(tmp_path, COUNTER, plan + requirement("eventually count.n == 3")))["R"]
    assert found.verdict is Verdict.UNKNOWN
    assert "no value of the scenario" in found.summary


def test_a_consumer_that_cannot_take_what_it_may_get_is_stuck(tmp_path: Path) -> None:
    """The provider may choose either value; that one of them leads on does not excuse the other."""
    text = node("a", "", "x : BOOL") + node("b", "x : BOOL, last : BOOL", "y : BOOL", "G: in.x and out.y")
    plan = "connections: [{from: b.y, to: b.last, delayed: true, initial: false}]\nscenario: {}\n"
    found = outcomes(make(tmp_path, text, plan + requirement("eventually b.y")))["R"]
    assert found.verdict is Verdict.REFUTED


def test_a_broken_assumption_frees_the_node(tmp_path: Path) -> None:
    text = node("a", "", "x : BOOL") + node("b", "x : BOOL", "y : BOOL", "A: in.x", "G: out.y")
    found = outcomes(make(tmp_path, text, "scenario: {}\n" + requirement("always b.y")))["R"]
    assert found.verdict is Verdict.REFUTED
    assert "b.A1" in found.summary, "and the run says that an assumption does not hold on the way"


def test_constants_stay_and_other_inputs_change(tmp_path: Path) -> None:
    text = node("a", "e : BOOL, last : BOOL", "x : BOOL, was : BOOL", "G: out.x == in.e", "G: out.was == in.last")
    plan = "connections: [{from: a.x, to: a.last, delayed: true, initial: true}]\nscenario: {}\n"
    always = requirement("next always a.x == a.was")
    found = outcomes(make(tmp_path / "a", text, plan + always))["R"]
    assert found.verdict is Verdict.REFUTED
    constant = "environment: {in.e: {because: test, constant: true}}\n"
    assert outcomes(make(tmp_path / "b", text, plan + constant + always))["R"].verdict is Verdict.CHECKED


@pytest.mark.parametrize(
    ("text", "plan", "words"),
    [
        (node("a", "r : REAL", "x : BOOL"), "{}", "infinitely many values"),
        (node("a", "f : REAL --> BOOL", "x : BOOL").replace("f : REAL --> BOOL", "f : F"), "{}", "interpret"),
        (node("a", "y : BOOL", "x : BOOL") + node("b", "x : BOOL", "y : BOOL"), "{}", "start-up deadlock"),
        (node("a", "r : REAL", "x : BOOL"), "scenario: {domains: {in.r: [blue]}}", "blue"),
        (
            node("a", "r : REAL", "x : BOOL"),
            'scenario: {domains: {in.r: [1]}}\nenvironment: {in.r: {assume: "in.r > 2", because: b}}',
            "no value of the scenario",
        ),
    ],
)
def test_what_cannot_be_run_says_why(tmp_path: Path, text: str, plan: str, words: str) -> None:
    context = "context { F : REAL --> BOOL; }\n" if "F )" in text else ""
    with pytest.raises(CannotRun, match=words):
        machine(make(tmp_path, context + text, plan))


def test_the_same_seed_gives_the_same_run(tmp_path: Path) -> None:
    text = node("a", "e : BOOL", "x : BOOL, y : BOOL", "G: out.x == in.e")
    system = make(tmp_path, text, "scenario: {}")
    runs = [[step.values["a.x"] for step in machine(system).walk(Random(seed), 12).steps] for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]
    assert len(runs[0]) == 12
