"""What of a case can be turned: its numbers, lengths, texts and choices, wherever in its inputs they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.formulas.values import Data, Element, FunctionValue, SequenceValue, Value
from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    SequenceSort,
    Sort,
    StringSort,
    TupleSort,
)

from .generate import Inputs
from .tuning import LONGEST_SEQUENCE, POINTS_TURNED

Number = RealSort | IntegerSort | NaturalSort

_LENGTH = "length"
_DEFAULT = "default"


@dataclass(frozen=True, slots=True)
class Knob:
    """A place in a case's inputs: the port's name, then places in its value. `sort`: of what stands there; of a length,
    that of the sequence or function."""

    path: tuple[Any, ...]
    sort: Sort

    @property
    def length(self) -> bool:
        return self.path[-1] == _LENGTH and len(self.path) > 1

    def choices(self) -> tuple[Value, ...]:
        """All that may stand there, if it is few."""
        match self.sort:
            case BoolSort():
                return (False, True)
            case EnumSort(members=members) if not self.length:
                return tuple(map(Element, members))
            case _:  # a number, a text
                return ()

    @property
    def whole(self) -> bool:
        return self.length or not isinstance(self.sort, RealSort)

    @property
    def numeric(self) -> bool:
        return self.length or isinstance(self.sort, Number)

    def fitting(self, number: Fraction) -> Fraction | int | None:
        """The number as one that may stand there; None where it may not."""
        if not self.whole:
            return number
        if number.denominator != 1:
            return None
        if self.length:
            return int(number) if 0 <= number <= 2 * LONGEST_SEQUENCE + 1 else None
        return int(number) if number >= 0 or isinstance(self.sort, IntegerSort) else None


def knobs(inputs: Mapping[str, Value], sorts: Mapping[str, Sort]) -> list[Knob]:
    """Those of a case; the plain numbers first."""
    found = [knob for name, sort in sorts.items() if name in inputs for knob in _of((name,), sort, inputs[name])]
    return sorted(found, key=lambda knob: len(knob.path))


def _of(path: tuple[Any, ...], sort: Sort, value: Value) -> Iterator[Knob]:
    match sort, value:
        case ((RealSort() | IntegerSort() | NaturalSort() | BoolSort() | StringSort() | EnumSort()), _):
            yield Knob(path, sort)
        case SequenceSort(item=item), SequenceValue(items=items):
            if items or _simplest(item) is not None:
                yield Knob((*path, _LENGTH), sort)
            for at in sorted({0, 1, len(items) - 1} & set(range(len(items)))):
                yield from _of((*path, at), item, items[at])
        case TupleSort(items=sorts), tuple():
            for at, (part, each) in enumerate(zip(value, sorts, strict=False)):
                yield from _of((*path, at), each, part)
        case DataSort(constructors=constructors), Data(constructor=name, arguments=arguments):
            made = next((c for c in constructors if c.name == name), None)
            for at, (part, each) in enumerate(zip(arguments, made.parameters if made else (), strict=False)):
                yield from _of((*path, at), each, part)
        case FunctionSort(parameters=parameters, result=result), FunctionValue(table=table, default=default):
            if len(parameters) == 1 and isinstance(parameters[0], Number) and isinstance(result, BoolSort):
                yield Knob((*path, _LENGTH), sort)
            elif not isinstance(result, BoolSort):
                yield from _of((*path, _DEFAULT), result, default)
                for point in list(table)[:POINTS_TURNED]:
                    yield from _of((*path, point), result, table[point])


def at(inputs: Mapping[str, Value], knob: Knob) -> Value:
    """What stands there; of a length, the number."""
    value: Any = inputs[knob.path[0]]
    for step in knob.path[1:]:
        match value:
            case SequenceValue(items=items):
                value = len(items) if step == _LENGTH else items[step]
            case Data(arguments=arguments):
                value = arguments[step]
            case FunctionValue(table=table, default=default):
                value = len(table) if step == _LENGTH else default if step == _DEFAULT else table.get(step, default)
            case _:  # a tuple
                value = value[step]
    found: Value = value
    return found


def put(inputs: Inputs, knob: Knob, value: Value) -> Inputs:
    """The inputs with something else there."""
    name, *path = knob.path
    more = _simplest(knob.sort.item) if isinstance(knob.sort, SequenceSort) else None
    return {**inputs, name: _put(inputs[name], path, value, more)}


def _simplest(sort: Sort) -> Value | None:
    match sort:
        case RealSort():
            return Fraction(0)
        case IntegerSort() | NaturalSort():
            return 0
        case BoolSort():
            return False
        case StringSort():
            return ""
        case EnumSort(members=members):
            return Element(members[0])
        case _:  # several parts
            return None


def _put(before: Any, path: list[Any], value: Value, more: Value | None) -> Any:
    """`more`: what an empty sequence is filled with."""
    if not path:
        return value
    step, *rest = path
    match before:
        case SequenceValue(items=items) if step == _LENGTH:
            assert isinstance(value, int)
            last: Any = items[-1] if items else more
            return SequenceValue((*items, *((last,) * (value - len(items))))[:value])
        case SequenceValue(items=items):
            return SequenceValue((*items[:step], _put(items[step], rest, value, more), *items[step + 1 :]))
        case Data(constructor=name, arguments=arguments):
            return Data(name, (*arguments[:step], _put(arguments[step], rest, value, more), *arguments[step + 1 :]))
        case FunctionValue(table=table, default=default) if step == _LENGTH:
            assert isinstance(value, int)
            points: list[tuple[Value, ...]] = list(table)[:value]
            points += [(number,) for number in range(value) if (number,) not in table][: value - len(points)]
            return FunctionValue(dict.fromkeys(points, True), default)
        case FunctionValue(table=table, default=default) if step == _DEFAULT:
            return FunctionValue(table, _put(default, rest, value, more))
        case FunctionValue(table=table, default=default):
            return FunctionValue({**table, step: _put(table.get(step, default), rest, value, more)}, default)
        case _:  # a tuple
            return (*before[:step], _put(before[step], rest, value, more), *before[step + 1 :])
