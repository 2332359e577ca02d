"""The rounding relation never excludes what IEEE gives: ties, subnormals and the largest numbers among the samples."""

from __future__ import annotations

import math
import random
import struct
import sys
from collections.abc import Iterator
from fractions import Fraction

import pytest

from avow.backend_kit.programs.samples import around
from avow.backends.python.rounding import LARGEST, OVERFLOW, gaps, no_overflow, number, rounded
from avow.evaluation.evaluate import compile_term
from avow.formulas.formula import conjunction
from avow.language.sorts import REAL
from avow.language.terms import Role, Variable

X, R, A, B = (Variable(Role.BOUND, name, REAL) for name in "xrab")
THRESHOLDS = (0.0, 0.1, 0.3, -0.3, 0.5, 1.0, 1.5, 3.0, 5e-324, sys.float_info.max, sys.float_info.min)
NEAR = (*THRESHOLDS, *(math.nextafter(t, e) for t in THRESHOLDS for e in (-math.inf, math.inf)))


def operands(chance: random.Random) -> tuple[float, float]:
    def one() -> float:
        kind = chance.random()
        if kind < 0.3:
            return chance.choice([n for n in NEAR if math.isfinite(n)])
        if kind < 0.5:
            return chance.uniform(-10, 10)
        if kind < 0.6:
            return chance.randrange(-(2**60), 2**60) * 5e-324
        (found,) = struct.unpack("<d", chance.randbytes(8))
        return found if math.isfinite(found) else 1.0

    a = one()
    if chance.random() < 0.3:  # near a threshold, and at a tie now and then
        target = chance.choice(THRESHOLDS)
        return a, target - a if math.isfinite(target - a) else target
    return a, one()


def samples(operator: str, count: int) -> Iterator[tuple[Fraction, float, float, float]]:
    chance = random.Random(operator)
    while count:
        a, b = operands(chance)
        if operator == "/" and b == 0:
            continue
        one, other = Fraction(a), Fraction(b)
        match operator:
            case "+":
                exact, got = one + other, a + b
            case "*":
                exact, got = one * other, a * b
            case _:
                exact, got = one / other, a / b
        count -= 1
        yield exact, got, a, b


def check(operator: str, count: int) -> None:
    contract = (Fraction(3, 10), Fraction(1, 3), -Fraction(1, 10))
    relation = rounded(R, X, products=operator != "+", beside=(A, B), at=THRESHOLDS)
    holds = compile_term(conjunction((relation, *gaps(R, contract))))
    fits = compile_term(no_overflow(X))
    for exact, got, a, b in samples(operator, count):
        values = {"x": exact, "a": Fraction(a), "b": Fraction(b)}
        assert bool(fits(values)) == math.isfinite(got), (a, b)
        if math.isfinite(got):
            assert holds({**values, "r": Fraction(got)}), (operator, a, b)


@pytest.mark.parametrize("operator", ["+", "*", "/"])
def test_no_result_is_excluded(operator: str) -> None:
    check(operator, 1500)


@pytest.mark.nightly
@pytest.mark.parametrize("operator", ["+", "*", "/"])
def test_no_result_is_excluded_of_many(operator: str) -> None:
    check(operator, 100_000)


def test_a_wrong_result_is_excluded() -> None:
    """The relation says something: one double further is no rounding of a number near a threshold."""
    holds = compile_term(rounded(R, X, products=False, beside=(), at=(0.5,)))
    exact = Fraction(1, 2) + Fraction(1, 2**54)  # a tie: 0.5 is even
    assert holds({"x": exact, "r": Fraction(1, 2)})
    assert not holds({"x": exact, "r": Fraction(math.nextafter(0.5, 1.0))})
    assert not holds({"x": exact + Fraction(1, 2**80), "r": Fraction(1, 2)})


def test_the_ends_of_what_a_double_holds() -> None:
    assert float(OVERFLOW - 1) == sys.float_info.max
    with pytest.raises(OverflowError):
        float(OVERFLOW)
    assert Fraction(sys.float_info.max) == LARGEST
    assert around(Fraction(3, 10)) == (0.3, math.nextafter(0.3, 1.0))
    assert around(Fraction(1, 2)) == (0.5, 0.5)
    assert number(0.1).value == Fraction(0.1)
