"""Limits that no machine changes: a question gets so many steps, not so much time.

Effort is counted, never measured: Z3 counts its own steps (its `rlimit`), and Avow's searches count what they look at,
in the same unit. So the same question gets the same answer on a slow machine, on a busy one and on a cluster, and a
deadline is a number of steps. A unit of effort is `STEPS` of Z3's steps, which take about a millisecond. What a person
writes in seconds (`--seconds`, a plan's ``seconds:``) is a thousand units a second.

Clocks are only read to end what hangs: what counts no steps and still does not return.
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
    """What this thread has spent so far, in steps, and when the effort of all its questions together is used up."""

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
    """When so much effort more is used up, or the budget before it: a deadline, as `spent` counts. Every search has its
    deadline from here: with nothing left of the budget, its questions are refused, and it would only write them down.
    """
    return min(spent() + effort, _spent.end)


def effort_left(deadline: float) -> int:
    """Whole units of effort before a deadline, never below 0. Half a step is forgiven: fractions of a unit are rounded,
    and what is left must not hang on what this thread had spent before it began."""
    return max(0, math.floor(deadline - spent() + 0.5 / STEPS))


def from_seconds(seconds: float) -> int:
    """The effort that a person's limit in seconds stands for; never 0."""
    return max(1, int(seconds * 1000))


def steps(effort: float) -> int:
    """Z3's limit for so much effort; never 0, which it takes for no limit at all."""
    return max(1, min(int(effort * STEPS), MOST_STEPS))


def effort_told(effort: float) -> dict[str, object]:
    """For the details of evidence: the steps that a question was allowed, and whose they are."""
    return {"budget": {"steps": steps(effort), "of": "Z3's rlimit"}}


def tried(reason: str, effort: int) -> str:
    """Why there is no answer, for people; where effort was used up, how many steps of it the whole question had, and
    what allows more."""
    if effort <= 0 or (reason and not reason.startswith(_NO_ANSWER)):
        return reason or NO_ANSWER
    return f"{_NO_ANSWER} {steps(effort):,} steps of effort, which usually take {effort / 1000:g} s; {ALLOWS_MORE}"


@contextlib.contextmanager
def budget(effort: float) -> Iterator[None]:
    """All questions asked within the block share this much effort, however much each may take by itself; a block within
    a block cannot extend it."""
    before = _spent.end
    _spent.end = until(effort)
    try:
        yield
    finally:
        _spent.end = before


def allowed(effort: int) -> int:
    """What is left of a question's effort within the budget; 0 if nothing is."""
    if math.isinf(_spent.end):
        return effort
    return min(effort, effort_left(_spent.end))


def net(effort: float) -> int:
    """Milliseconds after which a question of so much effort hangs. Z3 sometimes misses its own limits altogether (seen:
    84 s for 16 ms)."""
    return int(1000 * HANGS_SECONDS + HANGS * effort)
