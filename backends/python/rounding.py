"""IEEE 754 rounding to nearest, ties to even, in linear arithmetic over the reals.

A double r that an operation rounds from the exact x is described by facts about every rounding: it is near, it has the
sign, it passes no double on the way, and at each constant it falls to the side that the tie's rule gives. The facts
are of rounding without a largest number; that nothing overflows is a condition of its own. They never exclude what
IEEE gives; they may allow more.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator
from fractions import Fraction

from avow.backend_kit.programs.samples import around
from avow.formulas.formula import conjunction
from avow.language.sorts import REAL
from avow.language.terms import Arithmetic, Compare, Conditional, Iff, Implies, Literal, Negative, Term, Variable

LARGEST = Fraction(sys.float_info.max)
"""The largest finite double."""

OVERFLOW = Fraction(2**1024 - 2**970)
"""Exact results from here on round to infinity: the largest double and half of its last place."""

NEAR = Fraction(1, 2**53)
"""The greatest relative error of a rounding."""

SUBNORMAL = Fraction(1, 2**1075)
"""The greatest absolute error besides, of products and quotients: sums that are so small are exact."""


def number(value: Fraction | int | float) -> Literal:
    return Literal(Fraction(value), REAL)


def magnitude(term: Term) -> Term:
    """|x|."""
    return Conditional(Compare("<=", number(0), term), term, Negative(term, REAL), REAL)


def finite(term: Term) -> Term:
    """That a number is no larger than the largest double."""
    return conjunction((Compare("<=", number(-LARGEST), term), Compare("<=", term, number(LARGEST))))


def no_overflow(exact: Term) -> Term:
    """That an exact result rounds to a finite number."""
    return conjunction((Compare("<", number(-OVERFLOW), exact), Compare("<", exact, number(OVERFLOW))))


def rounded(result: Variable, exact: Term, *, products: bool, beside: Iterable[Term], at: Iterable[float]) -> Term:
    """That `result` is the double next to `exact`. `products`: it may be subnormal. `beside` are terms that are
    doubles, `at` constants that are."""
    error = Arithmetic("-", result, exact, REAL)
    bound: Term = Arithmetic("*", number(NEAR), magnitude(exact), REAL)
    if products:
        bound = Arithmetic("+", bound, number(SUBNORMAL), REAL)
    near = (Compare("<=", error, bound), Compare("<=", Negative(error, REAL), bound))
    return conjunction((*near, *_passes_none(result, exact, (number(0), *beside)), *_thresholds(result, exact, at)))


def _passes_none(result: Term, exact: Term, doubles: Iterable[Term]) -> Iterator[Term]:
    """Rounding is monotone, and leaves doubles as they are."""
    for double in dict.fromkeys(doubles):
        yield Implies(Compare("<=", exact, double), Compare("<=", result, double))
        yield Implies(Compare(">=", exact, double), Compare(">=", result, double))


def _thresholds(result: Term, exact: Term, constants: Iterable[float]) -> Iterator[Term]:
    """For a double c: r <= c just where x is not beyond the middle of c and the next double; at the middle itself the
    one with an even mantissa is taken. Likewise r >= c."""
    for constant in sorted(set(constants)):
        ties = _even(constant)
        c = number(constant)
        above, below = number(_middle(constant, math.inf)), number(_middle(constant, -math.inf))
        yield Iff(Compare("<=", result, c), Compare("<=" if ties else "<", exact, above))
        yield Iff(Compare(">=", result, c), Compare(">=" if ties else ">", exact, below))


def _middle(constant: float, towards: float) -> Fraction:
    """Half way to the next double, as if there were no largest one."""
    other = math.nextafter(constant, towards)
    if math.isinf(other):
        other_exact = Fraction(constant) * 2 - Fraction(math.nextafter(constant, -towards))
        return (Fraction(constant) + other_exact) / 2
    return (Fraction(constant) + Fraction(other)) / 2


def _even(constant: float) -> bool:
    """Whether a double's mantissa is even."""
    exact = Fraction(constant)
    last = Fraction(math.ulp(constant))
    return int(exact / last) % 2 == 0


def gaps(term: Term, constants: Iterable[Fraction]) -> Iterator[Term]:
    """No double lies strictly between the two that are next to a number which is none."""
    for constant in sorted(set(constants)):
        low, high = around(constant)
        if low != high and math.isfinite(low) and math.isfinite(high):
            yield Implies(Compare(">", term, number(low)), Compare(">=", term, number(high)))
