"""A requirement that follows from a guarantee is shown only where that guarantee's assumptions are met, and whatever
they are met by is shown as well."""

from __future__ import annotations

from pathlib import Path

import pytest
from calculus.make import discharge, requirement_obligations

from avow.backend_kit.protocol import Limits
from avow.base.verdict import Outcome, Verdict
from avow.system.load import load_system


def node(name: str, source: str, target: str, assume: str, guarantee: str) -> str:
    return (
        f"node {name} {{ inputs( {source} : REAL ) outputs( {target} : REAL ) topics()\n"
        f"  {f'assume A ( {assume} )' if assume else ''} guarantee g ( {guarantee} ) }}\n"
    )


LOOP = node("a", "y", "x", "y >= 0", "x >= 0") + node("b", "x", "y", "x >= 0", "y >= 0")
CHAIN = (
    node("a", "w", "x", "", "x >= 0") + node("b", "x", "y", "x >= 1", "y >= 1") + node("c", "y", "z", "y > 0", "z > 0")
)


def settled(folder: Path, contract: str, plan: str) -> Outcome:
    (folder / "system.rcl").write_text(contract)
    (folder / "plan.yaml").write_text(plan)
    system = load_system(folder)
    (outcome,) = discharge(system, requirement_obligations(system), Limits())
    return outcome


@pytest.mark.parametrize("connections", ["", "connections: [{from: b.y, to: a.y, delayed: true, initial: '-0.5'}]\n"])
def test_a_loop(tmp_path: Path, connections: str) -> None:
    """Nobody shows that the assumption holds at first, or at all: the requirement must not read as proved."""
    requirement = "requirements: {R: {text: t, formula: 'a.x >= 0', supported_by: [a.g]}}\n"
    assert settled(tmp_path, LOOP, connections + requirement).verdict is Verdict.UNKNOWN


def test_a_chain_rests_on_all_that_comes_before(tmp_path: Path) -> None:
    found = settled(tmp_path, CHAIN, "requirements: {R: {text: t, formula: 'c.z > 0', supported_by: [c.g]}}\n")
    assert found.verdict is Verdict.UNKNOWN, "x >= 0 is not x >= 1: nobody shows what b assumes"
    good = CHAIN.replace("x >= 0", "x >= 1")
    found = settled(tmp_path, good, "requirements: {R: {text: t, formula: 'c.z > 0', supported_by: [c.g]}}\n")
    assert found.verdict is Verdict.PROVED
    assert {h.name for h in found.rests_on} >= {
        *("c/guarantee/g", "system/composition/whole.c.A"),
        *("b/guarantee/g", "system/composition/whole.b.A"),
        "a/guarantee/g",
    }
