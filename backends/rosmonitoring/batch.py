"""Some events of a trace by topic: their fields as arrays if the trace has them so, an event only on request."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import FunctionValue, Value
from avow.language.sorts import RealSort
from avow.language.terms import Compare, In, SequenceRange, SetTerm, Term, Variable
from avow.ros.bags import ENVELOPE, Channel, Event
from avow.ros.definitions import FLOATS, Scalar
from avow.ros.layout import Layout

from .options import same_topic
from .reading import Reader, at
from .rules import Choice, FieldPath, Fields, Hold, Rule, paths_of
from .tuning import BATCH, BATCH_BYTES
from .wires import LARGEST_SINGLE, MappingError

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Array = npt.NDArray[Any]

NONE: Ints = np.zeros(0, np.int64)


@dataclass(slots=True)
class Batch:
    event: Callable[[int], Event]
    """The event of a row."""
    lines: Sequence[int]
    written: Mapping[str, Ints]
    """Topic, as it is written → its rows."""
    raws: Sequence[Any] | Array
    """The times, as they are written."""
    times: Floats
    _arrays: Mapping[str, Callable[[FieldPath], Array | None]] = field(default_factory=dict)
    nanoseconds: Ints | None = None
    """The times in nanoseconds, if they are known so."""
    rows: dict[str, Ints] = field(default_factory=dict)
    """Topic, without its leading slash → its rows."""
    backwards: bool = False
    """Whether a time is less than one before."""
    _keys: dict[tuple[str, FieldPath], Sequence[Hashable]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for topic, rows in self.written.items():
            before = self.rows.get(same_topic(topic))
            self.rows[same_topic(topic)] = rows if before is None else np.sort(np.concatenate((before, rows)))

    def of(self, rows: Ints) -> list[Event]:
        return [self.event(row) for row in rows.tolist()]

    def numbered(self, topic: str) -> bool:
        """Whether a topic's messages may have sequence numbers that are in no array."""
        return topic not in self._arrays and any("header" in event for event in self.of(self.rows[topic]))

    def array(self, topic: str, path: FieldPath) -> Array | None:
        """A field of a topic's messages, if it is a number in each of them."""
        arrays = self._arrays.get(topic)
        return None if arrays is None or not path or path[0] in ENVELOPE else arrays(path)

    def keys(self, topic: str, path: FieldPath) -> Sequence[Hashable]:
        """The content of a field in each of a topic's messages: equal keys mean equal values."""
        found, array = self._keys.get((topic, path)), self.array(topic, path)
        if found is None and array is not None:
            found = self._keys[topic, path] = array.tolist()
        if found is None:
            events = self.of(self.rows[topic])
            if len(path) == 1 and isinstance(name := path[0], str) and name not in ENVELOPE:
                found = [event.get(name, _MISSING) for event in events]  # the usual case
            if found is None or not set(map(type, found)) <= {*_PLAIN}:
                found = [_key(event, path) for event in events]
            self._keys[topic, path] = found
        return found


_MISSING = "no such field", 0
_PLAIN = (bytes, int, float, str)


def _key(event: Event, path: FieldPath) -> Hashable:
    try:
        return key_of(at(event, path))
    except MappingError:
        return _MISSING


def key_of(raw: Any) -> Hashable:
    # True equals 1 as a dictionary key, no list is a key, and NaN does not equal itself
    return raw if raw is None or (raw.__class__ in _PLAIN and raw == raw) else repr(raw).encode()


def of_events(events: Sequence[Event], lines: Sequence[int]) -> Batch:
    """Events of JSON."""
    raws = [event["time"] for event in events]
    rows: dict[str, list[int]] = {}
    for row, event in enumerate(events):
        rows.setdefault(event["topic"], []).append(row)
    written = {topic: np.array(found, np.int64) for topic, found in rows.items()}
    return Batch(events.__getitem__, lines, written, raws, np.array(list(map(float, raws))))


def of_messages(messages: Iterable[tuple[Channel, int, bytes]]) -> Iterator[Batch]:
    """The messages of a bag, in batches."""
    layouts: dict[int, Layout | None] = {}
    channels: list[Channel] = []
    times: list[int] = []
    raws: list[bytes] = []
    line, size = 1, 0
    for channel, time, raw in messages:
        channels.append(channel)
        times.append(time)
        raws.append(raw)
        size += len(raw)
        if size > BATCH_BYTES or len(raws) == BATCH:
            yield _of_messages(channels, times, raws, line, layouts)
            line, size = line + len(raws), 0
            channels, times, raws = [], [], []
    if raws:
        yield _of_messages(channels, times, raws, line, layouts)


def _of_messages(
    channels: list[Channel], times: list[int], raws: list[bytes], line: int, layouts: dict[int, Layout | None]
) -> Batch:
    distinct = {id(channel): channel for channel in channels}
    topics = list(dict.fromkeys(channel.topic for channel in distinct.values()))
    owners = np.array(list(map({key: topics.index(one.topic) for key, one in distinct.items()}.get, map(id, channels))))
    said = Counter(same_topic(channel.topic) for channel in distinct.values())
    written: dict[str, Ints] = {}
    arrays: dict[str, Callable[[FieldPath], Array | None]] = {}
    for number, topic in enumerate(topics):
        written[topic] = rows = np.flatnonzero(owners == number)
        some = raws if len(rows) == len(raws) else [raws[row] for row in rows]
        if said[same_topic(topic)] == 1 and (columns := _columns(channels[rows[0]], some, layouts)):
            arrays[same_topic(topic)] = columns
    event = cache(lambda row: channels[row].event(times[row], raws[row]))
    seconds = np.array([time / 10**9 for time in times])  # nearest to the event's time
    return Batch(event, range(line, line + len(raws)), written, times, seconds, arrays, np.array(times, np.int64))


def _columns(
    channel: Channel, raws: Sequence[bytes], layouts: dict[int, Layout | None]
) -> Callable[[FieldPath], Array | None] | None:
    """The fields of one channel's messages, by the layout of earlier ones or of the first of these."""
    known = layouts.get(id(channel))
    columns = None if known is None else known.columns(raws)
    if columns is None:
        channel.read(raws[0])  # raises if it is no message
        known = layouts[id(channel)] = channel.layout(raws[0])
        columns = None if known is None else known.columns(raws)
    return columns


def of_arrays(topics: Mapping[str, Mapping[str, Array]]) -> Iterator[Batch]:
    """Arrays: topic → field (`pose.x`; `time` in seconds) → one number for each message."""
    parts = [np.asarray(fields["time"], np.float64) for fields in topics.values()]
    times, several = np.concatenate(parts), len(parts) > 1
    order = np.argsort(times, kind="stable") if several else NONE
    owners = np.repeat(np.arange(len(parts)), [len(part) for part in parts])[order] if several else NONE
    ends = [0] * len(parts)
    for start in range(0, len(times), 4 * BATCH):
        some = slice(start, start + 4 * BATCH)
        now = times[order[some]] if several else times[some]
        written: dict[str, Ints] = {}
        arrays: dict[str, Mapping[FieldPath, Array]] = {}
        for k, (topic, fields) in enumerate(topics.items()):
            rows = np.flatnonzero(owners[some] == k) if several else np.arange(len(now))
            if len(rows):
                first, ends[k] = ends[k], ends[k] + len(rows)
                written[topic] = rows
                arrays[topic] = {tuple(n.split(".")): a[first : ends[k]] for n, a in fields.items() if n != "time"}
        yield _of_arrays(written, arrays, now, start + 1)


def _of_arrays(
    written: Mapping[str, Ints], arrays: Mapping[str, Mapping[FieldPath, Array]], times: Floats, line: int
) -> Batch:
    def make(row: int) -> Event:
        topic = next(t for t, rows in written.items() if row in rows)
        place = int(np.searchsorted(written[topic], row))
        event: dict[str, Any] = {"topic": topic, "time": float(times[row])}
        for path, column in arrays[topic].items():
            inner = event
            for step in path[:-1]:
                inner = inner.setdefault(str(step), {})
            inner[str(path[-1])] = column[place].item()
        return event

    gets = {same_topic(topic): fields.get for topic, fields in arrays.items()}
    return Batch(cache(make), range(line, line + len(times)), written, times, times, gets)


UNKNOWN, UNREADABLE = -1, -2
"""Codes of a variable that has no value yet, and of an unreadable message."""


class Column:
    """The values of one variable that messages carry, as codes."""

    def __init__(self, rule: Fields | Choice, read: Reader, formulas: Iterable[Term]) -> None:
        self._read = read
        self._paths = paths_of(rule)
        self._seen = isinstance(rule, Fields) and rule.hold is Hold.SEEN
        self.regions = Regions.of(rule, formulas)
        self.clear()

    def clear(self) -> None:
        """Forget all codes, except those of regions, which do not change."""
        self._codes: dict[Hashable, int] = {}
        self._by_value: dict[Hashable, int] = {}
        self.values: list[Value | None] = [None] * (0 if self.regions is None else self.regions.count)
        """The values by code; for a region, any of its numbers."""

    def code_of(self, value: Value) -> int:
        if self.regions is not None and isinstance(value, Fraction):
            place = self.regions.place(value)
            self.values[place] = value
            return place
        key = (value.default, frozenset(value.table.items())) if isinstance(value, FunctionValue) else value
        code = self._by_value.setdefault(key, len(self.values))
        if code == len(self.values):
            self.values.append(value)
        return code

    def codes(self, batch: Batch, topic: str, now: int) -> tuple[Ints, Flags | None]:
        """The codes of a topic's messages, and which of them the engine has to read, if any. `now`: the code before."""
        if self.regions is not None and (array := batch.array(topic, self._paths[0])) is not None:
            return self._places(*self.regions.read(array), array, batch, topic), None
        parts = [batch.keys(topic, path) for path in self._paths]
        raws = parts[0] if len(parts) == 1 else list(zip(*parts, strict=True))
        if self._seen:
            return self._accumulated(raws, batch.of(batch.rows[topic]), now)
        if self.regions is not None and set(map(type, raws)) <= {bytes, int, float}:
            with suppress(OverflowError, ValueError):
                numbers = np.array(list(map(float, raws)))  # type: ignore[arg-type]
                return self._places(numbers, True, raws, batch, topic), None
        for raw, first in {raw: k for k, raw in enumerate(raws) if raw not in self._codes}.items():
            self._learn(raw, batch, topic, first)
        return np.array([self._codes[raw] for raw in raws], np.int64), None

    def _places(self, numbers: Floats, rough: bool, raws: Sequence[Hashable] | Array, batch: Batch, topic: str) -> Ints:
        """The regions of numbers. If these are only the nearest doubles, messages near a bound are read."""
        assert self.regions is not None
        places = self.regions.places(numbers)
        odd = self.regions.unsure(numbers) if rough else ~np.isfinite(numbers)
        exact = np.flatnonzero(odd).tolist() if odd.any() else []
        for place in np.flatnonzero(np.bincount(places[~odd] if exact else places)).tolist():
            if self.values[place] is None:
                first = int(np.argmax((places == place) & ~odd))
                self._learn(key_of(raws[first]), batch, topic, first)
        for k in exact:
            raw = key_of(raws[k])
            known = self._codes.get(raw)
            places[k] = self._learn(raw, batch, topic, k) if known is None else known
        return places

    def _learn(self, raw: Hashable, batch: Batch, topic: str, k: int) -> int:
        try:
            code = self.code_of(self._read(batch.event(int(batch.rows[topic][k])), None))
        except MappingError:
            code = UNREADABLE
        self._codes[raw] = code
        return code

    def _accumulated(self, raws: Sequence[Hashable], events: Sequence[Event], now: int) -> tuple[Ints, Flags]:
        """The codes of the tuples seen so far; the engine has to judge messages with new ones."""
        fresh = np.zeros(len(events), np.bool_)
        found: list[int] = []
        for k, (raw, event) in enumerate(zip(raws, events, strict=True)):
            if raw not in self._codes:
                fresh[k] = True
                try:
                    now = self.code_of(self._read(event, self.values[now] if now >= 0 else None))
                    self._codes[raw] = now
                except MappingError:
                    pass
            found.append(now)
        return np.array(found, np.int64), fresh


def combinations(columns: Sequence[Ints], widths: Sequence[int]) -> tuple[Ints, Ints]:
    """The first row of each combination of codes, and each row's combination."""
    packed, size = columns[0], widths[0]
    for codes, width in zip(columns[1:], widths[1:], strict=True):
        if size * width > 2**62:
            unique, packed = np.unique(packed, return_inverse=True)
            size = len(unique)
        packed, size = packed * width + codes, size * width
    if size > 8 * len(packed) + 1024:
        _, first, which = np.unique(packed, return_index=True, return_inverse=True)
        return first, which
    places = np.full(size, -1)
    places[packed[::-1]] = np.arange(len(packed) - 1, -1, -1)
    present = np.flatnonzero(places >= 0)
    first = places[present]
    places[present] = np.arange(len(present))
    return first, places[packed]


class Regions:
    """The numbers that clauses compare a variable with: each of them, and all numbers between two of them, make the
    same clauses true. A double is placed exactly: it lies above a number if it is greater than the greatest double that
    is not above it."""

    def __init__(self, numbers: Iterable[Fraction], wire: str) -> None:
        """Raises OverflowError for a number beyond the range of doubles."""
        self._wire = wire
        self._numbers = sorted(numbers)
        near = [(number, float(number)) for number in self._numbers]
        self._below = np.array([f if f <= n else math.nextafter(f, -math.inf) for n, f in near])
        self._above = np.array([f if f >= n else math.nextafter(f, math.inf) for n, f in near])
        self._rough = [(f - (room := abs(f) * 2.0**-20 + 1e-40), f + room) for _, f in near]
        self.count = 2 * len(near) + 1

    @classmethod
    def of(cls, rule: Rule, formulas: Iterable[Term]) -> Regions | None:
        """None if the variable does not only occur in comparisons, or is not a single number."""
        if not isinstance(rule, Fields) or rule.take or len(rule.paths) > 1:
            return None
        wire = rule.wire(0)
        if not isinstance(rule.variable.sort, RealSort) or not (
            wire is None or (isinstance(wire, Scalar) and wire.name in FLOATS)
        ):
            return None
        found = {number for formula in formulas for number in _compared(formula, rule.variable)}
        try:
            numbers = [number for number in found if number is not None]
            return cls(numbers, "" if wire is None else str(wire)) if len(numbers) == len(found) else None
        except OverflowError:
            return None

    def read(self, array: Array) -> tuple[Floats, bool]:
        """Numbers as the field's type holds them, and whether they are rough: without a type, the digits are exact."""
        return array.astype(self._wire or np.float64).astype(np.float64), not self._wire

    def place(self, value: Fraction) -> int:
        return bisect_left(self._numbers, value) + bisect_right(self._numbers, value)

    def places(self, numbers: Floats) -> Ints:
        if len(self._below) > 8:
            return np.searchsorted(self._below, numbers, "left") + np.searchsorted(self._above, numbers, "right")
        found = np.zeros(len(numbers), np.int64)
        for below, above in zip(self._below, self._above, strict=True):
            found += numbers > below
            found += numbers >= above
        return found

    def unsure(self, numbers: Floats) -> Flags:
        """Which of these may have been in another region before they were rounded to doubles or singles."""
        odd = ~(np.abs(numbers) < LARGEST_SINGLE / 2)
        for low, high in self._rough:
            odd |= (low <= numbers) & (numbers <= high)
        return odd


def _compared(term: Term, variable: Variable) -> Iterator[Fraction | None]:
    """The numbers that the variable is compared with; None if it occurs in another way."""
    match term:
        case Variable():
            if term.qualified == variable.qualified:
                yield None
        case Compare(left=left, right=right) if _is(left, variable) or _is(right, variable):
            yield _number_of(right if _is(left, variable) else left)
        case In(item=item, collection=SetTerm(items=items)) if _is(item, variable):
            yield from map(_number_of, items)
        case In(item=item, collection=SequenceRange(low=low, high=high)) if _is(item, variable):
            yield from (_number_of(low), _number_of(high))
        case _:  # no comparison itself
            for child in term.children:
                yield from _compared(child, variable)


def _number_of(term: Term) -> Fraction | None:
    """The value of a term without variables; None if it is not a number."""
    try:
        value = evaluate(term, {})
    except NotEvaluable:
        return None
    return Fraction(value) if isinstance(value, int | Fraction) and not isinstance(value, bool) else None


def _is(term: Term, variable: Variable) -> bool:
    return isinstance(term, Variable) and term.qualified == variable.qualified
