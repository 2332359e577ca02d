"""Messages to values, by the rules. A reader is made once for each rule and called for each message."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from avow.formulas.values import Data, FunctionValue, Value
from avow.language import sorts as s
from avow.ros.bags import ENVELOPE, message_of
from avow.ros.definitions import Array, Wire

from .rules import Argument, Choice, FieldPath, Fields, Hold, Lookup
from .wires import Convert, MappingError, NoReading, converter, meant, of_type, parts_of, show, table_of, taken

Message = Mapping[str, Any]
Reader = Callable[[Message, Value | None], Value]
"""(the message, the variable's value so far) → its new value. Raises MappingError."""


def reader(rule: Fields | Choice) -> Reader:
    match rule:
        case Choice():
            return _choice(rule)
        case Fields():
            sort = rule.variable.sort
            if isinstance(sort, s.FunctionSort):
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


def _converters(rule: Fields, sorts: tuple[s.Sort, ...]) -> tuple[Convert, ...]:
    """How what each of the rule's paths leads to becomes a value."""
    found: list[Convert] = []
    for place, sort in enumerate(sorts):
        wire = rule.wire(place)
        if rule.take is not None and isinstance(wire, Array):
            found.append(taken(rule.take, sort, wire, rule.known, rule.gaps))
        else:
            found.append(converter(sort, wire, rule.names, rule.known, rule.gaps))
    return tuple(found)


def _scalar(rule: Fields, sort: s.Sort) -> Reader:
    items = sort.items if isinstance(sort, s.TupleSort) and len(rule.paths) > 1 else (sort,)
    made = _converters(rule, items)
    if isinstance(sort, s.TupleSort) and len(rule.paths) > 1:
        pairs = tuple(zip(rule.paths, made, strict=True))
        return _with_default(rule, lambda message, old: tuple([read(at(message, p)) for p, read in pairs]))
    path, read = rule.paths[0], made[0]
    if len(path) == 1 and isinstance(path[0], str) and path[0] not in ENVELOPE:
        name = path[0]  # the most frequent reader of all
        return _with_default(rule, lambda message, old: read(message[name] if name in message else at(message, path)))
    return _with_default(rule, lambda message, old: read(at(message, path)))


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


def _function(rule: Fields, sort: s.FunctionSort) -> Reader:
    relation, seen = sort.result == s.BOOL, rule.hold is Hold.SEEN
    points = _points(rule, parts_of(sort))
    if not relation and rule.elsewhere is None:
        raise ValueError("the options demand `elsewhere` of a function with a result")
    elsewhere: Value = False if relation or rule.elsewhere is None else rule.elsewhere

    def read(message: Message, old: Value | None) -> Value:
        found = points(message)
        before = old.table if seen and isinstance(old, FunctionValue) else {}
        fresh = table_of(found, sort)
        if isinstance(old, FunctionValue) and all(before.get(k) == v for k, v in fresh.items()) and seen:
            return old
        return FunctionValue({**before, **fresh}, elsewhere)

    return read


def _points(rule: Fields, sorts: tuple[s.Sort, ...]) -> Callable[[Message], list[tuple[Value, ...]]]:
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
    assert isinstance(sort, s.DataSort)
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
        word = meant(raw, names)
        if word not in shapes:
            raise MappingError(f"{show(raw)} is none of the constructors {', '.join(shapes)}")
        return Data(word, tuple([argument(message) for argument in shapes[word]]))

    return read


def _argument(where: Argument, sort: s.Sort, rule: Choice) -> Callable[[Message], Value]:
    if isinstance(where, Lookup):
        return functools.partial(_looked_up, where=where, sort=sort)
    read = converter(sort, rule.wires.get(where))
    return lambda message: read(at(message, where))


def _looked_up(message: Message, where: Lookup, sort: s.Sort) -> Value:
    key = at(message, where.key)
    cell = where.rows.get(str(key.decode() if isinstance(key, bytes) else key))
    if cell is None:
        raise MappingError(f"{show(key)} is in no row of {where.table}")
    return from_text(cell, sort, where.held)


def from_text(cell: str, sort: s.Sort, held: Wire | None = None) -> Value:
    """A table's cell as a value; `held`: the type in which a node holds it. Raises MappingError."""
    if isinstance(sort, s.RealSort | s.IntegerSort | s.NaturalSort):
        value = converter(sort)(cell.strip().encode())
        return of_type(value, held) if isinstance(value, Fraction) else value
    if isinstance(sort, s.BoolSort):
        return converter(sort)({"TRUE": True, "FALSE": False}.get(cell.strip().upper(), cell))
    return converter(sort)(cell)
