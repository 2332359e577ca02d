"""Random systems against all of their runs: nothing that is proved is false on any run.

Truth values only, so that the runs are a finite graph: a state is what every output was, and which nodes' assumptions
have held so far. A node keeps its guarantees as long as its assumptions have held; else it may put out anything.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from random import Random

import pytest
from calculus.make import make, outcomes

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates, requirement_scope
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.finder import Hint
from avow.kernel.certificate import Certificate, How
from avow.kernel.statements import Kind

Values = dict[str, bool]
Formula = tuple[str, Callable[[Values], bool]]


def formula(random: Random, names: list[str], depth: int = 2) -> Formula:
    """A formula over some names, as text and as a function."""
    if depth == 0 or random.random() < 0.25:
        name = random.choice(names)
        return (
            (f"{name} == TRUE", lambda v: v[name])
            if random.random() < 0.6
            else (f"{name} == FALSE", lambda v: not v[name])
        )
    (one, first), (other, second) = (formula(random, names, depth - 1) for _ in range(2))
    match random.randrange(4):
        case 0:
            return f"(({one}) and ({other}))", lambda v: first(v) and second(v)
        case 1:
            return f"(({one}) or ({other}))", lambda v: first(v) or second(v)
        case 2:
            return f"(({one}) -> ({other}))", lambda v: not first(v) or second(v)
        case _:
            return f"(({one}) <=> ({other}))", lambda v: first(v) == second(v)


class System:
    """A random system: nodes n0, n1, …, each with an output and some inputs, from others, itself or the environment."""

    def __init__(self, seed: int) -> None:
        random = Random(seed)
        size = random.randint(2, 3)
        self.nodes = [f"n{k}" for k in range(size)]
        self.wires: dict[tuple[str, str], tuple[str, bool] | None] = {}
        self.initial = {name: random.choice([True, False, None]) for name in self.nodes}
        self.assumed: dict[str, list[tuple[str, Callable[[Values], bool]]]] = {}
        self.promised: dict[str, list[tuple[str, Callable[[Values], bool]]]] = {}
        for name in self.nodes:
            inputs = [f"i{k}{name}" for k in range(random.randint(1, 2))]
            for port in inputs:
                source = random.choice([*self.nodes, None])
                same = source is not None and (source == name or random.random() < 0.4)
                self.wires[name, port] = None if source is None else (source, same)
            ins = [f"in.{port}" for port in inputs]
            self.assumed[name] = [formula(random, ins, 1) for _ in range(random.randint(0, 2))]
            self.promised[name] = [formula(random, [*ins, f"out.o{name}"]) for _ in range(random.randint(1, 2))]
        self.required = [formula(random, [f"{n}.o{n}" for n in self.nodes]) for _ in range(2)]
        self.names = ["g0", "g1"]
        self.text, self.plan = self.written(), self.planned(random)

    def written(self) -> str:
        text = ""
        for name in self.nodes:
            clauses = [f"  assume a{k} ( {text_} )\n" for k, (text_, _) in enumerate(self.assumed[name])]
            clauses += [
                f"  guarantee {called} ( {text_} )\n"
                for called, (text_, _) in zip(self.names, self.promised[name], strict=False)
            ]
            ports = ", ".join(f"{port} : BOOL" for node, port in self.wires if node == name)
            text += f"node {name} {{ inputs( {ports} ) outputs( o{name} : BOOL ) topics()\n{''.join(clauses)}}}\n"
        return text

    def edited(self, random: Random) -> None:
        """Another system, which has much of this one."""
        for _ in range(random.randint(1, 2)):
            name = random.choice(self.nodes)
            ins = [f"in.{port}" for node, port in self.wires if node == name]
            match random.randrange(6):
                case 0:
                    self.promised[name][0] = formula(random, [*ins, f"out.o{name}"])
                case 1:
                    self.assumed[name] = [formula(random, ins, 1)]
                case 2:
                    self.initial[name] = random.choice([True, False, None])
                case 3:
                    at = random.choice([at for at in self.wires if at[0] == name])
                    self.wires[at] = random.choice(
                        [None, *((n, random.random() < 0.5 or n == name) for n in self.nodes)]
                    )
                case 4:
                    self.names.reverse()
                case 5:
                    self.required.reverse()
        self.text, self.plan = self.written(), self.planned(random)

    def planned(self, random: Random) -> str:
        plan = "connections:\n"
        for (name, port), wire in self.wires.items():
            if wire is not None:
                source, delayed = wire
                first = self.initial[source]
                more = (
                    f", delayed: true{'' if first is None else f', initial: {str(first).upper()!r}'}" if delayed else ""
                )
                plan += f"  - {{from: {source}.o{source}, to: {name}.{port}{more}}}\n"
        plan = plan if plan.count("\n") > 1 else ""
        if random.random() < 0.5:
            rule = random.choice(["R1", "R2", "R3", "R4"])
            plan += f"compose: {{D: {{select: [{', '.join(random.sample(self.nodes, 2))}], rule: {rule}}}}}\n"
        if len(self.nodes) == 3 and random.random() < 0.4:
            plan += f"subsystems: {{s: {{nodes: [{', '.join(random.sample(self.nodes, 2))}]}}}}\n"
        plan += "requirements:\n"
        return plan + "".join(
            f"  R{k}: {{text: t, formula: '{text}', supported_by: [{', '.join(self.nodes)}]}}\n"
            for k, (text, _) in enumerate(self.required)
        )

    def inputs(self, name: str, before: Values, now: Values, outside: Values) -> Values:
        found = {}
        for (node, port), wire in self.wires.items():
            if node == name:
                value = outside[port] if wire is None else (before if wire[1] else now)[wire[0]]
                found[f"in.{port}"] = value
        return found

    def steps(self) -> Iterator[tuple[Values, Values, Values]]:
        """Every step that some run takes: the outputs before it and at it, and what the environment gives."""
        free = [port for (_, port), wire in self.wires.items() if wire is None]
        choices = [[True, False] if self.initial[n] is None else [self.initial[n]] for n in self.nodes]
        todo = [(values, (True,) * len(self.nodes)) for values in product(*choices)]
        seen = set(todo)
        while todo:
            last, kept = todo.pop()
            before = dict(zip(self.nodes, last, strict=True))
            for chosen in product([True, False], repeat=len(self.nodes)):
                now = dict(zip(self.nodes, chosen, strict=True))
                for given in product([True, False], repeat=len(free)):
                    outside = dict(zip(free, given, strict=True))
                    read = {n: self.inputs(n, before, now, outside) for n in self.nodes}
                    still = tuple(
                        was and all(holds(read[n]) for _, holds in self.assumed[n])
                        for n, was in zip(self.nodes, kept, strict=True)
                    )
                    if all(
                        not good or all(holds({**read[n], f"out.o{n}": now[n]}) for _, holds in self.promised[n])
                        for n, good in zip(self.nodes, still, strict=True)
                    ):
                        yield before, now, outside
                        after = (chosen, still)
                        if after not in seen:
                            seen.add(after)
                            todo.append(after)


def judged(folder: Path, seed: int) -> int:
    """How many claims of a random system are proved. Asserts that none is false on any run."""
    system = System(seed)
    try:
        found = outcomes(make(folder / str(seed), system.text, system.plan))
    except Rejected:
        return 0
    proved = {name for name, outcome in found.items() if outcome.verdict is Verdict.PROVED}
    claims: list[tuple[str, Callable[[Values, Values, Values], bool]]] = []
    for k, (_, holds) in enumerate(system.required):
        if f"R{k}" in proved and not _conditional(found, f"R{k}"):
            claims.append((f"R{k}", lambda b, n, o, holds=holds: holds({f"{x}.o{x}": v for x, v in n.items()})))  # type: ignore[misc]
    for before, now, outside in system.steps() if claims else ():
        for name, holds_ in claims:
            assert holds_(before, now, outside), (seed, name, before, now, outside)
    return len(claims)


def kept(folder: Path, seed: int) -> int:
    """How many requirements of a system the kernel establishes from the certificates of the system that it was before
    it was edited. Asserts that none is false on any run of what it is now."""
    system, random = System(seed), Random(seed)
    found = 0
    made: dict[str, Certificate] = {}
    for edit in range(4):
        try:
            composition = compose(make(folder / f"{seed}-{edit}", system.text, system.plan))
        except Rejected:
            return found
        certificates = Certificates(composition, made)
        for k, (_, holds) in enumerate(system.required):
            claim = certificates.kept_for(requirement_scope(f"R{k}"), Kind.REQUIREMENT, f"R{k}")
            if claim is not None and not any(need.kind is How.ENVIRONMENT for need in claim.hypotheses):
                found += 1
                for _, now, _ in system.steps():
                    assert holds({f"{n}.o{n}": value for n, value in now.items()}), (seed, edit, k)
            composition.certificates.requirement(f"R{k}", Hint(()), Bounds())
        made = {**made, **composition.certificates.made}
        system.edited(random)
    return found


@pytest.mark.slow
def test_no_certificate_of_what_was_shows_what_is_false_now(tmp_path: Path) -> None:
    assert sum(kept(tmp_path, seed) for seed in range(12)) > 0


@pytest.mark.nightly
def test_no_certificate_of_what_was_shows_what_is_false_now_at_length(tmp_path: Path) -> None:
    assert sum(kept(tmp_path, seed) for seed in range(100, 400)) > 20


def _conditional(found: object, name: str) -> bool:
    """Whether it rests on what the environment has to give: that is not in these runs."""
    return any(".environment" in h.name or "/environment." in h.name for h in found[name].rests_on)  # type: ignore[index]


def test_nothing_proved_is_false(tmp_path: Path) -> None:
    assert sum(judged(tmp_path, seed) for seed in range(5)) > 0


@pytest.mark.nightly
def test_nothing_proved_is_false_at_length(tmp_path: Path) -> None:
    assert sum(judged(tmp_path, seed) for seed in range(100, 280)) > 12
