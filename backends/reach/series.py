"""Truncated power series in time, whose coefficients are intervals with their partial derivatives.

The recurrences are those of automatic differentiation (R. E. Moore, R. B. Kearfott, M. J. Cloud: Introduction to
interval analysis, 2009, chapter 9). All intervals are codac's, which rounds outward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from .expressions import Expression, value
from .intervals import Interval, codac, outward

Dual = tuple[Interval, ...]
"""An interval and its partial derivatives, or the interval alone: all are 0."""
ZERO = Interval(0)
_ALL = 10**6
"""The order of a series of which no coefficient is unknown."""


class Undefined(Exception):  # noqa: N818 - it says what is the case
    """A term may have no value, in words."""


def interval(number: Fraction) -> Interval:
    """The least interval of floating-point numbers around it. Raises Undefined if there is none."""
    low, high = around(number)
    if math.isinf(low) or math.isinf(high):
        raise Undefined("a number is too large")
    return Interval(low, high)


def around(number: Fraction) -> tuple[float, float]:
    """The floating-point number that it is, or the two nearest to it."""
    try:
        near = float(number)
    except OverflowError:
        near = math.inf if number > 0 else -math.inf
    if math.isfinite(near) and Fraction(near) == number:
        return near, near
    return math.nextafter(near, -math.inf), math.nextafter(near, math.inf)


def _wide(one: Dual, size: int) -> Dual:
    return one if len(one) == size else (*one, *[ZERO] * (size - len(one)))


def _plus(one: Dual, other: Dual) -> Dual:
    small, great = sorted((one, other), key=len)
    return (*(a + b for a, b in zip(small, great, strict=False)), *great[len(small) :])


def _minus(one: Dual) -> Dual:
    return tuple(-part for part in one)


def _times(one: Dual, other: Dual) -> Dual:
    small, great = sorted((one, other), key=len)
    first = small[0] * great[0]
    if len(small) == 1:
        return (first, *(part * small[0] for part in great[1:]))
    return (first, *(a * great[0] + b * small[0] for a, b in zip(small[1:], great[1:], strict=True)))


def _square(one: Dual) -> Dual:
    return (codac.sqr(one[0]), *(2.0 * one[0] * part for part in one[1:]))


def _over(one: Dual, other: Dual) -> Dual:
    if other[0].contains(0.0):
        raise Undefined("a divisor may be 0")
    size = max(len(one), len(other))
    a, b = _wide(one, size), _wide(other, size)
    first = a[0] / b[0]
    return (first, *((x - first * y) / b[0] for x, y in zip(a[1:], b[1:], strict=True)))


def _total(parts: Sequence[Dual]) -> Dual:
    total: Dual = (ZERO,)
    for part in parts:
        total = _plus(total, part)
    return total


@dataclass(frozen=True, slots=True)
class Series:
    """The coefficients up to `order`; those that are left out are 0."""

    of: tuple[Dual, ...]
    order: int = _ALL

    def at(self, k: int) -> Dual:
        return self.of[k] if k < len(self.of) else (ZERO,)

    def _made(self, other: Series, make: Callable[[int], Dual], most: int) -> Series:
        order = min(self.order, other.order)
        return Series(tuple(make(k) for k in range(min(order, most) + 1)), order)

    def __add__(self, other: Series) -> Series:
        most = max(len(self.of), len(other.of)) - 1
        return self._made(other, lambda k: _plus(self.at(k), other.at(k)), most)

    def __sub__(self, other: Series) -> Series:
        return self + Series(tuple(map(_minus, other.of)), other.order)

    def __mul__(self, other: Series) -> Series:
        n, m = len(self.of), len(other.of)

        def make(k: int) -> Dual:
            return _total([_times(self.of[i], other.of[k - i]) for i in range(max(0, k - m + 1), min(k, n - 1) + 1)])

        return self._made(other, make, n + m - 2)

    def __pow__(self, exponent: int) -> Series:
        if exponent == 0:
            return Series(((Interval(1),),))
        if exponent % 2:
            return self if exponent == 1 else self * self ** (exponent - 1)
        root = self ** (exponent // 2)
        whole = root * root
        return Series((_square(root.of[0]), *whole.of[1:]), whole.order)

    def __truediv__(self, other: Series) -> Series:
        made: list[Dual] = []
        most = len(self.of) - 1 if len(other.of) == 1 else _ALL
        for k in range(min(self.order, other.order, most) + 1):
            known = [_times(other.at(j), made[k - j]) for j in range(1, k + 1)]
            made.append(_over(_plus(self.at(k), _minus(_total(known))), other.of[0]))
        return Series(tuple(made), min(self.order, other.order))

    def sqrt(self) -> Series:
        first = self.of[0]
        if first[0].lb() < 0:
            raise Undefined("the argument of sqrt may be negative")
        root = codac.sqrt(first[0])
        begin: Dual = (root,)
        if len(first) > 1:
            begin = (root, *_over((ZERO, *first[1:]), (2.0 * root,))[1:])
        made = [begin]
        for k in range(1, self.order + 1 if len(self.of) > 1 else 1):
            known = [_times(made[j], made[k - j]) for j in range(1, k)]
            made.append(_over(_plus(self.at(k), _minus(_total(known))), _times(begin, (Interval(2),))))
        return Series(tuple(made), self.order)

    def sin(self) -> Series:
        return self._waves()[0]

    def cos(self) -> Series:
        return self._waves()[1]

    def _waves(self) -> tuple[Series, Series]:
        (first, *slopes) = self.of[0]
        sin, cos = codac.sin(first), codac.cos(first)
        sines: list[Dual] = [(sin, *(cos * s for s in slopes))]
        cosines: list[Dual] = [(cos, *(-sin * s for s in slopes))]
        for k in range(1, self.order + 1 if len(self.of) > 1 else 1):
            parts = [(_times(self.at(j), (Interval(j) / k,)), k - j) for j in range(1, k + 1)]
            one = _total([_times(part, cosines[at]) for part, at in parts])
            other = _total([_times(part, sines[at]) for part, at in parts])
            sines.append(one)
            cosines.append(_minus(other))
        return Series(tuple(sines), self.order), Series(tuple(cosines), self.order)


def constant(number: Fraction) -> Series:
    return Series(((interval(number),),))


@outward()
def values(terms: Sequence[Expression], names: Sequence[str], of: Sequence[Dual]) -> list[Dual]:
    """The terms over the box that the names have. Raises Undefined."""
    known = {name: Series((dual,)) for name, dual in zip(names, of, strict=True)}
    return [value(term, known, constant).of[0] for term in terms]


@outward()
def taylor(
    equations: Mapping[str, Expression], begin: Sequence[Dual], inputs: Mapping[str, Interval], order: int
) -> list[list[Dual]]:
    """For each state the coefficients 0 to `order` of the solution from `begin`, with constant inputs. Raises
    Undefined."""
    held = {name: Series(((given,),)) for name, given in inputs.items()}
    found = [[first] for first in begin]
    for k in range(order):
        known = held | {name: Series(tuple(c), k) for name, c in zip(equations, found, strict=True)}
        slopes = [value(term, known, constant).at(k) for term in equations.values()]
        for coefficients, slope in zip(found, slopes, strict=True):
            coefficients.append(_times(slope, (Interval(1) / (k + 1),)))
    return found
