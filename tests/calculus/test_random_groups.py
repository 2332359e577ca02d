"""Random systems with random subsystems against brute force: grouping never derives what an enumeration refutes."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.calculus.composition import Composition, compose
from avow.calculus.discharge import Bounds

from .make import make, node, settled
from .test_random_systems import broken, random_system

SYSTEMS = 100


def random_groups(seed: int, nodes: list[str]) -> str:
    """Subsystems over some of the nodes, some inside others, as a plan has them."""
    chance = random.Random(seed)
    free, groups = list(nodes), {}
    for number in range(chance.randint(1, 3)):
        members = [name for name in free if chance.random() < 0.6]
        if members:
            free = [name for name in free if name not in members] + [f"s{number}"]
            groups[f"s{number}"] = members
    return "".join(f"  {name}: {{nodes: [{', '.join(members)}]}}\n" for name, members in groups.items())


def stands(composition: Composition) -> bool:
    return composition.stands(composition.whole, Bounds()) is Verdict.PROVED


@pytest.mark.nightly
@pytest.mark.parametrize("block", range(5))
def test_no_grouping_derives_what_enumeration_refutes(tmp_path: Path, block: int) -> None:
    stood = grouped = 0
    for seed in range(block * SYSTEMS // 5, (block + 1) * SYSTEMS // 5):
        text, plan = random_system(seed)
        groups = random_groups(seed, [f"n{k}" for k in range(text.count("node "))])
        composition = compose(make(tmp_path / str(seed), text, f"{plan}subsystems:\n{groups}" if groups else plan))
        assert len(composition.goals) == groups.count("\n") + 1
        if stands(composition):
            stood += 1
            grouped += any(goal.conditions for goal in composition.goals if groups)
            assert broken(composition) is None, f"seed {seed}:\n{text}\n{plan}{groups}"
    assert stood >= 3, "the test says little if nothing is ever proved"
    assert grouped >= 2


CIRCLE = node("a", "y : BOOL", "x : BOOL", "A: in.y", "G: out.x") + node(
    "b", "x : BOOL", "y : BOOL", "A: in.x", "G: out.y"
)


@pytest.mark.parametrize("groups", ["{s: {nodes: [a, b]}}", "{s: {nodes: [a]}, t: {nodes: [b]}}", "{s: {nodes: [a]}}"])
def test_circular_support_is_refused_wherever_the_border_runs(tmp_path: Path, groups: str) -> None:
    composition = compose(make(tmp_path, CIRCLE, f"subsystems: {groups}"))
    assert broken(composition) is not None
    assert composition.stands(composition.whole, Bounds()) is Verdict.REFUTED


@pytest.mark.nightly
def test_grouping_loses_little(tmp_path: Path) -> None:
    """Of what stands without subsystems, most stands with them: the calculus did not get sound by proving nothing."""
    flat = kept = 0
    for seed in range(40):
        text, plan = random_system(seed)
        if settled(make(tmp_path / f"{seed}", text, plan))[1].verdict is not Verdict.PROVED:
            continue
        flat += 1
        groups = random_groups(seed, [f"n{k}" for k in range(text.count("node "))])
        kept += stands(compose(make(tmp_path / f"{seed}g", text, f"{plan}subsystems:\n{groups}" if groups else plan)))
    assert flat >= 5
    assert kept >= flat // 2, (flat, kept)
