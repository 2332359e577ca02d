"""What a monitor does with a clause that is judged by the latest values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from avow.formulas.values import Value

from .memory import UNSURE, blamed
from .pairing import time_of
from .watched import Answer, Fault, Violation, Watched

if TYPE_CHECKING:
    from .engine import Monitor


def judge_latest(
    monitor: Monitor, watched: Watched, event: Mapping[str, Any], found: list[Violation], answer: Answer | None
) -> None:
    """Judge a clause at an event; `answer`: the parts of the answer, where they came apart."""
    values, steps, tally = monitor.known(watched, answer), watched.steps, watched.tally
    missing = any(name not in values for name in watched.names)
    supposed = any(name in monitor.supposed for name in watched.names)
    lost = False
    if steps is None:
        if missing:
            tally.early += 1
            return
        key = (*[monitor.versions[n] for n in watched.names], supposed)
        if key != watched.key or watched.held or answer is not None:
            watched.key = key if answer is None else None
            watched.truth = watched.truth_of(values, monitor.solver)
            if not supposed:
                watched.note_trigger(values)
    else:
        if missing and steps.early(watched.names, values):
            if steps.unsaid:
                tally.published -= 1  # what it responds to, which has no value yet, did not come about
            else:
                tally.early += 1
            if steps.answers or steps.stepped:
                monitor.lose(watched)  # a step went by; of inputs alone, the run begins when all have a value
            return
        lost = steps.lost
        steps.comes(time_of(event))
        watched.truth = steps.step(watched, values, monitor.solver, monitor.events, supposed)
    if monitor.so_far is not None:
        monitor.so_far.note(watched)
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
    """A clause does not hold of the latest values, or nobody can tell."""
    tally = watched.tally
    if monitor.doubts is not None and monitor.doubts.ask(monitor, watched, values, event):
        return
    tally.judged += 1
    blame = blamed(watched, monitor.assumptions, values, monitor.solver, monitor.so_far, monitor.events)
    if blame is None:
        tally.undecided += 1
        tally.reason = tally.reason or UNSURE
        return
    tally.broken += 1
    fault, why = blame
    if fault is Fault.EXCUSED:
        tally.excused += 1
    found.append(monitor.violation(fault, watched.clause.name, event, why + late, watched, values))
