"""Exact numbers as people write them."""

from __future__ import annotations

from fractions import Fraction


def decimal(value: Fraction) -> str | None:
    """The number with all its decimals (``-2.5``, ``3``); None where they do not end."""
    digits, rest = 0, value.denominator
    for prime in (2, 5):
        power = 0
        while rest % prime == 0:
            rest, power = rest // prime, power + 1
        digits = max(digits, power)
    if rest != 1:
        return None
    if not digits:
        return str(value.numerator)
    whole = f"{abs(value.numerator) * 10**digits // value.denominator:0{digits + 1}d}"
    return f"{'-' if value < 0 else ''}{whole[:-digits]}.{whole[-digits:]}"
