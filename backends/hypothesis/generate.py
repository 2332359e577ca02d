"""Inputs of one case from one string of bytes that Hypothesis draws and shrinks: a smaller byte is a simpler choice.

One draw for a case in place of dozens makes it several times as fast.

One case draws a few places and numbers first, and every relation and every value takes its parts from these: so that a
robot is often at a known place, and a command often names one. Where an assumption fails, an input that it speaks of is
drawn again, a few times; what still fails is rejected, and counted.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, TypeVar

from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value
from avow.language.sorts import (
    STRING,
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

from .pools import Pools, runs, scenario_runs
from .tuning import ATTEMPTS, CASE_BYTES, COMMON_LENGTHS, OPAQUE_VALUES, VALUE_DEPTH

T = TypeVar("T")

Inputs = dict[str, Value]
Failing = Callable[[Inputs], tuple[str, ...] | None]
"""The inputs that a failing assumption, or part of a trigger, speaks of; None where nothing fails."""

_PLAIN = BoolSort | RealSort | IntegerSort | NaturalSort | StringSort | EnumSort


class Source:
    """Choices from a string of bytes."""

    __slots__ = ("_at", "_data")

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def below(self, bound: int) -> int:
        """A number from 0 to bound - 1; 0 is the simplest."""
        if bound <= 1:
            return 0
        value = 0
        for _ in range(1 if bound <= 256 else 2):
            value = value * 256 + (self._data[self._at] if self._at < len(self._data) else 0)
            self._at += 1
        return value % bound

    def of(self, values: Sequence[T]) -> T:
        """One of some values; the first is the simplest."""
        return values[self.below(len(values))]

    def coin(self) -> bool:
        return self.below(2) == 1

    def signed(self, bound: int) -> int:
        """A number from -bound to bound, 0 first."""
        value = self.below(2 * bound + 1)
        return -(value + 1) // 2 if value % 2 else value // 2


class Impossible(Exception):  # noqa: N818 - it names what is wrong
    """No values of a sort can be generated."""


@dataclass(slots=True)
class Generator:
    """Makes inputs; `case` makes those of one case."""

    ports: Mapping[str, Sort]
    pools: Pools
    shared: Mapping[tuple[Sort, ...], tuple[tuple[Value, ...], ...]] = field(init=False)
    _threes: dict[tuple[Sort, ...], tuple[tuple[tuple[Value, ...], ...], ...]] = field(default_factory=dict)
    _tables: dict[str, FunctionValue] = field(default_factory=dict)
    _inside: bool = False
    """Whether the case that is being made is one of the scenario: its tables belong together."""

    def __post_init__(self) -> None:
        self.shared = scenario_runs(self.pools.rows, self.ports)

    def case(self, source: Source, failing: Failing, aims: tuple[Failing, ...] = ()) -> Inputs:
        """One case's inputs; the assumptions may fail of them. Most cases aim at one guarantee's trigger."""
        near: dict[tuple[Sort, ...], list[tuple[Value, ...]]] = {}
        self._inside = bool(self.pools.rows) and source.coin()
        inputs = {name: self._port(source, name, sort, near) for name, sort in self.ports.items()}
        if aims:
            aim = source.of((None, *aims))
            if aim is not None:
                self._towards(source, inputs, near, aim)
        self._towards(source, inputs, near, failing)
        return inputs

    def edges(self, failing: Failing) -> Iterator[Inputs]:
        """Each number and string from the pools in its turn for each input that is one, all else as simple as can be,
        and once more all else by chance: that no threshold is left to luck. Of a function it is the value everywhere,
        of a sequence that of its last element; sequences also of each length."""
        chance = random.Random(0)
        for name, value in _in_turn([(name, self._at_edges(sort)) for name, sort in self.ports.items()]):
            for data in (b"", chance.randbytes(CASE_BYTES)):
                yield {**self.case(Source(data), failing), name: value}

    def _at_edges(self, sort: Sort) -> Iterator[Value]:
        match sort:
            case FunctionSort(parameters=(one,), result=BoolSort()):
                yield from (FunctionValue({(value,): True}, False) for value in self.pools.edges.get(one, ()))
            case FunctionSort(result=result):
                yield from (FunctionValue({}, value) for value in self.pools.edges.get(result, ()))
            case SequenceSort(item=item):
                for length in self.pools.lengths:
                    plain = self._value(Source(b""), item, {}, 1, False)
                    chance = random.Random(length)
                    mixed = (self._value(Source(chance.randbytes(8)), item, {}, 1, True) for _ in range(length))
                    yield from (SequenceValue((plain,) * length), SequenceValue(tuple(mixed)))
                    if length > COMMON_LENGTHS and isinstance(item, RealSort | IntegerSort | NaturalSort):
                        yield from _odd_one_out(self.pools.edges.get(item, ()), length)
                for value in self.pools.edges.get(item, ()):
                    simple = self._number(Source(b""), item, False) if item != STRING else value
                    yield from (SequenceValue((value,)), SequenceValue((simple, value)))
            case _:  # the edges of the sort itself
                yield from self.pools.edges.get(sort, ())

    def _towards(self, source: Source, inputs: Inputs, near: dict[Any, Any], failing: Failing) -> None:
        """Draw inputs again that are to blame, until none is or the attempts are used up."""
        for _ in range(ATTEMPTS):
            blamed = failing(inputs)
            if not blamed:
                return
            name = source.of(blamed)
            inputs[name] = self._port(source, name, self.ports[name], near)

    def _port(self, source: Source, name: str, sort: Sort, near: dict[Any, Any]) -> Value:
        rows = self.pools.rows.get(name)
        if rows and isinstance(sort, FunctionSort) and (self._inside or source.coin()):
            if name not in self._tables:
                self._tables[name] = table(rows, sort)
            return self._tables[name]
        return self._value(source, sort, near, 0, True)

    def _value(self, source: Source, sort: Sort, near: dict[Any, Any], depth: int, alone: bool) -> Value:
        value: Value
        match sort:
            case BoolSort():
                value = source.coin()
            case RealSort() | IntegerSort() | NaturalSort():
                value = self._number(source, sort, alone)
            case StringSort():
                value = source.of(self.pools.scalars[sort])
            case EnumSort(members=members):
                value = Element(source.of(members))
            case OpaqueSort(name=name):
                value = Opaque(name, source.below(OPAQUE_VALUES))
            case DataSort():
                value = self._data(source, sort, near, depth)
            case TupleSort(items=items):
                value = self._row(source, items, near, depth)
            case SequenceSort(item=item):
                each = range(self._length(source, depth))
                value = SequenceValue(tuple(self._value(source, item, near, depth + 1, source.coin()) for _ in each))
            case FunctionSort():
                value = self._function(source, sort, near, depth)
            case SetSort():
                raise Impossible("a set as an input")
        return value

    def _length(self, source: Source, depth: int) -> int:
        """Mostly a few; now and then one of those at which something may change."""
        chosen = source.below(COMMON_LENGTHS + 1)
        if chosen < COMMON_LENGTHS or depth > 0 or not self.pools.lengths:
            return chosen % COMMON_LENGTHS
        return source.of(self.pools.lengths)

    def _number(self, source: Source, sort: Sort, alone: bool) -> Value:
        if not alone:
            return source.of(self.pools.near[sort])
        known = self.shared.get((sort,)) if self._inside else None
        if known and source.coin():
            return source.of(known)[0]
        chosen = source.below(8)
        if chosen < 5:
            return source.of(self.pools.scalars[sort])
        if chosen == 5:  # what parameters and elements are drawn from, so that it sometimes is one of these
            return source.of(self.pools.near[sort])
        match sort:
            case RealSort():
                return Fraction(source.signed(2000), source.of((1, 2, 4, 10)))
            case NaturalSort():
                return source.below(2001)
            case IntegerSort():
                return source.signed(2000)
            case _:
                raise Impossible(f"a number of {sort}")

    def _data(self, source: Source, sort: DataSort, near: dict[Any, Any], depth: int) -> Value:
        made = sort.constructors
        if depth >= VALUE_DEPTH:
            made = tuple(c for c in made if not any(isinstance(p, DataSort) for p in c.parameters))
            if not made:
                raise Impossible(f"finite values of {sort.name}")
        chosen = source.of(made)
        return Data(chosen.name, self._row(source, chosen.parameters, near, depth))

    def _row(self, source: Source, sorts: tuple[Sort, ...], near: dict[Any, Any], depth: int) -> tuple[Value, ...]:
        """Values for parameters, each run of equal sorts from the few of this case."""
        values: list[Value] = []
        for run in runs(sorts):
            values.extend(self._some(source, run, near, depth))
        return tuple(values)

    def _some(self, source: Source, run: tuple[Sort, ...], near: dict[Any, Any], depth: int) -> tuple[Value, ...]:
        pool = self._pool(source, run, near, depth)
        return source.of(pool)

    def _pool(self, source: Source, run: tuple[Sort, ...], near: dict[Any, Any], depth: int) -> list[tuple[Value, ...]]:
        """The few values of a run that this case uses."""
        if run not in near:
            if run in self.shared:
                near[run] = list(self.shared[run])
            elif len(run) == 1 and isinstance(run[0], NaturalSort | IntegerSort | EnumSort | BoolSort):
                near[run] = [(value,) for value in self._few(run[0])]
            elif all(isinstance(s, _PLAIN) for s in run):
                near[run] = list(source.of(self._prepared(run)))
            else:
                rows = (tuple(self._value(source, s, near, depth + 1, False) for s in run) for _ in range(3))
                near[run] = list(dict.fromkeys(rows))
        found: list[tuple[Value, ...]] = near[run]
        return found

    def _prepared(self, run: tuple[Sort, ...]) -> tuple[tuple[tuple[Value, ...], ...], ...]:
        """Threes of places, made once; the first is the simplest."""
        if run not in self._threes:
            chance = random.Random(0)
            pools = [self._few(s) if isinstance(s, EnumSort | BoolSort) else self.pools.near[s] for s in run]
            every = list(itertools.islice(itertools.product(*(pool[:8] for pool in pools)), 512))
            size = min(3, len(every))
            self._threes[run] = (tuple(every[:size]), *(tuple(chance.sample(every, size)) for _ in range(99)))
        return self._threes[run]

    def _few(self, sort: Sort) -> tuple[Value, ...]:
        match sort:
            case EnumSort(members=members):
                return tuple(map(Element, members))
            case BoolSort():
                return (False, True)
            case _:  # a number or a text
                return self.pools.near[sort]

    def _function(self, source: Source, sort: FunctionSort, near: dict[Any, Any], depth: int) -> Value:
        groups = runs(sort.parameters)
        relation = isinstance(sort.result, BoolSort)
        if relation and len(groups) == 2 and source.coin():
            # one to one, in order: as maps, routes and registers mostly are
            left, right = (self._pool(source, group, near, depth) for group in groups)
            count = 1 + source.below(OPAQUE_VALUES)
            rows = [(*a, *b) for a, b in zip(left[:count], right[:count], strict=False)]
            return FunctionValue(dict.fromkeys(rows, True), False)
        if depth >= VALUE_DEPTH:
            points = []
        else:
            points = [self._row(source, sort.parameters, near, depth + 1) for _ in range(source.below(COMMON_LENGTHS))]
        if relation:
            return FunctionValue(dict.fromkeys(points, True), False)
        default = self._value(source, sort.result, near, depth + 1, True)
        table = {p: self._value(source, sort.result, near, depth + 1, True) for p in points}
        return FunctionValue({p: v for p, v in table.items() if v != default}, default)


def _in_turn(streams: Sequence[tuple[str, Iterator[Value]]]) -> Iterator[tuple[str, Value]]:
    """One value of each in its turn, so that none has to wait for the end of another."""
    waiting = list(streams)
    while waiting:
        still = []
        for name, values in waiting:
            for value in itertools.islice(values, 1):
                yield name, value
                still.append((name, values))
        waiting = still


def table(rows: Sequence[tuple[Value, ...]], sort: FunctionSort) -> FunctionValue:
    """A scenario's rows as a relation that holds at these; or as a function, each row ending in its result. Beside its
    rows a function's value is one that they do not have, where that is easily found."""
    if isinstance(sort.result, BoolSort):
        return FunctionValue(dict.fromkeys(rows, True), False)
    results = [row[-1] for row in rows]
    other = results[0]
    match sort.result:
        case RealSort() | IntegerSort() | NaturalSort():
            top = max(value for value in results if isinstance(value, int | Fraction))
            other = Fraction(top + 2) if isinstance(sort.result, RealSort) else int(top) + 2
        case EnumSort(members=members):
            other = next((Element(m) for m in members if Element(m) not in results), other)
    return FunctionValue({row[:-1]: row[-1] for row in rows}, other)


def _odd_one_out(edges: Iterable[Value], length: int) -> Iterator[Value]:
    """A long sequence whose last or first element alone is on the other side of every threshold."""
    numbers = sorted(value for value in edges if isinstance(value, int | Fraction))
    if numbers:
        for most, odd in ((numbers[0], numbers[-1]), (numbers[-1], numbers[0])):
            yield SequenceValue((*(most,) * (length - 1), odd))
            yield SequenceValue((odd, *(most,) * (length - 1)))
