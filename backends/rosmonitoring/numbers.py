"""Numbers of a trace, exact: a decimal means what its digits say, not the nearest binary fraction.

A JSON number with a point or an exponent is kept as its digits, in `bytes`, until somebody needs its value.
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction

from .tuning import NUMBER_LENGTH


class Exact(Fraction):
    """A fraction that computes its hash once: the same readings are looked up in tables again and again."""

    __slots__ = ("_kept",)
    _kept: int

    def __hash__(self) -> int:  # type: ignore[override]
        try:
            return self._kept
        except AttributeError:
            self._kept = super().__hash__()
            return self._kept


class NotANumber(Exception):  # noqa: N818 - it names what was found
    """NaN, an infinity, or a number too long to be meant."""


def exact(raw: object) -> Fraction | int:
    """The value of a number as it came from JSON or from a bag, or as it is. Raises NotANumber."""
    if isinstance(raw, bytes):
        return _fraction(raw.decode())
    if isinstance(raw, Fraction):
        return raw
    if isinstance(raw, int) and not isinstance(raw, bool):
        return raw
    if isinstance(raw, float):
        if not math.isfinite(raw):
            raise NotANumber
        return _fraction(repr(float(raw)))
    raise NotANumber


@functools.lru_cache(maxsize=4096)
def whole(value: int) -> Fraction:
    """A whole number as a real one."""
    return Exact(value)


@functools.lru_cache(maxsize=65536)
def _fraction(text: str) -> Fraction:
    front, point, digits = text.partition(".")
    try:
        if len(text) > NUMBER_LENGTH or abs(int(text.lower().partition("e")[2] or 0)) > NUMBER_LENGTH:
            raise NotANumber
        if point and text.isascii() and digits.isdecimal() and front.removeprefix("-").isdecimal():
            return Exact(int(front + digits), 10 ** len(digits))  # as nearly all are
        return Exact(text)
    except (ValueError, ZeroDivisionError):
        raise NotANumber from None
