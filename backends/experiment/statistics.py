"""What n runs justify, computed exactly or rounded so that the claim is never made stronger than the data allow.

Sources: C. J. Clopper and E. S. Pearson, "The use of confidence or fiducial limits illustrated in the case of the
binomial" (1934), for the bounds; the least standard deviation is elementary (see `least_deviation`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from math import isqrt

from avow.base.records import dataclass

from .tuning import HALVINGS

_DIGITS = Context(prec=80, Emin=-(10**15), Emax=10**15)
_SLACK = Decimal(10) ** -40
"""Far above the rounding of 80 digits over any number of runs that is accepted, far below anything that matters."""


def tail(failures: int, runs: int, probability: Fraction) -> Decimal:
    """P(X <= failures) for X binomial(runs, probability), to at least 40 digits, never too small."""
    if failures >= runs or probability <= 0:
        return Decimal(1)
    if probability >= 1:
        return Decimal(0)
    with localcontext(_DIGITS):
        p = Decimal(probability.numerator) / Decimal(probability.denominator)
        odds = p / (1 - p)
        term = (1 - p) ** runs
        total = term
        for k in range(failures):
            term = term * (runs - k) / (k + 1) * odds
            total += term
        return total * (1 + _SLACK)


def justified(failures: int, runs: int, most: Fraction, confidence: Fraction) -> bool:
    """Whether the data show, at that confidence, that a run fails with probability at most `most`."""
    with localcontext(_DIGITS):
        alpha = Decimal((1 - confidence).numerator) / Decimal((1 - confidence).denominator)
        return tail(failures, runs, most) <= alpha


def upper_bound(failures: int, runs: int, confidence: Fraction) -> Fraction:
    """The one-sided Clopper-Pearson upper bound on the probability of failure, rounded up."""
    if failures >= runs:
        return Fraction(1)
    low, high = Fraction(failures, runs), Fraction(1)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if justified(failures, runs, middle, confidence):
            high = middle
        else:
            low = middle
    return high


def lower_bound(failures: int, runs: int, confidence: Fraction) -> Fraction:
    """The one-sided Clopper-Pearson lower bound on the probability of failure, rounded down."""
    return 1 - upper_bound(runs - failures, runs, confidence) if failures else Fraction(0)


def runs_needed(most: Fraction, confidence: Fraction) -> int | None:
    """How many runs without a failure would justify "fails with probability at most `most`"; None: more than 10^6."""
    low, high = 0, 1
    while not justified(0, high, most, confidence):
        low, high = high, high * 2
        if high > 1_000_000:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        if justified(0, middle, most, confidence):
            high = middle
        else:
            low = middle
    return high


@dataclass(frozen=True, slots=True)
class Range:
    """All that a rounded figure may stand for, both ends included."""

    low: Fraction
    high: Fraction


def least_deviation(runs: int, mean: Range, least: Range, greatest: Range) -> Fraction:
    """The least sum of squared deviations that `runs` numbers with such a mean, minimum and maximum can have.

    One number is the minimum, one the maximum; the others spread least where all are equal, and the mean then says
    where. What is left is a convex quadratic over a box, at its least on one of the box's faces: all are tried,
    exactly. Divide by n (population) or n - 1 (sample) for the variance.
    """
    box = (least, greatest, mean)
    best: Fraction | None = None
    for choice in itertools.product(("low", "high", "free"), repeat=3):
        fixed = {i: getattr(box[i], side) for i, side in enumerate(choice) if side != "free"}
        point = _stationary(runs, fixed)
        if point is None or not all(r.low <= v <= r.high for r, v in zip(box, point, strict=True)):
            continue
        value = _squares(runs, *point)
        best = value if best is None else min(best, value)
    assert best is not None  # the corners alone are 8 candidates
    return best


def greatest_deviation(runs: int, mean: Range, least: Range, greatest: Range) -> Fraction:
    """An upper bound on the sum of squared deviations: n (max - mean) (mean - min) (Bhatia and Davis, 2000)."""
    a, b = least.low, greatest.high
    middle = min(max((a + b) / 2, mean.low), mean.high)
    return runs * max(b - middle, Fraction(0)) * max(middle - a, Fraction(0))


def root(value: Fraction) -> tuple[Fraction, Fraction]:
    """Bounds of the square root, equal where it is a short decimal or a ratio of squares. Raises ValueError below 0."""
    if value < 0:
        raise ValueError("the square root of a negative number")
    top, bottom = isqrt(value.numerator), isqrt(value.denominator)
    if top * top == value.numerator and bottom * bottom == value.denominator:
        exact = Fraction(top, bottom)
        return exact, exact
    scale = 10**12
    low = isqrt(value.numerator * scale * scale // value.denominator)
    return Fraction(low, scale), Fraction(low + 1, scale)


def _squares(runs: int, a: Fraction, b: Fraction, m: Fraction) -> Fraction:
    value = (a - m) ** 2 + (b - m) ** 2
    return value + (2 * m - a - b) ** 2 / (runs - 2) if runs > 2 else value


def _gradient(runs: int) -> list[list[Fraction]]:
    """The rows of the gradient of `_squares` / 2 in (a, b, m): it is linear, as `_squares` is a quadratic form."""
    k = Fraction(1, runs - 2) if runs > 2 else Fraction(0)
    return [
        [1 + k, k, -1 - 2 * k],
        [k, 1 + k, -1 - 2 * k],
        [-1 - 2 * k, -1 - 2 * k, 2 + 4 * k],
    ]


def _stationary(runs: int, fixed: dict[int, Fraction]) -> list[Fraction] | None:
    """The point where the free coordinates have gradient 0; None where there is no single one (a face with less
    freedom then reaches the same least value)."""
    free = [i for i in range(3) if i not in fixed]
    rows = _gradient(runs)
    known = {i: sum((rows[i][j] * v for j, v in fixed.items()), Fraction(0)) for i in free}
    solution = _solve([[rows[i][j] for j in free] + [-known[i]] for i in free])
    if solution is None:
        return None
    point = dict(fixed) | dict(zip(free, solution, strict=True))
    return [point[i] for i in range(3)]


def _solve(system: list[list[Fraction]]) -> Sequence[Fraction] | None:
    size = len(system)
    for column in range(size):
        pivot = next((r for r in range(column, size) if system[r][column]), None)
        if pivot is None:
            return None
        system[column], system[pivot] = system[pivot], system[column]
        system[column] = [v / system[column][column] for v in system[column]]
        for r in range(size):
            if r != column and system[r][column]:
                factor = system[r][column]
                system[r] = [x - factor * y for x, y in zip(system[r], system[column], strict=True)]
    return [row[-1] for row in system]
