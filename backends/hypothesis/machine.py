"""Machine numbers: what a subject gets that computes with floating-point numbers, as robots do.

Inputs are rounded to doubles before anything is judged, so that judge and subject speak of the same numbers; the judge
stays exact. What no REAL is (NaN, the infinities) is tried apart, and so is the negative zero.
"""

from __future__ import annotations

import sys
from fractions import Fraction
from typing import Any

from avow.formulas.values import Data, FunctionValue, SequenceValue, Value

EXACT, FINITE, ANY = "exact", "float64", "float64-with-nan"
"""The option `numbers`: fractions; doubles; doubles, and whoever fails on one that is no number is refuted."""

SPECIAL = {"-0": "-0x0.0p+0", "NaN": "nan", "infinity": "inf", "-infinity": "-inf"}
"""In words, and as Python reads them (`float.fromhex`)."""


def rounded(value: Value) -> Value:
    """Every REAL in it as the nearest double."""
    match value:
        case Fraction():
            try:
                return Fraction(float(value))
            except OverflowError:
                return Fraction(sys.float_info.max) * (1 if value > 0 else -1)
        case Data(constructor=constructor, arguments=arguments):
            return Data(constructor, tuple(map(rounded, arguments)))
        case SequenceValue(items=items):
            return SequenceValue(tuple(map(rounded, items)))
        case FunctionValue(table=table, default=default):
            other = rounded(default)
            points = {tuple(map(rounded, point)): rounded(v) for point, v in table.items()}
            return FunctionValue({point: v for point, v in points.items() if v != other}, other)
        case tuple():
            return tuple(map(rounded, value))
        case _:  # no number, or a whole one
            return value


def as_double(data: Any) -> Any:
    """What `convention.sent` made of a rounded value, with doubles in it."""
    match data:
        case {"q": [numerator, denominator]}:
            return {"r": float(Fraction(numerator, denominator)).hex()}
        case dict():
            return {key: as_double(part) for key, part in data.items()}
        case list():
            return [as_double(part) for part in data]
        case _:  # no number
            return data
