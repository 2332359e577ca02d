"""Figures as people print them: a decimal, what its last digit may hide, and a unit."""

from __future__ import annotations

import re
from fractions import Fraction

from avow.base.records import dataclass

from .statistics import Range

UNITS: dict[str, tuple[str, Fraction]] = {
    "": ("number", Fraction(1)),
    "%": ("number", Fraction(1, 100)),
    "mm": ("length", Fraction(1, 1000)),
    "cm": ("length", Fraction(1, 100)),
    "m": ("length", Fraction(1)),
    "km": ("length", Fraction(1000)),
    "ms": ("time", Fraction(1, 1000)),
    "s": ("time", Fraction(1)),
    "min": ("time", Fraction(60)),
    "h": ("time", Fraction(3600)),
    "deg": ("angle", Fraction(1)),
    "m/s": ("speed", Fraction(1)),
    "cm/s": ("speed", Fraction(1, 100)),
    "mm/s": ("speed", Fraction(1, 1000)),
    "kg": ("mass", Fraction(1)),
    "g": ("mass", Fraction(1, 1000)),
    "V": ("voltage", Fraction(1)),
}
"""Unit → its dimension and its size."""

_DECIMAL = re.compile(r"([-+]?)(\d{1,30})(?:\.(\d{1,30}))?(?:[eE]([-+]?\d{1,2}))?")
_FIGURE = re.compile(r"([-+]?\d[\d.]*(?:[eE][-+]?\d+)?)\s*([%\w/]*)", re.ASCII)


def decimal(text: str) -> Fraction | None:
    """The exact value of a plain decimal number; None for anything else (NaN, infinity, words, hexadecimal…)."""
    stripped = text.strip()
    if not stripped.isascii() or not _DECIMAL.fullmatch(stripped):
        return None
    return Fraction(stripped)


@dataclass(frozen=True, slots=True)
class Figure:
    """A printed figure; `value` and `half` (what rounding may hide, either way) are in `unit`."""

    text: str
    value: Fraction
    half: Fraction
    unit: str

    def within(self, unit: str) -> Range | None:
        """All that it may stand for, in another unit; None where the dimensions differ."""
        factor = conversion(self.unit, unit)
        if factor is None:
            return None
        return Range((self.value - self.half) * factor, (self.value + self.half) * factor)


def conversion(source: str, target: str) -> Fraction | None:
    """The factor from one unit to another; None where there is none. An unknown unit converts only to itself."""
    if source == target:
        return Fraction(1)
    a, b = UNITS.get(source), UNITS.get(target)
    if a is None or b is None or a[0] != b[0]:
        return None
    return a[1] / b[1]


def figure(text: str, unit: str = "") -> Figure | None:
    """Reads ``21.4 cm``; `unit` stands where none is written. The last digit counts as rounded to nearest. None: no
    figure."""
    match = _FIGURE.fullmatch(text.strip())
    if match is None:
        return None
    value = decimal(match.group(1))
    parts = _DECIMAL.fullmatch(match.group(1))
    if value is None or parts is None:
        return None
    digits = len(parts.group(3) or "") - int(parts.group(4) or 0)
    return Figure(text.strip(), value, Fraction(1, 2) / Fraction(10) ** digits, match.group(2) or unit)


def show(value: Fraction, digits: int = 4) -> str:
    """A rounded decimal for people, without trailing zeros."""
    scaled = round(abs(value) * 10**digits)
    whole, rest = divmod(scaled, 10**digits)
    decimals = f"{rest:0{digits}d}".rstrip("0")
    sign = "-" if value < 0 and scaled else ""
    return f"{sign}{whole}.{decimals}" if decimals else f"{sign}{whole}"
