"""Bounds on the probability of failure, by exact binomial statistics (`avow.kernel.rates`)."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from avow.kernel.rates import shows

from .tuning import GRID, RUNS_NEEDED


def upper_bound(failures: int, trials: int, confidence: Fraction) -> Fraction:
    """The one-sided Clopper-Pearson upper bound, rounded up to a multiple of 1 / GRID."""
    found = _least(GRID, lambda n: shows(failures, trials, Fraction(n, GRID), confidence))
    return Fraction(found or GRID, GRID)


def runs_needed(most: Fraction, confidence: Fraction) -> int | None:
    """How many runs without a failure would show that a run fails with probability at most `most`; None: very many."""
    return _least(RUNS_NEEDED, lambda n: shows(0, n, most, confidence))


def _least(most: int, holds: Callable[[int], bool]) -> int | None:
    """The least number from 0 to `most` of which it holds, as of all greater ones; None where there is none."""
    if not holds(most):
        return None
    low, high = -1, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
