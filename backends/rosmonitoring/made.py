"""Runs of messages that were made, not recorded: the monitors' judgement of each, for who makes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from avow.backend_kit.protocol import Job, Judged, JudgedRun
from avow.base.diagnostics import Rejected
from avow.base.verdict import Counterexample

from .coverage import Tally
from .engine import Monitor
from .memory import unmonitored
from .options import Setup, setup
from .pairing import Answers
from .watched import Fault, Violation

ARRIVAL = Answers("arrival", "callbacks run one at a time, and what they publish is known by them")


def judge(job: Job) -> Callable[[Iterable[Mapping[str, Any]]], JudgedRun]:
    """As `Backend.judge`. Which input an answer answered is by arrival, unless the options say otherwise; deadlines of
    the wire (`fresh`, `rate`) are none of a run that was made. Raises Rejected."""
    found, faults = setup(job.system, job.node, job.method.options)
    if faults:
        raise Rejected(*faults)
    used = replace(found, answers=found.answers or ARRIVAL, fresh={}, rates={}, shared={})
    names = [o.name for o in job.obligations]
    unsaid = {name: unmonitored(used, job.node.clause(name)) or "" for name in names}

    def run(events: Iterable[Mapping[str, Any]]) -> JudgedRun:
        monitor = Monitor(used, names)
        seen = [violation for event in events for violation in monitor.step(event)]
        seen += monitor.finish()
        return JudgedRun(
            {name: _judged(monitor, name, seen, unsaid[name] or monitor.backwards) for name in names},
            next((_assumption(used, v) for v in seen if _breaks(used, v)), None),
        )

    return run


def _breaks(found: Setup, violation: Violation) -> bool:
    """Whether an event is none that the contract allows the node's surroundings."""
    inputs = {port.variable.qualified for port in found.node.inputs}
    return violation.fault in (Fault.ASSUMPTION, Fault.PROVIDER) or (
        violation.fault is Fault.MAPPING and violation.clause in inputs
    )


def _assumption(found: Setup, violation: Violation) -> tuple[int, str]:
    return violation.index, f"{violation.clause}: {violation.explanation}"


def _judged(monitor: Monitor, name: str, seen: Iterable[Violation], unsaid: str) -> Judged:
    tally: Tally = monitor.tallies[name]
    outputs = {v for v in _spoken(monitor, name) if v.startswith("out.")}
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


def _spoken(monitor: Monitor, name: str) -> set[str]:
    from avow.formulas.formula import free_variables

    return {v.qualified for v in free_variables(monitor.setup.node.clause(name).formula)}
