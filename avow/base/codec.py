"""Dataclasses as JSON, there and back by their types, with one canonical text for digests; and the JSON schema that
follows.

Writing, reading and the schema come from the same type hints, so they cannot drift apart. Reading is strict: an unknown
or missing field, a value of another type, a repeated key, or a malformed number is `Unreadable`, never guessed. Values
in a field of type Any become plain when written (fractions, paths, enumerations become texts). A NamedTuple is a row, a
list without names, for data in thousands; bytes are text in base64. For a union, the first member that fits the data is
read.

Other modules make plain dictionaries only if a standard defines them (SARIF, in-toto, DSSE, JUnit, CycloneDX, ReqIF,
ROS), if a command shows data without a dataclass, and in `avow.pipeline.blobs`, whose values share their parts.
(msgspec was rejected because it ignores unknown fields.)
"""

from __future__ import annotations

import base64
import dataclasses
import itertools
import json
import math
import re
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from functools import cache
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")
Read = Callable[[Any], Any]

LATER: Mapping[str, Any] = {"avow.later": True}
"""Metadata of a field that texts of earlier versions lack, and that is not written if it is empty."""


def called(key: str) -> Mapping[str, Any]:
    """Metadata of a field that has another name in JSON."""
    return {"avow.key": key}


class Foreign:
    """Base of dataclasses for another program's format: only the fields that Avow reads are declared, others are
    ignored, and one with a default may be missing."""

    __slots__ = ()


class Unreadable(ValueError):  # noqa: N818 - it says what the text is
    """Text in a wrong format: torn, edited, or of another program. The message begins with the place."""


def canonical(value: object) -> str:
    """The one JSON text of a plain value: ASCII, sorted keys, no spaces."""
    return _CANONICAL.encode(value)


_CANONICAL = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
"""Made once: `json.dumps` makes one for each call with other than default arguments."""


def line(value: object) -> bytes:
    """A dataclass, or plain data, as a message between Avow's processes: one line, which `from_text` reads."""
    return f"{canonical(to_json(value))}\n".encode()


def document(value: object) -> str:
    """JSON for people and other programs, an item a line. A lone surrogate (Python's form of an undecodable byte in a
    file name) is shown as unreadable: no reader of JSON accepts it."""
    return _HALVES.sub("\ufffd", json.dumps(to_json(value), indent=1, ensure_ascii=False))


_HALVES = re.compile("[\ud800-\udfff]")


def plain(value: object) -> Any:
    """A value in a form that JSON can hold without loss of meaning; unknown objects become their text."""
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
        case _:  # no form in JSON
            return str(value)


def to_json(value: Any) -> Any:
    """A dataclass, or a tuple of such, as plain data."""
    kind: Any = type(value)
    if kind is str or value is None or kind is bool or kind is int:
        return value
    if kind is list or isinstance(value, tuple):
        return [to_json(item) for item in value]
    if isinstance(value, str):
        return str(value)
    if kind is dict:
        return {str(key): to_json(item) for key, item in value.items()}
    if kind is bytes:
        return base64.b64encode(value).decode()
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return plain(value)
    found = dict[str, Any]()
    for key, field in _fields(kind).items():
        item = getattr(value, field.name)
        if item or not field.later:  # most parts are plain, and there are very many
            plainly = item is None or type(item) in (str, bool, int)
            found[key] = item if plainly else to_json(item)
    return found


def from_json(kind: type[T], data: object) -> T:
    """The `kind` that plain data stands for. Raises Unreadable, with the place."""
    try:
        found: T = _reader(typing.cast(Any, kind))(data)
    except Unreadable as error:
        name = kind.__name__.strip("_").lower() if dataclasses.is_dataclass(kind) else "it"
        raise Unreadable(f"{name}{error}") from None
    return found


def from_text(kind: type[T], text: str | bytes) -> T:
    """As `from_json`, of the JSON text. Raises Unreadable, whatever the text is."""
    return from_json(kind, parsed(text))


def parsed(text: str | bytes) -> Any:
    """The plain data of a JSON text that all readers of JSON understand alike. Raises Unreadable."""
    try:
        said = text if isinstance(text, str) else str(text, "utf-8")
        return json.loads(said, object_pairs_hook=once, parse_constant=_no_number)
    except RecursionError:
        raise Unreadable("it is nested too deeply") from None
    except ValueError as error:
        raise Unreadable(str(error)) from None


def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object without repeated keys: readers of JSON differ in which of the values they take."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        double = next(key for key in keys if keys.count(key) > 1)
        raise Unreadable(f"the key {json.dumps(double[:60])} stands twice in one object")
    return found


def _no_number(word: str) -> Any:
    raise Unreadable(f"{word} is no number of JSON")


class _Field(NamedTuple):
    name: str
    hint: Any
    later: bool


@cache
def _fields(kind: type) -> dict[str, _Field]:
    """By their names in JSON."""
    hints, told = typing.get_type_hints(kind), dataclasses.fields(kind)
    return {f.metadata.get("avow.key", f.name): _Field(f.name, hints[f.name], "avow.later" in f.metadata) for f in told}


def _later(kind: type) -> frozenset[str]:
    """Fields that may be missing."""
    return frozenset(
        field.metadata.get("avow.key", field.name)
        for field in dataclasses.fields(kind)
        if "avow.later" in field.metadata
        or (issubclass(kind, Foreign) and (field.default, field.default_factory) != (_MISSING, _MISSING))
    )


_MISSING = dataclasses.MISSING


@cache
def _reader(kind: Any) -> Read:
    """Built once for each type: a ledger has many thousand records."""
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return _of_fields(kind)
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        return _of_tuple(arguments)
    if items := _row(kind):
        row = _of_tuple(items)
        return lambda data: kind(*row(data))
    if origin is types.UnionType or origin is typing.Union:
        return _of_union([_reader(a) for a in arguments if a is not type(None)], optional=type(None) in arguments)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _of_mapping(_reader(arguments[1]))
    return _of_plain(kind)


def _of_fields(kind: type) -> Read:
    fields, foreign, told = _fields(kind), issubclass(kind, Foreign), dataclasses.fields(kind)
    needed, by_place = fields.keys() - _later(kind), all(f.init and not f.kw_only for f in told)
    readers = [(key, field.name, _reader(field.hint)) for key, field in fields.items()]

    def whole(data: Any) -> Any:
        if type(data) is not dict:
            raise Unreadable(f": not a {kind.__name__}")
        missing, extra = needed - data.keys(), () if foreign else data.keys() - fields.keys()
        if missing or extra:
            raise Unreadable(f": fields missing: {sorted(missing)}, unknown: {sorted(map(str, extra))}")
        at = ""
        try:
            if by_place and len(data) == len(readers) and not foreign:  # quicker than by name
                return kind(*[read(data[at := key]) for key, _, read in readers])
            return kind(**{name: read(data[at := key]) for key, name, read in readers if key in data})
        except Unreadable as error:
            raise Unreadable(f".{at}{error}") from None

    return whole


def _every(readers: Iterable[Read], items: Iterable[Any]) -> Iterator[Any]:
    """What each reader makes of its item. Raises Unreadable, with the item's index."""
    for at, (read, item) in enumerate(zip(readers, items, strict=False)):
        try:
            yield read(item)
        except Unreadable as error:
            raise Unreadable(f"[{at}]{error}") from None


def _row(kind: Any) -> tuple[Any, ...]:
    """The types of a NamedTuple's items; empty for other types."""
    if not (isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")):
        return ()
    hints = typing.get_type_hints(kind)
    return tuple(hints[name] for name in kind._fields)


def _of_union(readers: list[Read], *, optional: bool) -> Read:
    *others, last = readers

    def first(data: Any) -> Any:
        if data is None and optional:
            return None
        for read in others:
            try:
                return read(data)
            except Unreadable:
                continue
        return last(data)

    return first


def _of_tuple(arguments: tuple[Any, ...]) -> Read:
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        one = _reader(arguments[0])
        return lambda data: tuple(_every(itertools.repeat(one), _list(data)))
    readers = tuple(map(_reader, arguments))

    def fixed(data: Any) -> tuple[Any, ...]:
        if len(_list(data)) != len(readers):
            raise Unreadable(f": {len(readers)} items are wanted")
        return tuple(_every(readers, data))

    return fixed


def _list(data: Any) -> list[Any]:
    if type(data) is not list:
        raise Unreadable(": not a list")
    return data


def _of_mapping(read: Read) -> Read:
    def mapping(data: Any) -> dict[str, Any]:
        if type(data) is not dict:
            raise Unreadable(": not an object")
        at = ""
        try:
            return {key: read(data[at := key]) for key in data}
        except Unreadable as error:
            raise Unreadable(f".{at}{error}") from None

    return mapping


def _of_plain(kind: Any) -> Read:
    if kind is Any or kind is object:
        return lambda data: data
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return _of_enum(kind)
    if kind is float:
        return _float
    if kind is bytes:
        return _bytes
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
    if not abs(data) <= sys.float_info.max:
        raise Unreadable(": beyond all numbers of a machine")
    return float(data)


def _bytes(data: Any) -> bytes:
    try:
        return base64.b64decode(data, validate=True)
    except (TypeError, ValueError):
        raise Unreadable(": no bytes in base64") from None


def schema(kind: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """The JSON schema (2020-12) of a type; dataclasses are added to `definitions`."""
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        if kind.__name__ not in definitions:
            definitions[kind.__name__] = {}
            fields, later = _fields(kind), _later(kind)
            definitions[kind.__name__] = {
                "description": " ".join((kind.__doc__ or "").strip().split("\n\n")[0].split()),
                "type": "object",
                "properties": {key: schema(field.hint, definitions) for key, field in fields.items()},
                "required": [key for key in fields if key not in later],
                "additionalProperties": False,
            }
        return {"$ref": f"#/$defs/{kind.__name__}"}
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple and len(arguments) == 2 and arguments[1] is Ellipsis:
        return {"type": "array", "items": schema(arguments[0], definitions)}
    if items := [schema(a, definitions) for a in (arguments if origin is tuple else _row(kind))]:
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if origin is types.UnionType or origin is typing.Union:
        return {"anyOf": [schema(a, definitions) for a in arguments]}
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": schema(arguments[1], definitions)}
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return {"enum": [member.value for member in kind]}
    return dict(_PLAIN[kind])


def published(kind: type, identifier: str, title: str) -> dict[str, Any]:
    """The complete JSON schema of a document: that of its dataclass, with its title."""
    definitions: dict[str, Any] = {}
    schema(kind, definitions)
    body = definitions.pop(kind.__name__)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": identifier, "title": title}
    return {**head, **body, "$defs": dict(sorted(definitions.items()))}


_PLAIN: dict[Any, dict[str, Any]] = {
    Any: {},
    object: {},
    str: {"type": "string"},
    int: {"type": "integer"},
    float: {"type": "number"},
    bool: {"type": "boolean"},
    bytes: {"type": "string", "contentEncoding": "base64"},
    type(None): {"type": "null"},
}
