"""Small random systems against brute force: no derivation may stand that an enumeration of all steps refutes."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest
from drawn.formulas import BOOL, PLAIN, Formulas

from avow.base.verdict import Verdict
from avow.calculus.composition import Composition
from avow.calculus.subsystem_contracts import innermost

from .enumeration import Enumeration
from .make import make, node, settled

SYSTEMS = 96
BLOCKS = 4
CONNECTED = replace(PLAIN, atoms=0.3, connectives=("and", "or", "or", "->", "<=>"))


def random_system(seed: int) -> tuple[str, str]:
    """Two to four nodes with truth values, wired at random, with and without delays and first values."""
    chance = random.Random(seed)
    formulas = Formulas(chance, CONNECTED)

    def formula(names: list[str], depth: int = 2) -> str:
        return formulas.formula(depth, dict.fromkeys(names, BOOL))

    count = chance.randint(2, 4)
    wires = [f"w{k}" for k in range(count)]
    text, connections = "", []
    for k in range(count):
        inputs = [w for w in wires if chance.random() < 0.45 and w != wires[k]]
        if chance.random() < 0.3:
            inputs.append("e")
        if chance.random() < 0.2:
            inputs.append("m")
            connections.append(
                f"{{from: n{k}.{wires[k]}, to: n{k}.m, delayed: true, initial: {chance.choice(['TRUE', 'FALSE'])}}}"
            )
        reads = [f"in.{name}" for name in inputs]
        clauses = [f"A a{j}: {formula(reads, 1)}" for j in range(chance.randint(0, 2)) if reads]
        clauses += [f"G g{j}: {formula([*reads, f'out.{wires[k]}'])}" for j in range(chance.randint(1, 2))]
        text += node(f"n{k}", ", ".join(f"{name} : BOOL" for name in inputs), f"{wires[k]} : BOOL", *clauses)
        first = chance.choice(["TRUE", "FALSE", None])
        for name in inputs:
            if name.startswith("w") and chance.random() < 0.45:
                connections.append(f"{{from: n{name[1:]}.{name}, to: n{k}.{name}, delayed: true, initial: %{name}}}")
    for wire in wires:
        first = chance.choice([", initial: true", ", initial: false", ""])
        connections = [c.replace(f", initial: %{wire}", first) for c in connections]
    fixed: dict[str, str] = {}
    for c in list(connections):  # all delayed edges of one output carry the same first value
        source = c.split(",")[0]
        initial = c.split("initial:")[1] if "initial:" in c else ""
        if fixed.setdefault(source, initial) != initial:
            connections.remove(c)
    environment = (
        'environment: {in.e: {assume: "in.e", because: test}}\n' if chance.random() < 0.3 and "e : BOOL" in text else ""
    )
    return text, f"connections: [{', '.join(connections)}]\n{environment}"


def broken(composition: Composition) -> str | None:
    """An assumption that some run breaks, though the environment and every node do their part."""
    assumed = frozenset(innermost(str(name)) for name in composition.whole.root.assumed)
    return Enumeration(composition).broken(assumed)


@pytest.mark.parametrize("block", [0, *(pytest.param(n, marks=pytest.mark.nightly) for n in range(1, BLOCKS))])
def test_no_derivation_stands_that_enumeration_refutes(tmp_path: Path, block: int) -> None:
    stood = conditions = 0
    for seed in range(block, SYSTEMS, BLOCKS):
        text, plan = random_system(seed)
        system = make(tmp_path / str(seed), text, plan)
        composition, answers = settled(system)
        conditions += len(answers.settled)
        if answers.verdict is Verdict.PROVED and answers.settled:
            stood += 1
            assert broken(composition) is None, f"seed {seed}:\n{text}\n{plan}"
    assert stood >= 2, "the test says little if nothing is ever proved"
    assert conditions > 20


def test_the_enumeration_itself_finds_faults(tmp_path: Path) -> None:
    """Circular support is exactly what it must not be blind to."""
    text = node("a", "y : BOOL", "x : BOOL", "A: in.y", "G: out.x") + node(
        "b", "x : BOOL", "y : BOOL", "A: in.x", "G: out.y"
    )
    composition, answers = settled(make(tmp_path, text))
    assert broken(composition) is not None
    assert answers.verdict is Verdict.REFUTED
