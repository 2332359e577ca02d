"""How a monitor judges a clause by the latest values.

A node promises nothing once one of its assumptions was broken (`SoFar`). On a running graph each topic has its own
connection: the message received first may not have been published first. So there a breach by the order of arrival
waits until the messages within `LIVE_APART` of it are known (`Doubts`), and is reported if it is one whichever of these
messages of other topics came before it; otherwise it is undecided. A clause's memory of steps depends on all earlier
messages: if these are of several topics, a breach is undecided.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.formulas.values import Value
from avow.language.contract import ClauseKind

from .options import same_topic
from .pairing import Answers, Asked, Pairing, ticks, time_of
from .rules import Choice, Fields
from .tuning import LIVE_APART
from .watched import Answer, Fault, Violation, Watched

if TYPE_CHECKING:
    from .engine import Monitor

UNSURE = "it is not known whether the assumptions have held so far"


@dataclass(slots=True)
class SoFar:
    """Whether the assumptions of a node that remembers have held so far: it promises nothing once one was broken."""

    jitter: Fraction
    """Seconds by which a clock may go back."""
    broken: str = ""
    unsure: bool = False
    """A message of an assumption was not seen, or it could not be decided whether one held."""
    newest: Fraction | None = None
    """The latest time of a message, in the current run."""

    def hears(self, now: Fraction, timed: Sequence[Watched]) -> None:
        """A message has come. If times go back further than a clock does, a new run begins for all clauses at once: if
        it began for each at its own next step, an assumption broken in between would be forgotten."""
        if self.newest is not None and now < self.newest - self.jitter:
            self.broken, self.unsure, self.newest = "", False, now
            for watched in timed:
                assert watched.steps is not None
                watched.steps.restart()
        self.newest = now if self.newest is None else max(now, self.newest)

    def note(self, watched: Watched) -> None:
        """A clause was judged; only assumptions count."""
        if watched.clause.kind is not ClauseKind.ASSUMPTION:
            return
        if watched.truth is False:
            self.broken = self.broken or watched.clause.name
        self.unsure = self.unsure or watched.truth is None


def _blamed(
    watched: Watched, truth: bool | None, assumptions: Sequence[Watched], values: Mapping[str, Value],
    so_far: SoFar | None = None, event: int = 0,
) -> tuple[Fault, str] | None:  # fmt: skip
    """The fault of a clause that does not hold, and the explanation; None if it cannot be decided."""
    if truth is None:
        return None
    said = watched.statement
    if watched.clause.kind is ClauseKind.ASSUMPTION:
        return Fault.ASSUMPTION, said
    for assumed in assumptions:
        if assumed.steps is not None or any(n not in values for n in assumed.names):
            continue
        if assumed.truth_of(values) is False:
            if so_far is not None:
                so_far.broken = so_far.broken or assumed.clause.name
            return Fault.EXCUSED, f"{said}; but the assumption {assumed.clause.name} does not hold"
    if so_far is not None and so_far.broken:
        return Fault.EXCUSED, f"{said}; but the assumption {so_far.broken} did not hold before"
    # an assumption about the node's own answers is judged with the answer, whose parts may be incomplete
    late = (a.steps for a in assumptions if a.steps is not None and a.steps.answers and a.steps.stepped != event)
    return None if so_far is not None and (so_far.unsure or any(late)) else (Fault.GUARANTEE, said)


def verdict_of(watched: Watched, assumptions: Sequence[Watched], values: Mapping[str, Value]) -> Fault | str | None:
    """Whether a clause without memory held for the values; None if it cannot be decided."""
    truth = watched.truth_of(values)
    blame = None if truth else _blamed(watched, truth, assumptions, values)
    return "held" if truth else blame and blame[0]


def judge_latest(
    monitor: Monitor, watched: Watched, event: Mapping[str, Any], found: list[Violation], answer: Answer | None
) -> None:
    """Judge a clause at an event; `answer`: the parts of the answer, if they came apart."""
    values, steps, tally = monitor.known(watched, answer), watched.steps, watched.tally
    missing = [name for name in watched.names if name not in values]
    supposed = any(name in monitor.supposed for name in watched.names)
    lost = False
    if steps is None:
        if missing:
            tally.too_early(missing)
            return
        key = (*[monitor.versions[n] for n in watched.names], supposed)
        if key != watched.key or watched.held or answer is not None:
            watched.key = key if answer is None else None
            watched.truth = watched.truth_of(values)
            if not supposed:
                tally.met |= watched.met(values, unknown=True)
    else:
        if missing and steps.early(watched.names, values):
            if steps.unsaid:
                tally.published -= 1  # the trigger, which has no value yet, did not occur
            else:
                tally.too_early(missing)
            if steps.answers or steps.stepped:
                monitor.lose(watched)  # a step passed; with inputs alone, the run begins when all have a value
            return
        lost = steps.lost
        steps.comes(time_of(event))
        watched.truth = steps.step(watched, values, monitor.events, supposed)
    if monitor.so_far is not None:
        monitor.so_far.note(watched)
    if steps is not None:
        still = watched.truth is False and steps.missed
        steps.missed = steps.awaits and not watched.truth and (steps.missed or watched.truth is False)
        if still:
            tally.overdue += 1
            return
    if watched.truth is None and lost:
        tally.forgotten += 1
        return
    if supposed and watched.truth is not False:
        tally.supposed += 1
        return
    if watched.truth:
        tally.judged += 1
        return
    not_met(monitor, watched, values, event, found)


def not_met(
    monitor: Monitor, watched: Watched, values: Mapping[str, Value], event: Mapping[str, Any], found: list[Violation],
    late: str = "",
) -> None:  # fmt: skip
    """A clause does not hold for the latest values, or cannot be decided."""
    tally = watched.tally
    if monitor.doubts is not None and monitor.doubts.ask(monitor, watched, values, event):
        return
    tally.judged += 1
    known = monitor.assumptions, values, monitor.so_far, monitor.events
    blame = _blamed(watched, watched.truth, *known)
    if blame is None:
        tally.undecided += 1
        tally.reason = tally.reason or UNSURE
        return
    tally.broken += 1
    fault, why = blame
    if fault is Fault.EXCUSED:
        tally.excused += 1
    found.append(monitor.violation(fault, watched.clause.name, event, why + late, watched, values))


REMEMBERS = "it refers to other steps and to several topics, whose order is unknown on a running graph"


@dataclass(slots=True)
class Doubts:
    """The breaches of one node that wait."""

    pairing: Pairing
    """The messages of each variable, and the breaches, treated as answers that may have answered any of those."""
    latest: int = 0
    """The event of the latest guarantee that was not met."""

    @staticmethod
    def beginning(values: Mapping[str, Value]) -> Doubts:
        """`values`: those known before any message."""
        pairing = Pairing(Answers("latency", jitter=LIVE_APART))
        pairing.begins(values)
        return Doubts(pairing)

    def ask(self, monitor: Monitor, watched: Watched, values: Mapping[str, Value], event: Mapping[str, Any]) -> bool:
        """Whether a breach is not reported now."""
        topic = same_topic(str(event.get("topic", "")))
        spoken = [n for n in dict.fromkeys(monitor.spoken(watched)) if n in values or n not in watched.names]
        rules = monitor.setup.rules
        topics = {n: same_topic(r.topic) for n in spoken if isinstance(r := rules.get(n), Fields | Choice)}
        inputs = tuple(n for n, of in topics.items() if of != topic)
        guarantee = watched.clause.kind is ClauseKind.GUARANTEE
        remembers = watched.steps is not None or (monitor.so_far is not None and guarantee)
        if not inputs or (remembers and watched.clause.pace is not None):
            return False
        if guarantee:
            self.latest = monitor.events
        if remembers:
            if len(set(topics.values())) < 2:
                return False
            watched.tally.unsure(REMEMBERS)
            return True
        known = {n: values[n] for n in spoken if n not in inputs and n in values}
        now, heard = time_of(event), monitor.heard_of(watched.names)
        asked = Asked(watched, event, monitor.events, known, inputs, ticks(now), float(now), None, heard, ())
        asked.needless = frozenset(inputs).difference(watched.names)
        self.pairing.ask(asked)
        return True


def hear(remembering: Iterable[Watched], names: Iterable[str]) -> None:
    """Messages of these variables have come."""
    for watched in remembering:
        if watched.steps is not None:
            watched.steps.hears(names)


def pass_between(monitor: Monitor, timed: Iterable[Watched], names: Mapping[str, bool], now: Fraction) -> None:
    """Messages of these variables have come; for some clauses, they made no step."""
    for watched in timed:
        steps, about = watched.steps, not names.keys().isdisjoint(watched.names) and watched.clause.pace is None
        if about and steps is not None and steps.answers and steps.stepped != monitor.events:
            steps.between(watched.names, monitor.known(watched, None), monitor.supposed, now)


def overdue(timed: Sequence[Watched], event: Mapping[str, Any]) -> list[tuple[Watched, Fraction]]:
    """The clauses that silence has broken by the time of an event, with the time of the breach, in order of time (at
    the same time: assumptions first); each is reported once."""
    now = time_of(event) if timed else Fraction(0)
    found: list[tuple[Watched, Fraction]] = []
    for watched in timed:
        assert watched.steps is not None
        watched.steps.begins(now)
        if (deadline := watched.steps.late(now)) is not None and not watched.steps.missed:
            watched.steps.missed = watched.steps.awaits
            watched.truth, watched.tally.published = False, watched.tally.published + 1
            found.append((watched, deadline))
    return sorted(found, key=lambda each: (each[1], each[0].clause.kind is not ClauseKind.ASSUMPTION))


def soonest(timed: Sequence[Watched]) -> float:
    """Silence breaks nothing before this time."""
    left = (watched.steps.deadline for watched in timed if watched.steps is not None)
    return min((math.nextafter(float(at), 0.0) for at in left if at is not None), default=math.inf)
