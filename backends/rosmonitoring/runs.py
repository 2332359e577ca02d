"""What runs show: recorded ones are evidence. For other methods, runs that were made are judged, and the steps of a
recording told."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from avow import __version__
from avow.backend_kit.given import told
from avow.backend_kit.protocol import Job, Judged, JudgedRun, Limits, Report
from avow.base.codec import to_json
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import inside
from avow.base.tuning.shown import TIMELINES
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.obligation import Obligation
from avow.formulas.formula import free_variables
from avow.formulas.values import Value
from avow.language.subterms import ports_of
from avow.language.terms import Role
from avow.system.graph import dataflow

from .coverage import Tally, coverage, old
from .engine import Monitor
from .lanes import Marks, Signals, signals, timeline
from .memory import unmonitored
from .observing import method_of
from .options import Setup, origin, same_topic, setup, usable
from .overhead import overheads
from .pairing import Answers
from .rml.translate import translate
from .session import Session
from .told import readable
from .traces import Recorded, digest_trace, read_trace
from .tuning import VIOLATIONS_KEPT
from .watched import Fault, Violation


def discharge(job: Job, traces: Sequence[str], limits: Limits) -> Report:
    """As `Backend.discharge`, by these recordings."""
    found, faults = setup(job.system, job.node, job.method.options)
    if faults:
        return Report.alike(job, Verdict.ERROR, told(job, faults), "avow monitor", __version__)
    refused = translate(found, [job.clause(o) for o in job.obligations]).refused
    if not traces:
        outcomes = tuple(_without_trace(job, found, refused, o) for o in job.obligations)
        return Report(outcomes, "avow monitor", __version__)
    deadline = time.monotonic() + limits.seconds
    runs: list[_Run] = []
    for name in traces:
        run = _judge(job, name, [Monitor(found, [o.name for o in job.obligations])], deadline)
        if any(v.fault is Fault.PROVIDER for v in run.first.values()):
            followed = _judge(job, name, _with_upstream(job, found), deadline)
            run = run if followed.unknown or followed.trouble else followed
        _draw(job, run)
        runs.append(run)
    logs = {f"trace-{k}.log": run.log() for k, run in enumerate(runs, start=1)}
    cost, _ = overheads(job)
    outcomes = tuple(_outcome(o.id, o.name, runs, _spoken(job, o), _excuse(job, runs)) for o in job.obligations)
    for obligation, outcome in zip(job.obligations, outcomes, strict=True):
        outcome.details["rml"] = refused.get(obligation.name, "translated")
        if cost:
            outcome.details["overhead"] = cost
        if drawn := _timelines(job, found, runs, obligation):
            outcome.details["timeline"] = drawn
    return Report(outcomes, "avow monitor", __version__, (), logs)


def _without_trace(job: Job, found: Setup, refused: dict[str, str], obligation: Obligation) -> Outcome:
    """A monitor is no evidence before it has watched something."""
    spoken = _spoken(job, obligation)
    hidden = next((reason for name, reason in found.hidden.items() if name in spoken), None)
    if hidden is not None:
        return Outcome(obligation.id, Verdict.UNKNOWN, f"not monitorable: {hidden}")
    reason = refused.get(obligation.name)
    summary = "monitor generated; the plan names no trace to judge"
    if reason is not None:
        summary = f"the plan names no trace to judge; {reason} (our own engine can judge it)"
    return Outcome(obligation.id, Verdict.NOT_RUN, summary, details={"rml": reason or "translated"})


class _Run:
    """What one trace showed."""

    def __init__(self, name: str, monitor: Monitor) -> None:
        self.name = name
        self.monitor = monitor
        self.digest = ""
        self.missing = ""
        """Which package reads it, where there is none."""
        self.trouble = ""
        self.unknown = ""
        self.violations: list[Violation] = []
        self.first: dict[str, Violation] = {}
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


def _with_upstream(job: Job, found: Setup) -> list[Monitor]:
    """The node's own monitor, and those of the nodes from which its data comes: as far as they can be watched."""
    system, names = job.system, dataflow(job.system).upstream(job.node.name)
    monitors = [Monitor(found, None if job.node.name in names else [o.name for o in job.obligations])]
    for name in sorted(names - {job.node.name}):
        node = system.contract.node(name)
        options = method_of(system, name)
        other, faults = setup(system, node, options, found.known)
        if not node.relay and not faults:
            monitors.append(Monitor(other))
    return monitors


def _judge(job: Job, name: str, monitors: Sequence[Monitor], deadline: float) -> _Run:
    """What a trace shows of the first monitor's node."""
    monitor, whole = monitors[0], Session(job.system, tuple(monitors))
    run = _Run(name, monitor)
    path = inside(job.root, name)
    if path is None:
        run.trouble = f"{name} is not in the system's folder"
        return run
    try:
        run.digest = digest_trace(path)
        if wrong := readable(monitor.setup, path, origin(job.system)):
            raise Rejected(*wrong)
        for _, found in whole.judged(path):
            run.note(found)
            if time.monotonic() > deadline:
                run.unknown = f"{name}: time was up after {monitor.events} events"
                break
    except Rejected as error:
        lacking = [d for d in error.diagnostics if d.code == "MON202"]
        run.missing = "; ".join(f"{name}: {d.message}; install it with: {d.hint}" for d in lacking)
        # by the plan's name for it: where the folder lies on this machine is no part of what was found
        told = ((f"{name}, line {d.span.line}" if d.span else name, d.message) for d in error.diagnostics)
        run.trouble = "; ".join(f"{where}: {message.replace(str(path), name)}" for where, message in told)
    except OSError as error:
        run.trouble = f"{name}: {error.strerror or error}"
    return run


def _draw(job: Job, run: _Run) -> None:
    """Read once more what the picture of a run shows."""
    monitor, path = run.monitor, inside(job.root, run.name)
    if monitor.events and path is not None and not run.trouble:
        run.heard = signals([monitor.setup], path, origin(job.system), monitor.events, run.marks, monitor.listens)


def _timelines(job: Job, found: Setup, runs: list[_Run], obligation: Obligation) -> list[dict[str, Any]]:
    """A picture's content for each trace, those with a finding first."""
    clauses = [(found, job.clause(obligation))]
    drawn = [
        timeline(run.name, run.monitor.events, run.heard, run.marks, clauses, lambda node, name: name)
        for run in runs
        if run.heard is not None
    ]
    drawn.sort(key=lambda one: not any(lane.marks for lane in one.lanes))
    return [to_json(one) for one in drawn[:TIMELINES]]


def _excuse(job: Job, runs: list[_Run]) -> str:
    """The first assumption that was broken, by whom, and where that began."""
    wrong = (Fault.ASSUMPTION, Fault.PROVIDER)
    found = ((run.name, v) for run in runs for v in run.first.values() if v.fault in wrong)
    first = min(found, key=lambda one: (one[0], one[1].index), default=None)
    if first is None:
        return "an assumption was broken"
    trace, broken = first
    spoken = {v.name for v in ports_of(job.node.clause(broken.clause).formula)}
    feeding = [e for e in dataflow(job.system).feeding(job.node.name) if e.target.port in spoken]
    late = " one step before" if any(e.delayed for e in feeding) else ""
    who = " and ".join(dict.fromkeys(str(e.source) for e in feeding))
    told = f"by what {who} said{late}" if broken.fault is Fault.PROVIDER else "by the environment"
    about = ", ".join(f"{n} = {v}" for n, v in broken.values)
    why = f"({about}): {broken.cause}" if broken.cause else f"({about})"
    return f"the assumption {broken.clause} was broken {told}, first at event {broken.index} of {trace} {why}"


def _outcome(obligation: str, name: str, runs: list[_Run], names: frozenset[str], excuse: str) -> Outcome:
    """`names`: what the guarantee speaks of; `excuse`: what was broken before it."""
    tallies = [run.monitor.tallies[name] for run in runs]
    judged = sum(t.judged for t in tallies)
    events = sum(run.monitor.events for run in runs)
    published = sum(t.published for t in tallies)
    bound: dict[str, object] = {
        "events": events,
        "judged": judged,
        "published": published,
        "traces": {run.name: run.digest for run in runs},
    }
    ages: dict[str, float] = {}
    for tally in tallies:
        for of, age in tally.ages.items():
            ages[of] = max(age, ages.get(of, 0.0))
    if ages:
        bound["oldest"] = {of: round(age, 6) for of, age in ages.items()}
    passages = [(topic, p) for run in runs for topic, p in run.monitor.passages(names)]
    lost, disordered = sum(p.lost for _, p in passages), sum(p.disordered for _, p in passages)
    uncounted = sorted({f"the messages of {topic} {p.uncounted}" for topic, p in passages if p.uncounted})
    open_ends = sum(t.open for t in tallies)
    bound |= {"open": open_ends} if open_ends else {}
    bound |= {"lost": lost} if not uncounted else {}
    bound |= {"out_of_order": disordered} if disordered else {}
    unpaired = any(t.unpaired for t in tallies)
    backwards = next((f"{run.name}: {run.monitor.backwards}" for run in runs if run.monitor.backwards), "")
    for run in runs:
        broken = run.first.get(f"{Fault.GUARANTEE.name}/{name}")
        if broken is not None:
            when = f" (t = {broken.time})" if broken.time else ""
            told = f"event {broken.index}{when} of {run.name}: {broken.explanation}"
            shown = Counterexample((*broken.bindings, *broken.values), told)
            summary = f"broken at event {broken.index} of {run.name}: {broken.explanation}"
            if unpaired or backwards:
                text = f"{backwards or _UNPAIRED}: {summary}"
                return Outcome(obligation, Verdict.UNKNOWN, text, shown, bound=bound)
            return Outcome(obligation, Verdict.REFUTED, summary, shown, bound=bound)

    def answer(verdict: Verdict, summary: str) -> Outcome:
        return Outcome(obligation, verdict, summary, bound=bound)

    missing = next((run.missing for run in runs if run.missing), "")
    trouble = next((run.trouble for run in runs if run.trouble and not run.missing), "")
    if missing and not trouble:
        return answer(Verdict.NOT_RUN, missing)
    if trouble:
        return answer(Verdict.ERROR, trouble)
    if backwards:
        return answer(Verdict.UNKNOWN, f"no evidence: {backwards}")
    unreadable = next((v for run in runs for v in run.violations if v.fault is Fault.MAPPING), None)
    if unreadable is not None:
        return answer(Verdict.UNKNOWN, f"a message could not be read: {unreadable.text()}")
    late = next((run.unknown for run in runs if run.unknown), "")
    undecided = sum(t.undecided for t in tallies)
    reason = next((t.reason for t in tallies if t.reason), "")
    if late or undecided or (reason and not judged):
        text = late or (f"undecided at {undecided} of {judged} judgements: {reason}" if undecided else reason)
        return answer(Verdict.UNKNOWN, f"not monitorable: {text}" if not undecided and not late else text)
    silent = next(
        (v for run in runs for v in run.first.values() if v.fault in (Fault.SILENT, Fault.RATE) and v.clause in names),
        None,
    )
    if silent is not None:
        return answer(Verdict.UNKNOWN, f"event {silent.index}: {silent.explanation}")
    setup = runs[0].monitor.setup
    if setup.losses is not None and (uncounted or lost > setup.losses):
        return answer(Verdict.UNKNOWN, "; ".join(uncounted) or f"{lost} messages were lost, and {setup.losses} may be")
    aged = next((of for of, age in ages.items() if setup.max_age is not None and age > setup.max_age), None)
    if aged is not None:
        return answer(Verdict.UNKNOWN, f"{aged} was {ages[aged]:.6g} s old when an answer came: too old (`max_age`)")
    if not judged:
        open_ = "; ".join(dict.fromkeys(t.reason for t in tallies if t.reason))
        text = f"the traces never gave all the values that it speaks of{_topics(runs)}"
        return answer(Verdict.UNKNOWN, f"never decided: {open_}" if open_ else text)
    decided = sum(t.decided for t in tallies)
    lacking = "; ".join(dict.fromkeys(coverage(t) for t in tallies))
    asked = sum(t.asked for t in tallies)
    if decided < runs[0].monitor.setup.decided * asked:
        open_ = "; ".join(dict.fromkeys(t.reason for t in tallies if t.reason))
        text = f"unmonitored: {decided} of {asked} publications were decided ({lacking})"
        return answer(Verdict.UNKNOWN, f"{text}: {open_}" if open_ else text)
    if unpaired:
        return answer(Verdict.UNKNOWN, f"{_UNPAIRED}: held at all {judged} judgements over {events} events")
    excused = sum(t.excused for t in tallies)
    if excused == judged:
        return answer(Verdict.UNKNOWN, f"every judgement fell while an assumption was broken: {excuse}")
    summary = f"held at all {judged} judgements over {events} events"
    if excused:
        summary = f"held at {judged - excused} of {judged} judgements; at the others {excuse}"
    if ages:
        summary += f"; {old(ages)}"
    if lost or disordered:
        summary += f"; {lost} messages lost, {disordered} out of order"
    if decided < published:
        summary += f" ({lacking})"
    if open_ends:
        summary += f"; what it demands was open at the end of {open_ends} of {len(runs)} traces"
    vacuous = not any(t.triggered for t in tallies)
    if vacuous:
        summary += "; but its antecedent was never met"
    return Outcome(obligation, Verdict.MONITORED, summary, bound=bound, vacuous=vacuous)


def _topics(runs: list[_Run]) -> str:
    """What the traces lack, and what they have."""
    monitors = [run.monitor for run in runs]
    silent = sorted({t for monitor in monitors for t in monitor.setup.topics if same_topic(t) not in monitor.heard})
    heard = sorted({topic for run in runs for topic in run.monitor.heard})
    if not silent:
        return ""
    return f": no message on {', '.join(silent)}; the traces have {', '.join(heard[:12]) or 'no topic'}"


def _spoken(job: Job, obligation: Obligation) -> frozenset[str]:

    return frozenset(v.qualified for v in free_variables(job.clause(obligation).formula))


_UNPAIRED = "no evidence, since the plan does not say which input an answer answered (`answers`)"


ARRIVAL = Answers("arrival", "callbacks run one at a time, and what they publish is known by them")


def judge(job: Job) -> Callable[[Iterable[Mapping[str, Any]]], JudgedRun]:
    """As `Backend.judge`. Which input an answer answered is by arrival, unless the options say otherwise; deadlines of
    the wire (`fresh`, `rate`) are none of a run that was made. Raises Rejected."""
    found = usable(job.system, job.node, job.method.options)
    used = replace(found, answers=found.answers or ARRIVAL, fresh={}, rates={}, shared={})
    names = [o.name for o in job.obligations]
    unsaid = {name: unmonitored(used, job.node.clause(name)) or "" for name in names}

    def run(events: Iterable[Mapping[str, Any]]) -> JudgedRun:
        monitor = Monitor(used, names)
        seen = [violation for event in events for violation in monitor.step(event)]
        seen += monitor.finish()
        return JudgedRun(
            {name: _judged(monitor, name, seen, unsaid[name] or monitor.backwards) for name in names},
            next(((v.index, f"{v.clause}: {v.explanation}") for v in seen if _breaks(used, v)), None),
        )

    return run


def steps(job: Job, traces: Iterable[str]) -> Iterator[tuple[Mapping[str, Value], ...]]:
    """As `Backend.steps`. A step begins with an output that its answer has not had yet, or that inputs have changed
    before."""
    found = usable(job.system, job.node, job.method.options)
    for name in traces:
        path = inside(job.root, name)
        if path is None:
            raise Rejected(Diagnostic("MON102", f"traces: {name!r} is outside the system's folder"))
        monitor = Monitor(replace(found, answers=ARRIVAL, fresh={}, rates={}), ())
        yield tuple(_steps(monitor, read_trace(path, origin(job.system), monitor.listens)))


def _steps(monitor: Monitor, events: Iterable[Recorded]) -> Iterator[Mapping[str, Value]]:
    """The inputs of each step."""
    inputs: dict[str, Value] = {}
    said: set[str] = set()
    for recorded in events:
        names = {n for n in monitor.carried(str(recorded.event.get("topic", ""))) if n.startswith("out.")}
        known = {n: v for n, v in monitor.values.items() if n.startswith("in.")} if names else {}
        monitor.step(recorded.event)
        heard = {name: known[name] for name in known.keys() & monitor.setup.heard}
        if names and (names & said or heard != inputs):
            said, inputs = names, heard
            yield known
        else:
            said |= names


def _breaks(found: Setup, violation: Violation) -> bool:
    """Whether an event is none that the contract allows the node's surroundings."""
    inputs = {port.variable.qualified for port in found.node.inputs}
    return violation.fault in (Fault.ASSUMPTION, Fault.PROVIDER) or (
        violation.fault is Fault.MAPPING and violation.clause in inputs
    )


def _judged(monitor: Monitor, name: str, seen: Iterable[Violation], unsaid: str) -> Judged:
    tally: Tally = monitor.tallies[name]
    spoken = free_variables(monitor.setup.node.clause(name).formula)
    outputs = {v.qualified for v in spoken if v.role is Role.OUTPUT}
    first = next(
        (
            v
            for v in seen
            if (v.fault is Fault.GUARANTEE and v.clause == name) or (v.fault is Fault.MAPPING and v.clause in outputs)
        ),
        None,
    )
    shown = None
    if first is not None:
        about = (*first.bindings, *first.values)
        why = first.explanation if first.fault is Fault.GUARANTEE else f"{first.clause}: {first.explanation}"
        shown = Counterexample(about, why)
    lost = tally.order + tally.partial + tally.forgotten + tally.nameless
    return Judged(
        tally.decided - tally.broken,
        tally.broken - tally.excused,
        tally.excused,
        tally.undecided + lost,
        tally.triggered,
        shown,
        first.index if first is not None else 0,
        unsaid or tally.reason,
    )
