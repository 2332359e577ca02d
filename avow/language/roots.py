"""Sums of square roots of rational numbers, exactly: the values of `sqrt` and of arithmetic on them.

A summand ``s * sqrt(|q|)``, s the sign of q, is written as the rational q; a rational r is the summand ``r * abs(r)``.
Two summands are rational multiples of each other if and only if their quotient is a square up to its sign; such are
added. Any others are linearly independent over the rationals (A. S. Besicovitch, "On the linear independence of
fractional powers of integers", 1940). A number therefore has one such form: equal numbers have equal forms, and none
that is left as a `Surd` is rational, so that enclosing it by rationals ever more closely ends in its sign.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from math import isqrt

from avow.base.records import dataclass
from avow.language.enclosures import Enclosed, Ends, Irrational, NotEvaluable, Number


@dataclass(frozen=True, slots=True)
class Surd(Irrational):
    """An irrational number."""

    summands: frozenset[Fraction]

    def __add__(self, other: Number) -> Number:
        if isinstance(other, Enclosed):
            return NotImplemented
        return _sum((*self.summands, *_summands(other)))

    def __mul__(self, other: Number) -> Number:
        if isinstance(other, Enclosed):
            return NotImplemented
        return _sum(a * b for a in self.summands for b in _summands(other))

    def __truediv__(self, other: Number) -> Number:
        return self * _inverse(other)

    def __rtruediv__(self, other: Number) -> Number:
        return _inverse(self) * other

    def __neg__(self) -> Surd:
        return Surd(frozenset(-q for q in self.summands))

    def __abs__(self) -> Surd:
        return -self if self < 0 else self

    def within(self, bits: int) -> Ends:
        roots = [(isqrt((abs(q.numerator) << 2 * bits) // q.denominator), q > 0) for q in self.summands]
        low = sum(root if positive else -root - 1 for root, positive in roots)
        return low, low + len(roots)

    def __str__(self) -> str:
        parts = ((q, _rational_root(abs(q))) for q in sorted(self.summands, reverse=True))
        said = (f"{'-' if q < 0 else '+'} {f'sqrt({abs(q)})' if root is None else root}" for q, root in parts)
        return " ".join(said).removeprefix("+ ")


def root(number: Number) -> Number:
    """The square root. Raises NotEvaluable: a negative number has none."""
    if number < 0:
        raise NotEvaluable("the square root of a negative number")
    if isinstance(number, Irrational):
        return Enclosed("sqrt", number)
    return _sum((Fraction(number),))


def quotient(dividend: Number, divisor: Number) -> Number:
    """Raises NotEvaluable."""
    if divisor == 0:
        raise NotEvaluable("division by zero")
    return (Fraction(dividend) if isinstance(dividend, int) else dividend) / divisor


def _summands(number: Number) -> Iterable[Fraction]:
    if isinstance(number, Surd):
        return number.summands
    assert not isinstance(number, Irrational)
    rational = Fraction(number)
    return (rational * abs(rational),)


def _sum(summands: Iterable[Fraction]) -> Number:
    found = dict[Fraction, Fraction]()
    """The first of the summands that are multiples of each other → how many times it."""
    for summand in filter(None, summands):
        times = ((other, _rational_root(abs(summand / other))) for other in found)
        first, factor = next(((o, f) for o, f in times if f is not None), (summand, Fraction(1)))
        found[first] = found.get(first, Fraction(0)) + (factor if (summand > 0) == (first > 0) else -factor)
    whole = frozenset(summand * times * abs(times) for summand, times in found.items() if times)
    rational = _rational_root(abs(next(iter(whole), Fraction(0)))) if len(whole) < 2 else None
    return Surd(whole) if rational is None else -rational if min(whole, default=0) < 0 else rational


def _rational_root(square: Fraction) -> Fraction | None:
    numerator, denominator = isqrt(square.numerator), isqrt(square.denominator)
    found = Fraction(numerator, denominator)
    return found if found * found == square else None


def _inverse(number: Number) -> Number:
    if not isinstance(number, Irrational):
        return 1 / Fraction(number)
    match sorted(number.summands) if isinstance(number, Surd) else ():
        case [only]:
            return Surd(frozenset((1 / only,)))
        case [a, b]:  # 1 / (s + t) = (s - t) / (s * s - t * t)
            return _sum((a, -b)) / (abs(a) - abs(b))
    return Enclosed("inverse", number)
