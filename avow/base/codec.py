"""Dataclasses as JSON, there and back by their types, with one canonical text for digests; and the JSON schema that
follows.

Writing, reading and the schema come from the same type hints, so they cannot drift apart. Reading is strict: an unknown
or missing field, or a value of another type, is `Unreadable`, never a guess. What a field of type Any holds is made
plain when it is written (fractions, paths, enumerations become texts).
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import cache
from typing import Any, TypeVar

T = TypeVar("T")
Read = Callable[[Any], Any]

LATER: Mapping[str, Any] = {"avow.later": True}
"""Metadata of a field that texts of earlier versions do not have, and that is not written where it is empty."""


class Unreadable(Exception):  # noqa: N818 - it says what the text is
    """Text that is not what it should be: torn, edited, or of another program."""


def canonical(value: object) -> str:
    """The one JSON text of a plain value: ASCII, sorted keys, no spaces."""
    return _CANONICAL.encode(value)


_CANONICAL = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
"""Made once: `json.dumps` makes one for each call that asks for anything but its defaults."""


def plain(value: object) -> Any:
    """A value as JSON can hold it without loss of what it says; unknown objects become their text."""
    match value:
        case None | bool() | int():
            return value
        case float():
            return value if math.isfinite(value) else str(value)
        case str():
            return str(value)
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case set() | frozenset():
            return sorted((plain(item) for item in value), key=canonical)
        case list() | tuple():
            return [plain(item) for item in value]
        case _:  # what JSON has no form for
            return str(value)


def to_json(value: object) -> Any:
    """A dataclass, or a tuple of such, as plain data."""
    kind: Any = type(value)
    if kind is str or value is None or kind is bool or kind is int:
        return value
    if isinstance(value, tuple):
        return [to_json(item) for item in value]
    if isinstance(value, str):
        return str(value)
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return plain(value)
    later, found = _later(kind), dict[str, Any]()
    for name in _fields(kind):
        item = getattr(value, name)
        if item or name not in later:  # most parts are plain, and there are very many
            plainly = item is None or type(item) in (str, bool, int)
            found[name] = item if plainly else to_json(item)
    return found


def from_json(kind: type[T], data: object) -> T:
    """The `kind` that plain data stands for. Raises Unreadable, with the place."""
    try:
        found: T = _reader(typing.cast(Any, kind))(data)
    except Unreadable as error:
        raise Unreadable(f"{kind.__name__.lower()}{error}") from None
    return found


@cache
def _fields(kind: type) -> dict[str, Any]:
    hints = typing.get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


@cache
def _later(kind: type) -> frozenset[str]:
    return frozenset(field.name for field in dataclasses.fields(kind) if field.metadata == LATER)


@cache
def _reader(kind: Any) -> Read:
    """Built once for each type: a ledger has many thousand records."""
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return _of_fields(kind)
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        return _of_tuple(arguments)
    if origin is types.UnionType or origin is typing.Union:
        inner = _reader(next(a for a in arguments if a is not type(None)))
        optional = type(None) in arguments
        return lambda data: None if data is None and optional else inner(data)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _of_mapping(_reader(arguments[1]))
    return _of_plain(kind)


def _of_fields(kind: type) -> Read:
    later, names = _later(kind), frozenset(_fields(kind))
    readers = {name: _reader(hint) for name, hint in _fields(kind).items()}

    def read(data: Any) -> Any:
        if type(data) is not dict:
            raise Unreadable(f": not a {kind.__name__}")
        if data.keys() != names:
            missing, extra = names - later - data.keys(), data.keys() - names
            if missing or extra:
                raise Unreadable(f": fields missing: {sorted(missing)}, unknown: {sorted(map(str, extra))}")
        values = {}
        for name, item in data.items():
            try:
                values[name] = readers[name](item)
            except Unreadable as error:
                raise Unreadable(f".{name}{error}") from None
        return kind(**values)

    return read


def _of_tuple(arguments: tuple[Any, ...]) -> Read:
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        one = _reader(arguments[0])

        def several(data: Any) -> tuple[Any, ...]:
            return tuple(map(one, _list(data)))

        return several
    readers = tuple(map(_reader, arguments))

    def fixed(data: Any) -> tuple[Any, ...]:
        if len(_list(data)) != len(readers):
            raise Unreadable(f": {len(readers)} items are wanted")
        return tuple(read(item) for read, item in zip(readers, data, strict=True))

    return fixed


def _list(data: Any) -> list[Any]:
    if type(data) is not list:
        raise Unreadable(": not a list")
    return data


def _of_mapping(read: Read) -> Read:
    def mapping(data: Any) -> dict[str, Any]:
        if type(data) is not dict:
            raise Unreadable(": not an object")
        return {key: read(item) for key, item in data.items()}

    return mapping


def _of_plain(kind: Any) -> Read:
    if kind is Any or kind is object:
        return lambda data: data
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return _of_enum(kind)
    if kind is float:
        return _float
    if kind not in (str, int, bool):
        raise TypeError(f"{kind} has no form in JSON")

    def exactly(data: Any) -> Any:
        if type(data) is not kind:
            raise Unreadable(f": not a {kind.__name__}")
        return data

    return exactly


def _of_enum(kind: type[StrEnum]) -> Read:
    members = {member.value: member for member in kind}

    def member(data: Any) -> StrEnum:
        if type(data) is not str or data not in members:
            raise Unreadable(f": no {kind.__name__}: {str(data)[:60]!r}")
        return members[data]

    return member


def _float(data: Any) -> float:
    if type(data) not in (int, float):
        raise Unreadable(": not a number")
    return float(data)


def schema(kind: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """The JSON schema (2020-12) of a type; dataclasses are added to `definitions`."""
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        if kind.__name__ not in definitions:
            definitions[kind.__name__] = {}
            fields = _fields(kind)
            definitions[kind.__name__] = {
                "description": (kind.__doc__ or "").strip().split("\n\n")[0],
                "type": "object",
                "properties": {name: schema(hint, definitions) for name, hint in fields.items()},
                "required": [name for name in fields if name not in _later(kind)],
                "additionalProperties": False,
            }
        return {"$ref": f"#/$defs/{kind.__name__}"}
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return {"type": "array", "items": schema(arguments[0], definitions)}
        items = [schema(a, definitions) for a in arguments]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if origin is types.UnionType or origin is typing.Union:
        return {"anyOf": [schema(a, definitions) for a in arguments]}
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": schema(arguments[1], definitions)}
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return {"enum": [member.value for member in kind]}
    return dict(_PLAIN[kind])


_PLAIN: dict[Any, dict[str, Any]] = {
    Any: {},
    object: {},
    str: {"type": "string"},
    int: {"type": "integer"},
    float: {"type": "number"},
    bool: {"type": "boolean"},
    type(None): {"type": "null"},
}
