"""The bound that cases without a failure justify is never below the exact one."""

from __future__ import annotations

from fractions import Fraction

import pytest

from avow.backends.hypothesis.judging import failure_bound
from avow.base.percent import at_most


@pytest.mark.parametrize("cases", [*range(1, 400), 1000, 2500, 10_000])
def test_a_bound_is_rounded_up(cases: int) -> None:
    """With a failure probability of `bound` or more, all cases pass with a probability of at most 5 %."""
    assert (1 - Fraction(repr(failure_bound(cases)))) ** cases <= Fraction(1, 20)
    assert Fraction(at_most(failure_bound(cases)).removesuffix(" %")) >= 100 * Fraction(repr(failure_bound(cases)))
    assert failure_bound(cases) - (1 - 0.05 ** (1 / cases)) < 1.1e-6


def test_no_case_justifies_nothing() -> None:
    assert failure_bound(0) == 1.0
    assert at_most(failure_bound(0)) == "100 %"
