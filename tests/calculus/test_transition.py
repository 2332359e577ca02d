"""Composed contracts, run and searched: what is decided, what is only tried, and what cannot be run at all."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from avow.base.tuning.bounds import NODE_ANSWERS
from avow.base.verdict import Verdict
from avow.calculus.scenario import CannotRun, world
from avow.calculus.transition import Machine
from avow.calculus.variables import frame
from avow.formulas.values import show
from avow.system.plan import System

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
    text = COUNTER.replace("out.n == in.last + 1", "out.n > in.last and out.n < in.last + 2")
    plan = WIRES.replace("0..3", "0..2")
    found = outcomes(make(tmp_path, text, plan + requirement("eventually count.n == 3")))["R"]
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


# -- functions and sequences that nodes put out ------------------------------------------------------------------------

TYPES = """context {
  Plan : NATURAL --> NATURAL;
  Price : NATURAL --> REAL;
  Row : <NATURAL>;
  Thing : {};
}
"""
READS = "forall(i in NATURAL | i < in.far -> out.p(i + 1) == out.p(i) + 1)"
PLANNER = node("a", "far : NATURAL", "p : Plan", "G: out.p(0) == 1 and " + READS)
READER = node("b", "p : Plan, far : NATURAL", "x : NATURAL", "G: out.x == in.p(in.far)")
PRICES = node("a", "k : NATURAL", "p : Price", "G: out.p(in.k) == in.k / 3")


def plan_of(property_: str, domains: str = "NATURAL: 0..5") -> str:
    return f"scenario: {{domains: {{{domains}}}}}\n" + requirement(property_)


@pytest.mark.parametrize(
    ("text", "property_", "domains", "verdict", "words"),
    [
        (PLANNER + READER, "always b.x == a.far + 1", "NATURAL: 0..5, in.far: [0, 2, 4]", Verdict.CHECKED, ""),
        (PLANNER + READER, "always b.x <= 4", "NATURAL: 0..5, in.far: [0, 2, 4]", Verdict.REFUTED, "is false"),
        # what the guarantees leave open, any reader may find there
        (PLANNER + READER.replace("(in.far)", "(in.far + 1)"), "always b.x != 3", "NATURAL: 0..4", Verdict.REFUTED, ""),
        (
            PLANNER,
            "always forall(i in NATURAL | i <= a.far -> a.p(i) > 0)",
            "NATURAL: 0..4, in.far: 0..3",
            Verdict.CHECKED,
            "",
        ),
        (PLANNER, "always forall(i in NATURAL | a.p(i) > 0)", "NATURAL: 0..3", Verdict.REFUTED, "is false"),
        # beyond the scenario's range the plan would have to go on
        (PLANNER, "always a.p(0) == 1", "NATURAL: 0..5, in.far: [9]", Verdict.TESTED, "no value of the scenario"),
        (PLANNER, "eventually a.p(0) == 1", "NATURAL: 0..5, in.far: [9]", Verdict.UNKNOWN, "no value of the scenario"),
        (
            node("a", "k : NATURAL", "p : Plan", "G: forall(i in NATURAL | out.p(i) != in.k)"),
            "always a.p(0) != 0",
            "NATURAL: 0..2, in.k: [0]",
            Verdict.TESTED,
            "over the scenario's values only",
        ),
        # an equation needs no range
        (
            PRICES + node("b", "p : Price, k : NATURAL", "x : REAL", "G: out.x == 2 * in.p(in.k)"),
            "always b.x <= 4",
            "NATURAL: 0..5",
            Verdict.CHECKED,
            "",
        ),
        (
            PRICES + node("b", "p : Price, k : NATURAL", "x : REAL", "G: out.x == 2 * in.p(in.k + 1)"),
            "always b.x <= 4",
            "NATURAL: 0..5",
            Verdict.UNKNOWN,
            "out.p",
        ),
        (
            node("a", "k : NATURAL", "s : Row", "G: out.s == <in.k, 0>"),
            "always a.s(1) == 0",
            "NATURAL: 0..5",
            Verdict.CHECKED,
            "",
        ),
        (
            node("a", "k : NATURAL", "s : Row", "G: in.k in out.s"),
            "always length(a.s) > 0",
            "NATURAL: 0..2",
            Verdict.TESTED,
            "sequences of more than 4 elements",
        ),
        (
            node("a", "k : NATURAL", "s : Row", "G: in.k in out.s"),
            "always a.s(0) == a.k",
            "NATURAL: 0..2",
            Verdict.REFUTED,
            "",
        ),
        (
            node("a", "k : NATURAL", "s : Row", "G: in.k in out.s"),
            "always length(a.s) > 1",
            'NATURAL: 0..2, out.s: ["<0, 1, 2>", "<>"]',
            Verdict.TESTED,
            "s = <",
        ),
        (
            node("a", "o : Thing, q : Thing", "x : BOOL", "G: out.x <=> in.o == in.q"),
            "always a.x",
            "NATURAL: 0..2",
            Verdict.TESTED,
            "unspecified type",
        ),
    ],
)
def test_functions_and_sequences(
    tmp_path: Path, text: str, property_: str, domains: str, verdict: Verdict, words: str
) -> None:
    found = outcomes(make(tmp_path, TYPES + text, plan_of(property_, domains)))["R"]
    assert found.verdict is verdict, found.summary
    assert words in found.summary


def test_what_nobody_looks_at_stays_open(tmp_path: Path) -> None:
    system = make(tmp_path, TYPES + PLANNER, plan_of("always a.far < 9", "NATURAL: 0..5, in.far: [2]"))
    runs = machine(system)
    (memory,) = runs.initial()
    (step,) = runs.steps(memory)
    assert show(step.values["a.p"]) == "{0: 1, 1: 2, 2: 3, else: any}", "one step stands for all plans that begin so"


def test_functions_over_delayed_edges(tmp_path: Path) -> None:
    """What the step before left open is decided by who reads it now."""
    text = TYPES + node("a", "q : Plan", "p : Plan", "G: out.p(0) == in.q(0) + 1 or out.p(0) == 0")
    wires = "connections: [{from: a.p, to: a.q, delayed: true, initial: 'out.p(0) == 0'}]\n"
    found = outcomes(make(tmp_path / "a", text, wires + plan_of("always a.p(0) < 3")))["R"]
    assert found.verdict is Verdict.REFUTED
    assert found.counterexample is not None
    assert dict(found.counterexample.values)["a.p"] == "{0: 3, else: any}"
    other = text.replace("in.q(0) + 1", "in.q(1)")
    found = outcomes(make(tmp_path / "b", other, wires + plan_of("always a.p(0) < 3")))["R"]
    assert found.verdict is Verdict.REFUTED, "q(1) may be anything at first"
    found = outcomes(make(tmp_path / "c", text, wires + plan_of("always a.p(0) <= 5")))["R"]
    assert found.verdict is Verdict.TESTED, "it grows beyond what the scenario has"


@pytest.mark.nightly
def test_a_search_that_would_take_for_ever_ends(tmp_path: Path) -> None:
    text = TYPES + node("a", "k : NATURAL", "p : Plan", "G: exists(i in NATURAL | i <= 9 and out.p(i) == in.k)")
    found = outcomes(make(tmp_path, text, plan_of("always a.k < 20", "NATURAL: 0..9")))["R"]
    assert found.verdict is Verdict.TESTED
    assert f"more than {NODE_ANSWERS} answers" in found.summary


def test_initial_values_may_be_those_of_what_the_environment_gives_for_good(tmp_path: Path) -> None:
    """`out.x <=> in.e` before the first step: `in.e` is constant, or the start would speak of a later value."""
    text = node("a", "m : BOOL, e : BOOL", "x : BOOL, y : BOOL", "G: out.y <=> in.m", "G: out.x")
    plan = """
connections: [{from: a.x, to: a.m, delayed: true, initial: "out.x <=> in.e"}]
environment: {in.e: {because: it does not move, constant: true}}
requirements:
  SAME: {text: t, temporal: "a.y <=> a.e"}
  ALWAYS: {text: t, temporal: "always (a.y <=> a.e)"}
"""
    found = outcomes(make(tmp_path, text, plan))
    assert found["SAME"].verdict is Verdict.CHECKED
    assert found["ALWAYS"].verdict is Verdict.REFUTED


@pytest.mark.parametrize("when", ["initial", "walk", "look_for_cuts"])
def test_what_cannot_be_run_is_unknown_whenever_that_comes_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    """Also after every step has been looked at: it was told as a fault of Avow's own."""

    def cannot(*_: object, **__: object) -> None:
        raise CannotRun("what a clause remembers has no value")

    monkeypatch.setattr(Machine, when, cannot)
    plan = WIRES + requirement("always count.n <= 3")
    found = outcomes(make(tmp_path, COUNTER, plan))["R"]
    assert found.verdict is Verdict.UNKNOWN
    assert found.summary == "the contracts cannot be run over the scenario: what a clause remembers has no value"
