"""Ways in which a false claim once read as proved, each through the real obligations."""

from __future__ import annotations

from pathlib import Path

import pytest
from calculus.make import make, node, outcomes
from calculus.test_commands import invoke
from helpers import some

from avow.base.diagnostics import Rejected
from avow.base.verdict import Outcome, Verdict
from avow.cli.compose import command

GOOD = (Verdict.PROVED, Verdict.CHECKED)

RING = (
    node("a", "z : INTEGER", "x : INTEGER", "A positive: in.z > 0", "G: in.z > 0 -> out.x == in.z")
    + node("b", "x : INTEGER", "y : INTEGER", "A: in.x > 0", "G: out.y == in.x")
    + node("c", "y : INTEGER", "z : INTEGER", "A: in.y > 0", "G: out.z == in.y - 1")
)
BACK = "connections: [{from: c.z, to: a.z, delayed: true, initial: '1'}]\n"
WANTED = "requirements: {R: {text: t, formula: 'b.y > 0', supported_by: [D]}}\n"


def names(outcome: Outcome) -> set[str]:
    return {h.name for h in outcome.rests_on}


@pytest.mark.parametrize(("rule", "select"), [("R1", "[a, b, c]"), ("R3", "[b, c]")])
def test_a_rule_that_drops_the_back_edge(tmp_path: Path, rule: str, select: str) -> None:
    plan = BACK + f"compose: {{D: {{select: {select}, rule: {rule}}}}}\n" + WANTED
    found = outcomes(make(tmp_path, RING, plan))
    assert found["R"].verdict not in GOOD, "at the second step b.y is 0"
    assert found["whole.a.positive"].verdict not in GOOD, "the loop's obligation is made, whatever rule is named"


def test_what_only_a_base_case_needs_is_a_hypothesis(tmp_path: Path) -> None:
    text = node("b", "", "s : INTEGER", "G zero: out.s == 0") + node(
        "a", "s : INTEGER, x0 : INTEGER", "x : INTEGER", "G: out.x == in.x0 + in.s"
    )
    plan = "connections: [{from: a.x, to: a.x0, delayed: true, initial: '0'}]\n"
    plan += "requirements: {R: {text: t, formula: 'a.x == 0', supported_by: [a]}}\n"
    found = outcomes(make(tmp_path, text, plan))["R"]
    assert found.verdict is Verdict.PROVED
    assert {"b/guarantee/zero", "system/composition/whole.persistence", "system/composition/whole.one-output"} <= names(
        found
    )


def test_a_circle_within_a_step_is_not_hidden_by_the_first_one(tmp_path: Path) -> None:
    text = node("a", "y : INTEGER, p : INTEGER", "x : INTEGER", "A: in.y > 0", "G: out.x > 0") + node(
        "b", "x : INTEGER", "y : INTEGER", "A: in.x > 0", "G: out.y > 0"
    )
    plan = "connections: [{from: a.x, to: a.p, delayed: true, initial: '1'}]\n"
    plan += "requirements: {R: {text: t, formula: 'a.x > 0', supported_by: [a]}}\n"
    found = outcomes(make(tmp_path, text, plan))
    assert not [name for name, o in found.items() if o.verdict in GOOD and not name.startswith(("joint", "start"))]


def test_two_guarantees_that_swap_names(tmp_path: Path) -> None:
    def behind(folder: str, first: str, second: str) -> set[tuple[str, str]]:
        text = node("p", "", "x : INTEGER", f"G {first}: out.x > 3", f"G {second}: out.x < 9") + node(
            "q", "x : INTEGER", "", "A: in.x > 2"
        )
        plan = "requirements: {R: {text: t, formula: 'p.x > 1', supported_by: [p]}}\n"
        outcome = outcomes(make(tmp_path / folder, text, plan))["R"]
        assert outcome.verdict is Verdict.PROVED
        return {(h.name, h.digest) for h in outcome.rests_on}

    one, other = behind("one", "g1", "g2"), behind("other", "g2", "g1")
    assert {digest for _, digest in one} == {digest for _, digest in other}, "the same formula, whatever it is called"
    assert {name for name, _ in one} == {"p/guarantee/g1"}
    assert {name for name, _ in other} == {"p/guarantee/g2"}


def test_an_initial_value_says_nothing_of_the_environment(tmp_path: Path) -> None:
    text = node("a", "e : INTEGER, w : INTEGER", "v : INTEGER", "G: out.v == in.w + in.e")
    plan = "connections: [{from: a.v, to: a.w, delayed: true, initial: 'out.v == 0 and in.e > 0'}]\n"
    with pytest.raises(Rejected, match="constant inputs"):
        outcomes(make(tmp_path / "changing", text, plan))
    outcomes(make(tmp_path / "constant", text, plan + "environment: {in.e: {constant: true, because: set once}}\n"))


def test_nothing_is_exported_from_a_refuted_derivation(tmp_path: Path) -> None:
    text = node("a", "", "x : INTEGER", "G: out.x > 0") + node("b", "x : INTEGER", "", "A: in.x > 1")
    make(tmp_path, text)
    code, written = invoke(command, str(tmp_path), "--rcl")
    assert code == 1
    assert "node" not in written.split("no contract")[0]


def test_values_of_several_nodes_belong_together_only_for_a_reason(tmp_path: Path) -> None:
    text = (
        node("p", "", "x : INTEGER", "G: out.x > 0")
        + node("q", "", "y : INTEGER", "G: out.y > 0")
        + node("r", "x : INTEGER, y : INTEGER", "z : INTEGER", "A: in.x + in.y > 1", "G: out.z > 0")
    )
    plan = "requirements: {R: {text: t, formula: 'r.z > 0', supported_by: [r.G1]}}\n"
    found = outcomes(make(tmp_path, text, plan))
    wanted = {"system/composition/whole.persistence", "system/composition/whole.one-output"}
    assert wanted <= names(found["R"])
    assert wanted <= names(found["whole.r.A1"])
    assert {found[name.rsplit("/", 1)[1]].verdict for name in wanted} == {Verdict.UNKNOWN}


APART = (
    # what m says of its own steps is nothing of n's, which it neither feeds nor hears
    ("A sm: rose(in.p) or fell(in.p)", "previous(TRUE, FALSE)", "previous(in.p, FALSE) != in.p"),
    ("A sm: once[100 ms](in.p)", "TRUE", "once[200 ms](in.p)"),
)


@pytest.mark.parametrize(("assumed", "first", "then"), some(APART, 1, slow=1))
def test_steps_of_two_nodes_are_one_only_for_a_reason(tmp_path: Path, assumed: str, first: str, then: str) -> None:
    text = node("n", "p : BOOL", "s : BOOL, t : BOOL", f"G: out.s <=> ({first})", f"G: {then} -> out.t")
    text += node("m", "p : BOOL", "u : BOOL", assumed, "G: out.u")
    plan = "requirements: {R: {text: t, formula: 'n.s -> n.t', supported_by: [n]}}\n"
    found = outcomes(make(tmp_path, text, plan))["R"]
    assert found.verdict is Verdict.PROVED
    assert {"system/composition/whole.persistence", "system/composition/whole.one-output"} <= names(found)


def test_a_node_called_loop(tmp_path: Path) -> None:
    text = node("a", "x0 : INTEGER", "x : INTEGER", "A: in.x0 > 0", "G: out.x > 0") + node(
        "loop", "x : INTEGER", "", "A a: in.x > 1"
    )
    plan = "connections: [{from: a.x, to: a.x0, delayed: true, initial: '1'}]\n"
    found = outcomes(make(tmp_path, text, plan))
    assert found["whole.loop.a"].verdict is Verdict.REFUTED, "what the node assumes"
    assert found["whole.loop-of.a"].verdict is Verdict.PROVED, "the loop of the other"
