"""Small random systems against brute force: no derivation may stand that an enumeration of all steps refutes."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import pytest
from drawn.formulas import BOOL, PLAIN, Formulas
from oracle.values import holds

from avow.base.verdict import Verdict
from avow.calculus.composition import Composition
from avow.calculus.variables import Frame
from avow.system.plan import Endpoint

from .make import make, node, settled

Values = dict[str, object]
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


class Enumeration:
    """All steps of a finite system, found by trying everything: its own reading of what contracts mean together."""

    def __init__(self, composition: Composition) -> None:
        self.frame: Frame = composition.frame
        self.graph = self.frame.graph
        contract = self.frame.system.contract
        self.outputs = [f"{n.name}.{p.name}" for n in contract.nodes for p in n.outputs]
        self.delayed = sorted({str(e.source) for e in self.graph.edges if e.delayed})
        self.outside = sorted({e.port for e in self.graph.environment})
        self.clauses = {
            f"{n.name}.{c.name}": (n.name, partial(holds, c.formula)) for n in contract.nodes for c in n.clauses
        }
        self.assumed = {str(name) for name in composition.whole.root.assumed}
        self.given = [partial(holds, a.formula) for a in self.frame.assumed]

    def local(self, name: str, values: Mapping[str, object], before: Mapping[str, object]) -> Values:
        found: Values = {}
        contract = self.frame.node(name)
        for port in contract.outputs:
            found[f"out.{port.name}"] = values[f"{name}.{port.name}"]
        for port in contract.inputs:
            edge = self.graph.by_target.get(Endpoint(name, port.name))
            if edge is None:
                found[f"in.{port.name}"] = values[f"in.{port.name}"]
            else:
                found[f"in.{port.name}"] = (before if edge.delayed else values)[str(edge.source)]
        return found

    def starts(self) -> Iterator[Values]:
        for combination in product([False, True], repeat=len(self.delayed)):
            before: Values = dict(zip(self.delayed, combination, strict=True))
            fits = True
            for edge in self.graph.edges:
                if edge.delayed and edge.initial is not None:
                    fits &= before[str(edge.source)] is (edge.initial == "TRUE")
            if fits:
                yield before

    def broken(self) -> str | None:
        """An assumption that fails at a step that is reached, though the environment and every node do their part."""
        waiting = list(self.starts())
        seen: set[tuple[object, ...]] = set()
        while waiting:
            before = waiting.pop()
            mark = tuple(before.values())
            if mark in seen:
                continue
            seen.add(mark)
            names = [*self.outputs, *(f"in.{port}" for port in self.outside)]
            for combination in product([False, True], repeat=len(names)):
                values: Values = dict(zip(names, combination, strict=True))
                local = {n: self.local(n, values, before) for n in self.graph.nodes}
                if not all(given({f"in.{p}": values[f"in.{p}"] for p in self.outside}) for given in self.given):
                    continue
                truth = {label: judge(local[n]) for label, (n, judge) in self.clauses.items()}
                if not all(truth[name] for name in self.assumed):
                    continue
                assumptions = {n: [f"{n}.{a.name}" for a in self.frame.node(n).assumptions] for n in self.graph.nodes}
                kept = all(
                    not all(truth[a] for a in assumptions[n])
                    or all(truth[f"{n}.{g.name}"] for g in self.frame.node(n).guarantees)
                    for n in self.graph.nodes
                )
                if not kept:
                    continue
                for names_of in assumptions.values():
                    for name in names_of:
                        if not truth[name]:
                            return name
                waiting.append({name: values[name] for name in self.delayed})
        return None


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
            assert Enumeration(composition).broken() is None, f"seed {seed}:\n{text}\n{plan}"
    assert stood >= 2, "the test says little if nothing is ever proved"
    assert conditions > 20


def test_the_enumeration_itself_finds_faults(tmp_path: Path) -> None:
    """Circular support is exactly what it must not be blind to."""
    text = node("a", "y : BOOL", "x : BOOL", "A: in.y", "G: out.x") + node(
        "b", "x : BOOL", "y : BOOL", "A: in.x", "G: out.y"
    )
    composition, answers = settled(make(tmp_path, text))
    assert Enumeration(composition).broken() is not None
    assert answers.verdict is Verdict.REFUTED
