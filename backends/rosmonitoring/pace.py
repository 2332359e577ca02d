"""When the messages that a monitor receives come, by which clock, at which rate, and which were lost."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction
from itertools import product

from avow.base.tuning.bounds import INSTANCES, POINTS_OF_ARGUMENTS
from avow.evaluation.evaluate import NotEvaluable, compile_term
from avow.evaluation.running import unnamed
from avow.formulas.formula import free_variables
from avow.formulas.temporal.ages import ELAPSED, Side
from avow.formulas.values import FunctionValue, Value, show
from avow.language.subterms import subterms
from avow.language.terms import Apply, Role, Term, Variable
from avow.ros.bags import Event

from .pairing import time_of
from .reading import at
from .rules import FieldPath
from .tuning import EVENTS_WITHOUT_CLOCK, GRACE, JITTER, RATE_MESSAGES, TIMES_ALIKE
from .wires import MappingError, seconds

RATE = re.compile(r"([0-9]+(?:[.][0-9]+)?) ?Hz ?(?:±|[+]/?-) ?([0-9]+(?:[.][0-9]+)?) ?%")

NO_TIME = "a time with a unit is wanted, such as 50 ms"

_UNITS = {"s": Fraction(1), "ms": Fraction(1, 1000), "us": Fraction(1, 10**6), "min": Fraction(60)}


def duration(text: str) -> Fraction:
    """``200 ms`` in seconds; the schema has checked its form."""
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz").strip()
    return Fraction(number) * _UNITS[text[len(text.rstrip("abcdefghijklmnopqrstuvwxyz")) :]]


@dataclass(frozen=True, slots=True)
class Leeway:
    """The tolerance of a monitor for clocks and memory, unless the plan sets another."""

    grace: Fraction = GRACE
    """Seconds after a deadline until silence is reported."""
    jitter: Fraction = JITTER
    """Seconds by which times may go back, and by which regular steps may be early or late."""
    instances: int = INSTANCES
    """The number of values of a quantified variable for which something is remembered."""

    @property
    def late(self) -> str:
        """The message about an answer that came within the grace period."""
        by = f"{float(self.grace * 1000):g} ms"
        return f"an answer came after its deadline, by at most {by}: it may have been on its way"


@dataclass(frozen=True, slots=True)
class Rate:
    """``10 Hz ± 20 %``: the time that any `RATE_MESSAGES` messages take lies within these bounds."""

    text: str
    least: Fraction
    most: Fraction

    @classmethod
    def of(cls, hertz: Fraction, share: Fraction, text: str) -> Rate:
        """Raises ZeroDivisionError if `hertz` is 0 or `share` is 1."""
        return cls(text, RATE_MESSAGES / (hertz * (1 + share)), RATE_MESSAGES / (hertz * (1 - share)))


@dataclass(slots=True)
class Pace:
    """The rate of one variable's messages. A wrong rate is reported once, until it is right again."""

    rate: Rate
    start: Fraction
    times: deque[Fraction] = field(default_factory=lambda: deque(maxlen=RATE_MESSAGES))
    """The times of the latest messages."""
    slow: bool = False
    fast: bool = False

    def late(self, now: Fraction) -> str:
        """What is wrong at a time, with or without a message then; empty if there is nothing new."""
        since = self.times[0] if len(self.times) == RATE_MESSAGES else self.start
        if self.slow or now - since <= self.rate.most:
            return ""
        self.slow = True
        return self._said(now - since, len(self.times))

    def beat(self, now: Fraction) -> str:
        """A message has come."""
        found = ""
        if len(self.times) == RATE_MESSAGES:
            self.slow = self.slow and now - self.times[0] > self.rate.most
            fast = now - self.times[0] < self.rate.least
            found = self._said(now - self.times[0], RATE_MESSAGES) if fast and not self.fast else ""
            self.fast = fast
        self.times.append(now)
        return found

    @property
    def deadline(self) -> Fraction | None:
        """The time at which it is too slow unless a message comes; None if that has been reported."""
        if self.slow:
            return None
        return (self.times[0] if len(self.times) == RATE_MESSAGES else self.start) + self.rate.most

    def _said(self, time: Fraction, count: int) -> str:
        return f"{count} messages in {show(time)} s, and {self.rate.text} is allowed"


@dataclass(slots=True)
class Passage:
    """The messages of one topic that were lost or came out of order, as far as their numbers show."""

    last: list[int] = field(default_factory=list)
    """The latest `header.seq`, if there is one."""
    lost: int = 0
    disordered: int = 0
    uncounted: str = ""
    """Why a loss may not be visible."""
    unheard: str = ""
    """Why messages were not heard, according to the one who recorded."""
    replaced: int = 0
    """Those that a filter passed on in place of withheld ones."""
    gap: bool = False
    """Some may have been published since the latest one."""
    latest: Fraction | None = None
    alike: int = 1
    """The number of consecutive messages so far that have the latest time."""
    most_alike: int = 1
    advanced: bool = False
    """Whether any message had another time than the one before."""

    def heard(self, event: Event, now: Fraction) -> bool:
        """Whether messages before this one were lost, or come later, by their numbers (which may never be set)."""
        if self.latest is not None and now < self.latest:
            self.disordered += 1
        if self.latest is not None:
            self.alike = self.alike + 1 if now == self.latest else 1
            self.most_alike = max(self.most_alike, self.alike)
            self.advanced = self.advanced or now != self.latest
        self.latest = now
        number = sequence(event)
        missed, self.gap = self.gap, False
        if number is None:
            self.uncounted = "have no numbers (header.seq)"
            return missed
        before = self.last[0] if self.last else number
        if self.last:
            gap = number - self.last[0]
            self.lost += max(0, gap - 1)
            self.disordered += gap <= 0
            if gap <= 0:  # never set, several publishers, or one that restarted
                self.uncounted = self.uncounted or "have numbers (header.seq) that do not rise"
        self.last[:] = [number]
        return missed or number - before not in (0, 1)


SEQUENCE = ("header", "seq")
"""The path of a message's number in ROS 1."""


def sequence(event: Event) -> int | None:
    """A message's number among those of its publisher."""
    header = event.get("header")
    number = header.get("seq") if header.__class__ is dict else None
    return number if number.__class__ is int else None


@dataclass(slots=True)
class Timing:
    """When the messages of a monitor come: deadlines, rates, losses, and when each variable was last received."""

    fresh: Mapping[str, Fraction]
    """How long each of these variables may be silent, in seconds."""
    rates: Mapping[str, Rate]
    heard: dict[str, float] = field(default_factory=dict)
    """When each variable was last received, as a float."""
    paces: dict[str, Pace] = field(default_factory=dict)
    passages: dict[str, Passage] = field(default_factory=dict)
    """The passages by topic."""
    _since: dict[str, tuple[Fraction, bool]] = field(default_factory=dict)
    """When each variable with a deadline was last received, and whether its silence has been reported."""

    def passes(self, event: Event, names: Set[str]) -> Iterator[tuple[str, str, bool]]:
        """An event of any topic: time has passed. Deadlines do not wait for the next message: each missed one is
        reported once, at the first later event of the run (variable, what is wrong, whether it is silent)."""
        if not self.fresh and not self.rates:
            return
        now = time_of(event)
        for name, limit in self.fresh.items():
            since, told = self._since.setdefault(name, (now, False))
            if not told and now > since + limit:
                yield (
                    name,
                    f"{name} was silent for {show(now - since)} s, and at most {show(limit)} s are allowed",
                    True,
                )
                self._since[name] = (since, True)
            if name in names:
                self._since[name] = (now, False)
        for name, rate in self.rates.items():
            pace = self.paces.setdefault(name, Pace(rate, now))
            if wrong := pace.late(now):
                yield name, f"{name} is too slow: {wrong}", False
            if name in names and (wrong := pace.beat(now)):
                yield name, f"{name} is too fast: {wrong}", False

    @property
    def standing(self) -> str:
        """Why the messages' times are no evidence for limits in seconds (they do not advance); empty if they are."""
        again = {topic: p.most_alike for topic, p in self.passages.items() if p.most_alike > 1}
        still = {topic: n for topic, n in again.items() if n >= TIMES_ALIKE}
        if not still and again and not any(p.advanced for p in self.passages.values()):
            still = again
        topic = max(still, key=still.__getitem__, default=None)
        told = "" if topic is None else f"{still[topic]} messages of {topic}, one after another, have one time"
        return f"{told}: such times are no evidence for limits in seconds" if told else ""

    def hear(self, event: Event, topic: str, names: Iterable[str]) -> bool:
        """A message of one of the monitor's topics. Returns whether earlier ones were lost, or came out of order."""
        now = time_of(event)
        missed = self.passages.setdefault(topic, Passage()).heard(event, now)
        self.heard.update(dict.fromkeys(names, float(now)))
        return missed

    def caught_up(self, event: Event, topic: str, names: Iterable[str]) -> None:
        """Take over the latest of some messages whose times were checked elsewhere: each was later than the one before
        it."""
        now = time_of(event)
        passage = self.passages[topic]
        passage.latest, passage.alike, passage.advanced = now, 1, True
        if (number := sequence(event)) is not None:
            passage.last[:] = [number]
        for name in names:
            self.heard[name] = float(now)
            if name in self._since:
                self._since[name] = (now, False)

    @property
    def deadline(self) -> float:
        """No deadline passes before this time."""
        left = [since + self.fresh[name] for name, (since, told) in self._since.items() if not told]
        left += [at for pace in self.paces.values() if (at := pace.deadline) is not None]
        return math.nextafter(float(min(left)), 0.0) if left else math.inf


SIMULATED = "clock"
"""The topic of rosgraph_msgs/Clock, without its leading slash."""


class By(StrEnum):
    RECEIPT = "receipt"
    SIM = "sim"
    STAMP = "stamp"


class Clock:
    """Gives events the time of another clock. Events before its first reading wait for it."""

    def __init__(self, by: By) -> None:
        self._by = by
        self._now: Fraction | None = None
        self._waiting: list[tuple[int, Event, int]] = []
        self._dropped = False
        self._moved = False

    def ready(self, index: int, event: Event, place: int) -> Iterator[tuple[int, Event, int]]:
        """The events that can be judged now, each with its number and its place in the trace."""
        read = self._read(event)
        self._moved = self._moved or (read is not None and self._now is not None and read != self._now)
        self._now = self._now if read is None else read
        if self._now is None:
            self._dropped = len(self._waiting) == EVENTS_WITHOUT_CLOCK
            if not self._dropped:
                self._waiting.append((index, event, place))
            return
        for each in (*self._waiting, (index, event, place)):
            yield each[0], {**each[1], "time": self._now}, each[2]
        self._waiting.clear()

    def passed(self, event: Event) -> Event | None:
        """Time has passed by the recording's clock, which does not determine this one."""
        return None if self._now is None else {**event, "time": self._now}

    def finish(self) -> str:
        """Why the run is no evidence: the clock was never read, or did not advance."""
        if self._by is By.SIM and self._now is not None and not self._moved:
            return f"/clock did not advance, and the plan uses it (`time: {self._by}`)"
        what = "no message of /clock came" if self._by is By.SIM else "no message had a `header.stamp`"
        if self._dropped and not self._waiting:
            what = f"more than {EVENTS_WITHOUT_CLOCK} events came before the first time"
        return f"{what}, and the plan uses that clock (`time: {self._by}`)" if self._waiting or self._dropped else ""

    def _read(self, event: Event) -> Fraction | None:
        way: FieldPath = ("clock",) if self._by is By.SIM else ("header", "stamp")
        if self._by is By.SIM and str(event.get("topic", "")).lstrip("/") != SIMULATED:
            return None
        try:
            read = seconds(at(event, way))
        except MappingError:
            return None
        return None if self._by is By.STAMP and not read else read  # ROS leaves 0 if nothing has set it


Moments = Callable[[Mapping[str, Value]], Iterator[Value]]


@dataclass(slots=True)
class Silence:
    """A clause with limits in seconds between steps, and when its steps were."""

    holds: Mapping[Side, Callable[[Mapping[str, Value]], Value]]
    """Whether it holds `ELAPSED` seconds after a step."""
    breaks: tuple[Moments, ...]
    """The numbers of seconds after a step at which its truth may change."""
    period: Fraction | None
    """For a clause that says that steps come periodically, the period in seconds."""
    leeway: Leeway
    latest: Fraction | None = None
    """The time of its latest step."""
    elapsed: Fraction = Fraction(0)
    """The time from the latest step to the next, which is being judged."""
    reported: bool = False
    """Whether a breach since the latest step has been reported."""
    spared: Fraction | None = None
    """If the step that is being judged came a little after a deadline: the time to it, `elapsed` to the deadline."""
    asked: bool = False
    """A message has come since the latest step; `latest` is its time."""
    passed_by: Fraction | None = None
    """A deadline that had passed when it came."""

    def broken(self, memory: Mapping[str, Value]) -> Fraction | None:
        """The time after the latest step at which silence breaks the clause, or None. Raises NotEvaluable."""

        def at(side: Side, elapsed: Fraction) -> bool:
            return bool(self.holds[side]({**memory, ELAPSED.qualified: elapsed}))

        if not at(Side.AFTER, Fraction(0)):
            return Fraction(0)
        times = {Fraction(t) for each in self.breaks for t in each(memory) if isinstance(t, int | Fraction)}
        for time in sorted(t for t in times if t > 0):
            if not at(Side.AT, time) or not at(Side.AFTER, time):
                return time
        return None

    def passed(self, now: Fraction) -> None:
        """A step comes."""
        self.elapsed = max(now - self.latest, Fraction(0)) if self.latest is not None else Fraction(0)
        if self.period is not None and abs(self.elapsed - self.period) <= self.leeway.jitter:
            self.elapsed = self.period


def moments(at: Term) -> Moments:
    """The values of a term over memory; if it depends on quantified variables, at all remembered values of these and at
    values that are not remembered. The returned function raises NotEvaluable."""
    value = compile_term(at)
    bound = sorted({v for v in free_variables(at) if v.role is Role.BOUND}, key=lambda v: v.name)
    if not bound:
        return lambda memory: iter((value(memory),))
    applied = [t for t in subterms(at) if isinstance(t, Apply) and isinstance(t.function, Variable)]
    places = {v: [(t.function, t.arguments.index(v)) for t in applied if v in t.arguments] for v in bound}

    def each(memory: Mapping[str, Value]) -> Iterator[Value]:
        known: list[list[Value]] = []
        for variable in bound:
            found = dict.fromkeys((unnamed(variable.sort),))
            for function, place in places[variable]:
                table = memory[function.qualified] if isinstance(function, Variable) else None
                found |= dict.fromkeys(k[place] for k in table.table) if isinstance(table, FunctionValue) else {}
            known.append(list(found))
        for count, point in enumerate(product(*known)):
            if count >= POINTS_OF_ARGUMENTS:
                raise NotEvaluable("too many combinations of values are remembered")
            yield value({**memory, **{v.name: p for v, p in zip(bound, point, strict=True)}})

    return each
