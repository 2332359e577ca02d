"""The numbers: known values, the definition by brute force, and properties."""

from __future__ import annotations

import itertools
from fractions import Fraction
from math import comb

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backends.experiment.statistics import (
    Range,
    greatest_deviation,
    justified,
    least_deviation,
    lower_bound,
    root,
    runs_needed,
    tail,
    upper_bound,
)

CONFIDENCE = Fraction(95, 100)


@pytest.mark.parametrize(
    ("failures", "percent"), [(0, "6.2"), (1, "9.7"), (2, "12.8"), (3, "15.7"), (4, "18.4"), (5, "21.1")]
)
def test_upper_bounds_for_47_runs(failures: int, percent: str) -> None:
    assert f"{float(upper_bound(failures, 47, CONFIDENCE)) * 100:.1f}" == percent


@given(st.integers(1, 30), st.data())
@settings(max_examples=60, deadline=None)
def test_tail_is_the_binomial_tail(runs: int, data: st.DataObject) -> None:
    failures = data.draw(st.integers(0, runs - 1))
    p = data.draw(st.fractions(Fraction(1, 1000), Fraction(999, 1000), max_denominator=1000))
    exact = sum(comb(runs, k) * p**k * (1 - p) ** (runs - k) for k in range(failures + 1))
    computed = Fraction(tail(failures, runs, p))
    assert exact <= computed <= exact * (1 + Fraction(1, 10**39))


@given(st.integers(1, 60), st.data())
@settings(max_examples=40, deadline=None)
def test_bounds_enclose_the_rate_and_are_tight(runs: int, data: st.DataObject) -> None:
    failures = data.draw(st.integers(0, runs))
    high, low = upper_bound(failures, runs, CONFIDENCE), lower_bound(failures, runs, CONFIDENCE)
    assert 0 <= low <= Fraction(failures, runs) <= high <= 1
    if failures < runs:
        assert justified(failures, runs, high, CONFIDENCE)
        assert not justified(failures, runs, high - Fraction(1, 10**6), CONFIDENCE)


def test_all_failed_justifies_nothing() -> None:
    assert upper_bound(5, 5, CONFIDENCE) == 1
    assert lower_bound(0, 5, CONFIDENCE) == 0


def test_the_rule_of_three() -> None:
    assert runs_needed(Fraction(1, 10), CONFIDENCE) == 29
    assert runs_needed(Fraction(1, 10**9), CONFIDENCE) is None


@pytest.mark.slow
@given(st.lists(st.integers(0, 12), min_size=2, max_size=6))
@settings(max_examples=200, deadline=None)
def test_least_and_greatest_deviation_bound_every_data_set(values: list[int]) -> None:
    n, mean = len(values), Fraction(sum(values), len(values))
    squares = sum((v - mean) ** 2 for v in values)
    exact = (Range(mean, mean), *(Range(Fraction(v), Fraction(v)) for v in (min(values), max(values))))
    assert least_deviation(n, *exact) <= squares <= greatest_deviation(n, *exact)
    half = Fraction(1, 2)
    rounded = tuple(Range(r.low - half, r.high + half) for r in exact)
    assert least_deviation(n, *rounded) <= least_deviation(n, *exact)


def test_least_deviation_is_reached() -> None:
    """Over a grid of all data sets with a mean of 4, a minimum of 1 and a maximum of 9."""
    found = min(
        sum((v - 4) ** 2 for v in (1, 9, *rest))
        for rest in itertools.product(range(1, 10), repeat=3)
        if sum(rest) == 10
    )
    bound = least_deviation(5, *(Range(Fraction(v), Fraction(v)) for v in (4, 1, 9)))
    assert bound <= found
    assert bound == Fraction(25 + 9) + 3 * (Fraction(10, 3) - 4) ** 2


def test_root_encloses() -> None:
    assert root(Fraction(9, 4)) == (Fraction(3, 2), Fraction(3, 2))
    low, high = root(Fraction(2))
    assert low < high
    assert low**2 < 2 < high**2
    with pytest.raises(ValueError, match="negative"):
        root(Fraction(-1))
