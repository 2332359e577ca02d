"""A trace judged by columns: events at which every clause certainly holds are counted, the engine judges all others.

The engine (`engine`) is exact and looks at one event at a time. Here a batch of events is sorted by topic, and each
variable of each monitor becomes an array of codes: equal codes, equal truth of every clause. A clause is evaluated once
for each combination of codes. Where it holds, the event only moves the counters. Any other event, and one with an
irregular time, number or key, goes to the engine, which is first brought up to date. So the engine finds every
violation, and a run is summed up as if the engine had judged all of it.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from avow.base.diagnostics import Diagnostic, Rejected
from avow.evaluation.evaluate import NotEvaluable
from avow.formulas.values import Value
from avow.ros.bags import ENVELOPE, LIVE, Event

from .answers import asks, judges_answers_alone, speaks, sure
from .codes_of_values import NONE, UNKNOWN, UNREADABLE, Batch, Column, Flags, Floats, Ints
from .engine import Monitor
from .options import same_topic
from .pace import sequence
from .pairing import Asked, Pairing, ticks_at, time_of
from .rules import Previous, heard_through
from .traces import chunks, parsed
from .tuning import BATCH, REMEMBERED, TOPICS_KEPT
from .watched import Violation, Watched

Found = Iterator[tuple[int, list[Violation]]]
"""Lines, and what was found there."""


@dataclass(frozen=True, slots=True)
class _Plan:
    """What one topic's messages do to one monitor, where nothing but their values matters."""

    names: tuple[str, ...]
    """The variables that the topic carries."""
    due: tuple[Watched, ...]
    """The clauses that are judged by the latest values."""
    asked: tuple[Watched, ...]
    """Those whose answers wait for the inputs that they answered."""


@dataclass(slots=True)
class _Noted:
    """One topic's messages in a batch, for a monitor that pairs answers with their inputs."""

    keys: list[object]
    inputs: list[tuple[str, list[Value | Event | None], list[int]]]
    """Each input, its values and its codes."""
    asked: list[tuple[Watched, tuple[str, ...], tuple[str, ...], list[Any], list[Any]]]
    """Each clause, what its verdict depends on, the inputs that it is paired with, and the values and the codes."""
    counted: list[Watched]
    """The clauses about outputs alone whose answers count."""


@dataclass(slots=True)
class _Judged:
    """One clause at the rows of one topic."""

    met: Flags
    """Where the antecedent is met."""
    ages: dict[str, Floats] = field(default_factory=dict)
    """How old each input is; -1 where it has not come."""


class _Watch:
    """One monitor and the columns of its variables."""

    def __init__(self, monitor: Monitor) -> None:
        self.monitor = monitor
        self._rules = rules = monitor.setup.rules
        formulas = [clause.formula for clause in monitor.setup.node.clauses]
        sources = {rule.source for rule in rules.values() if isinstance(rule, Previous)}
        self._columns: dict[str, Column] = {}
        for name, rule in monitor.setup.carried.items():
            # the step before is the source's value: both have one column, and the source's clauses alone set no regions
            self._columns[name] = Column(rule, monitor.reader_of(name), () if name in sources else formulas)
            if name in sources:
                self._columns[name].bounds = None
                self._columns[name].clear()
        self._plans: dict[str, _Plan | None] = {}
        self._truths: dict[int, dict[tuple[int, ...], tuple[bool, bool]]] = {}
        self._now: dict[str, int] = {}
        """The code of each variable before the batch."""
        self._known: dict[str, tuple[Ints, Ints]] = {}
        """The rows of each variable in the batch, and its codes there."""
        self._judged: dict[tuple[str, int], _Judged] = {}
        self._clear()

    def _clear(self) -> None:
        for column in self._columns.values():
            column.clear()
        self._truths.clear()
        for watched in self.monitor.about(self.monitor.clauses):
            watched.alike.clear()
        if self.monitor.pairing is not None:
            self.monitor.pairing.begin({name: self.monitor.reader_of(name) for name in self._columns})

    def column(self, name: str) -> Column | None:
        return self._columns.get(heard_through(self._rules[name]))

    def plan(self, topic: str) -> _Plan | None:
        if topic not in self._plans:
            self._plans[topic] = self._planned(topic)
        return self._plans[topic]

    def _planned(self, topic: str) -> _Plan | None:
        """None where more than the latest values matters: then the engine judges all messages of the topic."""
        monitor, names = self.monitor, self.monitor.carried(topic)
        setup, answers = monitor.setup, None if monitor.pairing is None else monitor.pairing.answers
        if not names or not monitor.by_values or not (setup.shared.keys() | setup.rates.keys()).isdisjoint(names):
            return None
        found = monitor.about(names)
        if any(watched.held or not watched.outputs <= set(names) for watched in found):
            return None
        if answers is not None and {*answers.input[:1], *answers.output[:1]} & {*ENVELOPE}:
            return None
        return _Plan(names, tuple(w for w in found if not w.paired), tuple(w for w in found if w.paired))

    # -- one batch ---------------------------------------------------------------------------------------------------

    def irregular(self, batch: Batch) -> Flags:
        """The rows that the engine has to judge."""
        monitor, wrong = self.monitor, np.zeros(len(batch.events), np.bool_)
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
            events = [batch.events[row] for row in rows.tolist()]
            wrong[rows] |= self._disordered(topic, events, batch.times[rows])
            for name in plan.names:
                codes, fresh = self._columns[name].codes(events, self._now[name])
                self._known[name] = rows, codes
                wrong[rows] |= codes < 0 if fresh is None else fresh | (codes < 0)
        for topic, rows, plan in plans:
            for watched in plan.due:
                holds, met = self._holds(watched, rows)
                wrong[rows] |= ~holds
                ages = {name: self._ages(name, rows, batch.times) for name in watched.inputs}
                self._judged[topic, id(watched)] = _Judged(met, ages)
        return wrong

    def _begin(self) -> None:
        monitor = self.monitor
        if any(len(column.values) > REMEMBERED for column in self._columns.values()):
            self._clear()
        self._known.clear()
        self._judged.clear()
        self._now = {}
        for name in self._rules:
            if (column := self.column(name)) is not None:
                value = None if name in monitor.supposed else monitor.values.get(name)
                self._now[name] = UNKNOWN if value is None else column.code_of(value)

    def _disordered(self, topic: str, events: Sequence[Event], times: Floats) -> Flags:
        """Messages with the time of the one before, and with numbers that are not the next; the very first."""
        passage = self.monitor.timing.passages.get(topic)
        before = math.nan if passage is None or passage.latest is None else float(passage.latest)
        wrong: Flags = times == np.concatenate(([before], times[:-1]))
        wrong[0] |= passage is None
        last = passage.last[0] if passage is not None and passage.last else None
        numbers = [sequence(event) if "header" in event else None for event in events]
        if last is not None or any(number is not None for number in numbers):
            for k, number in enumerate(numbers):
                wrong[k] |= number is not None if last is None else number != last + 1
                last = last if number is None else number
        return wrong

    def codes(self, name: str, rows: Ints) -> Ints:
        """The codes of the latest values of a variable; of the step before, of the values before these rows."""
        rule = self._rules[name]
        own, codes = self._known.get(heard_through(rule), (NONE, NONE))
        if own is rows and not isinstance(rule, Previous):
            return codes
        side = "left" if isinstance(rule, Previous) else "right"
        return np.concatenate(([self._now[name]], codes))[np.searchsorted(own, rows, side)]  # type: ignore[call-overload]

    def _holds(self, watched: Watched, rows: Ints) -> tuple[Flags, Flags]:
        """At which rows a clause certainly holds, and where its antecedent is met."""
        names = [name for name in watched.names if name in self._now]
        columns = [self.codes(name, rows) for name in names]
        holds = np.logical_and.reduce([codes >= 0 for codes in columns])
        met = np.zeros(len(rows), np.bool_)
        known = np.flatnonzero(holds)
        if not len(known):
            return holds, met
        columns = [codes[known] for codes in columns]
        first, which = _combinations(columns, [len(self._column_of(name).values) for name in names])
        truths = self._truths.setdefault(id(watched), {})
        verdicts = []
        for key in zip(*(codes[first].tolist() for codes in columns), strict=True):
            if key not in truths:
                truths[key] = self._judge(watched, dict(zip(names, key, strict=True)))
            verdicts.append(truths[key])
        table = np.array(verdicts, np.bool_)[which]
        holds[known], met[known] = table[:, 0], table[:, 1]
        return holds, met

    def _column_of(self, name: str) -> Column:
        column = self.column(name)
        assert column is not None
        return column

    def _judge(self, watched: Watched, codes: Mapping[str, int]) -> tuple[bool, bool]:
        """Whether a clause holds of values, and whether its antecedent is met (where nobody can tell, it is)."""
        values: dict[str, Any] = {n: self.monitor.values[n] for n in watched.names if n not in codes}
        values |= {name: self._column_of(name).values[code] for name, code in codes.items()}
        try:
            holds = bool(watched.holds(values))
        except NotEvaluable:
            return False, False
        try:
            return holds, watched.trigger is None or bool(watched.trigger(values))
        except NotEvaluable:
            return holds, True

    def _ages(self, name: str, rows: Ints, times: Floats) -> Floats:
        own = self._known.get(name, (NONE, NONE))[0]
        heard = np.concatenate(([self.monitor.timing.heard.get(name, math.inf)], times[own]))
        ages: Floats = times[rows] - heard[np.searchsorted(own, rows, "right")]
        return np.where(ages == -math.inf, -1.0, np.maximum(ages, 0.0))

    def count(self, batch: Batch, start: int, end: int) -> None:
        """Take over some events that need not be judged."""
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
            last.append(int(rows[high - 1]))
            for watched in plan.asked:
                watched.tally.published += high - low
            for watched in plan.due:
                tally, judged = watched.tally, self._judged[topic, id(watched)]
                tally.published += high - low
                tally.judged += high - low
                tally.triggered = tally.triggered or bool(judged.met[low:high].any())
                for name, ages in judged.ages.items():
                    tally.aging(name, float(ages[low:high].max()))
        for row in sorted(last):
            monitor.caught_up(batch.events[row], batch.lines[row])
        if last:
            monitor.settle_previous()

    # -- answers that are paired with their inputs -------------------------------------------------------------------

    def noted(self, batch: Batch, wrong: Flags) -> Iterator[tuple[int, _Watch, _Noted, int]]:
        """What has to be noted of each row of a paired monitor; `wrong` gets those of which the engine has to note."""
        monitor, pairing = self.monitor, self.monitor.pairing
        for topic, rows in batch.rows.items() if pairing is not None else ():
            plan = self.plan(topic) if monitor.listens(topic) else None
            if plan is None:
                continue
            assert pairing is not None
            inputs = [name for name in plan.names if name in monitor.paired]
            events = [batch.events[row] for row in rows.tolist()]
            path = pairing.answers.input if inputs else pairing.answers.output if plan.asked else ()
            keys = [Pairing.key(event, path) for event in events]
            if path:
                wrong[rows] |= np.array([key is None for key in keys])
            if inputs and plan.asked and pairing.answers.input != pairing.answers.output:
                wrong[rows] = True
            noted = _Noted(keys, [], [], [w for w in plan.due if judges_answers_alone(monitor, w)])
            for name in inputs:
                noted.inputs.append((name, self._values(name, rows, batch), self.codes(name, rows).tolist()))
            for watched in plan.asked:
                own, paired = speaks(monitor, watched), asks(monitor, watched)
                if any(name not in watched.paired and name not in pairing.seen for name in paired):
                    wrong[rows] = True
                for name in own:
                    if name in self._now:
                        wrong[rows] |= self.codes(name, rows) < 0
                values = list(zip(*(self._values(name, rows, batch) for name in own), strict=True))
                spoken = [name for name in own if name in watched.names and name in self._now]
                tokens = list(zip(*(self.codes(name, rows).tolist() for name in spoken), strict=True))
                nothing: list[Any] = [()] * len(rows)
                noted.asked.append((watched, own, paired, values or nothing, tokens or nothing))
            for k, row in enumerate(rows.tolist()):
                yield row, self, noted, k

    def _values(self, name: str, rows: Ints, batch: Batch) -> list[Value | Event | None]:
        """A variable's values: where only the region of a number is known, the message that has it."""
        column = self.column(name)
        if column is None:
            return [self.monitor.values.get(name)] * len(rows)
        if column.bounds is None:
            return [None if code < 0 else column.values[code] for code in self.codes(name, rows).tolist()]
        own = self._known.get(name, (NONE, NONE))[0]
        before = self.monitor.values.get(name)
        places, sources = np.searchsorted(own, rows, "right").tolist(), own.tolist()
        return [batch.events[sources[place - 1]] if place else before for place in places]

    def note(self, batch: Batch, row: int, index: int, noted: _Noted, k: int) -> list[Violation]:
        """Note a message as an input, as answers; what is found in answers whose inputs are now known."""
        pairing, event, line = self.monitor.pairing, batch.events[row], batch.lines[row]
        assert pairing is not None
        time, seconds, key = ticks_at(event), float(batch.times[row]), noted.keys[k]
        found: list[Violation] = []
        if pairing.waiting:
            self.monitor.settle(time, found)
        for name, values, codes in noted.inputs:
            pairing.saw(name, time, seconds, key, values[k], line, codes[k])
        for watched, own, inputs, known, tokens in noted.asked:
            places = (line,) if watched.outputs else ()
            asked = Asked(watched, event, index, own, known[k], inputs, time, seconds, key, None, places, tokens[k])
            pairing.ask(asked)
        for watched in noted.counted:
            pairing.count(watched, time)
        return sure(self.monitor, found)


def _combinations(columns: Sequence[Ints], widths: Sequence[int]) -> tuple[Ints, Ints]:
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


class Columns:
    """Feed it a trace. `told` is given what the monitors find at one event, and may explain it; `heard` is told of
    topics, and how many events of them there were."""

    def __init__(
        self,
        monitors: Sequence[Monitor],
        told: Callable[[list[Violation]], Iterable[Violation]] = lambda found: found,
        heard: Callable[[str, int], None] = lambda topic, count: None,
    ) -> None:
        self._told, self._heard = told, heard
        self._watches = [_Watch(monitor) for monitor in monitors]
        self._newest = -math.inf
        self._latest: object = None
        """The time of the latest event, as it is written."""
        self._line = 0
        self._by_arrival = any(monitor.by_arrival for monitor in monitors)
        self._one_by_one = False
        """The engine judges all: on a running graph, answers wait for what is heard after them."""

    def run(self, path: Path) -> Found:
        """Judge the lines of a file, as `lines` does. Raises Rejected."""
        try:
            with path.open("rb") as stream:
                yield from self.lines(stream.read1, str(path))
        except OSError as error:
            raise Rejected(Diagnostic("MON201", f"cannot read {path}: {error.strerror or error}")) from None

    def lines(self, read: Callable[[int], bytes], name: str) -> Found:
        """Judge the lines of a stream, which `read` gives as they come (none at its end): the line, and what was found
        there; nothing of lines where all is well, but once in each megabyte (so that whoever waits can look at the
        clock). Raises Rejected, OSError."""
        for chunk in chunks(read, name):
            events, lines, count, wrong = parsed(chunk, name, self._line)
            self._one_by_one = self._one_by_one or (self._by_arrival and LIVE.encode() in chunk)
            yield from self._judged(events, lines)
            self._line += count
            if wrong is not None:
                raise wrong
            yield self._line, []

    def events(self, events: Iterable[tuple[Event, int]]) -> Found:
        """Judge the messages of a bag, each with its size in bytes. Raises Rejected."""
        pending = iter(events)
        while several := [event for event, _ in itertools.islice(pending, BATCH)]:
            yield from self._judged(several, range(self._line + 1, self._line + len(several) + 1))
            self._line += len(several)
            yield self._line, []

    def _judged(self, events: Sequence[Event], lines: Sequence[int]) -> Found:
        if self._one_by_one or len(events) < FEW:
            for event, line in zip(events, lines, strict=True):
                self._newest = max(self._newest, float(time_of(event)))
                self._latest = event["time"]
                if found := self._engine(event, line):
                    yield line, found
            return
        batch, wrong = self._batch(events, lines)
        for watch in self._watches:
            wrong |= watch.irregular(batch)
        notes = sorted((note for watch in self._watches for note in watch.noted(batch, wrong)), key=_row)
        stops = np.flatnonzero(wrong).tolist()
        start = 0
        while start < len(events):
            stop = bisect_left(stops, start)
            end = stops[stop] if stop < len(stops) else len(events)
            end = min(end, max(start, int(np.searchsorted(batch.newest, self._horizon(batch, start)))))
            yield from self._pass(batch, start, end, notes)
            if end < len(events) and (found := self._engine(events[end], lines[end])):
                yield lines[end], found
            start = end + 1

    def _batch(self, events: Sequence[Event], lines: Sequence[int]) -> tuple[Batch, Flags]:
        """The events by topic, and those of which the engine has to judge the time: it goes back, or it is the same as
        before but written otherwise; and the very first."""
        raws = [event["time"] for event in events]
        times = np.array(list(map(float, raws)))
        newest = np.maximum.accumulate(np.concatenate(([self._newest], times)))
        wrong: Flags = times < newest[:-1]
        wrong[0] |= self._latest is None
        for k in np.flatnonzero(times == newest[:-1]).tolist():
            wrong[k] = raws[k] != (raws[k - 1] if k else self._latest)
        self._newest, self._latest = float(newest[-1]), raws[-1]
        said = [event["topic"] for event in events]
        written: dict[str, list[int]] = {topic: [] for topic in dict.fromkeys(said)}
        for row, topic in enumerate(said):
            written[topic].append(row)
        topics: dict[str, list[int]] = {}
        for topic, found in written.items():
            topics.setdefault(same_topic(topic), []).extend(found)
        rows = {topic: np.array(sorted(found), np.int64) for topic, found in topics.items()}
        as_written = {topic: np.array(found, np.int64) for topic, found in written.items()}
        return Batch(events, lines, times, newest[1:], as_written, rows), wrong

    def _horizon(self, batch: Batch, start: int) -> float:
        """No deadline passes before this time, counted from the messages that come first."""
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
        found = [violation for watch in self._watches for violation in watch.monitor.step(event, line)]
        return list(self._told(found)) if found else []

    def _pass(self, batch: Batch, start: int, end: int, notes: Sequence[tuple[int, _Watch, _Noted, int]]) -> Found:
        """Take over the events of some rows, and judge the answers whose inputs they bring."""
        some = notes[bisect_left(notes, start, key=_row) : bisect_left(notes, end, key=_row)]
        for row, group in itertools.groupby(some, key=_row):
            found: list[Violation] = []
            for _, watch, noted, k in group:
                found += watch.note(batch, row, watch.monitor.events + row - start + 1, noted, k)
            if found:
                self._count(batch, start, row + 1)
                start = row + 1
                yield batch.lines[row], list(self._told(found))
        self._count(batch, start, end)

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
"""Events that are judged one by one at once: arrays of fewer cost more than they save."""


def _row(note: tuple[int, _Watch, _Noted, int]) -> int:
    return note[0]
