"""Side conditions, with faults sown: each must be caught, and shown where it lies."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.calculus.derivation import LoopForm, Rule

from .make import make, node, outcomes, settled


def test_a_providers_assumption_may_be_used_and_stays_assumed(tmp_path: Path) -> None:
    system = make(
        tmp_path,
        node("a", "r : REAL", "x : REAL", "A high: in.r > 5", "G copy: out.x == in.r")
        + node("b", "x : REAL", "y : REAL", "A positive: in.x > 0"),
    )
    _, answers = settled(system)
    (answer,) = answers.settled.values()
    assert answer.verdict is Verdict.PROVED
    assert set(answer.needed) == {"a.high", "a.copy"}
    assert [str(name) for name in answers.goal.root.assumed] == ["a.high"]


def test_a_chain_is_one_r1(tmp_path: Path) -> None:
    text = node("n0", "", "x0 : INTEGER", "G: out.x0 >= 0")
    for k in range(1, 8):
        text += node(
            f"n{k}", f"x{k - 1} : INTEGER", f"x{k} : INTEGER", f"A: in.x{k - 1} >= 0", f"G: out.x{k} == in.x{k - 1} + 1"
        )
    _, answers = settled(make(tmp_path, text))
    assert answers.goal.root.rule is Rule.R1
    assert len(answers.goal.root.nodes) == 8
    assert answers.verdict is Verdict.PROVED


def test_a_link_broken_in_the_middle_of_a_chain(tmp_path: Path) -> None:
    text = node("a", "", "x : INTEGER", "G: out.x >= 0")
    text += node("b", "x : INTEGER", "y : INTEGER", "A: in.x >= 0", "G: out.y == in.x - 1")
    text += node("c", "y : INTEGER", "z : INTEGER", "A: in.y >= 0", "G: out.z >= in.y")
    text += node("d", "z : INTEGER", "", "A: in.z >= -1")
    _, answers = settled(make(tmp_path, text))
    verdicts = {condition.consumer: answer.verdict for condition, answer in answers.settled.items()}
    assert verdicts == {"b": Verdict.PROVED, "c": Verdict.REFUTED, "d": Verdict.PROVED}


def test_a_fan_and_a_diamond(tmp_path: Path) -> None:
    fan = node("a", "", "x : INTEGER", "G: out.x > 0")
    fan += node("b", "x : INTEGER", "y : INTEGER", "A: in.x > 0", "G: out.y > in.x")
    fan += node("c", "x : INTEGER", "z : INTEGER", "A: in.x >= 0", "G: out.z == -in.x")
    _, answers = settled(make(tmp_path / "fan", fan))
    assert answers.goal.root.rule is Rule.R2
    assert answers.goal.root.nodes == ("a", "b", "c")
    assert answers.verdict is Verdict.PROVED
    join = node("d", "y : INTEGER, z : INTEGER", "", "A relation: in.y + in.z > 0")
    _, answers = settled(make(tmp_path / "diamond", fan + join))
    assert answers.goal.root.rule is Rule.R3
    assert answers.verdict is Verdict.PROVED, "y > x and z == -x: both branches carry the same x"
    clause = {str(condition.about): answer for condition, answer in answers.settled.items()}
    assert set(clause["d.relation"].used) == {"b", "c"}


def test_contradicting_providers_are_not_a_proof_in_silence(tmp_path: Path) -> None:
    text = node("a", "", "x : INTEGER", "G one: out.x == 1", "G two: out.x == 2")
    text += node("b", "x : INTEGER", "", "A: in.x == 3")
    (outcome,) = [o for name, o in outcomes(make(tmp_path, text)).items() if name == "whole.b.A1"]
    assert outcome.vacuous
    assert "contradict" in outcome.summary


CIRCLE = node("a", "y : INTEGER", "x : INTEGER", "A: in.y > 0", "G: out.x > 0") + node(
    "b", "x : INTEGER", "y : INTEGER", "A: in.x > 0", "G: out.y > 0"
)


def test_a_circular_assumption_is_refused_with_its_cycle(tmp_path: Path) -> None:
    system = make(tmp_path, CIRCLE)
    _, answers = settled(system)
    assert answers.verdict is Verdict.REFUTED
    assert answers.loops[0].form is LoopForm.CIRCULAR
    assert all(set(answer.circle) == {"a", "b"} for answer in answers.settled.values())
    found = outcomes(system)
    assert found["whole.a.A1"].verdict is Verdict.REFUTED
    assert "circular" in found["whole.a.A1"].summary
    assert "a → b → a" in found["whole.loop.a-b"].summary
    assert found["start.a-b"].verdict is Verdict.REFUTED
    assert "{from: b.y, to: a.y, delayed: true, initial: …}" in str(found["start.a-b"].details["next"])


def test_a_long_circle_is_named_in_part_and_recorded_whole(tmp_path: Path) -> None:
    ring = [
        node(f"n{k}", f"x{k} : INTEGER", f"x{(k + 1) % 14} : INTEGER", f"A: in.x{k} > 0", f"G: out.x{(k + 1) % 14} > 0")
        for k in range(14)
    ]
    found = outcomes(make(tmp_path, "".join(ring)))["whole.n0.A1"]
    assert found.verdict is Verdict.REFUTED
    assert "… 2 more … → n" in found.summary
    assert len(found.details["circle"]) == 14  # type: ignore[arg-type]


def test_a_delay_with_a_good_first_value_makes_it_well_founded(tmp_path: Path) -> None:
    plan = "connections: [{from: b.y, to: a.y, delayed: true, initial: %s}]"
    _, answers = settled(make(tmp_path / "good", CIRCLE, plan % 1))
    assert answers.verdict is Verdict.PROVED
    assert answers.loops[0].form is LoopForm.INITIAL
    _, answers = settled(make(tmp_path / "bad", CIRCLE, plan % 0))
    clause = {str(condition.about): answer for condition, answer in answers.settled.items()}
    assert clause["a.A1"].verdict is Verdict.REFUTED
    assert [case.verdict for case in clause["a.A1"].cases] == [Verdict.REFUTED, Verdict.PROVED]
    assert clause["b.A1"].verdict is Verdict.PROVED
    undetermined = plan.replace(", initial: %s", "")
    _, answers = settled(make(tmp_path / "none", CIRCLE, undetermined))
    assert answers.verdict is Verdict.REFUTED, "the first value may be anything"


def test_preservation_around_the_loop_is_demanded(tmp_path: Path) -> None:
    text = node("a", "y : INTEGER", "x : INTEGER", "A: in.y > 0", "G: out.x == in.y - 1")
    text += node("b", "x : INTEGER", "y : INTEGER", "A: in.x >= 0", "G: out.y == in.x")
    plan = "connections: [{from: b.y, to: a.y, delayed: true, initial: 5}]"
    _, answers = settled(make(tmp_path, text, plan))
    clause = {str(condition.about): answer for condition, answer in answers.settled.items()}
    assert [case.verdict for case in clause["a.A1"].cases] == [Verdict.PROVED, Verdict.REFUTED]


def test_a_loop_that_no_assumption_depends_on_is_harmless_but_must_start(tmp_path: Path) -> None:
    text = node("a", "y : INTEGER, r : INTEGER", "x : INTEGER", "G: out.x > 0")
    text += node("b", "x : INTEGER", "y : INTEGER", "A: in.x > 0")
    system = make(tmp_path, text)
    _, answers = settled(system)
    assert answers.verdict is Verdict.PROVED
    assert answers.loops[0].form is LoopForm.BOOTSTRAP
    assert outcomes(system)["start.a-b"].verdict is Verdict.REFUTED


def test_nested_loops(tmp_path: Path) -> None:
    text = node(
        "a",
        "x : INTEGER, z : INTEGER",
        "y : INTEGER",
        "A near: in.x >= 0",
        "A far: in.z >= 0",
        "G: out.y == in.x + in.z",
    )
    text += node("b", "y : INTEGER", "x : INTEGER", "A: in.y >= 0", "G: out.x == in.y")
    text += node("c", "x : INTEGER", "z : INTEGER", "A: in.x >= 0", "G: out.z == 2 * in.x")
    plan = """
connections:
  - {from: b.x, to: a.x, delayed: true, initial: 0}
  - {from: c.z, to: a.z, delayed: true, initial: %s}
"""
    _, answers = settled(make(tmp_path / "good", text, plan % 3))
    assert answers.goal.root.rule is Rule.R4
    assert answers.verdict is Verdict.PROVED
    _, answers = settled(make(tmp_path / "bad", text, plan % -1))
    refuted = [str(c.about) for c, answer in answers.settled.items() if answer.verdict is Verdict.REFUTED]
    assert refuted == ["a.far"]


def test_what_the_environment_must_give_stays_in_the_conclusion(tmp_path: Path) -> None:
    text = node("a", "r : REAL", "x : REAL", "A reading: in.r >= 0") + node(
        "b", "x : REAL, s : REAL", "", "A other: in.s > 1"
    )
    system = make(tmp_path / "bare", text)
    _, answers = settled(system)
    assert {str(name) for name in answers.goal.root.assumed} == {"a.reading", "b.other"}
    found = outcomes(system)
    assert found["environment.a.reading"].verdict is Verdict.UNKNOWN
    plan = 'environment: {in.r: {assume: "in.r > 3", because: it counts}, in.s: {because: hardware}}'
    found = outcomes(make(tmp_path / "planned", text, plan))
    assert found["whole.a.reading"].verdict is Verdict.PROVED
    assert [h.name for h in found["whole.a.reading"].rests_on] == ["system/composition/environment.in.r"]
    assert found["environment.in.r"].verdict is Verdict.JUSTIFIED
    assert found["environment.b.other"].verdict is Verdict.JUSTIFIED


def test_one_nodes_input_is_not_anothers(tmp_path: Path) -> None:
    text = node("a", "r : REAL", "x : REAL", "A: in.r >= 0") + node("b", "r : REAL, x : REAL", "", "A: in.r >= 0")
    plan = 'environment: {%s: {assume: "in.r >= 0", because: it counts}}'
    assert outcomes(make(tmp_path / "shared", text, plan % "in.r"))["whole.b.A1"].verdict is Verdict.PROVED
    found = outcomes(make(tmp_path / "own", text, plan % "a.r"))
    assert found["whole.a.A1"].verdict is Verdict.PROVED
    assert "whole.b.A1" not in found, "what is assumed of a's input says nothing of b's"
    assert found["environment.b.A1"].verdict is Verdict.UNKNOWN


def test_a_constant_input_is_the_same_at_every_step(tmp_path: Path) -> None:
    text = node("a", "home : INTEGER, last : INTEGER", "x : INTEGER", "A: in.last == in.home", "G: out.x == in.home")
    plan = """
connections: [{from: a.x, to: a.last, delayed: true, initial: "out.x == in.home"}]
environment: {in.home: {because: it does not move, constant: %s}}
"""
    assert settled(make(tmp_path / "constant", text, plan % "true"))[1].verdict is Verdict.PROVED
    with pytest.raises(Rejected, match="PLAN112"):  # the condition on the start would speak of one that changes
        make(tmp_path / "changing", text, plan % "false")


@pytest.mark.parametrize("rule", ["R1", "R2", "R4"])
def test_a_rule_that_does_not_fit_is_said(tmp_path: Path, rule: str) -> None:
    text = node("a", "", "x : REAL") + node("b", "", "y : REAL") + node("c", "x : REAL, y : REAL", "")
    plan = f"compose: {{D: {{select: [a, b, c], rule: {rule}}}}}"
    system = make(tmp_path, text, plan)
    assert outcomes(system)["D.rule"].verdict is Verdict.REFUTED
    goal = compose(system).goal("D")

    assert [finding.code for finding in goal.findings] == ["PLAN125"]
    assert goal.root.rule is Rule.R3, "what fits is derived all the same"


def test_digests_follow_the_meaning(tmp_path: Path) -> None:
    from avow.calculus.obligations import composition_obligations

    def digest(name: str, rcl: str, plan: str = "{}") -> str:
        obligations = composition_obligations(make(tmp_path / name, rcl, plan))
        return next(o.digest for o in obligations if o.name == "whole.b.A1")

    provider, consumer = (
        node("a", "", "x : REAL", "G: forall(k in REAL | out.x < 1)"),
        node("b", "x : REAL", "", "A: in.x < 2"),
    )
    base = digest("base", provider + consumer)
    assert digest("layout", "// a comment\n" + consumer + provider.replace("out.x < 1", "(out.x  <  1)")) == base
    assert digest("bound", provider.replace("k in", "m in") + consumer) == base
    assert digest("provider", provider.replace("< 1", "< 1.5") + consumer) != base
    assert digest("consumer", provider + consumer.replace("< 2", "< 3")) != base
    delayed = "connections: [{from: a.x, to: b.x, delayed: true, initial: %s}]"
    assert digest("delayed", provider + consumer, delayed % 0) != base
    assert digest("initial", provider + consumer, delayed % 1) != digest("again", provider + consumer, delayed % 0)


@pytest.mark.parametrize("name", ["in.home", "mem.home"])
def test_what_is_assumed_of_the_environment_reaches_the_first_step(name: str, tmp_path: Path) -> None:
    """Also where only an initial value speaks of it."""
    text = node("mem", "last : REAL, home : REAL", "m : REAL", "A: in.last <= 10", "G: out.m == in.last or out.m < 9")
    plan = f"""
connections: [{{from: mem.m, to: mem.last, delayed: true, initial: "out.m <= in.home"}}]
environment: {{{name}: {{assume: "in.home <= 10", because: it is near, constant: true}}}}
"""
    assert settled(make(tmp_path, text, plan))[1].verdict is Verdict.PROVED


def test_a_constant_of_that_name_elsewhere_is_no_constant(tmp_path: Path) -> None:
    text = node("a", "last : REAL, h : REAL", "m : REAL") + node("b", "h : REAL", "n : REAL")
    plan = """
connections: [{from: a.m, to: a.last, delayed: true, initial: "out.m <= in.h"}]
environment: {b.h: {because: it does not move, constant: true}, a.h: {because: it moves}}
"""
    with pytest.raises(Rejected) as rejected:
        make(tmp_path, text, plan)
    assert [d.code for d in rejected.value.diagnostics] == ["PLAN112"]
    make(tmp_path / "good", text, plan.replace("b.h", "b.o").replace("a.h", "b.h").replace("b.o", "a.h"))
