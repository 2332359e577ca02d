"""The verdict on a guarantee by recorded runs: an ordered table of rules, of which the first that applies decides."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import or_

from avow.base.verdict import Counterexample, Outcome, Verdict

from .answers import passages, unheard
from .engine import Monitor
from .lanes import Marks, Signals
from .options import same_topic
from .tuning import VIOLATIONS_KEPT
from .watched import Fault, Violation, coverage, old, remedies, silent_topic, too_old


class Run:
    """The result of one recording."""

    def __init__(self, name: str, monitor: Monitor) -> None:
        self.name = name
        self.monitor = monitor
        self.digest = ""
        self.missing = ""
        """The package that would read it, if that is not installed."""
        self.trouble = ""
        self.unknown = ""
        self.violations: list[Violation] = []
        self.first: dict[str, Violation] = {}
        """The first violation of each fault and clause."""
        self.marks = Marks()
        self.heard: Signals | None = None

    def note(self, violations: Iterable[Violation]) -> None:
        for violation in violations:
            if violation.node != self.monitor.setup.node.name:
                continue
            self.marks.note(violation)
            self.first.setdefault(f"{violation.fault.name}/{violation.clause}", violation)
            if len(self.violations) < VIOLATIONS_KEPT:
                self.violations.append(violation)

    def log(self) -> str:
        lines = [f"trace {self.name}: {self.monitor.events} events, {self.monitor.relevant} of this node's topics"]
        lines.append(f"sha256 {self.digest}")
        lines += [line for line in (self.trouble, self.unknown) if line]
        lines += [v.text() for v in self.violations]
        for name, tally in self.monitor.tallies.items():
            lines.append(f"{name}: {coverage(tally)}")
        return "\n".join(lines) + "\n"


class Shown:
    """The facts about one guarantee over all runs. `names`: the variables that it speaks of; `excuse`: the assumption
    that was broken first."""

    def __init__(self, name: str, runs: list[Run], names: frozenset[str], excuse: str) -> None:
        self.name, self.runs, self.names, self.excuse = name, runs, names, excuse
        self.setup = runs[0].monitor.setup
        self.tallies = tallies = [run.monitor.tallies[name] for run in runs]
        self.events = sum(run.monitor.events for run in runs)
        self.judged = sum(t.judged for t in tallies)
        self.decided = sum(t.decided for t in tallies)
        self.undecided = sum(t.undecided for t in tallies)
        self.published = sum(t.published for t in tallies)
        self.unanswered = sum(t.unanswered for t in tallies)
        self.asked = sum(t.asked for t in tallies)
        self.excused = sum(t.excused for t in tallies)
        self.open_ends = sum(t.open for t in tallies)
        self.unpaired = any(t.unpaired for t in tallies)
        self.vacuous = not replace(tallies[0], met=reduce(or_, (t.met for t in tallies))).triggered
        self.reasons = list(dict.fromkeys(t.reason for t in tallies if t.reason))
        self.ages: dict[str, float] = {}
        for of, age in (each for t in tallies for each in t.ages.items()):
            self.ages[of] = max(age, self.ages.get(of, 0.0))
        found = [(topic, p) for run in runs for topic, p in passages(run.monitor, names)]
        self.lost, self.disordered = sum(p.lost for _, p in found), sum(p.disordered for _, p in found)
        self.uncounted = sorted({f"the messages of {topic} {p.uncounted}" for topic, p in found if p.uncounted})
        self.unheard = next(filter(None, (unheard(run.monitor, name) for run in runs)), "")
        self.backwards = next((f"{run.name}: {run.monitor.backwards}" for run in runs if run.monitor.backwards), "")
        self.late = next((run.unknown for run in runs if run.unknown), "")

    @cached_property
    def lacking(self) -> str:
        return "; ".join(dict.fromkeys(coverage(t) for t in self.tallies))

    @property
    def wanted(self) -> str:
        each = ((run.monitor.tallies[self.name], run.monitor) for run in self.runs)
        found = (remedies(tally, monitor.silent, monitor.unread) for tally, monitor in each)
        return "; ".join(dict.fromkeys(filter(None, found)))

    @property
    def held(self) -> str:
        return f"held at all {self.judged} judgements over {self.events} events"

    @property
    def bound(self) -> dict[str, object]:
        """The bounds of the evidence."""
        found: dict[str, object] = {
            "events": self.events,
            "judged": self.judged,
            "published": self.published,
            "traces": {run.name: run.digest for run in self.runs},
        }
        found |= {"oldest": {of: round(age, 6) for of, age in self.ages.items()}} if self.ages else {}
        found |= {"open": self.open_ends} if self.open_ends else {}
        found |= {"unanswered": self.unanswered} if self.unanswered else {}
        found |= {} if self.uncounted else {"lost": self.lost}
        return found | ({"out_of_order": self.disordered} if self.disordered else {})


@dataclass(frozen=True, slots=True)
class Answer:
    verdict: Verdict
    summary: str
    shown: Counterexample | None = None


UNPAIRED = "no evidence, since the plan does not say which input an answer answered (`answers`)"


def _broken(s: Shown) -> Answer | None:
    found = ((run, run.first.get(f"{Fault.GUARANTEE.name}/{s.name}")) for run in s.runs)
    run, broken = next(((run, v) for run, v in found if v is not None), (None, None))
    if run is None or broken is None:
        return None
    when = f" (t = {broken.time})" if broken.time else ""
    about = f"event {broken.index}{when} of {run.name}: {broken.explanation}"
    shown = Counterexample((*broken.bindings, *broken.values), about)
    summary = f"broken at event {broken.index} of {run.name}: {broken.explanation}"
    if s.unpaired or s.backwards:  # it is unknown what the answer answered
        return Answer(Verdict.UNKNOWN, f"{s.backwards or UNPAIRED}: {summary}", shown)
    return Answer(Verdict.REFUTED, summary, shown)


def _unread(s: Shown) -> Answer | None:
    trouble = next((run.trouble for run in s.runs if run.trouble and not run.missing), "")
    missing = next((run.missing for run in s.runs if run.missing), "")
    if trouble:
        return Answer(Verdict.ERROR, trouble)
    return Answer(Verdict.NOT_RUN, missing) if missing else None


def _backwards(s: Shown) -> Answer | None:
    return Answer(Verdict.UNKNOWN, f"no evidence: {s.backwards}") if s.backwards else None


def _unreadable(s: Shown) -> Answer | None:
    found = next((v for run in s.runs for v in run.violations if v.fault is Fault.MAPPING), None)
    return Answer(Verdict.UNKNOWN, f"a message could not be read: {found.text()}") if found is not None else None


def _undecided(s: Shown) -> Answer | None:
    reason = s.reasons[0] if s.reasons else ""
    if s.late or s.undecided:
        return Answer(Verdict.UNKNOWN, s.late or f"undecided at {s.undecided} of {s.judged} judgements: {reason}")
    return Answer(Verdict.UNKNOWN, f"not monitorable: {reason}") if reason and not s.judged else None


def _silent(s: Shown) -> Answer | None:
    wrong = (Fault.SILENT, Fault.RATE)
    found = (v for run in s.runs for v in run.first.values() if v.fault in wrong and v.clause in s.names)
    first = next(found, None)
    return Answer(Verdict.UNKNOWN, f"event {first.index}: {first.explanation}") if first is not None else None


def _lost(s: Shown) -> Answer | None:
    if s.unheard:
        return Answer(Verdict.UNKNOWN, s.unheard)
    allowed = s.setup.losses
    if allowed is None or not (s.uncounted or s.lost > allowed):
        return None
    return Answer(Verdict.UNKNOWN, "; ".join(s.uncounted) or f"{s.lost} messages were lost, and {allowed} may be")


def _aged(s: Shown) -> Answer | None:
    aged = too_old(s.ages, s.setup.max_age)
    return Answer(Verdict.UNKNOWN, aged) if aged else None


def _never(s: Shown) -> Answer | None:
    if s.judged:
        return None
    monitors = [run.monitor for run in s.runs]
    silent = sorted({topic for monitor in monitors for topic in monitor.silent.values()})
    heard = sorted({topic for monitor in monitors for topic in monitor.heard})
    gone = "; ".join(silent_topic(topic, {*heard} - {same_topic(name) for name in s.setup.topics}) for topic in silent)
    topics = f": {gone}; the traces have {', '.join(heard[:12]) or 'no topic'}"
    return Answer(Verdict.UNKNOWN, f"the traces never gave all the values that it speaks of{topics if silent else ''}")


def _unmonitored(s: Shown) -> Answer | None:
    if s.decided >= s.setup.decided * s.asked:
        return None
    text = f"unmonitored: {s.decided} of {s.asked} publications were decided"
    # the remedy comes early, since a next step clips the text
    return Answer(Verdict.UNKNOWN, "; ".join(filter(None, (text, s.wanted, s.lacking, *s.reasons))))


def _unpaired(s: Shown) -> Answer | None:
    return Answer(Verdict.UNKNOWN, f"{UNPAIRED}: {s.held}") if s.unpaired else None


def _excused(s: Shown) -> Answer | None:
    text = f"every judgement fell while an assumption was broken: {s.excuse}"
    return Answer(Verdict.UNKNOWN, text) if s.excused == s.judged else None


def _monitored(s: Shown) -> Answer:
    held = f"held at {s.judged - s.excused} of {s.judged} judgements; at the others {s.excuse}"
    parts = (
        (s.ages, f"; {old(s.ages)}"),
        (s.lost or s.disordered, f"; {s.lost} messages lost, {s.disordered} out of order"),
        (s.decided < s.asked or s.decided < s.published, f" ({s.lacking})"),
        (s.unanswered, f"; {s.unanswered} inputs without an answer"),
        (s.open_ends, f"; what it demands was open at the end of {s.open_ends} of {len(s.runs)} traces"),
        (s.vacuous, "; but a condition of it was never met"),
        (s.vacuous and s.wanted, f" by an answer that was decided: {s.wanted}"),
    )
    text = (held if s.excused else s.held) + "".join(text for applies, text in parts if applies)
    return Answer(Verdict.MONITORED, text)


RULES: tuple[Callable[[Shown], Answer | None], ...] = (
    _broken, _unread, _backwards, _unreadable, _undecided, _silent, _lost, _aged, _never, _unmonitored, _unpaired,
    _excused, _monitored,
)  # fmt: skip
"""A breach counts whatever else is wrong with the recordings."""


def outcome(obligation: str, shown: Shown) -> Outcome:
    answer = next(found for rule in RULES if (found := rule(shown)) is not None)
    vacuous = answer.verdict is Verdict.MONITORED and shown.vacuous
    made = Outcome(obligation, answer.verdict, answer.summary, answer.shown, bound=shown.bound, vacuous=vacuous)
    return replace(made, rests_on=shown.setup.box.hypotheses(shown.setup.node.name))
