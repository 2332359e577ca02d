"""Tests of a callback class: runs of messages in virtual time, judged as monitors judge a recording.

Each run has a new object, and messages that violate no assumption; its publications are judged against the latest
messages received. A violating run is reduced to as few messages as still violate the guarantee, and has to violate it
in another process as well.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.given import summarized
from avow.backend_kit.programs.callbacks import SECOND, Driver, Event, Run, Silent, driver
from avow.backend_kit.programs.compared import stamp_of
from avow.backend_kit.programs.cpython import Replies
from avow.backend_kit.protocol import Backend, Job, JudgedRun, Limits, Report
from avow.backend_kit.registry import judge_of_runs
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.percent import at_most
from avow.base.process import Stopwatch
from avow.base.verdict import Counterexample, Isolation, Object, Outcome, Verdict
from avow.evidence.obligation import Obligation
from avow.evidence.record import CASE, RETRY
from avow.formulas.temporal.cells import longest_limits
from avow.formulas.values import show
from avow.isolation.observed import Observed
from avow.language.terms import Role
from avow.ros.sources import message_files
from avow.system.plan import Driving
from avow.system.topics import whole_name

from . import tuning
from .convention import ANY, EXACT, SPECIAL
from .export import cases, numbers
from .judging import MEANING, failure_bound

UNSTEADY = "undeclared input: asked the same again from its start, another process publishes otherwise"

Messages = tuple[Event, ...]
Judge = Callable[[Iterable[Mapping[str, Any]]], JudgedRun]


def wanted(job: Job) -> bool:
    """Whether what the method tests is a callback class."""
    source = job.source if job.options.get("subject") is None else None
    return source is not None and bool(source.python) and source.kind is not Driving.STEP


def problems(job: Job) -> tuple[Diagnostic, ...]:
    """The problems of the options that can be found without running the class."""
    assert job.source is not None
    place = job.source.place.at("source")
    if numbers(job) == EXACT:
        return (
            Diagnostic("HYPO106", "messages carry doubles: a callback class is not tested with exact numbers", place),
        )
    backend = judge_of_runs()
    if backend is None:
        return (Diagnostic("HYPO107", "no installed method judges runs of messages", place),)
    try:
        backend.judge(job)
    except Rejected as rejected:
        return rejected.diagnostics
    return ()


def files(job: Job) -> tuple[Path, ...]:
    """The files of the message types, besides the class and its parameters."""
    return tuple(message_files(job.system.plan.messages))


def settle(job: Job, limits: Limits, version: str) -> Report:
    """One outcome for each obligation. `problems` is empty, so that there is a judge."""
    backend = judge_of_runs()
    assert backend is not None
    try:
        work = _work(job, backend, limits)
        outcomes = work.outcomes()
    except Rejected as rejected:
        report = Report.alike(job, Verdict.ERROR, summarized(job, rejected.diagnostics), "hypothesis", version)
        again: dict[str, object] = {RETRY: True} if isinstance(rejected, Silent) else {}
        return replace(report, outcomes=tuple(replace(o, details=dict(again)) for o in report.outcomes))
    outcomes = tuple(replace(o, of=Object.SOURCE, numbers="float64") for o in outcomes)
    return Report(outcomes, "hypothesis", version, (), {"runs.json": work.log()}, tuple(work.observed), work.isolation)


def _work(job: Job, backend: Backend, limits: Limits) -> _Work:
    """Raises Rejected."""
    judge = backend.judge(job)
    clauses = (*job.node.assumptions, *map(job.clause, job.obligations))
    length = tuning.STEPS + min(2 * longest_limits(c.formula for c in clauses), tuning.LONGEST_RUN)
    return _Work(job, driver(job.system, job.node.name), judge, limits, length)


@dataclass(slots=True)
class _Count:
    """The counts of one guarantee."""

    held: int = 0
    excused: int = 0
    undecided: int = 0
    runs: int = 0
    """The drawn runs in which it was judged."""
    met: Sequence[int] = ()
    """Of each of its conditions: in how many of these runs it was met."""
    reason: str = ""


@dataclass(slots=True)
class _Work:
    job: Job
    driver: Driver
    judge: Judge
    limits: Limits
    length: int
    """Messages of a run."""
    observed: dict[Observed, None] = field(default_factory=dict)
    isolation: Isolation = Isolation.SEALED
    messages: int = 0
    runs: int = 0
    rejected: int = 0
    answers: dict[str, list[int]] = field(default_factory=dict)
    """Topic → how many of its drawn messages got an answer at once, and how many none at all."""
    replayed: int = 0
    counts: dict[str, _Count] = field(default_factory=dict)
    failing: dict[str, Messages] = field(default_factory=dict)
    """Guarantee → a run that violates it, or in which the class raises."""
    first: list[tuple[Messages, Run]] = field(default_factory=list)
    spent: Stopwatch = field(default_factory=Stopwatch)
    end: float = 0.0
    """The processor seconds after which no more is tried."""
    stamped: dict[str, bool] = field(default_factory=dict)
    """Output's topic → whether a publication had the stamp of a message received."""

    def outcomes(self) -> tuple[Outcome, ...]:
        self.end = self.limits.seconds
        self.counts = {o.name: _Count() for o in self.job.obligations}
        self.put(list(self.kept()), drawn=False)
        stopped = self.sweep()
        self.check_stamps()
        found = {o.name: self.failed(o) for o in self.job.obligations if o.name in self.failing}
        unsteady = next((o.summary for o in found.values() if o.verdict is Verdict.UNKNOWN), "") or self.unsteady()
        wrong = self.apart()
        return tuple(found.get(o.name) or self.settled(o, stopped, unsteady, wrong) for o in self.job.obligations)

    # -- runs --------------------------------------------------------------------------------------------

    def sweep(self) -> str:
        """Run the drawn messages; the reason if there are too few."""
        number, many = 0, cases(self.job)
        while self.messages < many and len(self.failing) < len(self.counts):
            if self.spent() > self.end:
                return f"only {self.messages} of {many} messages in the time given"
            made: list[Messages] = []
            left = many - self.messages
            while len(made) < min(tuning.RUNS_TOGETHER, math.ceil(left / self.length)):
                events, number = self.allowed(f"{self.limits.seed}/{number}"), number + 1
                made += [events] if events else []
                if self.rejected > tuning.REJECTED_CASES * max(self.messages + sum(map(len, made)), 50):
                    whole = f"{self.messages} of {self.messages + self.rejected} generated messages"
                    return f"the assumptions are met too rarely: {whole}"
            self.put(made)
        return ""

    def allowed(self, seed: str) -> Messages:
        """Generated messages, without those that violate an assumption."""
        events = list(self.driver.generated(self.length, seed))
        if not events:
            raise Rejected(Diagnostic("HYPO107", f"{self.driver.source.class_name} hears no topic of others"))
        while events and (wrong := self.judge(self.recorded(events, events)).assumption) is not None:
            del events[min(wrong[0], len(events)) - 1]
            self.rejected += 1
        return tuple(events)

    def ask(self, runs: Sequence[Messages]) -> tuple[Run, ...]:
        """Each run from its start to some time after its last message. Raises Rejected."""
        found, how = self.driver.runs([(events, 0, _end(events)) for events in runs])
        self.keep(how)
        return found

    def keep(self, how: Replies) -> None:
        self.observed.update(dict.fromkeys(how.observed))
        self.isolation = min(self.isolation, how.isolation, key=lambda level: level.rank)

    def put(self, made: Sequence[Messages], *, drawn: bool = True) -> None:
        """Run the class, judge, count."""
        if not made:
            return
        for events, run in zip(made, self.ask(made), strict=True):
            if len(self.first) * self.length < tuning.ASKED_AGAIN:
                self.first.append((events, run))
            self.runs += drawn
            self.messages += drawn * len(events)
            self.count_answers(events if drawn else (), run)
            heard = {stamp_of(event.data) for event in events} - {None}
            for said in (e for e in run.said if heard and e.topic in self.outputs and stamp_of(e.data) is not None):
                self.stamped[said.topic] = self.stamped.get(said.topic, False) or stamp_of(said.data) in heard
            self.replayed += not drawn
            judged = self.judged(events, run)
            for name, count in self.counts.items():
                one = judged.clauses[name]
                count.held += one.held
                count.excused += one.excused
                count.undecided += one.undecided
                judged_here = drawn and one.held > 0
                count.runs += judged_here
                before = count.met or [0] * len(one.met)
                count.met = [n + (judged_here and m) for n, m in zip(before, one.met, strict=True)]
                count.reason = count.reason or one.reason
                if self.wrong(name, run, judged) is not None:
                    self.failing.setdefault(name, events)

    def check_stamps(self) -> None:
        """Raises Rejected if answers are paired by stamp, and no publication on a topic has the stamp of a message."""
        paired = self.job.options.get("answers", {})
        if self.failing or paired.get("by") != "stamp" or "output" in paired:
            return
        for topic in sorted(topic for topic, copied in self.stamped.items() if not copied):
            message = f"{self.driver.source.class_name} publishes {topic} without the stamp of what it answers"
            place, hint = self.driver.source.place.at("source"), "copy the header of the message into the answer"
            raise Rejected(Diagnostic("HYPO108", message, place, hint=hint))

    def count_answers(self, events: Messages, run: Run) -> None:
        """Which messages a callback answered; a publication of a later timer answers all messages before it."""
        said = [event for event in run.said if event.topic in self.outputs]
        timed = max((e.after for e in said if not e.after or e.at > events[e.after - 1].at), default=0) if events else 0
        at_once = {event.after for event in said}
        for number, event in enumerate(events, 1):
            counts = self.answers.setdefault(event.topic, [0, 0])
            counts[0] += number in at_once
            counts[1] += number not in at_once and number > timed

    @property
    def unanswered(self) -> int:
        """The drawn messages without an answer, on topics whose messages it answers at once."""
        return sum(none for at_once, none in self.answers.values() if at_once)

    @property
    def outputs(self) -> frozenset[str]:
        node, names = self.job.node, self.job.system.plan.ros.names
        topics = (t for t in node.topics if t.port is not None and t.port.role is Role.OUTPUT)
        return frozenset(whole_name(names, node, topic) for topic in topics)

    def judged(self, events: Messages, run: Run) -> JudgedRun:
        return self.judge(self.recorded(events, run.beside(events)))

    def recorded(self, heard: Sequence[Event], events: Iterable[Event]) -> Iterator[dict[str, Any]]:
        for event in events:
            yield {**self.driver.fields(event), "topic": event.topic, "time": Fraction(event.at, SECOND)}
        yield {"time": Fraction(_end(heard), SECOND)}

    def wrong(self, name: str, run: Run, judged: JudgedRun) -> Counterexample | None:
        """A run's counterexample to a guarantee, before any assumption is violated."""
        shown, broken = judged.clauses[name].shown, judged.assumption
        if shown is not None and (broken is None or judged.clauses[name].at <= broken[0]):
            order = f" (callbacks of one instant: {run.order})" if run.order else ""
            return replace(shown, explanation=f"guarantee {name} does not hold of these: {shown.explanation}{order}")
        if run.wrong and broken is None:
            return Counterexample((), f"at message {run.after} the class raises {run.wrong}: there is no output")
        return None

    # -- earlier counterexamples -------------------------------------------------------------------------

    def kept(self) -> Iterator[Messages]:
        """The earlier counterexamples that the class can still receive and the assumptions allow."""
        for case in (case for found in self.job.kept.values() for case in found):
            try:
                events = tuple(Event(str(topic), int(at), data) for topic, at, data in case)
                same = all(self.driver.coded(e.topic, self.driver.fields(e), "") == e.data for e in events)
            except (Rejected, ValueError, TypeError, KeyError, AttributeError, AssertionError):
                continue
            hears = all(event.topic in self.driver.inputs for event in events)
            if events and same and hears and self.judge(self.recorded(events, events)).assumption is None:
                yield events

    # -- results -----------------------------------------------------------------------------------------

    def failed(self, obligation: Obligation) -> Outcome:
        """The simplest run that violates it, as repeated in a process of its own."""
        name = obligation.name
        for events in (self.smaller(name, self.failing[name]), self.failing[name]):
            run = self.driver.run(events, 0, _end(events), orders=True)
            judged = self.judged(events, run)
            shown = self.wrong(name, run, judged)
            if shown is not None:
                shown = replace(shown, trace=tuple(self.told(events, run))[: (judged.clauses[name].at or None)])
                case: dict[str, object] = {CASE: [[e.topic, e.at, e.data] for e in events]}
                return Outcome(obligation.id, Verdict.REFUTED, shown.text(), shown, bound=self.bound(), details=case)
        return Outcome(obligation.id, Verdict.UNKNOWN, UNSTEADY, bound=self.bound())

    def smaller(self, name: str, best: Messages) -> Messages:
        """The run without unnecessary messages: first the last alone, then halves, then without one at a time."""
        end = min(self.end, self.spent() + tuning.SHRINKING_SECONDS)
        while len(best) > 1 and self.spent() < end:
            half = len(best) // 2
            tried = [best[-1:], best[half:], best[:half]] if half > 1 else []
            tried += [best[:k] + best[k + 1 :] for k in range(len(best))]
            found = zip(tried, self.ask(tried), strict=True)
            still = [e for e, run in found if self.wrong(name, run, self.judged(e, run)) is not None]
            if not still:
                break
            best = min(still, key=len)
        return best

    def told(self, events: Messages, run: Run) -> Iterator[tuple[tuple[str, str], ...]]:
        """One step per message: its topic, its time, its fields."""
        for event in run.beside(events):
            at = show(Fraction(event.at, SECOND))
            yield (("(time)", f"{at} s"), *_fields(event.topic, self.driver.fields(event)))

    def unsteady(self) -> str:
        """Whether another process answers the same runs differently; in reverse order, so that state shared by objects
        shows."""
        asked = [events for events, _ in reversed(self.first)]
        same = not asked or tuple(run for _, run in reversed(self.first)) == self.ask(asked)
        return "" if same else UNSTEADY

    def apart(self) -> list[Counterexample]:
        """The failures if one float of a message is NaN, infinite or the negative zero: each in turn."""
        tried: list[tuple[Messages, str]] = []
        for events, _ in self.first[: tuning.APART]:
            for topic in dict.fromkeys(event.topic for event in events):
                at = next(k for k, event in enumerate(events) if event.topic == topic)
                for path in _floats(events[at].data):
                    for word, text in SPECIAL.items():
                        put = replace(events[at], data=_put(events[at].data, path, {"f": text}))
                        tried.append(((*events[:at], put, *events[at + 1 :]), f"{topic}: {'.'.join(path)} = {word}"))
        found: dict[str, Counterexample] = {}
        asked = tried[:: max(1, len(tried) // (tuning.RUNS_TOGETHER * tuning.APART))]
        for (events, what), run in zip(asked, self.ask([events for events, _ in asked]) if asked else (), strict=True):
            judged = self.judged(events, run)
            broken = [n for n in self.counts if judged.clauses[n].shown is not None and n not in self.failing]
            why = f"the class raises {run.wrong}" if run.wrong else f"{', '.join(broken)}: broken" if broken else ""
            if why:
                found.setdefault(why, Counterexample((), f"{what}: {why}", tuple(self.told(events, run))))
        return list(found.values())

    def bound(self) -> dict[str, object]:
        """The limits of the answer."""
        found: dict[str, object] = {"cases": self.messages, "runs": self.runs, "rejected": self.rejected}
        found |= {"replayed": self.replayed} if self.replayed else {}
        found |= {"begins": self.driver.topics.state} if self.driver.topics.state else {}
        found |= {"unanswered": self.unanswered} if self.unanswered else {}
        return found | {"seed": self.limits.seed}

    def log(self) -> str:
        """The runs in numbers, guarantee by guarantee, and the first ones in full: what the class heard and said."""
        first = self.first[: tuning.LOGGED_RUNS]
        runs = [{"heard": heard, "said": run.said, "raised": run.wrong} for heard, run in first]
        return document({**self.bound(), "guarantees": self.counts, "first runs": runs}) + "\n"

    def settled(self, obligation: Obligation, stopped: str, unsteady: str, wrong: Sequence[Counterexample]) -> Outcome:
        count = self.counts[obligation.name]
        details: dict[str, object] = {"no numbers": [one.text() for one in wrong]} if wrong else {}
        bound = {**self.bound(), "judged": count.held}
        outcome = Outcome(obligation.id, Verdict.UNKNOWN, "", bound=bound, details=details)
        if wrong and numbers(self.job) == ANY:
            return replace(outcome, verdict=Verdict.REFUTED, summary=wrong[0].text(), counterexample=wrong[0])
        if count.undecided:
            why = f"{count.undecided} judgements are undecided: {count.reason or 'no calculation tells'}"
        elif not count.held:
            outcome = replace(outcome, verdict=Verdict.UNKNOWN if count.reason or count.excused else Verdict.ERROR)
            why = "no publication was judged: " + (count.reason or "the class never published all that it speaks of")
            why = f"{count.excused} times only with an assumption broken" if count.excused else why
        else:
            why = unsteady or stopped
        if why:
            return replace(outcome, summary=why)
        if not (triggered := min(count.met, default=count.runs)):
            return replace(outcome, summary=f"in none of {self.runs} runs was its condition met", vacuous=True)
        bound |= {"confidence": tuning.CONFIDENCE, "triggered": triggered}
        bound["failure_probability_below"] = failure_bound(count.runs)
        bound["failure_probability_when_triggered_below"] = failure_bound(triggered)
        before = f", {self.replayed} that once refuted a guarantee of this node" if self.replayed else ""
        part = self.unanswered / self.messages
        before += f", {self.unanswered} messages without an answer ({part:.0%})" if self.unanswered else ""
        like = f"runs like the {triggered} that judge it" if triggered < self.runs else "such runs"
        summary = (
            f"{self.runs} drawn runs of {self.messages} messages{before}: held at {count.held} judgements, none breaks "
            f"it (seed {self.limits.seed}; 95 %: at most {at_most(failure_bound(triggered))} of {like} fail)"
        )
        details["meaning"] = MEANING
        return replace(outcome, verdict=Verdict.TESTED, summary=summary, bound=bound)


def _end(events: Sequence[Event]) -> int:
    """The end of a run, in virtual time: timers are due after its last message."""
    return (events[-1].at if events else 0) + tuning.SILENCE * SECOND


def _fields(name: str, value: Any) -> Iterator[tuple[str, str]]:
    match value:
        case dict():
            for key, inner in value.items():
                yield from _fields(f"{name}.{key}", inner)
        case _:  # a number, a text, a list
            yield name, json.dumps(value)[:200]


def _floats(data: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The paths of a message's floats; for an array the first item."""
    match data:
        case {"f": _}:
            yield path
        case {"d": list(pairs)}:
            for name, inner in pairs:
                yield from _floats(inner, (*path, name))
        case {"l": [first, *_]}:
            yield from _floats(first, (*path, "0"))


def _put(data: Any, path: tuple[str, ...], value: Any) -> Any:
    if not path:
        return value
    if "l" in data:
        return {"l": [_put(data["l"][0], path[1:], value), *data["l"][1:]]}
    return {"d": [[name, _put(inner, path[1:], value) if name == path[0] else inner] for name, inner in data["d"]]}
