"""The values of one variable in a batch of events, as an array of codes: equal codes, equal truth of every clause."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from avow.formulas.values import FunctionValue, Value
from avow.language.sorts import RealSort
from avow.language.terms import Compare, In, SequenceRange, SetTerm, Term, Variable
from avow.ros.bags import ENVELOPE, Event
from avow.ros.definitions import FLOATS, Scalar

from .reading import Reader, at
from .rules import Choice, FieldPath, Fields, Hold, Rule, paths_of
from .told import number_of
from .wires import LARGEST_SINGLE, MappingError

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

UNKNOWN, UNREADABLE = -1, -2
"""Codes of a variable that has no value yet, and of a message that cannot be read."""
NONE: Ints = np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True)
class Batch:
    events: Sequence[Event]
    lines: Sequence[int]
    times: Floats
    newest: Floats
    """The latest time so far, at each event."""
    written: Mapping[str, Ints]
    """Topic, as it is written → its rows."""
    rows: Mapping[str, Ints]
    """Topic, without its leading slash → its rows."""


class Column:
    """The values of one variable that messages carry, as codes."""

    def __init__(self, rule: Fields | Choice, read: Reader, formulas: Iterable[Term]) -> None:
        self._read = read
        self._paths = paths_of(rule)
        self._seen = isinstance(rule, Fields) and rule.hold is Hold.SEEN
        self.bounds = regions(rule, formulas)
        self.clear()

    def clear(self) -> None:
        """Forget all codes: those of regions stay what they are."""
        self._codes: dict[Hashable, int] = {}
        self._by_value: dict[Hashable, int] = {}
        self.values: list[Value | None] = [None] * (0 if self.bounds is None else len(self.bounds) + 1)
        """By their codes; of a region, any of its numbers."""

    def code_of(self, value: Value) -> int:
        if self.bounds is not None and isinstance(value, Fraction):
            place = bisect_right(self.bounds, _as_float(value))
            if place % 2 == 0 and place < len(self.bounds):
                self.values[place] = value
                return place
        key = (value.default, frozenset(value.table.items())) if isinstance(value, FunctionValue) else value
        code = self._by_value.setdefault(key, len(self.values))
        if code == len(self.values):
            self.values.append(value)
        return code

    def codes(self, events: Sequence[Event], now: int) -> tuple[Ints, Flags | None]:
        """The codes of some messages, and which of them the engine has to read, if any. `now`: the code before."""
        if self._seen:
            return self._accumulated(events, now)
        raws = self._raws(events)
        places = None if self.bounds is None else self._places(raws, events)
        if places is None:
            for raw, first in {raw: k for k, raw in enumerate(raws) if raw not in self._codes}.items():
                self._learn(raw, events[first])
            places = np.array([self._codes[raw] for raw in raws], np.int64)
        return places, None

    def _places(self, raws: Sequence[Hashable], events: Sequence[Event]) -> Ints | None:
        """Regions of numbers, found in floating point; what lies too near to a bound is read exactly."""
        assert self.bounds is not None
        if not set(map(type, raws)) <= {bytes, int, float}:
            return None
        try:
            numbers = np.array(list(map(float, raws)))  # type: ignore[arg-type]
        except OverflowError:
            return None
        places = np.searchsorted(self.bounds, numbers, "right").astype(np.int64)
        near = (places % 2 == 1) | (places == len(self.bounds))
        for place in np.flatnonzero(np.bincount(places[~near])).tolist():
            if self.values[place] is None:
                self._learn(raws[first := int(np.argmax(places == place))], events[first])
        for k in np.flatnonzero(near).tolist():
            known = self._codes.get(raws[k])
            places[k] = self._learn(raws[k], events[k]) if known is None else known
        return places

    def _learn(self, raw: Hashable, event: Event) -> int:
        try:
            code = self.code_of(self._read(event, None))
        except MappingError:
            code = UNREADABLE
        self._codes[raw] = code
        return code

    def _accumulated(self, events: Sequence[Event], now: int) -> tuple[Ints, Flags]:
        """The codes of what was seen so far; the engine has to see what is new."""
        fresh = np.zeros(len(events), np.bool_)
        found: list[int] = []
        for k, (raw, event) in enumerate(zip(self._raws(events), events, strict=True)):
            if raw not in self._codes:
                fresh[k] = True
                try:
                    now = self.code_of(self._read(event, self.values[now] if now >= 0 else None))
                    self._codes[raw] = now
                except MappingError:
                    pass
            found.append(now)
        return np.array(found, np.int64), fresh

    def _raws(self, events: Sequence[Event]) -> Sequence[Hashable]:
        """What the values are read from, as keys."""
        parts = [_keys(events, path) for path in self._paths]
        return parts[0] if len(parts) == 1 else list(zip(*parts, strict=True))


_MISSING = "no such field", 0
_PLAIN = (bytes, int, float, str)


def _keys(events: Sequence[Event], path: FieldPath) -> Sequence[Hashable]:
    """What lies at a path of each event, as keys."""
    if len(path) == 1 and isinstance(path[0], str) and path[0] not in ENVELOPE:
        name = path[0]
        raws = [event.get(name, _MISSING) for event in events]  # as nearly always
        if set(map(type, raws)) <= {*_PLAIN}:
            return raws
    return [_key(event, path) for event in events]


def _key(event: Event, path: FieldPath) -> Hashable:
    try:
        raw = at(event, path)
    except MappingError:
        return _MISSING
    # True is 1 for a dictionary, and no list is a key
    return raw if raw is None or raw.__class__ in _PLAIN else repr(raw).encode()


def _as_float(number: Fraction) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf


def regions(rule: Rule, formulas: Iterable[Term]) -> list[float] | None:
    """Ascending bounds: a reading whose `bisect` among them is even lies in a region all of whose readings make the
    same formulas true; one whose place is odd is too near to a number to tell. None where the variable is not only
    compared. Places are found in floating point, so the bounds are wider than any rounding of reading and comparing."""
    if not isinstance(rule, Fields) or not isinstance(rule.variable.sort, RealSort) or rule.take or len(rule.paths) > 1:
        return None
    wire = rule.wire(0)
    if wire is not None and not (isinstance(wire, Scalar) and wire.name in FLOATS):
        return None
    found: set[Fraction] = set()
    for formula in formulas:
        for number in _compared(formula, rule.variable):
            if number is None:
                return None
            found.add(number)
    try:
        near = [(float(n), abs(float(n)) * 2.0**-20 + 1e-40) for n in found]
    except OverflowError:
        return None
    spans = [(middle - room, middle + room) for middle, room in near]
    return _merged([(-math.inf, -LARGEST_SINGLE / 2), *spans, (LARGEST_SINGLE / 2, math.inf)])


def _merged(spans: list[tuple[float, float]]) -> list[float]:
    bounds: list[float] = []
    for low, high in sorted(spans):
        if bounds and low <= bounds[-1]:
            bounds[-1] = max(bounds[-1], high)
        else:
            bounds += [low, high]
    return bounds


def _compared(term: Term, variable: Variable) -> Iterator[Fraction | None]:
    """The numbers that the variable is compared with; None where it occurs in another way."""
    match term:
        case Variable():
            if term.qualified == variable.qualified:
                yield None
        case Compare(left=left, right=right) if _is(left, variable) or _is(right, variable):
            yield number_of(right if _is(left, variable) else left)
        case In(item=item, collection=SetTerm(items=items)) if _is(item, variable):
            yield from map(number_of, items)
        case In(item=item, collection=SequenceRange(low=low, high=high)) if _is(item, variable):
            yield from (number_of(low), number_of(high))
        case _:  # compares nothing itself
            for child in term.children:
                yield from _compared(child, variable)


def _is(term: Term, variable: Variable) -> bool:
    return isinstance(term, Variable) and term.qualified == variable.qualified
