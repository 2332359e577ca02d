"""For other methods: the monitors' judgement of runs that were made, and the steps that a recording shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from avow.backend_kit.protocol import Job, Judged, JudgedRun
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import inside
from avow.base.verdict import Counterexample
from avow.formulas.formula import free_variables
from avow.formulas.values import Value
from avow.language.terms import Role

from .coverage import Tally
from .engine import Monitor
from .memory import unmonitored
from .options import Setup, origin, usable
from .pairing import Answers
from .traces import read_trace
from .watched import Fault, Violation

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
        watched = _Steps(replace(found, answers=ARRIVAL, fresh={}, rates={}))
        events = read_trace(path, origin(job.system), watched.monitor.listens)
        yield tuple(step for recorded in events if (step := watched.step(recorded.event)) is not None)


class _Steps:
    """Tells one answer from the next."""

    def __init__(self, used: Setup) -> None:
        self.monitor = Monitor(used, ())
        self.inputs: dict[str, Value] = {}
        self.said: set[str] = set()

    def step(self, event: Mapping[str, Any]) -> Mapping[str, Value] | None:
        """The inputs of the step that begins with this event, where one does."""
        names = {n for n in self.monitor.carried(str(event.get("topic", ""))) if n.startswith("out.")}
        known = {n: v for n, v in self.monitor.values.items() if n.startswith("in.")} if names else {}
        self.monitor.step(event)
        heard = {name: known[name] for name in known.keys() & self.monitor.setup.heard}
        if not names or not (names & self.said or heard != self.inputs):
            self.said |= names
            return None
        self.said, self.inputs = names, heard
        return known


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
