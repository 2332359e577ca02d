"""Small random systems that put out functions and sequences, over delays and loops, against all their runs."""

from __future__ import annotations

import random
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from oracle.domains import domain
from reference.meaning import holds

from avow.base.verdict import Outcome, Verdict
from avow.calculus.composition import Composition, compose
from avow.calculus.obligations import composition_obligations
from avow.language.sorts import SequenceSort, Sort
from avow.system.temporal import parse_state

from .enumeration import Enumeration, Values
from .make import make, node, requirement_obligations, settle_all

CONTEXT = "context { Tint : {red, blue}; Paint : Tint --> Tint; Row : <Tint>; }\n"
TYPES = {"t": "Tint", "f": "Paint", "s": "Row", "b": "BOOL"}
SYSTEMS = 8
ROWS = [(), ("red",), ("blue",), ("red", "blue")]


def tint(chance: random.Random, names: list[str], depth: int = 2) -> str:
    own = [n for n in names if n.rpartition(".")[2][0] in "tf"]
    name = chance.choice(own) if own and chance.random() < 0.8 else chance.choice(["red", "blue"])
    if name.rpartition(".")[2].startswith("f") and "." in name:
        return f"{name}({tint(chance, names, depth - 1) if depth else chance.choice(['red', 'blue'])})"
    return name


def atom(chance: random.Random, names: list[str]) -> str:
    flags = [n for n in names if n.rpartition(".")[2].startswith("b")]
    rows = [n for n in names if n.rpartition(".")[2].startswith("s")]
    maps = [n for n in names if n.rpartition(".")[2].startswith("f")]
    kind = chance.random()
    if flags and kind < 0.25:
        return chance.choice(flags)
    if rows and kind < 0.45:
        row = chance.choice(rows)
        return chance.choice(
            [f"length({row}) == {chance.randint(0, 2)}", f"{tint(chance, names)} in {row}", f"length({row}) >= 1"]
        )
    if maps and kind < 0.6:
        return f"forall(c in Tint | {chance.choice(maps)}(c) {chance.choice(['==', '!='])} {tint(chance, names, 0)})"
    return f"{tint(chance, names)} == {tint(chance, names)}"


def formula(chance: random.Random, names: list[str], depth: int = 2) -> str:
    if depth == 0 or chance.random() < 0.3:
        return atom(chance, names) if chance.random() < 0.7 else f"(not {atom(chance, names)})"
    operator = chance.choice(["and", "or", "or", "->", "<=>"])
    return f"({formula(chance, names, depth - 1)} {operator} {formula(chance, names, depth - 1)})"


def random_system(seed: int) -> tuple[str, str, str]:
    """Two or three nodes; each reads some outputs of earlier ones at once, and some of any of them one step later."""
    chance = random.Random(seed)
    count = chance.randint(2, 3)
    outputs = [[f"{chance.choice('tfsb')}{k}" for _ in range(1)] for k in range(count)]
    text, edges, ports = CONTEXT, [], []
    for k in range(count):
        inputs = [name for earlier in outputs[:k] for name in earlier if chance.random() < 0.7]
        for other, names in enumerate(outputs):
            if chance.random() < 0.35:
                late = f"{names[0]}_{other}"
                inputs.append(late)
                edges.append((f"n{other}.{names[0]}", f"n{k}.{late}"))
        if chance.random() < 0.3:
            inputs.append("b_e")
        reads = [f"in.{name}" for name in inputs]
        writes = [f"out.{name}" for name in outputs[k]]
        clauses = [f"A a: {formula(chance, reads, 1)}"] if reads and chance.random() < 0.5 else []
        clauses += [f"G g{j}: {formula(chance, [*reads, *writes, *writes])}" for j in range(chance.randint(1, 2))]
        described = [", ".join(f"{n} : {TYPES[n[0]]}" for n in part) for part in (inputs, outputs[k])]
        text += node(f"n{k}", *described, *clauses)
        ports += [f"n{k}.{name}" for name in (*inputs, *outputs[k])]
    first = {"t": ["red", "blue"], "b": ["TRUE", "FALSE"], "s": ["<red>"], "f": []}
    given: dict[str, str] = {}
    for source, _ in edges:
        values = first[source.partition(".")[2][0]]
        given.setdefault(source, chance.choice(values) if values and chance.random() < 0.8 else "")
    shown = [
        f"{{from: {source}, to: {target}, delayed: true{', initial: ' + given[source] if given[source] else ''}}}"
        for source, target in edges
    ]
    rows = ", ".join(f'"<{", ".join(row)}>"' for row in ROWS)
    claim = formula(chance, ports)
    plan = f"connections: [{', '.join(shown)}]\nscenario: {{domains: {{Row: [{rows}]}}}}\n"
    plan += f"requirements: {{ALWAYS: {{text: t, temporal: '{claim}'}}, R: {{text: t, formula: '{claim}'}}}}\n"
    return text, plan.replace(f"temporal: '{claim}'", f"temporal: 'always ({claim})'"), claim


def everything(sort: Sort) -> list[Any]:
    """The scenario has no other sequences."""
    return ROWS if isinstance(sort, SequenceSort) else domain(sort)


class Runs(Enumeration):
    """What a claim, and an assumption, are in all runs."""

    def __init__(self, composition: Composition, claim: str) -> None:
        super().__init__(composition, everything)
        self.claim = partial(holds, parse_state(claim, self.frame.system.contract, None))

    def holds(self, values: Values) -> bool:
        given: Values = {}
        for name in self.clauses:
            given |= {
                f"{k.partition('.')[0]}.{name}.{k.partition('.')[2]}": v for k, v in self.local(name, values).items()
            }
        return self.claim(given)

    def always(self, *, trusting: bool) -> bool:
        """Whether the claim holds at every step of every run; `trusting`: of those at which every assumption does."""
        return all(self.holds(values) for values, _ in self.reached(lambda broken: not (trusting and broken)))

    def may_break(self, node_name: str, clause: str) -> bool:
        """Whether, after steps at which every assumption holds, this one may be false though all behind it is kept."""
        behind, stack = {node_name}, [node_name]
        while stack:
            for edge in self.graph.feeding(stack.pop()):
                if not edge.delayed and edge.source.node not in behind:
                    behind.add(edge.source.node)
                    stack.append(edge.source.node)
        names = [n for n in self.ports if n.partition(".")[0] in behind - {node_name}]
        memories = [{n: values[n] for n in self.late} for values, _ in self.reached(lambda broken: not broken)]
        for before in {str(memory): memory for memory in (*self.starts(), *memories)}.values():
            for some in self.valuations(names, before):
                values = {n: self.everything(p.sort)[0] for n, p in self.ports.items()} | some
                kept = all(
                    holds(self.local(name, values))
                    for name in behind - {node_name}
                    for holds in (*self.clauses[name][0].values(), *self.clauses[name][1])
                )
                if kept and not self.clauses[node_name][0][f"{node_name}.{clause}"](self.local(node_name, values)):
                    return True
        return False


class Limits:
    seconds = 2.0
    seed = 0


def compare(tmp_path: Path, seed: int, told: Counter[str]) -> None:
    text, plan, claim = random_system(seed)
    system = make(tmp_path / str(seed), text, plan)
    composition = compose(system)
    obligations = [*requirement_obligations(system), *composition_obligations(system)]
    found: dict[str, Outcome] = {
        o.name: outcome for o, outcome in zip(obligations, settle_all(composition, obligations, Limits()), strict=True)
    }
    truth = Runs(composition, claim)
    about = f"seed {seed}:\n{text}\n{plan}"
    if any(name.startswith("start.") and outcome.verdict is Verdict.REFUTED for name, outcome in found.items()):
        return
    always, trusting = truth.always(trusting=False), truth.always(trusting=True)
    # of sequences the enumeration, too, knows the scenario's only: where a contract allows others, runs are cut off
    cut = always and ": Row" in text and "the scenario's" in found["ALWAYS"].summary
    expected = Verdict.REFUTED if not always else Verdict.TESTED if cut else Verdict.CHECKED
    assert found["ALWAYS"].verdict is expected, about + found["ALWAYS"].summary
    match found["R"].verdict:
        case Verdict.PROVED:
            assert trusting, about
        case Verdict.REFUTED:
            assert not always, about + found["R"].summary
    told[f"ALWAYS {found['ALWAYS'].verdict}"] += 1
    told[f"R {found['R'].verdict}"] += 1
    for condition in composition.whole.conditions:
        outcome = found[f"{composition.whole.name}.{condition.about}"]
        told[f"side {outcome.verdict}"] += 1
        if outcome.verdict is Verdict.REFUTED and "circle" not in outcome.details:
            assert truth.may_break(condition.consumer, condition.clause), about + outcome.summary


@pytest.mark.parametrize(
    "seeds",
    [
        range(1),
        pytest.param(range(1, SYSTEMS), marks=pytest.mark.slow),
        pytest.param(range(SYSTEMS, 5 * SYSTEMS), marks=pytest.mark.nightly),
    ],
    ids=["one", "few", "many"],
)
def test_runs_are_what_an_enumeration_finds(tmp_path: Path, seeds: range) -> None:
    told: Counter[str] = Counter()
    for seed in seeds:
        compare(tmp_path, seed, told)
    assert told["ALWAYS checked"] + told["ALWAYS refuted"] >= 1
    if len(seeds) > 1:
        assert min(told["ALWAYS checked"], told["ALWAYS refuted"]) >= 1
