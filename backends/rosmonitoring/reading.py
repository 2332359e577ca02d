"""Messages to values, by the rules. A reader is made once for each rule and called for each message."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Any

from avow.formulas.values import Data, Element, FunctionValue, Sequence, Value
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
    Sort,
    StringSort,
    TupleSort,
)

from .numbers import Decimal, NotANumber, exact, whole
from .rules import Argument, Choice, Fields, Hold, InOrder, Lookup, Path

Message = Mapping[str, Any]
Reader = Callable[[Message, Value | None], Value]
"""(the message, the variable's value so far) → its new value. Raises MappingError."""

META = frozenset({"topic", "time", "service", "request", "response"})
"""Keys that ROSMonitoring adds to a message."""


class MappingError(Exception):
    """A message that does not fit its rule; the text says how, for people."""


def reader(rule: Fields | InOrder | Choice) -> Reader:
    match rule:
        case Choice():
            return _choice(rule)
        case Fields() | InOrder():
            sort = rule.variable.sort
            if isinstance(sort, FunctionSort):
                return _function(rule, sort)
            return _scalar(rule, sort)


def at(message: Any, path: Path) -> Any:
    """The part of a message that a path leads to. Raises MappingError."""
    place = message
    for depth, name in enumerate(path):
        if isinstance(place, Mapping) and name in place:
            place = place[name]
        elif depth == 0 and isinstance(place, Mapping) and isinstance(place.get("data"), Mapping):
            place = place["data"].get(name, _MISSING)
        else:
            place = _MISSING
        if place is _MISSING:
            raise MappingError(f"the message has no field {'.'.join(path)}")
    return place


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
                raise MappingError(f"{_show(raw)} is not a whole number")
            if isinstance(sort, NaturalSort) and number < 0:
                raise MappingError(f"{_show(raw)} is negative, where a natural number is wanted")
            return int(number)
        case BoolSort():
            if isinstance(raw, bool):
                return raw
            raise MappingError(f"{_show(raw)} is not a truth value")
        case StringSort():
            if isinstance(raw, str):
                return names.get(raw, raw)
            raise MappingError(f"{_show(raw)} is not a string")
        case EnumSort():
            return _element(raw, sort, names)
        case DataSort():
            return _data(raw, sort, names)
        case TupleSort(items=items):
            if isinstance(raw, list) and len(raw) == len(items):
                return tuple(convert(part, item, names) for part, item in zip(raw, items, strict=True))
            raise MappingError(f"{_show(raw)} is not a list of {len(items)}")
        case SequenceSort(item=item):
            if isinstance(raw, list):
                return Sequence(tuple(convert(part, item, names) for part in raw))
            raise MappingError(f"{_show(raw)} is not a list")
        case FunctionSort():
            return _relation_literal(raw, sort, names)
        case OpaqueSort(name=name):
            raise MappingError(f"{name} is an unspecified sort: no message can be read as one of its values")
        case _:
            raise MappingError("no message can be read as a value of this sort")


def _number(raw: Any) -> Fraction | int:
    if raw.__class__ is int or raw.__class__ is Decimal or isinstance(raw, float):
        try:
            return exact(raw)
        except NotANumber:
            pass
    raise MappingError(f"{_show(raw)} is not a number")


def _element(raw: Any, sort: EnumSort, names: Mapping[str, str]) -> Element:
    word = raw if isinstance(raw, str) else str(raw) if raw.__class__ is int else None
    if word is not None:
        word = names.get(word, word)
        if word in sort.members:
            return Element(word)
    raise MappingError(f"{_show(raw)} is outside {{{', '.join(sort.members)}}}")


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
    raise MappingError(f"{_show(raw)} is no value of {sort.name}")


def _relation_literal(raw: Any, sort: FunctionSort, names: Mapping[str, str]) -> FunctionValue:
    """``[[1, 2], [3, 4]]``: the tuples at which a relation holds."""
    if sort.result != BOOL or not isinstance(raw, list):
        raise MappingError("only a relation can be written out, as the list of its tuples")
    table: dict[tuple[Value, ...], Value] = {}
    for row in raw:
        parts = row if isinstance(row, list) else [row]
        if len(parts) != len(sort.parameters):
            raise MappingError(f"{_show(row)} is not a list of {len(sort.parameters)}")
        table[tuple(convert(p, s, names) for p, s in zip(parts, sort.parameters, strict=True))] = True
    return FunctionValue(table, False)


def _show(raw: Any) -> str:
    try:
        text = repr(raw)
    except RecursionError:
        return "something nested deeply"
    return text if len(text) <= 60 else text[:57] + "..."


def _scalar(rule: Fields | InOrder, sort: Sort) -> Reader:
    names = rule.names
    if isinstance(rule, Fields):
        path, items = rule.paths[0], sort.items if isinstance(sort, TupleSort) else ()
        if len(rule.paths) > 1:
            pairs = tuple(zip(rule.paths, items, strict=True))
            return lambda message, old: tuple([convert(at(message, p), s, names) for p, s in pairs])
        return lambda message, old: convert(at(message, path), sort, names)
    topic = rule.topic

    def first_that_fits(message: Message, old: Value | None) -> Value:
        trouble: MappingError | None = None
        for raw in _in_order(message, topic):
            try:
                return convert(raw, sort, names)
            except MappingError as error:
                trouble = trouble or error
        raise trouble or MappingError("the message has no fields")

    return first_that_fits


def _in_order(message: Message, topic: str) -> Iterator[Any]:
    """The fields of a message in its order. What is wrapped in ``data``, or under the topic's own name, counts as the
    message."""
    short = topic.rsplit("/", 1)[-1]
    for wrapper in (short, "data"):
        if isinstance(message.get(wrapper), Mapping):
            yield from _leaves(message[wrapper])
            return
    yield from _leaves({k: v for k, v in message.items() if k not in META})


def _leaves(message: Any) -> Iterator[Any]:
    stack = [message]
    while stack:
        part = stack.pop()
        if isinstance(part, Mapping):
            stack.extend(reversed(list(part.values())))
        else:
            yield part


def _function(rule: Fields | InOrder, sort: FunctionSort) -> Reader:
    relation = sort.result == BOOL
    sorts = sort.parameters if relation else (*sort.parameters, sort.result)
    names, seen = rule.names, rule.hold is Hold.SEEN
    points = _named(rule, sorts) if isinstance(rule, Fields) else _fitting(rule.topic, sorts, names, relation)
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


def _named(rule: Fields, sorts: tuple[Sort, ...]) -> Callable[[Message], list[tuple[Value, ...]]]:
    paths, names, each = rule.paths, rule.names, rule.each

    def one(message: Message) -> tuple[Value, ...]:
        return tuple([convert(at(message, p), s, names) for p, s in zip(paths, sorts, strict=True)])

    if each is None:
        return lambda message: [one(message)]
    way = each

    def several(message: Message) -> list[tuple[Value, ...]]:
        items = at(message, way)
        if not isinstance(items, list):
            raise MappingError(f"the field {'.'.join(way)} is not a list")
        return [one(item) for item in items]

    return several


def _fitting(
    topic: str, sorts: tuple[Sort, ...], names: Mapping[str, str], relation: bool
) -> Callable[[Message], list[tuple[Value, ...]]]:
    """Fields fill the parameters in order; the result is the last field that fits."""
    parameters = sorts if relation else sorts[:-1]

    def read(message: Message) -> list[tuple[Value, ...]]:
        leaves = list(_in_order(message, topic))
        values: list[Value] = []
        while leaves and len(values) < len(parameters):
            raw = leaves.pop(0)
            try:
                values.append(convert(raw, parameters[len(values)], names))
            except MappingError:
                continue
        if len(values) < len(parameters):
            raise MappingError(f"the message fills {len(values)} of {len(parameters)} parameters")
        if relation:
            return [tuple(values)]
        for raw in reversed(leaves):
            try:
                return [(*values, convert(raw, sorts[-1], names))]
            except MappingError:
                continue
        raise MappingError("the message has no field for the function's result")

    return read


def _choice(rule: Choice) -> Reader:
    sort = rule.variable.sort
    assert isinstance(sort, DataSort)
    shapes = {
        name: tuple(zip(arguments, sort.constructor(name).parameters, strict=True))
        for name, arguments in rule.arguments.items()
    }
    tag, names = rule.tag, rule.names

    def read(message: Message, old: Value | None) -> Value:
        raw = at(message, tag)
        word = names.get(raw, raw) if isinstance(raw, str) else str(raw) if raw.__class__ is int else None
        word = names.get(word, word) if word is not None else None
        if word not in shapes:
            raise MappingError(f"{_show(raw)} is none of the constructors {', '.join(shapes)}")
        return Data(word, tuple([_argument(message, where, part) for where, part in shapes[word]]))

    return read


def _argument(message: Message, where: Argument, sort: Sort) -> Value:
    if not isinstance(where, Lookup):
        return convert(at(message, where), sort, {})
    key = at(message, where.key)
    cell = where.rows.get(str(key.text if isinstance(key, Decimal) else key))
    if cell is None:
        raise MappingError(f"{_show(key)} is in no row of {where.table}")
    return from_text(cell, sort)


def from_text(cell: str, sort: Sort) -> Value:
    """A table's cell as a value. Raises MappingError."""
    if isinstance(sort, RealSort | IntegerSort | NaturalSort):
        return convert(Decimal(cell.strip()), sort, {})
    if isinstance(sort, BoolSort):
        return convert({"TRUE": True, "FALSE": False}.get(cell.strip().upper(), cell), sort, {})
    return convert(cell, sort, {})
