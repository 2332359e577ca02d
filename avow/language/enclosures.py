"""Irrational numbers by enclosures between rationals, as close as a comparison needs: the values of `sin`, `cos` and
`atan2`, and of arithmetic on them.

An enclosure to so many binary digits is a pair of integers `low`, `high` with ``low <= number * 2**bits <= high``. All
arithmetic is on integers, rounded outwards: nothing depends on floating point. By Lindemann and Weierstrass the sine
and cosine of a rational other than zero, and the angle of a rational vector off the positive x axis, equal no rational,
so that comparing one with a rational ends. A sum or product of such numbers may equal one: then the comparison ends at
`PRECISION` without an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from itertools import count
from math import isqrt
from typing import TYPE_CHECKING, ClassVar

Ends = tuple[int, int]

PRECISION = 2048
"""The binary digits after which a comparison of enclosures gives up; some 600 decimal ones."""

_FIRST = 64
"""Binary digits of the first enclosure, which decides nearly all comparisons."""

_GUARD = 16
"""Further digits in which π is computed, so that it is good to its last digits."""


class NotEvaluable(Exception):  # noqa: N818 - it names a state, not a fault
    """Exact evaluation is impossible here; `reason` is a clause for people: ``division by zero``."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class _TooWide(Exception):  # noqa: N818
    """The divisor's enclosure contains zero: more digits are needed."""


class Irrational:
    """A number that no Fraction is, or is known to be."""

    __slots__ = ()
    most: ClassVar[int | None] = None
    """The digits after which it cannot be enclosed more closely."""

    if TYPE_CHECKING:

        def within(self, bits: int) -> Ends:
            """Its enclosure. Raises _TooWide."""
            raise NotImplementedError

        def __add__(self, other: Number) -> Number: ...
        def __mul__(self, other: Number) -> Number: ...
        def __truediv__(self, other: Number) -> Number: ...
        def __rtruediv__(self, other: Number) -> Number: ...
        def __neg__(self) -> Irrational: ...

    def __radd__(self, other: Number) -> Number:
        return self + other

    def __rmul__(self, other: Number) -> Number:
        return self * other

    def __sub__(self, other: Number) -> Number:
        return self + -other

    def __rsub__(self, other: Number) -> Number:
        return -self + other

    def enclosures(self) -> Iterator[tuple[Fraction, Fraction]]:
        """Rationals not above and not below it, ever closer. Raises NotEvaluable at the end."""
        for bits in (_FIRST << k for k in count()):
            if self.most is not None and bits > self.most:
                raise NotEvaluable(
                    f"a number that {self.most} binary digits do not tell from the one it is compared to"
                )
            try:
                low, high = self.within(bits)
            except _TooWide:
                continue
            yield Fraction(low, 1 << bits), Fraction(high, 1 << bits)

    def sign(self) -> int:
        return next(1 if low > 0 else -1 for low, high in self.enclosures() if low > 0 or high < 0)

    def _beside(self, other: Number) -> int:
        """Negative if it is the smaller one, positive if it is the greater one, 0 if they are equal."""
        difference = self - other
        return difference.sign() if isinstance(difference, Irrational) else (difference > 0) - (difference < 0)

    def __lt__(self, other: Number) -> bool:
        return self._beside(other) < 0

    def __le__(self, other: Number) -> bool:
        return self._beside(other) <= 0

    def __gt__(self, other: Number) -> bool:
        return self._beside(other) > 0

    def __ge__(self, other: Number) -> bool:
        return self._beside(other) >= 0

    def __floor__(self) -> int:
        ends = ((low.__floor__(), high.__floor__()) for low, high in self.enclosures())
        return next(low for low, high in ends if low == high)

    def __ceil__(self) -> int:
        return -(-self).__floor__()

    def closely(self) -> tuple[Fraction, Fraction]:
        """The first enclosure that is as close as doubles are, or the last one."""
        found = self.enclosures()
        low, high = next(found)
        with suppress(NotEvaluable):
            while (high - low) * 2**50 > 1 + abs(high):
                low, high = next(found)
        return low, high

    def __float__(self) -> float:
        return float(sum(self.closely()) / 2)


Number = int | Fraction | Irrational


class Enclosed(Irrational):
    """A number as it was computed: an operation on numbers."""

    __slots__ = ("_known", "operation", "parts")
    most = PRECISION

    def __init__(self, operation: str, *parts: Number) -> None:
        self.operation, self.parts = operation, parts
        self._known: tuple[int, Ends] = 0, (0, 0)

    def within(self, bits: int) -> Ends:
        if self._known[0] != bits:
            ends = [part.within(bits) if isinstance(part, Irrational) else _rational(part, bits) for part in self.parts]
            self._known = bits, _OPERATIONS[self.operation](bits, *ends)
        return self._known[1]

    def __add__(self, other: Number) -> Number:
        return self if _is_rational(other, 0) else Enclosed("+", self, other)

    def __mul__(self, other: Number) -> Number:
        if _is_rational(other, 0):
            return Fraction(0)
        return self if _is_rational(other, 1) else Enclosed("*", self, other)

    def __sub__(self, other: Number) -> Number:
        return Fraction(0) if _alike(self, other) else self + -other

    def __truediv__(self, other: Number) -> Number:
        return self * (Enclosed("inverse", other) if isinstance(other, Irrational) else 1 / Fraction(other))

    def __rtruediv__(self, other: Number) -> Number:
        return Enclosed("inverse", self) * other

    def __neg__(self) -> Enclosed:
        return Enclosed("*", self, -1)

    def __abs__(self) -> Enclosed:
        return Enclosed("abs", self)

    def __eq__(self, other: object) -> bool:
        return self._beside(other) == 0 if isinstance(other, int | Fraction | Irrational) else NotImplemented

    def __hash__(self) -> int:
        raise NotEvaluable("a number that is known only by what encloses it cannot be looked up")

    def __str__(self) -> str:
        return f"about {float(self):.9g}"

    __repr__ = __str__


def sine(angle: Number) -> Number:
    return Fraction(0) if _is_rational(angle, 0) else Enclosed("sin", angle)


def cosine(angle: Number) -> Number:
    return Fraction(1) if _is_rational(angle, 0) else Enclosed("cos", angle)


def angle(y: Number, x: Number) -> Number:
    """The angle of the vector (x, y) to the x axis, above -π and at most π. Raises NotEvaluable: (0, 0) has none."""
    if y != 0:
        away = Enclosed("arctan", x / y if isinstance(y, Irrational) else x * (1 / Fraction(y)))
        return Enclosed("half of pi") * (1 if y > 0 else -1) - away
    if x == 0:
        raise NotEvaluable("the angle of a vector without length")
    return Fraction(0) if x > 0 else Enclosed("half of pi") * 2


def _is_rational(number: object, value: int) -> bool:
    return isinstance(number, int | Fraction) and number == value


def _alike(one: Number, other: Number) -> bool:
    """Whether they were computed in the same way."""
    if isinstance(one, Enclosed) and isinstance(other, Enclosed):
        same = one.operation == other.operation and len(one.parts) == len(other.parts)
        return one is other or (same and all(map(_alike, one.parts, other.parts)))
    return type(one) is type(other) and one == other


# -- enclosures of operations ------------------------------------------------------------------------------------------


def _rational(number: int | Fraction, bits: int) -> Ends:
    scaled = number.numerator << bits
    return scaled // number.denominator, -(-scaled // number.denominator)


def _product(bits: int, one: Ends, other: Ends) -> Ends:
    products = [a * b for a in one for b in other]
    return min(products) >> bits, -(-max(products) >> bits)


def _inverse(bits: int, of: Ends) -> Ends:
    low, high = of
    if low <= 0 <= high:
        raise _TooWide
    return (1 << 2 * bits) // high, -(-(1 << 2 * bits) // low)


def _absolute(bits: int, of: Ends) -> Ends:
    low, high = of
    return max(0, low, -high), max(-low, high)


def _root(bits: int, of: Ends) -> Ends:
    low, high = of
    return isqrt(max(0, low) << bits), isqrt(max(0, high) << bits) + 1


def _wave(quarters: int) -> Callable[[int, Ends], Ends]:
    """The sine of an angle and so many quarter turns. No sine differs more than its angles do."""

    def enclosed(bits: int, of: Ends) -> Ends:
        low, high = of
        (turn, doubt), one = _half_of_pi(bits), 1 << bits
        turns = (2 * low + turn) // (2 * turn)
        rest = low - turns * turn  # at most an eighth of a turn
        square, which = rest * rest >> bits, (turns + quarters) % 4
        if which % 2:
            value, wrong = _series(one, square, bits, lambda n: (2 * n - 1) * 2 * n)
        else:
            value, wrong = _series(abs(rest), square, bits, lambda n: 2 * n * (2 * n + 1))
            value = value if rest >= 0 else -value
        value = value if which < 2 else -value
        wrong += abs(turns) * doubt + high - low
        return max(-one, value - wrong), min(one, value + wrong)

    return enclosed


def _arctan(bits: int, of: Ends) -> Ends:
    low, high = of
    value, wrong = _arctan_at(low, bits)
    wrong += high - low  # no two arcs of tangents differ more than the tangents do
    return value - wrong, value + wrong


def _arctan_at(x: int, bits: int) -> Ends:
    """A value and how far it may be wrong."""
    one = 1 << bits
    if x < 0:
        value, wrong = _arctan_at(-x, bits)
        return -value, wrong
    if x > one:  # π/2 less the arc of 1 / x, which is rounded
        (turn, doubt), (value, wrong) = _half_of_pi(bits), _arctan_at((one << bits) // x, bits)
        return turn - value, wrong + doubt + 1
    if 2 * x > one:  # the arc of 1/2, and of (x - 1/2) / (1 + x/2), which is at most 1/3 and rounded
        (half, doubt), (value, wrong) = (
            _arctan_at(x, bits) for x in (one // 2, ((2 * x - one) << bits) // (2 * one + x))
        )
        return half + value, doubt + wrong + 1
    return _series(x, x * x >> bits, bits, lambda n: 1, lambda n: 2 * n + 1)


@lru_cache(maxsize=16)
def _half_of_pi(bits: int) -> Ends:
    """A value and how far it may be wrong: 8 arctan(1/5) - 2 arctan(1/239) (J. Machin, 1706)."""
    digits = bits + _GUARD
    (fifth, one), (small, other) = (_arctan_at((1 << digits) // n, digits) for n in (5, 239))
    wrong = 8 * (one + 1) + 2 * (other + 1)  # both arguments are rounded
    return (8 * fifth - 2 * small) >> _GUARD, (wrong >> _GUARD) + 2


def _series(
    term: int, square: int, bits: int, divisor: Callable[[int], int], over: Callable[[int], int] = lambda n: 1
) -> Ends:
    """An alternating sum of ever smaller terms, each the one before times `square` by `divisor`; what is added is the
    term by `over`. Returns a value and how far it may be wrong.

    All numbers are at most 1 and rounded down. If a term is too small by at most e units, so is its `square` fold by at
    most e + 2, and the next one by at most (e + 2) / divisor + 1. With a divisor of at least 2, or a square of at most
    1/4 and another unit, e is never above 4: nor is the error of what is added, or all that is left out at the end.
    """
    total, n = 0, 0
    while term:
        total += -(term // over(n)) if n % 2 else term // over(n)
        n += 1
        term = (term * square >> bits) // divisor(n)
    return total, 5 * (n + 1)


def _pi_over_two(bits: int) -> Ends:
    value, wrong = _half_of_pi(bits)
    return value - wrong, value + wrong


_OPERATIONS: dict[str, Callable[..., Ends]] = {
    "+": lambda bits, one, other: (one[0] + other[0], one[1] + other[1]),
    "*": _product,
    "inverse": _inverse,
    "abs": _absolute,
    "sqrt": _root,
    "sin": _wave(0),
    "cos": _wave(1),
    "arctan": _arctan,
    "half of pi": _pi_over_two,
}
