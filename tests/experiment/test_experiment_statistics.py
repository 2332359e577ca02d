"""The numbers: known values, and the bound against its definition in exact fractions."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backends.experiment.statistics import runs_needed, upper_bound

CONFIDENCE = Fraction(95, 100)


def tail(failures: int, runs: int, p: Fraction) -> Fraction:
    return sum((comb(runs, k) * p**k * (1 - p) ** (runs - k) for k in range(failures + 1)), Fraction(0))


@pytest.mark.parametrize(
    ("failures", "percent"), [(0, "6.2"), (1, "9.7"), (2, "12.8"), (3, "15.7"), (4, "18.4"), (5, "21.1")]
)
def test_upper_bounds_for_47_runs(failures: int, percent: str) -> None:
    assert f"{float(upper_bound(failures, 47, CONFIDENCE)) * 100:.1f}" == percent


@given(st.integers(0, 60), st.data())
@settings(max_examples=60, deadline=None)
def test_the_bound_is_the_least_of_the_grid_that_the_definition_allows(runs: int, data: st.DataObject) -> None:
    failures = data.draw(st.integers(0, runs))
    confidence = data.draw(st.sampled_from([Fraction(9, 10), CONFIDENCE, Fraction(999, 1000)]))
    bound, step = upper_bound(failures, runs, confidence), Fraction(1, 100_000)
    assert failures <= bound * runs or failures == 0
    if failures < runs:
        assert bound == 1 or tail(failures, runs, bound) <= 1 - confidence
        assert tail(failures, runs, bound - step) > 1 - confidence
    else:
        assert bound == 1


@pytest.mark.parametrize(("most", "runs"), [("0.1", 29), ("0.2", 14), ("0.5", 5), ("0.01", 299)])
def test_runs_needed_without_a_failure(most: str, runs: int) -> None:
    assert runs_needed(Fraction(most), CONFIDENCE) == runs
    assert runs_needed(Fraction(1, 10**9), CONFIDENCE) is None
