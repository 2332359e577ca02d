"""Hypothesis strategies from the sorts of a node's inputs.

One case draws a few places and numbers first, and every relation and every value takes its parts from these: so that a
robot is often at a waypoint, and a command often names one. Where an assumption fails, an input that it speaks of is
drawn again, a few times; what still fails is rejected, and counted.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from hypothesis import strategies as st

from avow.backends.hypothesis.pools import Pools, runs, scenario_runs
from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.logic.values import Data, Element, FunctionValue, Opaque, Sequence, Value

Draw = Callable[[st.SearchStrategy[Any]], Any]
Inputs = dict[str, Value]
Failing = Callable[[Inputs], tuple[str, ...] | None]
"""The inputs that a failing assumption, or part of a trigger, speaks of; None where nothing fails."""

ATTEMPTS = 6
DEEPEST = 4
_PLAIN = BoolSort | RealSort | IntegerSort | NaturalSort | StringSort | EnumSort
_BOOL = st.booleans()
_COUNT = st.integers(0, 4)
_FEW = st.integers(0, 3)
_FRACTIONS = st.builds(Fraction, st.integers(-2000, 2000), st.sampled_from((1, 1, 2, 4, 10)))


class Impossible(Exception):  # noqa: N818 - it names what is wrong
    """No values of a sort can be generated."""


@dataclass(slots=True)
class Generator:
    """Strategies that are made once; `case` draws the inputs of one case."""

    ports: Mapping[str, Sort]
    pools: Pools
    shared: Mapping[tuple[Sort, ...], tuple[tuple[Value, ...], ...]] = field(init=False)
    _choices: dict[Any, st.SearchStrategy[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.shared = scenario_runs(self.pools.rows, self.ports)

    def case(self, draw: Draw, failing: Failing, aims: tuple[Failing, ...] = ()) -> Inputs:
        """One case's inputs; the assumptions may fail of them. Most cases aim at one guarantee's trigger."""
        near: dict[tuple[Sort, ...], list[tuple[Value, ...]]] = {}
        inputs = {name: self._port(draw, name, sort, near) for name, sort in self.ports.items()}
        if aims:
            aim = draw(self._choice("aim", (None, *aims)))
            if aim is not None:
                self._towards(draw, inputs, near, aim)
        self._towards(draw, inputs, near, failing)
        return inputs

    def _towards(self, draw: Draw, inputs: Inputs, near: dict[Any, Any], failing: Failing) -> None:
        """Draw inputs again that are to blame, until none is or the attempts are used up."""
        for _ in range(ATTEMPTS):
            blamed = failing(inputs)
            if not blamed:
                return
            name = blamed[0] if len(blamed) == 1 else draw(self._choice(("blamed", blamed), blamed))
            inputs[name] = self._port(draw, name, self.ports[name], near)

    def _choice(self, key: Any, values: tuple[Any, ...]) -> st.SearchStrategy[Any]:
        if key not in self._choices:
            self._choices[key] = st.sampled_from(values)
        return self._choices[key]

    def _port(self, draw: Draw, name: str, sort: Sort, near: dict[Any, Any]) -> Value:
        rows = self.pools.rows.get(name)
        if rows and isinstance(sort, FunctionSort) and draw(_BOOL):
            return FunctionValue(dict.fromkeys(rows, True), False)
        return self._value(draw, sort, near, 0, True)

    def _value(self, draw: Draw, sort: Sort, near: dict[Any, Any], depth: int, alone: bool) -> Value:
        value: Value
        match sort:
            case BoolSort():
                value = draw(_BOOL)
            case RealSort():
                value = draw(self._number(sort, alone))
            case IntegerSort() | NaturalSort():
                value = draw(self._number(sort, alone))
            case StringSort():
                value = draw(self._choice(("string", sort), self.pools.scalars[sort]))
            case EnumSort(members=members):
                value = Element(draw(self._choice(sort, members)))
            case OpaqueSort(name=name):
                value = Opaque(name, draw(_FEW))
            case DataSort():
                value = self._data(draw, sort, near, depth)
            case TupleSort(items=items):
                value = self._row(draw, items, near, depth)
            case SequenceSort(item=item):
                value = Sequence(tuple(self._value(draw, item, near, depth + 1, False) for _ in range(draw(_COUNT))))
            case FunctionSort():
                value = self._function(draw, sort, near, depth)
            case SetSort():
                raise Impossible("a set as an input")
        return value

    def _number(self, sort: Sort, alone: bool) -> st.SearchStrategy[Any]:
        key = ("number", sort, alone)
        if key not in self._choices:
            pool = st.sampled_from((self.pools.scalars if alone else self.pools.near)[sort])
            if not alone:
                self._choices[key] = pool
            elif isinstance(sort, RealSort):
                self._choices[key] = st.one_of(pool, _FRACTIONS)
            else:
                low = 0 if isinstance(sort, NaturalSort) else -2000
                self._choices[key] = st.one_of(pool, st.integers(low, 2000))
        return self._choices[key]

    def _data(self, draw: Draw, sort: DataSort, near: dict[Any, Any], depth: int) -> Value:
        made = sort.constructors
        if depth >= DEEPEST:
            made = tuple(c for c in made if not any(isinstance(p, DataSort) for p in c.parameters))
            if not made:
                raise Impossible(f"finite values of {sort.name}")
        chosen = draw(self._choice(("constructors", made), made))
        return Data(chosen.name, self._row(draw, chosen.parameters, near, depth))

    def _row(self, draw: Draw, sorts: tuple[Sort, ...], near: dict[Any, Any], depth: int) -> tuple[Value, ...]:
        """Values for parameters, each run of equal sorts from the few of this case."""
        values: list[Value] = []
        for run in runs(sorts):
            values.extend(self._some(draw, run, near, depth))
        return tuple(values)

    def _some(self, draw: Draw, run: tuple[Sort, ...], near: dict[Any, Any], depth: int) -> tuple[Value, ...]:
        pool = self._pool(draw, run, near, depth)
        chosen: tuple[Value, ...] = pool[draw(self._choice(("index", len(pool)), tuple(range(len(pool)))))]
        return chosen

    def _pool(self, draw: Draw, run: tuple[Sort, ...], near: dict[Any, Any], depth: int) -> list[tuple[Value, ...]]:
        """The few values of a run that this case uses."""
        if run not in near:
            if run in self.shared:
                near[run] = list(self.shared[run])
            elif len(run) == 1 and isinstance(run[0], NaturalSort | IntegerSort | EnumSort | BoolSort):
                near[run] = [(value,) for value in self._few(run[0])]
            elif all(isinstance(s, _PLAIN) for s in run):
                near[run] = list(draw(self._prepared(run)))
            else:
                rows = (tuple(self._value(draw, s, near, depth + 1, False) for s in run) for _ in range(3))
                near[run] = list(dict.fromkeys(rows))
        found: list[tuple[Value, ...]] = near[run]
        return found

    def _prepared(self, run: tuple[Sort, ...]) -> st.SearchStrategy[Any]:
        """Threes of places, made once: drawing one of these costs much less than drawing each coordinate."""
        key = ("prepared", run)
        if key not in self._choices:
            chance = random.Random(0)
            pools = [self._few(s) if isinstance(s, EnumSort | BoolSort) else self.pools.near[s] for s in run]
            every = list(itertools.islice(itertools.product(*(pool[:8] for pool in pools)), 512))
            size = min(3, len(every))
            threes = [tuple(every[:size]), *(tuple(chance.sample(every, size)) for _ in range(60))]
            self._choices[key] = st.sampled_from(threes)
        return self._choices[key]

    def _few(self, sort: Sort) -> tuple[Value, ...]:
        match sort:
            case EnumSort(members=members):
                return tuple(map(Element, members))
            case BoolSort():
                return (False, True)
            case _:
                return self.pools.near[sort]

    def _function(self, draw: Draw, sort: FunctionSort, near: dict[Any, Any], depth: int) -> Value:
        groups = runs(sort.parameters)
        relation = isinstance(sort.result, BoolSort)
        if relation and len(groups) == 2 and draw(_BOOL):
            # one to one, in order: as maps, routes and registers mostly are
            left, right = (self._pool(draw, group, near, depth) for group in groups)
            count = 1 + draw(_FEW)
            rows = [(*a, *b) for a, b in zip(left[:count], right[:count], strict=False)]
            return FunctionValue(dict.fromkeys(rows, True), False)
        if depth >= DEEPEST:
            points = []
        else:
            points = [self._row(draw, sort.parameters, near, depth + 1) for _ in range(draw(_COUNT))]
        if relation:
            return FunctionValue(dict.fromkeys(points, True), False)
        default = self._value(draw, sort.result, near, depth + 1, True)
        table = {p: self._value(draw, sort.result, near, depth + 1, True) for p in points}
        return FunctionValue({p: v for p, v in table.items() if v != default}, default)
