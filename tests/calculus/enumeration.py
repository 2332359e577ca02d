"""All steps and runs of a small system, found by trying everything: another reading of what contracts mean together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

from oracle.domains import domain
from reference.meaning import holds

from avow.calculus.composition import Composition
from avow.language.contract import Port
from avow.language.sorts import Sort
from avow.system.plan import Endpoint

Values = dict[str, Any]
INITIAL: Values = {"red": "red", "blue": "blue", "TRUE": True, "FALSE": False, "<red>": ("red",)}


class Enumeration:
    """`everything`: the values of a type."""

    def __init__(self, composition: Composition, everything: Callable[[Sort], list[Any]] = domain) -> None:
        self.frame = composition.frame
        self.graph = self.frame.graph
        self.everything = everything
        nodes = self.frame.system.contract.nodes
        self.ports: dict[str, Port] = {f"{n.name}.{p.name}": p for n in nodes for p in n.outputs}
        self.inputs = [(n.name, p.name) for n in nodes for p in n.inputs]
        self.outside = sorted({e.port for e in self.graph.environment})
        self.late = sorted({str(e.source) for e in self.graph.edges if e.delayed})
        self.clauses = {
            n.name: (
                {f"{n.name}.{a.name}": partial(holds, a.formula) for a in n.assumptions},
                [partial(holds, g.formula) for g in n.guarantees],
            )
            for n in nodes
        }
        self.given = [partial(holds, a.formula) for a in self.frame.assumed]

    def local(self, name: str, values: Mapping[str, Any]) -> Values:
        found = {f"out.{p}": values[f"{name}.{p}"] for n, _, p in (x.partition(".") for x in self.ports) if n == name}
        for owner, port in self.inputs:
            if owner == name:
                edge = self.graph.by_target.get(Endpoint(name, port))
                where = f"in.{port}" if edge is None else f"{edge.source}{'@before' if edge.delayed else ''}"
                found[f"in.{port}"] = values[where]
        return found

    def starts(self) -> Iterator[Values]:
        initial = {str(e.source): e.initial for e in self.graph.edges if e.delayed}
        ranges = [
            self.everything(self.ports[n].sort) if (given := initial[n]) is None else [INITIAL[given]]
            for n in self.late
        ]
        for combination in product(*ranges):
            yield dict(zip(self.late, combination, strict=True))

    def valuations(self, names: list[str], before: Values) -> Iterator[Values]:
        """What these outputs, and the environment, may be after a step."""
        ranges = [self.everything(self.ports[n].sort) for n in names] + [[False, True] for _ in self.outside]
        for combination in product(*ranges):
            values = dict(zip([*names, *(f"in.{port}" for port in self.outside)], combination, strict=True))
            yield values | {f"{name}@before": value for name, value in before.items()}

    def steps(self, before: Values) -> Iterator[tuple[Values, frozenset[str]]]:
        """Every complete step, and the assumptions that do not hold at it."""
        for values in self.valuations([*self.ports], before):
            if not all(given({f"in.{p}": values[f"in.{p}"] for p in self.outside}) for given in self.given):
                continue
            broken: set[str] = set()
            for name, (assumed, promised) in self.clauses.items():
                local = self.local(name, values)
                false = {label for label, holds in assumed.items() if not holds(local)}
                broken |= false
                if not false and not all(holds(local) for holds in promised):
                    break
            else:
                yield values, frozenset(broken)

    def reached(self, may_follow: Callable[[frozenset[str]], bool]) -> Iterator[tuple[Values, frozenset[str]]]:
        """The steps of all runs whose steps, by the assumptions that do not hold, are such."""
        waiting, seen = list(self.starts()), set()
        while waiting:
            before = waiting.pop()
            if (mark := str({name: str(value) for name, value in before.items()})) in seen:
                continue
            seen.add(mark)
            for values, broken in self.steps(before):
                if may_follow(broken):
                    yield values, broken
                    waiting.append({name: values[name] for name in self.late})

    def broken(self, assumed: frozenset[str]) -> str | None:
        """An assumption that is false at a step of a run at which those that stay assumed hold."""
        found = (min(broken) for _, broken in self.reached(lambda broken: not broken & assumed) if broken)
        return next(found, None)
