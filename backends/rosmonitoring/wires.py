"""The content of a field as a value: every number is the one that the message carries, in any transport.

A `float32` or `float64` means its exact binary number: digits of a JSON text are first rounded to the type, as in the
node that reads the message. If the type is not known, the digits are taken literally.
"""

from __future__ import annotations

import functools
import math
import struct
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import Any, TypeVar, assert_never

from avow.backend_kit.programs.samples import as_single, next_single
from avow.formulas.values import Binary, Data, Element, FunctionValue, SequenceValue, Value
from avow.language import sorts as s
from avow.ros.definitions import FLOATS, HEADER, INTEGERS, Array, Definitions, Nested, Scalar, Wire

from .rules import NOTHING_KNOWN, Gap, Take
from .tuning import NUMBER_LENGTH


class Exact(Fraction):
    """A fraction that computes its hash once: the same readings are looked up in tables repeatedly."""

    __slots__ = ("_kept",)
    _kept: int

    def __hash__(self) -> int:  # type: ignore[override]
        try:
            return self._kept
        except AttributeError:
            self._kept = super().__hash__()
            return self._kept


class NotANumber(Exception):  # noqa: N818 - it names what was found
    """NaN, an infinity, or a number too long to be intended."""


def exact(raw: object) -> Fraction | int:
    """The value of a number from JSON or from a bag, or of an exact number. Raises NotANumber."""
    if isinstance(raw, bytes):
        return _fraction(raw.decode())
    if isinstance(raw, Fraction):
        return raw
    if isinstance(raw, int) and not isinstance(raw, bool):
        return raw
    if isinstance(raw, float):
        if not math.isfinite(raw):
            raise NotANumber
        return _fraction(repr(float(raw)))
    raise NotANumber


@functools.lru_cache(maxsize=4096)
def whole(value: int) -> Fraction:
    """An integer as a real number."""
    return Exact(value)


@functools.lru_cache(maxsize=65536)
def _fraction(text: str) -> Fraction:
    front, point, digits = text.partition(".")
    try:
        if len(text) > NUMBER_LENGTH or abs(int(text.lower().partition("e")[2] or 0)) > NUMBER_LENGTH:
            raise NotANumber
        if point and text.isascii() and digits.isdecimal() and front.removeprefix("-").isdecimal():
            return Exact(int(front + digits), 10 ** len(digits))  # nearly all have this form
        return Exact(text)
    except (ValueError, ZeroDivisionError):
        raise NotANumber from None


Convert = Callable[[Any], Value]
T = TypeVar("T")


class MappingError(Exception):
    """A message that does not fit its rule; the text gives the reason, for people."""


class NoReading(MappingError):  # noqa: N818 - it names what was found
    """The field holds a value that the plan declares as no reading."""


class Unplaced(MappingError):  # noqa: N818 - it names what was found
    """The message is not in the contract's frame, and cannot be put into it: nothing is judged."""


def fits(sort: s.Sort, wire: Wire, known: Definitions) -> bool:
    """Whether a field of the type may carry a value of the sort (enumerations' words are checked separately)."""
    match sort, wire:
        case s.RealSort(), Scalar(name=name):
            return name in FLOATS or name in INTEGERS or name in ("time", "duration")
        case ((s.IntegerSort() | s.NaturalSort()), Scalar(name=name)):
            return name in INTEGERS
        case s.BoolSort(), Scalar(name=name):
            return name == "bool"
        case s.StringSort(), Scalar(name=name):
            return name in ("string", "wstring")
        case s.EnumSort(), Scalar(name=name):
            return name in ("string", "wstring") or name in INTEGERS
        case s.SequenceSort(item=item), Array(item=inner):
            return fits(item, inner, known)
        case s.TupleSort(items=items), Array(item=inner, length=length):
            return length == len(items) and all(fits(item, inner, known) for item in items)
        case s.TupleSort(items=items, labels=labels), Nested():
            named = dict(record(wire, known))
            parts = [named.get(label) for label in labels or named]
            return len(parts) == len(items) and all(
                part is not None and fits(item, part, known) for item, part in zip(items, parts, strict=True)
            )
        case _:  # functions, algebraic types: the plan decides
            return False


def record(wire: Nested, known: Definitions) -> tuple[tuple[str, Wire], ...]:
    """The fields of a message within a message, without its header."""
    message = known.get(wire.name)
    return tuple((f.name, f.wire) for f in message.fields if f.wire != Nested(HEADER)) if message else ()


def converter(
    sort: s.Sort, wire: Wire | None = None, names: Mapping[str, str] = MappingProxyType({}),
    known: Definitions = NOTHING_KNOWN, gaps: frozenset[Gap] = frozenset(),
) -> Convert:  # fmt: skip
    """A function from a field's content to a value of a sort; made once for each rule. If the field's type is not
    known, or does not fit, digits are taken literally."""
    wire = None if wire is None or not fits(sort, wire, known) else wire
    match sort:
        case s.RealSort():
            return _real(wire, gaps)
        case s.IntegerSort() | s.NaturalSort():
            kind, natural = wire.name if isinstance(wire, Scalar) else None, isinstance(sort, s.NaturalSort)
            return functools.partial(_whole, name=kind, natural=natural)
        case s.BoolSort():
            return lambda raw: _given(raw, bool, "a truth value")
        case s.StringSort():
            return lambda raw: names.get(word := _given(raw, str, "a string"), word)
        case s.EnumSort():
            return lambda raw: element(raw, sort, names)
        case s.SequenceSort(item=item):
            inner, length = (wire.item, wire.length) if isinstance(wire, Array) else (None, None)
            part = converter(item, inner, names, known)
            return lambda raw: SequenceValue(tuple(map(part, _items(raw, length))))
        case s.TupleSort():
            return _tuple(sort, wire, names, known, gaps)
        case s.DataSort():
            return functools.partial(_data, sort=sort, names=names)
        case s.FunctionSort():
            return functools.partial(_relation_literal, sort=sort, names=names)
        case s.OpaqueSort(name=name):
            return _unreadable(f"{name} is an unspecified sort: no message can be read as one of its values")
        case s.SetSort():
            return _unreadable("no message can be read as a value of this sort")
        case _:
            assert_never(sort)


def _real(wire: Wire | None, gaps: frozenset[Gap]) -> Convert:
    match wire:
        case Scalar(name="float32" | "float64" as name):
            return functools.partial(_float, wide=name == "float64", gaps=gaps)
        case Scalar(name="time" | "duration"):
            return seconds
        case Scalar(name=name):
            return lambda raw: whole(_whole(raw, name))
        case _:  # not known
            return lambda raw: whole(number) if isinstance(number := _number(raw), int) else number


def _tuple(
    sort: s.TupleSort, wire: Wire | None, names: Mapping[str, str], known: Definitions, gaps: frozenset[Gap]
) -> Convert:
    """For a message, its fields, by name if the tuple has names, whatever else it holds; otherwise the items."""
    if isinstance(wire, Nested):
        fields: dict[str, Wire | None] = dict(record(wire, known))
        labels = sort.labels or tuple(fields)
        inner = [fields[label] for label in labels]
    else:
        labels, inner = sort.labels, [wire.item if isinstance(wire, Array) else None] * len(sort.items)
    parts = [converter(item, one, names, known, gaps) for item, one in zip(sort.items, inner, strict=True)]

    def by_name(raw: Any) -> Value:
        return tuple([read(_member(raw, name)) for name, read in zip(labels, parts, strict=True)])

    def by_place(raw: Any) -> Value:
        return tuple([read(item) for read, item in zip(parts, _items(raw, len(parts)), strict=True)])

    if isinstance(wire, Nested):
        return by_name
    if wire is None and labels:
        return lambda raw: by_name(raw) if isinstance(raw, Mapping) else by_place(raw)
    return by_place


def _data(raw: Any, sort: s.DataSort, names: Mapping[str, str]) -> Data:
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
                    return Data(word, tuple(converter(p)(part) for part, p in pairs))
                raise MappingError(f"{word} takes {len(constructor.parameters)} arguments, not {len(arguments)}")
    raise MappingError(f"{show(raw)} is no value of {sort.name}")


def _relation_literal(raw: Any, sort: s.FunctionSort, names: Mapping[str, str]) -> FunctionValue:
    """``[[1, 2], [3, 4]]``: the tuples at which a relation holds."""
    if sort.result != s.BOOL or not isinstance(raw, list):
        raise MappingError("only a relation can be written out, as the list of its tuples")
    parts = [converter(part, None, names) for part in sort.parameters]
    table: dict[tuple[Value, ...], Value] = {}
    for row in raw:
        items = _items(row if isinstance(row, list) else [row], len(parts))
        table[tuple(read(item) for read, item in zip(parts, items, strict=True))] = True
    return FunctionValue(table, False)


def _unreadable(why: str) -> Convert:
    def refuse(raw: Any) -> Value:
        raise MappingError(why)

    return refuse


def taken(take: Take, sort: s.Sort, wire: Array, known: Definitions, gaps: frozenset[Gap]) -> Convert:
    """The least or the greatest of an array's items, or their number; items without a reading do not count."""
    if take is Take.COUNT and not gaps:
        length = wire.length
        as_real = isinstance(sort, s.RealSort)
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
            return whole(len(found)) if isinstance(sort, s.RealSort) else len(found)
        if not found:
            raise NoReading("none of the items is a reading")
        best: Value = min(found) if take is Take.MIN else max(found)
        return best

    return read


_REAL = s.RealSort()


def of_type(value: Fraction, wire: Wire | None) -> Fraction:
    """The content of a field of the type after `value` is written to it: the nearest number of the type."""
    match wire:
        case Scalar(name="float64"):
            return _nearest(value, float(value), wide=True)
        case Scalar(name="float32"):
            return _nearest(value, _single(float(value)), wide=False)
        case _:  # exact as it is
            return value


def _float(raw: Any, *, wide: bool, gaps: frozenset[Gap]) -> Fraction:
    kind = raw.__class__
    if kind is bytes or kind is int:
        return _of_text(raw.decode() if kind is bytes else str(raw), wide)
    if isinstance(raw, float):
        if math.isfinite(raw):
            return _of_float(float(raw), wide)
        gap = Gap.NAN if math.isnan(raw) else Gap.INF
        if gap in gaps:
            raise NoReading(f"{raw} is no reading")
        advice = f"if it means no reading, map it: `{{…, {gap.value}: none, elsewhere: …}}`"
        raise MappingError(f"{raw} is not a number; {advice}")
    raise MappingError(f"{show(raw)} is not a number")


@functools.lru_cache(maxsize=65536)
def _of_text(text: str, wide: bool) -> Fraction:
    try:
        return of_type(Fraction(exact(text.encode())), Scalar("float64" if wide else "float32"))
    except (NotANumber, OverflowError):
        raise MappingError(f"{text[:60]} is not a number of this type") from None


@functools.lru_cache(maxsize=65536)
def _of_float(value: float, wide: bool) -> Fraction:
    return _held(Fraction(value if wide else _single(value)), wide=wide)


LARGEST_SINGLE = (2 - 2.0**-23) * 2.0**127
"""The greatest float32."""


def _single(value: float) -> float:
    found = as_single(value)
    if not math.isfinite(found):
        raise MappingError(f"{value} is too large for a float32")
    return found


def _nearest(value: Fraction, near: float, *, wide: bool) -> Fraction:
    """The number of the type that is nearest to a value; `near` is that number or (rounded twice) next to it."""
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
    """A time in seconds: ROS 1 writes secs and nsecs, ROS 2 sec and nanosec. Raises MappingError."""
    if isinstance(raw, Mapping):
        for second, rest in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
            if second in raw and rest in raw:
                return Exact(_whole(raw[second], "int64") + Fraction(_whole(raw[rest], "int64"), 10**9))
    raise MappingError(f"{show(raw)} is no time of seconds and nanoseconds")


def _number(raw: Any) -> Fraction | int:
    try:
        return exact(raw)
    except NotANumber:
        raise MappingError(f"{show(raw)} is not a number") from None


def _whole(raw: Any, name: str | None, *, natural: bool = False) -> int:
    """An integer of a ROS type, if that is known. Raises MappingError."""
    number = _number(raw)
    if number.denominator != 1:
        raise MappingError(f"{show(raw)} is not a whole number")
    least, greatest = (number, number) if name is None else INTEGERS[name]
    if not least <= number <= greatest:
        raise MappingError(f"{show(raw)} is no {name}")
    if natural and number < 0:
        raise MappingError(f"{number} is negative, where a natural number is wanted")
    return int(number)


def _given(raw: Any, kind: type[T], what: str) -> T:
    if isinstance(raw, kind):
        return raw
    raise MappingError(f"{show(raw)} is not {what}")


def parts_of(sort: s.Sort) -> tuple[s.Sort, ...]:
    """The sorts for which fields are needed: a function's parameters (and result), or the value's own sort."""
    if isinstance(sort, s.FunctionSort):
        return sort.parameters if sort.result == s.BOOL else (*sort.parameters, sort.result)
    return (sort,)


def table_of(points: Iterable[tuple[Value, ...]], sort: s.FunctionSort) -> dict[tuple[Value, ...], Value]:
    """The table of a relation that holds at these tuples, or of a function whose result is the last item of each."""
    return dict.fromkeys(points, True) if sort.result == s.BOOL else {point[:-1]: point[-1] for point in points}


def meant(raw: Any, names: Mapping[str, str]) -> str | None:
    """The contract's name for a message's word or number; None if it is neither."""
    word = raw if isinstance(raw, str) else str(raw) if raw.__class__ is int else None
    return None if word is None else names.get(word, word)


def element(raw: Any, sort: s.EnumSort, names: Mapping[str, str]) -> Value:
    """The element that a word or a number denotes. Raises MappingError."""
    word = meant(raw, names)
    if word is not None and word in sort.members:
        return Element(word)
    raise MappingError(f"{show(raw)} is outside {{{', '.join(sort.members)}}}")


def _items(raw: Any, length: int | None) -> list[Any]:
    found: list[Any] = _given(raw, list, "a list")
    if length is not None and len(found) != length:
        raise MappingError(f"{show(raw)} has {len(found)} items, not {length}")
    return found


def _member(raw: Any, name: str) -> Any:
    if isinstance(raw, Mapping) and name in raw:
        return raw[name]
    raise MappingError(f"{show(raw)} has no field {name}")


def show(raw: Any) -> str:
    try:
        text = raw.decode() if isinstance(raw, bytes) else repr(raw)
    except RecursionError:
        return "something nested deeply"
    return text if len(text) <= 60 else text[:57] + "..."
