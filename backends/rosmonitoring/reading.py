"""Messages to values, by the rules. A reader is made once for each rule and called for each message."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, assert_never

from avow.formulas.values import Data, FunctionValue, SequenceValue, Value
from avow.language.sorts import (
    BOOL,
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
from avow.ros.bags import ENVELOPE, message_of
from avow.ros.definitions import Array, Wire

from .numbers import Decimal, NotANumber, exact, whole
from .rules import NOTHING_KNOWN, Argument, Choice, FieldPath, Fields, Hold, Lookup
from .wires import Convert, MappingError, NoReading, converter, element, fits, of_type, show, taken

Message = Mapping[str, Any]
Reader = Callable[[Message, Value | None], Value]
"""(the message, the variable's value so far) → its new value. Raises MappingError."""


def reader(rule: Fields | Choice) -> Reader:
    match rule:
        case Choice():
            return _choice(rule)
        case Fields():
            sort = rule.variable.sort
            if isinstance(sort, FunctionSort):
                return _function(rule, sort)
            return _scalar(rule, sort)


def at(event: Message, path: FieldPath) -> Any:
    """The part of an event's message that a path leads to. Raises MappingError."""
    return _within(message_of(event, str(path[0])) if path else event, path)


def _within(message: Any, path: FieldPath) -> Any:
    place = message
    for depth, name in enumerate(path):
        if isinstance(name, int):
            place = place[name] if isinstance(place, list) and -len(place) <= name < len(place) else _MISSING
        elif isinstance(place, Mapping) and name in place:
            place = place[name]
        elif depth == 0 and isinstance(place, Mapping) and isinstance(place.get("data"), Mapping):
            place = place["data"].get(name, _MISSING)
        else:
            place = _MISSING
        if place is _MISSING:
            raise MappingError(f"the message has no field {shown(path)}")
    return place


def shown(path: FieldPath) -> str:
    """``pose.position.x``, ``ranges[0]``."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


_MISSING = object()


def convert(raw: Any, sort: Sort, names: Mapping[str, str]) -> Value:
    """A field's content as a value of a sort. Raises MappingError."""
    match sort:
        case RealSort():
            real = _number(raw)
            return whole(real) if isinstance(real, int) else real
        case IntegerSort() | NaturalSort():
            number = _number(raw)
            if number.denominator != 1:
                raise MappingError(f"{show(raw)} is not a whole number")
            if isinstance(sort, NaturalSort) and number < 0:
                raise MappingError(f"{show(raw)} is negative, where a natural number is wanted")
            return int(number)
        case BoolSort():
            if isinstance(raw, bool):
                return raw
            raise MappingError(f"{show(raw)} is not a truth value")
        case StringSort():
            if isinstance(raw, str):
                return names.get(raw, raw)
            raise MappingError(f"{show(raw)} is not a string")
        case EnumSort():
            return element(raw, sort, names)
        case DataSort():
            return _data(raw, sort, names)
        case TupleSort(items=items, labels=labels) if labels and isinstance(raw, Mapping):
            if missing := [label for label in labels if label not in raw]:
                raise MappingError(f"{show(raw)} has no {', '.join(missing)}")
            return tuple(convert(raw[label], item, names) for label, item in zip(labels, items, strict=True))
        case TupleSort(items=items):
            if isinstance(raw, list) and len(raw) == len(items):
                return tuple(convert(part, item, names) for part, item in zip(raw, items, strict=True))
            raise MappingError(f"{show(raw)} is not a list of {len(items)}")
        case SequenceSort(item=item):
            if isinstance(raw, list):
                return SequenceValue(tuple(convert(part, item, names) for part in raw))
            raise MappingError(f"{show(raw)} is not a list")
        case FunctionSort():
            return _relation_literal(raw, sort, names)
        case OpaqueSort(name=name):
            raise MappingError(f"{name} is an unspecified sort: no message can be read as one of its values")
        case SetSort():
            raise MappingError("no message can be read as a value of this sort")
        case _:
            assert_never(sort)


def _number(raw: Any) -> Fraction | int:
    if raw.__class__ is int or raw.__class__ is Decimal or isinstance(raw, float):
        try:
            return exact(raw)
        except NotANumber:
            pass
    raise MappingError(f"{show(raw)} is not a number")


def _data(raw: Any, sort: DataSort, names: Mapping[str, str]) -> Data:
    """``{"move": [1, 2]}``, or a word for a constructor without arguments."""
    if isinstance(raw, str):
        raw = {raw: []}
    if isinstance(raw, Mapping) and len(raw) == 1:
        ((word, arguments),) = raw.items()
        word = names.get(word, word)
        for constructor in sort.constructors:
            if constructor.name == word and isinstance(arguments, list):
                if len(arguments) == len(constructor.parameters):
                    pairs = zip(arguments, constructor.parameters, strict=True)
                    return Data(word, tuple(convert(part, p, {}) for part, p in pairs))
                raise MappingError(f"{word} takes {len(constructor.parameters)} arguments, not {len(arguments)}")
    raise MappingError(f"{show(raw)} is no value of {sort.name}")


def _relation_literal(raw: Any, sort: FunctionSort, names: Mapping[str, str]) -> FunctionValue:
    """``[[1, 2], [3, 4]]``: the tuples at which a relation holds."""
    if sort.result != BOOL or not isinstance(raw, list):
        raise MappingError("only a relation can be written out, as the list of its tuples")
    table: dict[tuple[Value, ...], Value] = {}
    for row in raw:
        parts = row if isinstance(row, list) else [row]
        if len(parts) != len(sort.parameters):
            raise MappingError(f"{show(row)} is not a list of {len(sort.parameters)}")
        table[tuple(convert(p, s, names) for p, s in zip(parts, sort.parameters, strict=True))] = True
    return FunctionValue(table, False)


def _converters(rule: Fields, sorts: tuple[Sort, ...]) -> tuple[Convert, ...]:
    """How what each of the rule's paths leads to becomes a value."""
    found: list[Convert] = []
    for place, sort in enumerate(sorts):
        wire = rule.wire(place)
        if rule.take is not None and isinstance(wire, Array):
            found.append(taken(rule.take, sort, wire, rule.known, rule.gaps))
        elif wire is None or not fits(sort, wire, rule.known):
            found.append(functools.partial(convert, sort=sort, names=rule.names))
        else:
            found.append(converter(sort, wire, rule.names, rule.known, rule.gaps))
    return tuple(found)


def _scalar(rule: Fields, sort: Sort) -> Reader:
    items = sort.items if isinstance(sort, TupleSort) and len(rule.paths) > 1 else (sort,)
    made = _converters(rule, items)
    if isinstance(sort, TupleSort) and len(rule.paths) > 1:
        pairs = tuple(zip(rule.paths, made, strict=True))
        return _with_default(rule, lambda message, old: tuple([read(at(message, p)) for p, read in pairs]))
    path, read = rule.paths[0], made[0]
    if len(path) == 1 and isinstance(path[0], str) and path[0] not in ENVELOPE:
        return _with_default(rule, _one_field(path, path[0], read))
    return _with_default(rule, lambda message, old: read(at(message, path)))


def _one_field(path: FieldPath, name: str, read: Convert) -> Reader:
    """The most frequent reader of all."""

    def of_field(message: Message, old: Value | None) -> Value:
        return read(message[name] if name in message else at(message, path))

    return of_field


def _with_default(rule: Fields, read: Reader) -> Reader:
    """Where there is no reading, the value that the plan gives."""
    elsewhere = rule.elsewhere
    if elsewhere is None:
        return read

    def otherwise(message: Message, old: Value | None) -> Value:
        try:
            return read(message, old)
        except NoReading:
            return elsewhere

    return otherwise


def _function(rule: Fields, sort: FunctionSort) -> Reader:
    relation = sort.result == BOOL
    sorts = sort.parameters if relation else (*sort.parameters, sort.result)
    seen = rule.hold is Hold.SEEN
    points = _points(rule, sorts)
    if not relation and rule.elsewhere is None:
        raise ValueError("the options demand `elsewhere` of a function with a result")
    elsewhere: Value = False if relation or rule.elsewhere is None else rule.elsewhere

    def read(message: Message, old: Value | None) -> Value:
        found = points(message)
        before = old.table if seen and isinstance(old, FunctionValue) else {}
        fresh = {(p if relation else p[:-1]): (True if relation else p[-1]) for p in found}
        if isinstance(old, FunctionValue) and all(before.get(k) == v for k, v in fresh.items()) and seen:
            return old
        return FunctionValue({**before, **fresh}, elsewhere)

    return read


def _points(rule: Fields, sorts: tuple[Sort, ...]) -> Callable[[Message], list[tuple[Value, ...]]]:
    """The tuples that a message brings; a tuple with no reading among its parts is not brought."""
    each, pairs = rule.each, tuple(zip(rule.paths, _converters(rule, sorts), strict=True))

    def one(message: Message, part: Callable[[Any, FieldPath], Any]) -> tuple[Value, ...] | None:
        try:
            return tuple([read(part(message, p)) for p, read in pairs])
        except NoReading:
            return None

    if each is None:
        return lambda message: [point] if (point := one(message, at)) is not None else []
    way = each

    def several(message: Message) -> list[tuple[Value, ...]]:
        items = at(message, way)
        if not isinstance(items, list):
            raise MappingError(f"the field {shown(way)} is not a list")
        return [point for item in items if (point := one(item, _within)) is not None]

    return several


def _choice(rule: Choice) -> Reader:
    sort = rule.variable.sort
    assert isinstance(sort, DataSort)
    shapes = {
        name: tuple(
            _argument(where, part, rule)
            for where, part in zip(arguments, sort.constructor(name).parameters, strict=True)
        )
        for name, arguments in rule.arguments.items()
    }
    tag, names = rule.tag, rule.names

    def read(message: Message, old: Value | None) -> Value:
        raw = at(message, tag)
        word = names.get(raw, raw) if isinstance(raw, str) else str(raw) if raw.__class__ is int else None
        word = names.get(word, word) if word is not None else None
        if word not in shapes:
            raise MappingError(f"{show(raw)} is none of the constructors {', '.join(shapes)}")
        return Data(word, tuple([argument(message) for argument in shapes[word]]))

    return read


def _argument(where: Argument, sort: Sort, rule: Choice) -> Callable[[Message], Value]:
    if isinstance(where, Lookup):
        return functools.partial(_looked_up, where=where, sort=sort)
    wire = rule.wires.get(where)
    if wire is None:
        return lambda message: convert(at(message, where), sort, {})
    read = converter(sort, wire, {}, NOTHING_KNOWN, frozenset())
    return lambda message: read(at(message, where))


def _looked_up(message: Message, where: Lookup, sort: Sort) -> Value:
    key = at(message, where.key)
    cell = where.rows.get(str(key.text if isinstance(key, Decimal) else key))
    if cell is None:
        raise MappingError(f"{show(key)} is in no row of {where.table}")
    return from_text(cell, sort, where.held)


def from_text(cell: str, sort: Sort, held: Wire | None = None) -> Value:
    """A table's cell as a value; `held`: the type in which a node holds it. Raises MappingError."""
    if isinstance(sort, RealSort | IntegerSort | NaturalSort):
        value = convert(Decimal(cell.strip()), sort, {})
        return of_type(value, held) if isinstance(value, Fraction) else value
    if isinstance(sort, BoolSort):
        return convert({"TRUE": True, "FALSE": False}.get(cell.strip().upper(), cell), sort, {})
    return convert(cell, sort, {})
