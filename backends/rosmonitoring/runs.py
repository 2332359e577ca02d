"""The results of runs: recorded runs are evidence; for other methods, generated runs are judged, and the steps of a
recording extracted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow import __version__
from avow.backend_kit.given import summarized
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
from avow.ros.bags import digest_trace
from avow.system.graph import dataflow

from .engine import Monitor
from .further import contradictions
from .judged import Judgement, ReportingMonitor
from .lanes import signals, timeline
from .memory import unmonitored
from .notes import readable
from .observing import method_of, outside
from .options import Setup, origin, setup, usable
from .overhead import overheads
from .pairing import Answers
from .rml.translate import translate
from .session import Session
from .traces import Recorded, read_trace, transforms
from .verdicts import Run, Shown, outcome
from .watched import Fault, Tally, Violation


def discharge(job: Job, traces: Mapping[str, str], limits: Limits) -> Report:
    """As `Backend.discharge`, with these recordings."""
    found, faults = setup(job.system, job.node, job.method.options)
    if faults:
        return Report.alike(job, Verdict.ERROR, summarized(job, faults), "avow monitor", __version__)
    refused = translate(found, [job.clause(o) for o in job.obligations]).refused
    if not traces:
        outcomes = tuple(_without_trace(job, found, refused, o) for o in job.obligations)
        return Report(outcomes, "avow monitor", __version__)
    deadline = time.process_time() + limits.seconds  # the machine's load is no part of the verdict
    runs: list[Run] = []
    for name, digest in traces.items():
        run = _judge(job, name, [Monitor(found, [o.name for o in job.obligations])], deadline)
        if digest and not run.digest:
            run.missing = f"the recording {name} (SHA-256 {digest}) is not here: fetch it first, also in CI"
        elif digest and run.digest != digest:
            run.trouble = f"{name} is not the recording that the plan names: its digest is {run.digest}"
        if any(v.fault is Fault.PROVIDER for v in run.first.values()):
            followed = _judge(job, name, _with_upstream(job, found), deadline)
            run = run if followed.unknown or followed.trouble else followed
        _draw(job, run)
        runs.append(run)
    logs = {f"trace-{k}.log": run.log() for k, run in enumerate(runs, start=1)}
    cost, _ = overheads(job)
    excuse = _excuse(job, runs)
    outcomes = tuple(outcome(o.id, Shown(o.name, runs, _spoken(job, o), excuse)) for o in job.obligations)
    whole = [run.name for run in runs if run.monitor.events and not (run.trouble or run.missing or run.unknown)]
    beyond, doubts, late = contradictions(job, whole, limits.seconds)
    told: dict[str, Any] = {"verdict": Verdict.UNKNOWN, "summary": late} if late else {"hypotheses": doubts}
    outcomes = tuple(replace(o, **told) if o.verdict.supports else o for o in outcomes)
    aside = [f"{n}: outside of {key} on purpose: {why}" for n in traces for key, why in _outside(job, n).items()]
    outcomes = tuple(replace(o, summary="; ".join((o.summary, *aside))) for o in outcomes)
    for obligation, each in zip(job.obligations, outcomes, strict=True):
        each.details["rml"] = refused.get(obligation.name, "translated")
        if cost:
            each.details["overhead"] = cost
        if drawn := _timelines(job, found, runs, obligation):
            each.details["timeline"] = drawn
    return Report(outcomes, "avow monitor", __version__, (), logs, contradicted=beyond)


def _outside(job: Job, recording: str) -> Mapping[str, str]:
    return outside(job.method.options, recording)


def _without_trace(job: Job, found: Setup, refused: dict[str, str], obligation: Obligation) -> Outcome:
    """The outcome without a trace: a monitor is no evidence before it has judged one."""
    spoken = _spoken(job, obligation)
    hidden = next((reason for name, reason in found.hidden.items() if name in spoken), None)
    if hidden is not None:
        return Outcome(obligation.id, Verdict.UNKNOWN, f"not monitorable: {hidden}")
    reason = refused.get(obligation.name)
    summary = "monitor generated; the plan names no trace to judge"
    if reason is not None:
        summary = f"the plan names no trace to judge; {reason} (our own engine can judge it)"
    return Outcome(obligation.id, Verdict.NOT_RUN, summary, details={"rml": reason or "translated"})


def _with_upstream(job: Job, found: Setup) -> list[Monitor]:
    """The node's own monitor, and those of the nodes from which its data comes, if they can be watched."""
    system, names = job.system, dataflow(job.system).upstream(job.node.name)
    monitors = [Monitor(found, None if job.node.name in names else [o.name for o in job.obligations])]
    for name in sorted(names - {job.node.name}):
        node = system.contract.node(name)
        other, faults = setup(system, node, method_of(system, name), found.known)
        if not node.relay and not faults:
            monitors.append(Monitor(other))
    return monitors


def _judge(job: Job, name: str, monitors: Sequence[Monitor], deadline: float) -> Run:
    """Judge a trace for the first monitor's node."""
    monitor, whole = monitors[0], Session(job.system, tuple(monitors))
    run = Run(name, monitor)
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
            if time.process_time() > deadline:
                run.unknown = f"{name}: time was up after {monitor.events} events"
                break
    except Rejected as error:
        # named as in the plan: the folder's location on this machine is no part of the result
        told = ((f"{name}, line {d.span.line}" if d.span else name, d.message) for d in error.diagnostics)
        run.trouble = "; ".join(f"{where}: {message.replace(str(path), name)}" for where, message in told)
    except OSError as error:
        run.trouble = f"{name}: {error.strerror or error}"
    return run


def _draw(job: Job, run: Run) -> None:
    """Read the trace once more, for the picture of a run."""
    monitor, path = run.monitor, inside(job.root, run.name)
    if monitor.events and path is not None and not run.trouble:
        run.heard = signals([monitor.setup], path, origin(job.system), monitor.events, run.marks, monitor.listens)


def _timelines(job: Job, found: Setup, runs: list[Run], obligation: Obligation) -> list[dict[str, Any]]:
    """A picture's content for each trace, those with a finding first."""
    clauses = [(found, job.clause(obligation))]
    drawn = [
        timeline(run.name, run.monitor.events, run.heard, run.marks, clauses, lambda node, name: name)
        for run in runs
        if run.heard is not None
    ]
    drawn.sort(key=lambda one: not any(lane.marks for lane in one.lanes))
    return [to_json(one) for one in drawn[:TIMELINES]]


def _excuse(job: Job, runs: list[Run]) -> str:
    """The first assumption that was broken, by which node, and where that began."""
    wrong = (Fault.ASSUMPTION, Fault.PROVIDER)
    found = ((run.name, v) for run in runs for v in run.first.values() if v.fault in wrong)
    first = min(found, key=lambda one: (one[0], one[1].index), default=None)
    if first is None:
        return "an assumption was broken"
    trace, broken = first
    spoken = {v.name for v in ports_of(runs[0].monitor.setup.node.clause(broken.clause).formula)}
    feeding = [e for e in dataflow(job.system).feeding(job.node.name) if e.target.port in spoken]
    late = " one step before" if any(e.delayed for e in feeding) else ""
    who = " and ".join(dict.fromkeys(str(e.source) for e in feeding))
    told = f"by a message of {who}{late}" if broken.fault is Fault.PROVIDER else "by the environment"
    about = ", ".join(f"{n} = {v}" for n, v in broken.values)
    why = f"({about}): {broken.cause}" if broken.cause else f"({about})"
    return f"the assumption {broken.clause} was broken {told}, first at event {broken.index} of {trace} {why}"


def _spoken(job: Job, obligation: Obligation) -> frozenset[str]:
    return frozenset(v.qualified for v in free_variables(job.clause(obligation).formula))


ARRIVAL = Answers("arrival", "callbacks run one at a time, and what they publish is known by them")


def judge(job: Job) -> Callable[[Iterable[Mapping[str, Any]] | Path], JudgedRun]:
    """As `Backend.judge`. In a generated run, answers are paired with inputs by arrival, unless the options say
    otherwise, and deadlines of the wire (`fresh`, `rate`) do not apply. Raises Rejected."""
    found = usable(job.system, job.node, job.method.options)
    used = replace(found, answers=found.answers or ARRIVAL, fresh={}, rates={}, shared={}, placed="")
    names = [o.name for o in job.obligations]
    unsaid = {name: unmonitored(used, job.node.clause(name)) or "" for name in names}

    def run(events: Iterable[Mapping[str, Any]] | Path) -> JudgedRun:
        if isinstance(events, Path):
            return _of_recording(job, found, events.relative_to(job.root.resolve()).as_posix())
        monitor = Monitor(used, names)
        seen = [violation for event in events for violation in monitor.step(event)]
        seen += monitor.finish()
        return JudgedRun(
            {name: _judged(monitor, name, seen, unsaid[name] or monitor.backwards) for name in names},
            next(((v.index, f"{v.clause}: {v.explanation}") for v in seen if _breaks(used, v)), None),
        )

    return run


_SILENT = "the last inputs met a condition and had no answer: let the run go on until the node has answered"


def _of_recording(job: Job, found: Setup, name: str) -> JudgedRun:
    """Each guarantee as if the recording were its only evidence."""
    monitor, distances = ReportingMonitor(found, [o.name for o in job.obligations]), dict[str, float]()

    def note(one: Judgement) -> None:
        if one.margin is not None and one.verdict in ("held", "broken"):
            distances[one.clause] = min(one.margin, distances.get(one.clause, one.margin))

    monitor.report = note
    run = _judge(job, name, [monitor], math.inf)
    clauses, excuse = {}, _excuse(job, [run])
    for o in job.obligations:
        shown = Shown(o.name, [run], _spoken(job, o), excuse)
        answer, tally, distance = outcome(o.id, shown), monitor.tallies[o.name], distances.get(o.name)
        broken, held = answer.verdict is Verdict.REFUTED, answer.verdict is Verdict.MONITORED
        silent = not broken and bool(tally.left & ~tally.met)
        clauses[o.name] = Judged(
            shown.decided - tally.broken, int(broken), tally.excused, int(silent or not (broken or held)), _met(tally),
            answer.counterexample, 0, _SILENT if silent else answer.summary, tally.open > 0, distance,
        )  # fmt: skip
    broke = next((v for v in run.first.values() if _breaks(found, v)), None)
    unseen = tuple(c.name for c in job.node.assumptions if not monitor.tallies[c.name].judged)
    return JudgedRun(clauses, None if broke is None else (broke.index, f"{broke.clause}: {broke.explanation}"), unseen)


def steps(job: Job, traces: Iterable[str]) -> Iterator[tuple[Mapping[str, Value], ...]]:
    """As `Backend.steps`. A step begins with an output that its answer has not had yet, or with an output after the
    inputs changed. Raises Rejected."""
    found = usable(job.system, job.node, job.method.options)
    for name in traces:
        path = inside(job.root, name)
        if path is None:
            raise Rejected(Diagnostic("MON102", f"traces: {name!r} is outside the system's folder"))
        monitor = Monitor(replace(found, answers=ARRIVAL, fresh={}, rates={}), ())
        if monitor.tree is not None:
            monitor.tree.fill(transforms(path, origin(job.system)))
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
    """Whether an event is one that the contract does not allow the node's environment."""
    inputs = {port.variable.qualified for port in found.node.inputs}
    return violation.fault in (Fault.ASSUMPTION, Fault.PROVIDER) or (
        violation.fault is Fault.MAPPING and violation.clause in inputs
    )


def _judged(monitor: Monitor, name: str, seen: Iterable[Violation], unsaid: str) -> Judged:
    tally: Tally = monitor.tallies[name]
    outputs = {v.qualified for v in free_variables(monitor.setup.node.clause(name).formula) if v.role is Role.OUTPUT}
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
    event, reason = first.index if first is not None else 0, unsaid or tally.reason
    held, broken, undecided = tally.decided - tally.broken, tally.broken - tally.excused, tally.undecided + lost
    return Judged(held, broken, tally.excused, undecided, _met(tally), shown, event, reason)


def _met(tally: Tally) -> tuple[bool, ...]:
    return tuple(bool(tally.met >> k & 1) for k in range(tally.conditions))
