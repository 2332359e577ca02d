"""Limits that are the same on every machine: a question has a number of steps, not an amount of time.

Effort is counted, never measured: Z3 counts its own steps (its `rlimit`), and Avow's searches count the items that they
examine, in the same unit. The same question therefore gets the same answer on a slow machine, on a busy one and on a
cluster, and a deadline is a number of steps. A unit of effort is `STEPS` of Z3's steps, which take about a millisecond.
A limit in seconds (`--seconds`, a plan's ``seconds:``) is a thousand units a second.

Clocks are only read to end a call that hangs: one that counts no steps and still does not return.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Iterator

from avow.base.plain import ALLOWS_MORE
from avow.base.tuning.effort import HANGS, HANGS_SECONDS, MOST_STEPS, STEPS

_NO_ANSWER = "no answer with"
NO_ANSWER = f"{_NO_ANSWER} the effort allowed"


class _Spent(threading.local):
    """The steps that this thread has spent so far, and the count at which the effort for all its questions ends."""

    steps: int = 0
    end: float = math.inf


_spent = _Spent()


def spend(steps: int) -> None:
    """Count work of this thread, in Z3's steps: 2,500 take about a millisecond."""
    _spent.steps += steps


def spent() -> float:
    """Units of effort that this thread has spent: for deadlines."""
    return _spent.steps / STEPS


def until(effort: float) -> float:
    """The deadline, as `spent` counts, after so much more effort, or at the end of the budget if that is earlier. Every
    search has its deadline from here: without any budget left, its questions are refused, and it would only count them.
    """
    return min(spent() + effort, _spent.end)


def effort_left(deadline: float) -> int:
    """Whole units of effort before a deadline, never below 0. Half a step is forgiven: fractions of a unit are rounded,
    and the rest must not depend on what this thread had spent before it began."""
    return max(0, math.floor(deadline - spent() + 0.5 / STEPS))


def from_seconds(seconds: float) -> int:
    """The effort for a person's limit in seconds; never 0."""
    return max(1, int(seconds * 1000))


def steps(effort: float) -> int:
    """Z3's limit for so much effort; never 0, which Z3 treats as no limit."""
    return max(1, min(int(effort * STEPS), MOST_STEPS))


def effort_told(effort: float) -> dict[str, object]:
    """For the details of evidence: the steps that a question was allowed, and their unit."""
    return {"budget": {"steps": steps(effort), "of": "Z3's rlimit"}}


def tried(reason: str, effort: int) -> str:
    """The reason why there is no answer, for people; if effort was used up, the number of steps for the whole question,
    and the option that allows more."""
    if effort <= 0 or (reason and not reason.startswith(_NO_ANSWER)):
        return reason or NO_ANSWER
    return f"{_NO_ANSWER} {steps(effort):,} steps of effort, which usually take {effort / 1000:g} s; {ALLOWS_MORE}"


@contextlib.contextmanager
def budget(effort: float) -> Iterator[None]:
    """All questions within the block share this much effort, whatever each may use by itself; a nested block cannot
    extend it."""
    before = _spent.end
    _spent.end = until(effort)
    try:
        yield
    finally:
        _spent.end = before


def allowed(effort: int) -> int:
    """The part of a question's effort that the budget still allows; 0 if nothing is left."""
    if math.isinf(_spent.end):
        return effort
    return min(effort, effort_left(_spent.end))


def net(effort: float) -> int:
    """Milliseconds after which a question of so much effort hangs. Z3 sometimes ignores its own limits (seen: 84 s for
    16 ms)."""
    return int(1000 * HANGS_SECONDS + HANGS * effort)
