"""Messages to values, by the rules. A reader is made once for each rule and called for each message."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from avow.base.diagnostics import Hinted
from avow.base.plain import listed
from avow.formulas.values import Data, FunctionValue, Value
from avow.language import sorts as s
from avow.language.sorts import EnumSort, IntegerSort, NaturalSort, RealSort, Sort
from avow.ros import frames
from avow.ros.bags import ENVELOPE, Event, message_of
from avow.ros.definitions import INTEGERS, Array, Definitions, Message, Nested, Scalar, Wire

from . import parameters
from .rules import Argument, Choice, FieldPath, Fields, Hold, Lookup, Parameter
from .tuning import CANDIDATES_SHOWN
from .wires import (
    Convert,
    MappingError,
    NoReading,
    Unplaced,
    converter,
    fits,
    meant,
    of_type,
    parts_of,
    show,
    table_of,
    taken,
)

Reader = Callable[[Event, Value | None], Value]
"""(the message, the variable's value so far) → its new value. Raises MappingError."""


def reader(rule: Fields | Choice, tree: frames.Tree | None, known: Definitions) -> Reader:
    """`tree`: the transforms of the run, for a rule with a frame."""
    read = _reader(rule)
    if tree is None or not rule.frame:
        return read

    def placed(message: Event, old: Value | None) -> Value:
        try:
            moved = tree.placed(message, rule.kind, known, rule.frame)
        except frames.Unplaced as why:
            raise Unplaced(str(why)) from None
        try:
            return read(moved, old)
        except MappingError as error:
            if moved is message:
                raise
            raise Unplaced(f"it is not in the frame {rule.frame}, and what is transformed lacks it: {error}") from None

    return placed


def _reader(rule: Fields | Choice) -> Reader:
    match rule:
        case Choice():
            return _choice(rule)
        case Parameter():
            return parameters.reader(rule)
        case Fields():
            sort = rule.variable.sort
            if isinstance(sort, s.FunctionSort):
                return _function(rule, sort)
            return _scalar(rule, sort)


def at(event: Event, path: FieldPath) -> Any:
    """The part of an event's message at a path. Raises MappingError."""
    return _within(message_of(event, str(path[0])) if path else event, path)


def _within(message: Any, path: FieldPath) -> Any:
    place = message
    for depth, name in enumerate(path):
        inside = place
        if isinstance(name, int):
            place = place[name] if isinstance(place, list) and -len(place) <= name < len(place) else _MISSING
        elif isinstance(place, Mapping) and name in place:
            place = place[name]
        elif depth == 0 and isinstance(place, Mapping) and isinstance(place.get("data"), Mapping):
            place = place["data"].get(name, _MISSING)
        else:
            place = _MISSING
        if place is _MISSING:
            names = [key for key in inside if key not in ENVELOPE] if isinstance(inside, Mapping) else []
            told = f"; {shown(path[:depth]) or 'it'} has {', '.join(names[:8])}" if names else ""
            raise MappingError(f"the message has no field {shown(path)}{told}")
    return place


def shown(path: FieldPath) -> str:
    """``pose.position.x``, ``ranges[0]``."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")


_MISSING = object()


def _converters(rule: Fields, sorts: tuple[s.Sort, ...]) -> tuple[Convert, ...]:
    """For each of the rule's paths, the conversion of its content to a value."""
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
        name = path[0]  # by far the most frequent reader
        return _with_default(rule, lambda message, old: read(message[name] if name in message else at(message, path)))
    return _with_default(rule, lambda message, old: read(at(message, path)))


def _with_default(rule: Fields, read: Reader) -> Reader:
    """A reader that returns the plan's value if there is no reading."""
    elsewhere = rule.elsewhere
    if elsewhere is None:
        return read

    def otherwise(message: Event, old: Value | None) -> Value:
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

    def read(message: Event, old: Value | None) -> Value:
        found = points(message)
        before = old.table if seen and isinstance(old, FunctionValue) else {}
        fresh = table_of(found, sort)
        if isinstance(old, FunctionValue) and all(before.get(k) == v for k, v in fresh.items()) and seen:
            return old
        return FunctionValue({**before, **fresh}, elsewhere)

    return read


def _points(rule: Fields, sorts: tuple[s.Sort, ...]) -> Callable[[Event], list[tuple[Value, ...]]]:
    """The tuples that a message brings, without those that have no reading among their parts."""
    each, pairs = rule.each, tuple(zip(rule.paths, _converters(rule, sorts), strict=True))

    def one(message: Event, part: Callable[[Any, FieldPath], Any]) -> tuple[Value, ...] | None:
        try:
            return tuple([read(part(message, p)) for p, read in pairs])
        except NoReading:
            return None

    if each is None:
        return lambda message: [point] if (point := one(message, at)) is not None else []
    way = each

    def several(message: Event) -> list[tuple[Value, ...]]:
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

    def read(message: Event, old: Value | None) -> Value:
        raw = at(message, tag)
        word = meant(raw, names)
        if word not in shapes:
            raise MappingError(f"{show(raw)} is none of the constructors {', '.join(shapes)}")
        return Data(word, tuple([argument(message) for argument in shapes[word]]))

    return read


def _argument(where: Argument, sort: s.Sort, rule: Choice) -> Callable[[Event], Value]:
    if isinstance(where, Lookup):
        return functools.partial(_looked_up, where=where, sort=sort)
    read = converter(sort, rule.wires.get(where))
    return lambda message: read(at(message, where))


def _looked_up(message: Event, where: Lookup, sort: s.Sort) -> Value:
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


class Undecided(Hinted):
    """Several ways to read a variable, or none; the text says which, `hint` what the plan may write."""


def decide(sort: Sort, message: Message, known: Definitions, values: Mapping[str, str]) -> tuple[FieldPath, ...]:
    """The fields of the message that a variable of the sort is read from. Raises Undecided."""
    missing = known.missing(message)
    if missing:
        raise Undecided(f"nothing defines {', '.join(missing)}, of which {message.name} is made", SOURCES)
    wanted = parts_of(sort)
    places = [(path, wire, holder) for path, wire, holder in _places(message, known)]
    fitting = [[suits(part, wire, holder, known, values) for _, wire, holder in places] for part in wanted]
    ways = _ways(fitting, len(places))
    if ways == 1:
        return tuple(places[at][0] for at in _only(fitting))
    hint = _hint(wanted, places, known, values)
    told = [
        f"{'.'.join(map(str, path)) or 'the whole message'} : {wire}"
        for at, (path, wire, _) in enumerate(places)
        if any(row[at] for row in fitting)
    ]
    if ways == 0:
        every = ", ".join(f"{'.'.join(map(str, p))} : {w}" for p, w, _ in places[:CANDIDATES_SHOWN] if p) or "none"
        raise Undecided(f"no field of {message.name} can be read as it; its fields are {every}", hint)
    what = "field" if len(wanted) == 1 else f"{len(wanted)} fields"
    which = f"it may be read from more than one {what} of {message.name}"
    raise Undecided(f"{which}: {listed(told, CANDIDATES_SHOWN)}", hint)


def fitting_fields(sort: Sort, message: Message, known: Definitions) -> str | None:
    """A hint for a field from which a value of the sort cannot be read: those from which it can."""
    names = [
        ".".join(map(str, at)) for at, wire, of in _places(message, known) if at and suits(sort, wire, of, known, {})
    ]
    return f"fields that can be read as it: {listed(names, CANDIDATES_SHOWN)}" if names else None


def _hint(
    wanted: Sequence[Sort],
    places: Sequence[tuple[FieldPath, Wire, Message]],
    known: Definitions,
    values: Mapping[str, str],
) -> str | None:
    """A proposal for the plan: for arrays, whose items no variable is read from by default, and for numbers that may be
    elements of an enumeration; None if there are neither."""
    if len(wanted) != 1:
        return None
    sort = wanted[0]
    for path, wire, holder in places:
        name = ".".join(map(str, path))
        if isinstance(wire, Array) and isinstance(sort, RealSort | IntegerSort | NaturalSort):
            take = "min" if fits(sort, wire.item, known) else "count"
            item = f"an item of an array, `{name}[0]`, or " if take == "min" else ""
            return f"name the field; {item}of all items: `{{field: {name}, take: {take}}}`"
        if isinstance(sort, EnumSort) and isinstance(wire, Scalar) and wire.name in INTEGERS and not values:
            constants = [constant for constant, kind, _ in holder.constants if kind == wire.name] or ["0"]
            left = [m for m in sort.members if m not in words(sort, wire, holder, {}).values()]
            if left:
                said = f"`{{field: {name}, values: {{{constants[0]}: {left[0]}, …}}}}`"
                return f"say what its numbers mean ({', '.join(constants)}): {said}"
    return None


SOURCES = "name its file under `messages:`, or the distribution: `ros: {distro: …}`"


def suits(sort: Sort, wire: Wire, holder: Message, known: Definitions, values: Mapping[str, str]) -> bool:
    """Whether it `fits`, and, if numbers denote elements, each element has a known number."""
    if not fits(sort, wire, known):
        return False
    if isinstance(sort, EnumSort) and isinstance(wire, Scalar) and wire.name in INTEGERS:
        return set(sort.members) <= set(words(sort, wire, holder, values).values())
    return True


def words(sort: EnumSort, wire: Scalar, holder: Message, values: Mapping[str, str]) -> dict[str, str]:
    """The meaning of a message's words or numbers: by the plan's `values` (which may name constants of the definition),
    otherwise, each, by the definition's constant whose name is an element's, ignoring case."""
    constants = {name: text for name, kind, text in holder.constants if kind == wire.name}
    members = {member.lower(): member for member in sort.members if wire.name in INTEGERS}
    own = {text: members[name.lower()] for name, text in constants.items() if name.lower() in members}
    return own | {constants.get(key, key): meant for key, meant in values.items()}


def _places(message: Message, known: Definitions) -> list[tuple[FieldPath, Wire, Message]]:
    """The candidates: the leaves, and each message within the message (for tuples), the message itself first."""
    found: list[tuple[FieldPath, Wire, Message]] = [((), Nested(message.name), message)]
    seen: set[FieldPath] = set()
    for path, wire, holder in known.leaves(message):
        for depth in range(1, len(path)):
            if path[:depth] not in seen:
                seen.add(path[:depth])
                inner, where = known.at(message, path[:depth])
                found.append((path[:depth], inner, where))
        found.append((path, wire, holder))
    return found


def _ways(fitting: Sequence[Sequence[bool]], places: int) -> int:
    """The number of ways to fill the parts by places in their order: 0, 1, or 2 for several."""
    counts = [1] + [0] * len(fitting)
    for at in range(places):
        for part in range(len(fitting), 0, -1):
            if fitting[part - 1][at]:
                counts[part] = min(2, counts[part] + counts[part - 1])
    return counts[-1]


def _only(fitting: Sequence[Sequence[bool]]) -> list[int]:
    """The only way: each part takes the first place after the last that fits."""
    found: list[int] = []
    at = 0
    for row in fitting:
        while not row[at]:
            at += 1
        found.append(at)
        at += 1
    return found
