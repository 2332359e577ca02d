"""Answers and the inputs that they answered, in a batch of events: those that certainly held are only counted.

An answer waits for the messages with its key, or (by latency) for those of its time. If all of these are in one batch,
they are found with arrays. `pairing` judges the others, and receives the counted messages that it may still need.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import TYPE_CHECKING

import numpy as np

from .answers import asks, speaks
from .batch import NONE, UNREADABLE, Batch, Flags, Floats, Ints
from .pairing import NUMBER, InputMessage, Pairing, ticks_at
from .rules import FieldPath
from .tuning import COMBINATIONS, KEYS_KEPT, TICKS
from .watched import DEPENDS, Watched

if TYPE_CHECKING:
    from .columns import Watch

_NANO = TICKS // 10**9
_NEVER = sys.maxsize


@dataclass(slots=True)
class _Input:
    """The messages of one input: by latency, first those of earlier batches that may still be needed."""

    before: Sequence[InputMessage]
    rows: Ints
    """The rows in the batch; -1: of an earlier batch."""
    ids: Ints
    """The same number for the same key; by latency the times, in nanoseconds."""
    codes: Ints
    seconds: Floats
    used: Ints
    """For each message, the row at which the first answer is paired with it."""
    kept: dict[int, InputMessage] = field(default_factory=dict)


@dataclass(slots=True)
class _Asked:
    """A clause's answers on one topic that certainly held, or whose verdict certainly depends on what they answered."""

    watched: Watched
    rows: Ints
    held: Flags
    met: Ints
    ends: Ints
    """For each answer, the row at which all its inputs are known; by latency the time, in nanoseconds."""
    ranges: dict[str, tuple[Ints, Ints]]
    """For each input, the first and the last message that each answer may have answered."""

    def take(self, some: Flags) -> None:
        self.rows, self.ends = self.rows[some], self.ends[some]
        self.held, self.met = self.held[some], self.met[some]
        self.ranges = {name: (first[some], last[some]) for name, (first, last) in self.ranges.items()}


class Paired:
    """The answers to one monitor in one batch. `wrong`: the rows that the engine has to judge; more are added."""

    def __init__(self, watch: Watch, pairing: Pairing, batch: Batch, wrong: Flags) -> None:
        self._watch, self._pairing, self._batch, self._wrong = watch, pairing, batch, wrong
        self._topics = {topic: rows for topic, rows in batch.rows.items() if watch.monitor.carried(topic)}
        self._listened = np.sort(np.concatenate([NONE, *self._topics.values()]))
        self._by = pairing.answers.by
        self._latency, self._jitter = int(-(-pairing.latency // _NANO)), int(pairing.jitter // _NANO)
        self._times = _nanoseconds(batch) if self._by == "latency" and not batch.backwards else NONE
        self._numbers: dict[object, int] = {}
        self._groups: dict[tuple[str, FieldPath], tuple[Ints, Ints]] = {}
        """The rows and ids of messages that have keys."""
        self._inputs: dict[str, _Input] = {}
        self._asked: list[_Asked] = []
        self._odd = np.zeros(0, np.bool_)
        """For each id, whether the engine has to judge the messages with it."""
        if self._possible():
            self._find()
        else:
            wrong[self._listened] = True

    def _possible(self) -> bool:
        if self._by != "order":
            return self._by != "latency" or len(self._times) > 0
        lost = self._watch.monitor.unnumbered or self._watch.gap
        return not lost and all(self._watch.plan(topic) is not None for topic in self._topics)

    def _find(self) -> None:
        monitor, pairing = self._watch.monitor, self._pairing
        for name in monitor.paired:
            known = pairing.seen.get(name)
            rows, codes = self._watch.known(name)
            # `place` 0: an initial value, whose answers the engine judges
            kept = [message for message in known.messages if message.place] if known and self._times.size else []
            ids = self._ids(self._watch.topic(name), pairing.answers.input) if len(rows) else NONE
            self._inputs[name] = _Input(
                kept,
                np.concatenate((np.full(len(kept), -1), rows)),
                np.concatenate((np.array([int(message.time // _NANO) for message in kept], np.int64), ids)),
                np.concatenate((np.array([self._code(name, message) for message in kept], np.int64), codes)),
                np.concatenate(([message.seconds for message in kept], self._batch.times[rows])),
                np.full(len(kept) + len(rows), _NEVER),
            )
        asking: list[tuple[str, Watched, Ints]] = []
        for topic in self._topics:
            for watched in monitor.about(monitor.carried(topic)):
                if watched.paired:
                    asking.append((topic, watched, self._ids(topic, pairing.answers.output)))
        if self._by != "latency":
            before: list[object] = [key for seen in pairing.seen.values() for key in seen.by_key]
            before += [None, *(asked.key for asked in pairing.waiting.values())]
            self._odd = np.zeros(len(self._numbers), np.bool_)
            self._odd[[self._numbers[key] for key in before if key in self._numbers]] = True
            for one in self._inputs.values():
                self._odd |= np.bincount(one.ids, minlength=len(self._odd)) > 1
            self.close()
        for topic, watched, ids in asking:
            if self._watch.plan(topic) is not None:
                self._ask(watched, self._topics[topic], ids)

    def _code(self, name: str, message: InputMessage) -> int:
        value, column = self._pairing.value_of(name, message), self._watch.column(name)
        return UNREADABLE if value is None or column is None else column.code_of(value)

    def _ids(self, topic: str, path: FieldPath) -> Ints:
        """The ids by which a topic's messages are paired."""
        rows = self._topics[topic]
        if self._by == "latency":
            return self._times[rows]
        if (topic, path) not in self._groups:
            numbers, keys = self._numbers, self._keys(topic, path)
            ids = np.array([numbers.setdefault(key, len(numbers)) for key in keys], np.int64)
            self._groups[topic, path] = rows, ids
        return self._groups[topic, path][1]

    def _keys(self, topic: str, path: FieldPath) -> Iterable[object]:
        if path == (NUMBER,):
            first = self._watch.monitor.numbers.get(topic, 0) + 1
            return range(first, first + len(self._topics[topic]))
        second, rest = (self._batch.array(topic, (*path, part)) for part in ("sec", "nanosec"))
        if second is not None and rest is not None:
            return zip((second.astype(np.int64) * 10**9 + rest).tolist(), repeat("s"))
        array = self._batch.array(topic, path)
        if array is not None:
            found: list[object] = array.tolist()
            return found
        return [Pairing.key(event, path) for event in self._batch.of(self._topics[topic])]

    def _ask(self, watched: Watched, rows: Ints, ids: Ints) -> None:
        watch, monitor = self._watch, self._watch.monitor
        names = asks(monitor, watched)
        certain = ~self._wrong[rows]
        if any(name not in watched.paired and name not in self._pairing.seen for name in names):
            certain[:] = False
        for name in speaks(monitor, watched):
            if watch.column(name) is not None:
                certain &= watch.codes(name, rows) >= 0
        ranges = {name: self._match(self._inputs[name], ids) for name in names}
        latency = self._by == "latency"
        for name, (first, _) in ranges.items():
            certain &= first >= 0
            if not latency:  # the engine judges an input after its answer, by exact times
                own = self._pairing.answers
                ahead = 0.0 if name in own.looped else max(0.0, float(own.jitter) - 1e-6)
                late = self._inputs[name].seconds[first[certain]] - self._batch.times[rows[certain]]
                certain[certain] &= late <= ahead
        ends = ids + self._jitter if latency else rows
        if latency:
            certain &= ends < self._times[self._listened[-1]]
        asked = _Asked(watched, rows, certain, certain.astype(np.int64), ends, ranges)
        asked.take(certain)
        if not latency:
            for name, (first, _) in asked.ranges.items():
                asked.ends = np.maximum(asked.ends, self._inputs[name].rows[first])
        certain[certain] = self._judged(asked)
        self._wrong[rows[~certain]] = True
        self._asked.append(asked)

    def _match(self, one: _Input, ids: Ints) -> tuple[Ints, Ints]:
        """For each answer, the first and the last message of an input that it may have answered; -1: none is known."""
        if self._by == "latency":
            start = ids - self._latency - self._jitter
            return (
                np.searchsorted(one.ids, start, "right") - 1,
                np.searchsorted(one.ids, ids + self._jitter, "right") - 1,
            )
        places = np.full(len(self._numbers), -1)
        places[one.ids] = np.arange(len(one.ids))
        return places[ids], places[ids]

    def _judged(self, asked: _Asked) -> Flags:
        """Which answers hold whatever they answered, or only for some of it; without those that wait so long that
        messages are forgotten."""
        counts = {name: last - first + 1 for name, (first, last) in asked.ranges.items()}
        cases = np.ones(len(asked.rows), np.int64)
        for count in counts.values():
            cases *= np.minimum(count, COMBINATIONS + 1)
        certain = (cases >= 1) & (cases <= COMBINATIONS)
        if self._by != "latency":
            certain &= (asked.ends - asked.rows) * max(1, len(self._watch.monitor.tallies)) < KEYS_KEPT
            for name, (first, _) in asked.ranges.items():
                certain &= np.searchsorted(self._inputs[name].rows, asked.ends, "right") - 1 - first < KEYS_KEPT
        asked.held, asked.met = np.ones(len(asked.rows), np.bool_), np.full(len(asked.rows), -1)
        some_hold, some_fail = np.zeros(len(asked.rows), np.bool_), np.zeros(len(asked.rows), np.bool_)
        for number in range(int(cases[certain].max(initial=0))):
            some = np.flatnonzero(certain & (cases > number))
            left = np.full(len(some), number)
            picks: dict[str, Ints] = {}
            for name, (first, _) in asked.ranges.items():
                count = counts[name][some]
                picks[name] = self._inputs[name].codes[first[some] + left % count]
                left //= count
                certain[some] &= picks[name] >= 0  # including those that only assumptions speak of
            holds, met, fails = self._watch.holds(asked.watched, asked.rows[some], picks)
            asked.held[some] &= holds
            asked.met[some] &= met
            some_hold[some] |= holds
            some_fail[some] |= fails
        certain &= asked.held | (some_hold & some_fail)
        asked.take(certain)
        return certain

    def close(self) -> bool:
        """Mark all messages that share a key with one that the engine judges. Returns whether any was added."""
        before = np.count_nonzero(self._wrong)
        for rows, ids in self._groups.values():
            self._odd[ids[self._wrong[rows]]] = True
        for rows, ids in self._groups.values():
            self._wrong[rows] |= self._odd[ids]
        return bool(np.count_nonzero(self._wrong) > before)

    def settle(self) -> None:
        """No more rows are added to those that the engine judges."""
        for asked in self._asked:
            asked.take(~self._wrong[asked.rows])
            for name, (first, _) in asked.ranges.items():
                np.minimum.at(self._inputs[name].used, first, asked.ends)

    # -- what is counted -----------------------------------------------------------------------------------------------

    def due(self, start: int) -> int:
        """The row, from `start` on, at which an answer that waits for time to pass is judged."""
        if self._by != "latency" or not self._pairing.waiting or not len(self._times):
            return _NEVER
        passed = next(iter(self._pairing.waiting.values())).time + self._pairing.jitter
        later = np.searchsorted(self._times[self._listened], int(passed // _NANO), "right")
        place = max(int(later), int(np.searchsorted(self._listened, start)))
        return int(self._listened[place]) if place < len(self._listened) else _NEVER

    def note(self, start: int, end: int) -> None:
        """Count the rows from `start` to `end` without judging them."""
        for name, one in self._inputs.items():
            self._hear(name, one, start, end)
        for asked in self._asked:
            low, high = np.searchsorted(asked.rows, (start, end)).tolist()
            if low < high:
                self._count(asked, low, high)
        if self._by != "latency":
            self._watch.monitor.settle(0, [])  # those that waited while too many others came
        elif (place := int(np.searchsorted(self._listened, end))) and len(self._times):
            now = self._times[self._listened[place - 1]]
            for asked in self._asked:
                if passed := int(np.searchsorted(asked.ends, now)):
                    self._pairing.settled = max(self._pairing.settled or 0, int(asked.ends[passed - 1]) * _NANO)

    def _hear(self, name: str, one: _Input, start: int, end: int) -> None:
        pairing = self._pairing
        for k in np.flatnonzero((one.used >= start) & (one.used < end)).tolist():
            if k in one.kept:
                one.kept[k].used = True
        low, high = np.searchsorted(one.rows, (start, end)).tolist()
        if low == high:
            return
        since = one.ids[high - 1] - self._latency - 2 * self._jitter
        first = high - KEYS_KEPT if self._by != "latency" else int(np.searchsorted(one.ids, since, "right")) - 1
        first = low if self._by == "latency" and pairing.waiting else max(low, first)
        pairing.input(name)
        keys = [*self._numbers] if self._by != "latency" else []
        pairing.heard(name, [keys[k] for k in one.ids[low : first if keys else low].tolist()])
        for k in range(first, high):
            row = int(one.rows[k])
            event, key = self._batch.event(row), keys[one.ids[k]] if keys else None
            message = pairing.saw(name, ticks_at(event), float(one.seconds[k]), key, event, self._batch.lines[row])
            message.used = bool(one.used[k] < end) and self._by != "latency"
            one.kept[k] = message

    def _count(self, asked: _Asked, low: int, high: int) -> None:
        watched, batch, pairing = asked.watched, self._batch, self._pairing
        tally = watched.tally
        held = asked.held[low:high]
        tally.judged += int(np.count_nonzero(held))
        tally.met |= int(np.bitwise_or.reduce(asked.met[low:high][held]))
        if not held.all():
            tally.unsure(DEPENDS, len(held) - int(np.count_nonzero(held)))
        rows = asked.rows[low:high]
        for name in watched.paired:
            ages = batch.times[rows] - self._inputs[name].seconds[asked.ranges[name][0][low:high]]
            tally.aging(name, float(ages[held].max(initial=-1.0)))
        watched.asked = tuple(asked.ranges)
        pairing.asked += high - low
        if self._by != "latency":
            (name, (first, _)), keys = next(iter(asked.ranges.items())), [*self._numbers]
            pairing.replied(watched, [keys[k] for k in self._inputs[name].ids[first[low:high]].tolist()])
        for k in range(max(low, high - KEYS_KEPT), high) if watched.outputs else ():
            messages = {
                name: tuple(self._place(name, one) for one in range(int(first[k]), int(last[k]) + 1))
                for name, (first, last) in asked.ranges.items()
            }
            pairing.answer(batch.lines[int(asked.rows[k])], messages)

    def _place(self, name: str, k: int) -> int:
        one = self._inputs[name]
        return one.before[k].place if k < len(one.before) else self._batch.lines[int(one.rows[k])]


def _nanoseconds(batch: Batch) -> Ints:
    """Times in nanoseconds; none if one of them is not an integer number of nanoseconds."""
    if batch.nanoseconds is not None:
        return batch.nanoseconds
    found = [divmod(ticks_at({"time": raw}), _NANO) for raw in batch.raws]
    exact = all(not rest and time < 2**62 for time, rest in found)
    return np.array([int(time) for time, _ in found], np.int64) if exact else NONE
