"""Sine, cosine and angle by long decimals, as the recipes of Python's own `decimal` have them: wrong by less than
10**-200 for numbers up to 10**60."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache

DIGITS = 300


def _decimal(number: Fraction) -> Decimal:
    return Decimal(number.numerator) / Decimal(number.denominator)


def _sum(first: Decimal, square: Decimal, n: int) -> Decimal:
    """first - first * square / (n (n + 1)) + …"""
    term, total = first, first
    while abs(term) > Decimal(10) ** -(DIGITS - 10):
        term *= -square / (n * (n + 1))
        total += term
        n += 2
    return total


@cache
def pi() -> Decimal:
    with localcontext() as context:
        context.prec = DIGITS
        lasts, t, s, n, na, d, da = Decimal(0), Decimal(3), Decimal(3), 1, 0, 0, 24
        while s != lasts:
            lasts = s
            n, na = n + na, na + 8
            d, da = d + da, da + 32
            t = (t * n) / d
            s += t
        return +s


def sine(angle: Fraction) -> Fraction:
    with localcontext() as context:
        context.prec = DIGITS
        x = _decimal(angle).remainder_near(2 * pi())
        return Fraction(_sum(x, x * x, 2))


def cosine(angle: Fraction) -> Fraction:
    with localcontext() as context:
        context.prec = DIGITS
        x = _decimal(angle).remainder_near(2 * pi())
        return Fraction(_sum(Decimal(1), x * x, 1))


def angle(y: Fraction, x: Fraction) -> Fraction:
    """Of a vector with a length. Half of the angle of a vector is that of the vector and its length, added."""
    with localcontext() as context:
        context.prec = DIGITS
        if y == 0:
            return Fraction(pi()) if x < 0 else Fraction(0)
        a, b = _decimal(x), _decimal(y)
        for _ in range(12):
            a, b = (a + (a * a + b * b).sqrt(), b) if a >= 0 else (b * b, b * ((a * a + b * b).sqrt() - a))
            a, b = a / (a * a + b * b).sqrt(), b / (a * a + b * b).sqrt()
        tangent, total, n = b / a, Decimal(0), 1
        power = tangent
        while abs(power) > Decimal(10) ** -(DIGITS - 20):
            total += power / n
            power *= -tangent * tangent
            n += 2
        return Fraction(total * 2**12)
