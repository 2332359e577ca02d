"""Refinement, the derived contract, and hierarchy."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.calculus.composition import compose
from avow.calculus.export import derived_contract
from avow.calculus.refinement import refines
from avow.language.contract import Node
from avow.language.load import check_text
from avow.language.translate import to_rcl
from avow.system.load import load_bare
from avow.verdict import Verdict

from .case_study import REPAIRED
from .make import case_study, make, node, settled


def only(text: str, context: str = "") -> Node:
    contract, diagnostics = check_text(context + text, "test.rcl")
    assert contract is not None, diagnostics
    return contract.nodes[0]


BASE = node("n", "r : REAL", "x : REAL", "A reading: 0 <= in.r <= 10", "G above: out.x >= in.r")


@pytest.mark.parametrize(
    ("text", "verdict", "clause"),
    [
        (BASE, Verdict.PROVED, ""),
        (BASE.replace("0 <= in.r <= 10", "-1 <= in.r"), Verdict.PROVED, ""),
        (BASE.replace("out.x >= in.r", "out.x == in.r + 1"), Verdict.PROVED, ""),
        (BASE.replace("out.x >= in.r", "(in.r <= 10 -> out.x > in.r)"), Verdict.PROVED, ""),
        (BASE.replace("<= 10", "< 10"), Verdict.REFUTED, "reading"),
        (BASE.replace("out.x >= in.r", "out.x >= in.r - 0.001"), Verdict.REFUTED, "above"),
    ],
)
def test_weaker_assumptions_stronger_guarantees(text: str, verdict: Verdict, clause: str) -> None:
    found = refines(only(text), only(BASE))
    assert found.verdict is verdict
    failing = [demand for demand in found.demands if demand.verdict is not Verdict.PROVED]
    assert [demand.clause.name for demand in failing] == ([clause] if clause else [])
    assert all(demand.counterexample is not None for demand in failing)


def test_ports_must_fit() -> None:
    missing = refines(only(node("n", "r : REAL", "z : REAL")), only(BASE))
    assert missing.verdict is Verdict.REFUTED
    assert "no output 'x'" in missing.faults[0].message
    wants_more = refines(only(BASE.replace("r : REAL", "r : REAL, s : REAL")), only(BASE))
    assert "wants an input 's'" in wants_more.faults[0].message
    other_type = refines(only(BASE.replace("x : REAL", "x : REAL").replace("r : REAL", "r : INTEGER")), only(BASE))
    assert other_type.verdict is Verdict.REFUTED


def test_types_are_compared_by_what_they_are() -> None:
    text = node("n", "c : %s", "d : %s", "G: in.c == red -> out.d in {red, green}")
    one = only(text % ("Colour", "Colour"), "context { Colour : {red, green, blue}; }\n")
    other = only(text % ("Lamp", "Lamp"), "context { Lamp : {red, green, blue}; }\n")
    assert refines(one, other).verdict is Verdict.PROVED
    assert refines(other, one).verdict is Verdict.PROVED


def test_the_derived_contract_is_a_contract(tmp_path: Path) -> None:
    composition = compose(case_study(tmp_path, "remote_inspection", REPAIRED))
    for goal in composition.goals:
        text = to_rcl(derived_contract(composition, goal))
        contract, diagnostics = check_text(text, "derived.rcl")
        assert contract is not None, diagnostics
    whole = derived_contract(composition, composition.whole).nodes[0]
    assert {port.name for port in whole.outputs} == {
        "position",
        "at",
        "command",
        "phase",
        "radiationStatus",
        "inspected",
    }
    assert {port.name for port in whole.inputs} >= {"wayP", "r", "command_before", "at_before"}
    assert "navigation_was_somewhere" in [clause.name for clause in whole.assumptions], "shown only over own steps"


def test_hierarchy(tmp_path: Path) -> None:
    """A composed subsystem takes its part in a larger system."""
    inner = make(
        tmp_path / "inner",
        node("a", "r : REAL", "m : REAL", "A: in.r >= 0", "G: out.m == in.r + 1")
        + node("b", "m : REAL", "x : REAL", "A: in.m >= 1", "G: out.x >= in.m"),
    )
    composition, answers = settled(inner)
    assert answers.verdict is Verdict.PROVED
    (tmp_path / "sub.rcl").write_text(to_rcl(derived_contract(composition, composition.whole)))
    (tmp_path / "top.rcl").write_text(
        node("source", "", "r : REAL", "G: out.r >= 2") + node("sink", "x : REAL", "", "A: in.x >= 3")
    )
    system = load_bare([tmp_path / "sub.rcl", tmp_path / "top.rcl"])
    _, answers = settled(system)
    assert answers.verdict is Verdict.PROVED
    assert answers.goal.root.nodes == ("source", "inner", "sink") or len(answers.goal.root.nodes) == 3
