"""What a field of a known type holds, as a value: every number is the one that the message carries, in any transport.

A `float32` or `float64` means its exact binary number: digits of a JSON text are first rounded to the type, as they are
in the node that reads the message.
"""

from __future__ import annotations

import functools
import math
import struct
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from avow.backend_kit.programs.samples import as_single, next_single
from avow.formulas.values import Binary, Element, SequenceValue, Value
from avow.language.sorts import (
    BoolSort,
    EnumSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    SequenceSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.ros.definitions import FLOATS, HEADER, INTEGERS, Array, Definitions, Nested, Scalar, Wire

from .numbers import Decimal, Exact, NotANumber, exact, whole
from .rules import Gap, Take

Convert = Callable[[Any], Value]


class MappingError(Exception):
    """A message that does not fit its rule; the text says how, for people."""


class NoReading(MappingError):  # noqa: N818 - it names what was found
    """The field holds what the plan says is no reading."""


def fits(sort: Sort, wire: Wire, known: Definitions) -> bool:
    """Whether a field of the type may carry a value of the sort (an enumeration's words or numbers are asked apart)."""
    match sort, wire:
        case RealSort(), Scalar(name=name):
            return name in FLOATS or name in INTEGERS or name in ("time", "duration")
        case ((IntegerSort() | NaturalSort()), Scalar(name=name)):
            return name in INTEGERS
        case BoolSort(), Scalar(name=name):
            return name == "bool"
        case StringSort(), Scalar(name=name):
            return name in ("string", "wstring")
        case EnumSort(), Scalar(name=name):
            return name in ("string", "wstring") or name in INTEGERS
        case SequenceSort(item=item), Array(item=inner):
            return fits(item, inner, known)
        case TupleSort(items=items), Array(item=inner, length=length):
            return length == len(items) and all(fits(item, inner, known) for item in items)
        case TupleSort(items=items, labels=labels), Nested() if labels:
            named = dict(record(wire, known))
            return all(
                label in named and fits(item, named[label], known) for label, item in zip(labels, items, strict=True)
            )
        case TupleSort(items=items), Nested():
            parts = record(wire, known)
            return len(parts) == len(items) and all(
                fits(item, part, known) for item, (_, part) in zip(items, parts, strict=True)
            )
        case _:  # functions, algebraic types: the plan says how
            return False


def record(wire: Nested, known: Definitions) -> tuple[tuple[str, Wire], ...]:
    """The fields of a message within a message, without its header."""
    message = known.get(wire.name)
    return tuple((f.name, f.wire) for f in message.fields if f.wire != Nested(HEADER)) if message else ()


def converter(sort: Sort, wire: Wire, names: Mapping[str, str], known: Definitions, gaps: frozenset[Gap]) -> Convert:
    """From what a field of this type holds to a value of the sort; made once for each rule. `fits` holds of them."""
    match sort, wire:
        case RealSort(), Scalar(name="float32" | "float64" as name):
            return functools.partial(_float, wide=name == "float64", gaps=gaps)
        case RealSort(), Scalar(name="time" | "duration"):
            return seconds
        case RealSort(), Scalar(name=name):
            return lambda raw: whole(_whole(raw, name))
        case ((IntegerSort() | NaturalSort()), Scalar(name=name)):
            natural = isinstance(sort, NaturalSort)
            return lambda raw: _natural(_whole(raw, name)) if natural else _whole(raw, name)
        case BoolSort(), Scalar():
            return _truth
        case StringSort(), Scalar():
            return lambda raw: names.get(_word(raw), _word(raw))
        case EnumSort(), Scalar():
            return lambda raw: element(raw, sort, names)
        case SequenceSort(item=item), Array(item=inner, length=length):
            part = converter(item, inner, names, known, frozenset())
            return lambda raw: SequenceValue(tuple(map(part, _items(raw, length))))
        case TupleSort(items=items), Array(item=inner, length=length):
            parts = [converter(item, inner, names, known, gaps) for item in items]
            return lambda raw: tuple([p(x) for p, x in zip(parts, _items(raw, length), strict=True)])
        case TupleSort(items=items), Nested():
            fields = record(wire, known)
            if sort.labels:  # by name, whatever else the message holds
                fields = tuple((label, dict(fields)[label]) for label in sort.labels)
            readers = [
                (name, converter(item, inner, names, known, gaps))
                for item, (name, inner) in zip(items, fields, strict=True)
            ]
            return lambda raw: tuple([read(_member(raw, name)) for name, read in readers])
        case _:
            raise ValueError(f"{wire} does not fit {sort}: `fits` is asked first")


def taken(take: Take, sort: Sort, wire: Array, known: Definitions, gaps: frozenset[Gap]) -> Convert:
    """The least, the greatest, or the number of an array's items; items without a reading do not count."""
    if take is Take.COUNT and not gaps:
        length = wire.length
        as_real = isinstance(sort, RealSort)
        return lambda raw: whole(len(_items(raw, length))) if as_real else len(_items(raw, length))
    part = converter(sort if take is not Take.COUNT else _REAL, wire.item, {}, known, gaps)

    def read(raw: Any) -> Value:
        found: list[Any] = []
        for item in _items(raw, wire.length):
            try:
                found.append(part(item))
            except NoReading:
                continue
        if take is Take.COUNT:
            return whole(len(found)) if isinstance(sort, RealSort) else len(found)
        if not found:
            raise NoReading("none of the items is a reading")
        best: Value = min(found) if take is Take.MIN else max(found)
        return best

    return read


_REAL = RealSort()


def of_type(value: Fraction, wire: Wire | None) -> Fraction:
    """What a field of the type holds where `value` is written to it: the nearest number that there is."""
    match wire:
        case Scalar(name="float64"):
            return _nearest(value, float(value), wide=True)
        case Scalar(name="float32"):
            return _nearest(value, _single(float(value)), wide=False)
        case _:  # exact as it is
            return value


def _float(raw: Any, *, wide: bool, gaps: frozenset[Gap]) -> Fraction:
    kind = raw.__class__
    if kind is Decimal:
        return _of_text(raw.text, wide)
    if kind is int:
        return _of_text(str(raw), wide)
    if isinstance(raw, float):
        if math.isfinite(raw):
            return _of_float(float(raw), wide)
        gap = Gap.NAN if math.isnan(raw) else Gap.INF
        if gap in gaps:
            raise NoReading(f"{raw} is no reading")
    raise MappingError(f"{show(raw)} is not a number")


@functools.lru_cache(maxsize=65536)
def _of_text(text: str, wide: bool) -> Fraction:
    try:
        value = Fraction(exact(Decimal(text)))
        return of_type(value, Scalar("float64" if wide else "float32"))
    except (NotANumber, OverflowError):
        raise MappingError(f"{text[:60]} is not a number of this type") from None


@functools.lru_cache(maxsize=65536)
def _of_float(value: float, wide: bool) -> Fraction:
    return _held(Fraction(value if wide else _single(value)), wide=wide)


LARGEST_SINGLE = (2 - 2.0**-23) * 2.0**127
"""What a float32 holds at most."""


def _single(value: float) -> float:
    found = as_single(value)
    if not math.isfinite(found):
        raise MappingError(f"{value} is too large for a float32")
    return found


def _nearest(value: Fraction, near: float, *, wide: bool) -> Fraction:
    """The number of the type that is nearest to a value; `near` is it, or (rounded twice) next to it."""
    if wide:
        return _held(Fraction(near), wide=True)
    beside = (next_single(near, end) if near else near for end in (-math.inf, math.inf))
    around = [near, *filter(math.isfinite, beside)]
    return _held(min(map(Fraction, around), key=lambda n: abs(n - value)), wide=False)


def _held(value: Fraction, *, wide: bool) -> Fraction:
    near = float(value)
    digits = repr(near)
    if not wide:
        bits = struct.pack("<f", near)
        shorter = (float(f"{near:.{places}g}") for places in range(1, 9))
        fitting = (t for t in shorter if abs(t) <= LARGEST_SINGLE and struct.pack("<f", t) == bits)
        digits = next(map(repr, fitting), digits)
    return Binary.held(value, digits.removesuffix(".0"))


def seconds(raw: Any) -> Fraction:
    """ROS 1 writes secs and nsecs, ROS 2 sec and nanosec."""
    if isinstance(raw, Mapping):
        for second, rest in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
            if second in raw and rest in raw:
                return Exact(_whole(raw[second], "int64") + Fraction(_whole(raw[rest], "int64"), 10**9))
    raise MappingError(f"{show(raw)} is no time of seconds and nanoseconds")


def _whole(raw: Any, name: str) -> int:
    try:
        number = exact(raw)
    except NotANumber:
        raise MappingError(f"{show(raw)} is not a number") from None
    if number.denominator != 1:
        raise MappingError(f"{show(raw)} is not a whole number")
    least, greatest = INTEGERS[name]
    if not least <= number <= greatest:
        raise MappingError(f"{show(raw)} is no {name}")
    return int(number)


def _natural(number: int) -> int:
    if number < 0:
        raise MappingError(f"{number} is negative, where a natural number is wanted")
    return number


def _truth(raw: Any) -> bool:
    if isinstance(raw, bool):
        return raw
    raise MappingError(f"{show(raw)} is not a truth value")


def _word(raw: Any) -> str:
    if isinstance(raw, str):
        return raw
    raise MappingError(f"{show(raw)} is not a string")


def element(raw: Any, sort: EnumSort, names: Mapping[str, str]) -> Value:
    """The element that a word or a number stands for. Raises MappingError."""
    word = raw if isinstance(raw, str) else str(raw) if raw.__class__ is int else None
    if word is not None:
        word = names.get(word, word)
        if word in sort.members:
            return Element(word)
    raise MappingError(f"{show(raw)} is outside {{{', '.join(sort.members)}}}")


def _items(raw: Any, length: int | None) -> list[Any]:
    if not isinstance(raw, list):
        raise MappingError(f"{show(raw)} is not a list")
    if length is not None and len(raw) != length:
        raise MappingError(f"{show(raw)} has {len(raw)} items, not {length}")
    return raw


def _member(raw: Any, name: str) -> Any:
    if isinstance(raw, Mapping) and name in raw:
        return raw[name]
    raise MappingError(f"{show(raw)} has no field {name}")


def show(raw: Any) -> str:
    try:
        text = repr(raw)
    except RecursionError:
        return "something nested deeply"
    return text if len(text) <= 60 else text[:57] + "..."
