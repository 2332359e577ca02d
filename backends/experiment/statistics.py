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
    """The number of runs without a failure that would show a failure probability of at most `most`; None: very many."""
    return _least(RUNS_NEEDED, lambda n: shows(0, n, most, confidence))


def _least(most: int, holds: Callable[[int], bool]) -> int | None:
    """The least number from 0 to `most` for which `holds`, as for all greater ones; None if there is none."""
    if not holds(most):
        return None
    low, high = -1, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
