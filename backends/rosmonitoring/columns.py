"""A trace judged by columns: events at which every clause certainly holds are counted, the engine judges all others.

The engine (`engine`) is exact and handles one event at a time. Here a batch of events is sorted by topic, and each
variable of each monitor becomes an array of codes: equal codes mean equal truth of every clause. A clause is evaluated
once for each combination of codes. If it holds, the event only updates the counters. Any other event, and one with an
irregular time, number or key, goes to the engine, which is first brought up to date. So the engine finds every
violation, and the counts of a run are the same as if the engine had judged all of it.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from avow.evaluation.evaluate import NotEvaluable
from avow.ros.bags import ENVELOPE, GONE, LIVE, LOST, PUBLISHER, Event

from .answers import sure
from .batch import NONE, UNKNOWN, UNREADABLE, Batch, Column, Flags, Floats, Ints, combinations, of_events
from .engine import Monitor
from .options import same_topic
from .pace import SEQUENCE, sequence
from .paired import Paired
from .pairing import ticks_at, time_of
from .rules import Parameter, Previous, heard_through
from .traces import Services, chunks, parsed, unread
from .tuning import REMEMBERED, TOPICS_KEPT
from .watched import Violation, Watched

Found = Iterator[tuple[int, list[Violation]]]
"""Lines, and the violations found there."""


@dataclass(frozen=True, slots=True)
class _Plan:
    """The effect of one topic's messages on one monitor, if only their values matter."""

    names: tuple[str, ...]
    """The variables that the topic carries."""
    due: tuple[Watched, ...]
    """The clauses that are judged by the latest values."""
    asked: tuple[Watched, ...]
    """The clauses whose answers wait for the inputs that they answered."""


@dataclass(slots=True)
class _Judged:
    """One clause at the rows of one topic."""

    met: Ints
    """Which of its conditions are met at each row."""
    ages: dict[str, Floats] = field(default_factory=dict)
    """The age of each input, in seconds; -1 if it has not come."""


class Watch:
    """One monitor and the columns of its variables."""

    def __init__(self, monitor: Monitor) -> None:
        self.monitor = monitor
        self._rules = rules = monitor.setup.rules
        formulas = [clause.formula for clause in monitor.setup.node.clauses]
        sources = {rule.source for rule in rules.values() if isinstance(rule, Previous)}
        self._columns: dict[str, Column] = {}
        for name, rule in monitor.setup.carried.items():
            # a previous value is the source's value: both share a column, and the source's clauses alone set no regions
            self._columns[name] = Column(rule, monitor.reader_of(name), () if name in sources else formulas)
            if name in sources:
                self._columns[name].regions = None
                self._columns[name].clear()
        self._plans: dict[str, _Plan | None] = {}
        self._truths: dict[int, dict[tuple[int, ...], tuple[bool, int, bool]]] = {}
        self._now: dict[str, int] = {}
        """The code of each variable before the batch."""
        self._known: dict[str, tuple[Ints, Ints]] = {}
        """The rows of each variable in the batch, and its codes there."""
        self._judged: dict[tuple[str, int], _Judged] = {}
        self.answers: Paired | None = None
        """The answers of the batch, if they are paired with their inputs."""
        self.gap = False
        """Whether a message of the batch does not have the number after that of its predecessor."""
        if monitor.pairing is not None:
            monitor.pairing.readers = {name: monitor.reader_of(name) for name in self._columns}
        self._clear()

    def _clear(self) -> None:
        for column in self._columns.values():
            column.clear()
        self._truths.clear()

    def column(self, name: str) -> Column | None:
        return self._columns.get(heard_through(self._rules[name]))

    def topic(self, name: str) -> str:
        """The topic that carries a variable, without its leading slash."""
        return same_topic(self.monitor.setup.carried[name].topic)

    def known(self, name: str) -> tuple[Ints, Ints]:
        """The rows of a variable's messages in the batch, and its codes there."""
        return self._known.get(name, (NONE, NONE))

    def plan(self, topic: str) -> _Plan | None:
        if topic not in self._plans:
            self._plans[topic] = self._planned(topic)
        return self._plans[topic]

    def _planned(self, topic: str) -> _Plan | None:
        """None if more than the latest values matters: then the engine judges all messages of the topic."""
        monitor, names = self.monitor, self.monitor.carried(topic)
        setup, answers = monitor.setup, None if monitor.pairing is None else monitor.pairing.answers
        if not names or not monitor.by_values or not (setup.shared.keys() | setup.rates.keys()).isdisjoint(names):
            return None
        if any(setup.carried[name].frame or isinstance(setup.carried[name], Parameter) for name in names):
            return None
        found = monitor.about(names)
        if any(watched.held or not watched.outputs <= set(names) for watched in found):
            return None
        if answers is not None and (answers.others or {*answers.input[:1], *answers.output[:1]} & {*ENVELOPE}):
            return None
        return _Plan(names, tuple(w for w in found if not w.paired), tuple(w for w in found if w.paired))

    # -- one batch ---------------------------------------------------------------------------------------------------

    def irregular(self, batch: Batch) -> Flags:
        """The rows that the engine has to judge."""
        monitor, wrong = self.monitor, np.zeros(len(batch.times), np.bool_)
        self._begin()
        plans: list[tuple[str, Ints, _Plan]] = []
        for topic, rows in batch.rows.items():
            if not monitor.listens(topic):
                continue
            plan = self.plan(topic)
            if plan is None:
                wrong[rows] = True
                self._known |= {name: (rows, np.full(len(rows), UNREADABLE)) for name in monitor.carried(topic)}
                continue
            plans.append((topic, rows, plan))
            wrong[rows] |= self._disordered(topic, batch)
            for name in plan.names:
                codes, fresh = self._columns[name].codes(batch, topic, self._now[name])
                self._known[name] = rows, codes
                wrong[rows] |= codes < 0 if fresh is None else fresh | (codes < 0)
        for topic, rows, plan in plans:
            for watched in plan.due:
                holds, met, _ = self.holds(watched, rows, {})
                wrong[rows] |= ~holds
                ages = {name: self._ages(name, rows, batch.times) for name in watched.inputs}
                self._judged[topic, id(watched)] = _Judged(met, ages)
        return wrong

    def pair(self, batch: Batch, wrong: Flags) -> None:
        """Find the answers that certainly held; the rows of the others are added to `wrong`."""
        pairing = self.monitor.pairing
        self.answers = None if pairing is None else Paired(self, pairing, batch, wrong)

    def _begin(self) -> None:
        monitor = self.monitor
        self.gap = False
        if any(len(column.values) > REMEMBERED for column in self._columns.values()):
            self._clear()
        self._known.clear()
        self._judged.clear()
        self._now = {}
        for name in self._rules:
            if (column := self.column(name)) is not None:
                value = None if name in monitor.supposed else monitor.values.get(name)
                self._now[name] = UNKNOWN if value is None else column.code_of(value)

    def _disordered(self, topic: str, batch: Batch) -> Flags:
        """The messages with the time of their predecessor, or without the next number; and the very first."""
        passage = self.monitor.timing.passages.get(topic)
        before = math.nan if passage is None or passage.latest is None else float(passage.latest)
        times = batch.times[batch.rows[topic]]
        wrong: Flags = times == np.concatenate(([before], times[:-1]))
        wrong[0] |= passage is None
        last = passage.last[0] if passage is not None and passage.last else None
        array = batch.array(topic, SEQUENCE)
        if array is not None:
            numbers = np.concatenate(([-2 if last is None else last], array))
            odd: Flags = numbers[1:] != numbers[:-1] + 1
            wrong |= odd
            self.gap = self.gap or bool(odd[last is None :].any())
        elif last is not None or batch.numbered(topic):
            for k, number in enumerate(map(sequence, batch.of(batch.rows[topic]))):
                if number is not None if last is None else number != last + 1:
                    wrong[k] = True
                    self.gap = self.gap or last is not None
                last = last if number is None else number
        return wrong

    def codes(self, name: str, rows: Ints) -> Ints:
        """The codes of the latest values of a variable; for the step before, of the values before these rows."""
        rule = self._rules[name]
        own, codes = self._known.get(heard_through(rule), (NONE, NONE))
        if own is rows and not isinstance(rule, Previous):
            return codes
        side = "left" if isinstance(rule, Previous) else "right"
        return np.concatenate(([self._now[name]], codes))[np.searchsorted(own, rows, side)]  # type: ignore[call-overload]

    def holds(self, watched: Watched, rows: Ints, others: Mapping[str, Ints]) -> tuple[Flags, Ints, Flags]:
        """The rows at which a clause certainly holds, which of its conditions are met at each, and the rows at which it
        certainly does not hold. `others`: codes that are not of the latest values."""
        names = [name for name in watched.names if name in self._now]
        columns = [others[name] if name in others else self.codes(name, rows) for name in names]
        known: Flags = np.logical_and.reduce([codes >= 0 for codes in columns])
        every = bool(known.all())
        if not known.any():
            return known, known.astype(np.int64), known
        if not every:
            columns = [codes[known] for codes in columns]
        first, which = combinations(columns, [len(self._column_of(name).values) for name in names])
        truths = self._truths.setdefault(id(watched), {})
        verdicts = []
        for key in zip(*(codes[first].tolist() for codes in columns), strict=True):
            if key not in truths:
                truths[key] = self._judge(watched, dict(zip(names, key, strict=True)))
            verdicts.append(truths[key])
        held, conditions, failed = zip(*verdicts, strict=True)
        holds, fails = (np.array(column, np.bool_)[which] for column in (held, failed))
        met = np.array(conditions, np.int64)[which]
        return (holds, met, fails) if every else (_spread(known, holds), _spread(known, met), _spread(known, fails))

    def _column_of(self, name: str) -> Column:
        return self._columns[heard_through(self._rules[name])]

    def _judge(self, watched: Watched, codes: Mapping[str, int]) -> tuple[bool, int, bool]:
        """Whether a clause holds for the values, which of its conditions are met (also if that cannot be evaluated),
        and whether the clause fails."""
        values: dict[str, Any] = {n: self.monitor.values[n] for n in watched.names if n not in codes}
        values |= {name: self._column_of(name).values[code] for name, code in codes.items()}
        try:
            holds = bool(watched.holds(values))
        except NotEvaluable:
            return False, 0, False
        return holds, watched.met(values, unknown=True), not holds

    def _ages(self, name: str, rows: Ints, times: Floats) -> Floats:
        own = self._known.get(name, (NONE, NONE))[0]
        heard = np.concatenate(([self.monitor.timing.heard.get(name, math.inf)], times[own]))
        ages: Floats = times[rows] - heard[np.searchsorted(own, rows, "right")]
        return np.where(ages == -math.inf, -1.0, np.maximum(ages, 0.0))

    def count(self, batch: Batch, start: int, end: int) -> None:
        """Take over the events from `start` to `end`, which need not be judged."""
        monitor = self.monitor
        monitor.events += end - start
        last: list[int] = []
        for topic, rows in batch.rows.items():
            low, high = np.searchsorted(rows, (start, end)).tolist()
            if low == high:
                continue
            if len(monitor.heard) < TOPICS_KEPT:
                monitor.heard.add(topic)
            plan = self.plan(topic) if monitor.listens(topic) else None
            if plan is None:
                continue
            monitor.relevant += high - low
            monitor.numbers[topic] = monitor.numbers.get(topic, 0) + high - low
            last.append(int(rows[high - 1]))
            for watched in plan.asked:
                watched.tally.published += high - low
            for watched in plan.due:
                tally, judged = watched.tally, self._judged[topic, id(watched)]
                tally.published += high - low
                tally.judged += high - low
                tally.met |= int(np.bitwise_or.reduce(judged.met[low:high]))
                for name, ages in judged.ages.items():
                    tally.aging(name, float(ages[low:high].max()))
        for row in sorted(last):
            monitor.caught_up(batch.event(row), batch.lines[row])
        if last:
            monitor.settle_previous()
        if self.answers is not None:
            self.answers.note(start, end)

    def settle(self, batch: Batch, row: int) -> list[Violation]:
        """Judge the answers that no longer have to wait at a row."""
        found: list[Violation] = []
        if self.monitor.pairing is not None and self.monitor.pairing.waiting:
            self.monitor.settle(ticks_at(batch.event(row)), found)
        return sure(self.monitor, found)


def _spread(where: Flags, flags: npt.NDArray[Any]) -> npt.NDArray[Any]:
    found = np.zeros(len(where), flags.dtype)
    found[where] = flags
    return found


class Columns:
    """Feed it a trace. `explain` receives the violations that the monitors find at one event, and may explain them;
    `heard` receives topics, and the number of their events."""

    def __init__(
        self,
        monitors: Sequence[Monitor],
        explain: Callable[[list[Violation]], Iterable[Violation]] = lambda found: found,
        heard: Callable[[str, int], None] = lambda topic, count: None,
    ) -> None:
        self._explain, self._heard = explain, heard
        self._watches = [Watch(monitor) for monitor in monitors]
        self._newest = -math.inf
        self._latest: object = None
        """The time of the latest event, as it is written."""
        self._line = 0
        self._services = Services()
        self._by_arrival = any(monitor.by_arrival for monitor in monitors)
        self._one_by_one = False
        """The engine judges every event: on a running graph, answers wait for later messages."""

    def run(self, path: Path) -> Found:
        """Judge the lines of a file, as `lines` does. Raises Rejected."""
        try:
            with path.open("rb") as stream:
                yield from self.lines(stream.read1, str(path))
        except OSError as error:
            raise unread(path, error) from None

    def lines(self, read: Callable[[int], bytes], name: str) -> Found:
        """Judge the lines of a stream, which `read` returns as they come (empty at its end): the line, and the
        violations found there. Lines without violations give no result, except one in each megabyte, so that the caller
        can check the clock. Raises Rejected, OSError."""
        for chunk in chunks(read, name):
            events, lines, count, wrong = parsed(chunk, name, self._line, self._services)
            marks = (LOST, GONE, PUBLISHER, *([LIVE] if self._by_arrival else []))
            self._one_by_one = self._one_by_one or any(mark.encode() in chunk for mark in marks)
            yield from self._judged(events, lines)
            self._line += count
            if wrong is not None:
                raise wrong
            yield self._line, []

    def batches(self, batches: Iterable[Batch]) -> Found:
        """Judge the messages of a bag, or arrays. Raises Rejected."""
        for batch in batches:
            yield from self._batch(batch)
            yield batch.lines[-1], []

    def _judged(self, events: Sequence[Event], lines: Sequence[int]) -> Found:
        if not self._one_by_one and len(events) >= FEW:
            yield from self._batch(of_events(events, lines))
            return
        for event, line in zip(events, lines, strict=True):
            self._newest = max(self._newest, float(time_of(event)))
            self._latest = event["time"]
            if found := self._engine(event, line):
                yield line, list(self._explain(found))

    def _batch(self, batch: Batch) -> Found:
        newest, wrong = self._times(batch)
        for watch in self._watches:
            wrong |= watch.irregular(batch)
        for watch in self._watches:
            watch.pair(batch, wrong)
        paired = [watch.answers for watch in self._watches if watch.answers is not None]
        while any(answers.close() for answers in paired):
            pass
        for answers in paired:
            answers.settle()
        stops = np.flatnonzero(wrong).tolist()
        start, count = 0, len(batch.times)
        while start < count:
            stop = bisect_left(stops, start)
            end = stops[stop] if stop < len(stops) else count
            end = min(end, max(start, int(np.searchsorted(newest, self._horizon(batch, start)))))
            due = min((answers.due(start) for answers in paired), default=end)
            if due < end:
                self._count(batch, start, due)
                found = [v for watch in self._watches for v in watch.settle(batch, due)]
                start = due
            else:
                self._count(batch, start, end)
                found = self._engine(batch.event(end), batch.lines[end]) if end < count else []
                start, due = end + 1, end
            if found:
                yield batch.lines[due], list(self._explain(found))

    def _times(self, batch: Batch) -> tuple[Floats, Flags]:
        """The latest time so far, at each event, and the events whose time the engine has to judge: it goes back, or it
        is the same as before but written differently; and the very first."""
        times, raws = batch.times, batch.raws
        newest = np.maximum.accumulate(np.concatenate(([self._newest], times)))
        wrong: Flags = times < newest[:-1]
        batch.backwards = bool(wrong.any())
        wrong[0] |= self._latest is None
        for k in np.flatnonzero(times == newest[:-1]).tolist():
            wrong[k] = wrong[k] or raws[k] != (raws[k - 1] if k else self._latest)
        self._newest, self._latest = float(newest[-1]), raws[-1]
        return newest[1:], wrong

    def _horizon(self, batch: Batch, start: int) -> float:
        """No deadline passes before this time, counting from the messages that come first."""
        found = math.inf
        for watch in self._watches:
            found = min(found, watch.monitor.deadline)
            for name, limit in watch.monitor.setup.fresh.items():
                rows = batch.rows.get(same_topic(watch.monitor.setup.carried[name].topic), NONE)
                first = int(np.searchsorted(rows, start))
                if first < len(rows):
                    found = min(found, (float(batch.times[rows[first]]) + float(limit)) * (1 - 2**-50))
        return found

    def _engine(self, event: Event, line: int) -> list[Violation]:
        topic = event.get("topic")
        self._heard(topic if isinstance(topic, str) else "", 1)
        return [violation for watch in self._watches for violation in watch.monitor.step(event, line)]

    def _count(self, batch: Batch, start: int, end: int) -> None:
        if start == end:
            return
        for topic, rows in batch.written.items():
            low, high = np.searchsorted(rows, (start, end)).tolist()
            if low < high:
                self._heard(topic, high - low)
        for watch in self._watches:
            watch.count(batch, start, end)


FEW = 16
"""Fewer events than this are judged one by one: arrays of them cost more than they save."""
