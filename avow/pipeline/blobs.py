"""Typed data as canonical JSON, and back: the form in which a job is sent.

A table holds each part once and refers to it by its index, so that equal data has equal bytes however its parts are
shared in memory, and depth costs nothing. Source positions are left out, and paths are relative to the system's folder:
no answer may depend on either. Only the classes that a slice is made of, by the types that its fields declare, are
written and read. (`avow.base.codec` writes trees for people and other programs: it would repeat a shared part at each
use.)
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import json
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from json.encoder import encode_basestring
from pathlib import Path
from typing import Any, cast, get_args, get_type_hints

from avow.base.diagnostics import Span
from avow.pipeline.slices import Slice

_NOWHERE = Span("", 1, 1, 1, 1)
_PLAIN = (str, int, bool, float, type(None), Fraction, Path, Span, Any)


class Garbled(ValueError):  # noqa: N818 - it says what they are
    """Bytes that are not those of any value."""


_PLAINLY = {None: "null", True: "true", False: "false"}
_PLAIN_KINDS = frozenset((str, bool, type(None)))
"""The types that are written in place, and not in the table."""


def encode(value: object, root: Path) -> bytes:
    """Raises TypeError for other data than a slice's. `root` is the system's folder."""
    table: dict[str, int] = {}
    known: dict[int, str] = {}
    kept: list[object] = []
    """Keeps the parts alive that `known` names by their id, so that no other part gets that id."""
    stack: list[tuple[Any, Sequence[object] | None]] = [] if type(value) in _PLAIN_KINDS else [(value, None)]
    while stack:
        current, parts = stack.pop()
        if id(current) in known:
            continue
        if parts is None:
            kind: Any = type(current)
            parts = _children(kind)(current)
            stack.append((current, parts))
            stack.extend([(part, None) for part in parts if type(part) not in _PLAIN_KINDS])
            continue
        text = _entry(current, [_reference(part, known) for part in parts], root)
        known[id(current)] = str(table.setdefault(text, len(table)))
        kept.append(current)
    rows = ",\n".join(table)
    return f'{{"root":{_reference(value, known)},"table":[\n{rows}\n]}}'.encode("utf-8", "surrogatepass")


def decode(data: bytes, root: Path) -> Any:
    """The value again, with paths under `root`. Raises Garbled."""
    try:
        said = json.loads(data.decode("utf-8", "surrogatepass"))
        if set(said) != {"root", "table"}:
            raise Garbled("no value")
        made: list[Any] = []
        for entry in said["table"]:
            made.append(_made(entry, made, root))
        return _value(said["root"], made)
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        raise Garbled(f"{type(error).__name__}: {error}") from error


@functools.cache
def _fields(kind: Any) -> tuple[str, ...]:
    return tuple(f.name for f in dataclasses.fields(kind) if f.init and not _is_place(f.name))


@functools.cache
def _row(kind: Any) -> tuple[str, tuple[int, ...]]:
    """How a row of the class is written, and which of its fields stand there, by name."""
    names = _fields(kind)
    order = sorted(range(len(names)), key=lambda at: names[at])
    return f'{{"":"{kind.__name__}"' + "".join(f',"{names[at]}":%s' for at in order) + "}", tuple(order)


def _is_place(name: str) -> bool:
    return name in ("span", "spans") or name.endswith(("_span", "_spans"))


@functools.cache
def _children(kind: Any) -> Callable[[Any], Sequence[object]]:
    """A function that returns the parts of a value of that class."""
    known = kind is _classes().get(kind.__name__)
    if known and not issubclass(kind, enum.Enum):
        names = _fields(kind)
        return operator.attrgetter(*names) if len(names) > 1 else lambda value: [getattr(value, n) for n in names]
    if known or kind in (Fraction, int, float) or issubclass(kind, Path):
        return lambda value: ()
    if issubclass(kind, Mapping):
        return lambda value: [part for pair in value.items() for part in pair]
    if issubclass(kind, tuple | list):
        return lambda value: cast(Sequence[object], value)
    raise TypeError(f"{kind.__name__} is no data of a work")


def _reference(value: Any, known: Mapping[int, str]) -> str:
    """As JSON: the value itself where it is plain, else its place in the table."""
    if type(value) is str:
        return encode_basestring(value)
    return known.get(id(value)) or _PLAINLY[value]


def _entry(value: Any, parts: list[str], root: Path) -> str:
    """A row of the table; `parts` are the references to the value's children."""
    match value:
        case enum.Enum():
            return f'["e",{encode_basestring(type(value).__name__)},{json.dumps(value.value, ensure_ascii=False)}]'
        case Fraction():
            return f'["q","{value.numerator}","{value.denominator}"]'
        case Path():
            return f'["p",{encode_basestring(Path(os.path.relpath(value, root)).as_posix())}]'
        case int():
            return f'["i","{value}"]'
        case float():
            return f'["f","{value.hex()}"]'
        case Mapping():
            return f'["m"{"".join([f",{part}" for part in parts])}]'
        case tuple():
            return f'["t"{"".join([f",{part}" for part in parts])}]'
        case list():
            return f'["l"{"".join([f",{part}" for part in parts])}]'
        case _:  # a dataclass
            kind: Any = type(value)
            row, order = _row(kind)
            return row % tuple([parts[at] for at in order])


def _value(reference: Any, made: list[Any]) -> Any:
    if reference is None or isinstance(reference, bool | str):
        return reference
    if not isinstance(reference, int) or not 0 <= reference < len(made):
        raise Garbled("a part refers to what does not stand before it")
    return made[reference]


def _made(entry: Any, made: list[Any], root: Path) -> Any:
    match entry:
        case ["e", str(name), value]:
            kind = _classes()[name]
            if dataclasses.is_dataclass(kind):
                raise Garbled(f"{name} has parts")
            return kind(value)
        case ["q", str(numerator), str(denominator)]:
            return Fraction(int(numerator), int(denominator))
        case ["p", str(path)]:
            return root / path
        case ["i", str(digits)]:
            return int(digits)
        case ["f", str(text)]:
            return float.fromhex(text)
        case ["m", *parts]:
            found = [_value(part, made) for part in parts]
            return dict(zip(found[::2], found[1::2], strict=True))
        case ["t", *items]:
            return tuple(_value(item, made) for item in items)
        case ["l", *items]:
            return [_value(item, made) for item in items]
        case {"": str(name), **rest}:
            kind = _classes()[name]
            if set(rest) != set(_fields(kind)):
                raise Garbled(f"{name} has other parts")
            arguments = {str(field): _value(part, made) for field, part in rest.items()}
            return kind(**arguments | _places(kind))
        case _:
            raise Garbled("no such part")


@functools.cache
def _places(kind: Any) -> dict[str, Any]:
    """For places that a class wants."""
    wanted = (f for f in dataclasses.fields(kind) if f.init and _is_place(f.name))
    return {
        f.name: _NOWHERE
        for f in wanted
        if f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
    }


@functools.cache
def _classes() -> Mapping[str, Any]:
    """Name → dataclass or enumeration, of all that a slice can hold."""
    found: dict[str, Any] = {}
    left: list[Any] = [Slice]
    while left:
        kind = left.pop()
        if not isinstance(kind, type):  # a union, or a container of others
            left.extend(get_args(kind))
        elif kind not in _PLAIN and kind is not found.get(kind.__name__):
            assert kind.__name__ not in found, f"a slice holds two classes named {kind.__name__}"
            assert dataclasses.is_dataclass(kind) or issubclass(kind, enum.Enum), f"a slice holds a {kind.__name__}"
            found[kind.__name__] = kind
            if dataclasses.is_dataclass(kind):
                left.extend(get_type_hints(kind).values())
    return found
