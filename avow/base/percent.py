"""Shares in percent, as every text and report shows them."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction


def percent(part: Fraction | float | str, rounding: str = ROUND_HALF_EVEN) -> str:
    """``25.8 %`` for ``0.258``, to three digits."""
    exact = Fraction(str(part))
    context = Context(prec=3, rounding=rounding)
    return f"{context.divide(Decimal(100 * exact.numerator), Decimal(exact.denominator)).normalize():f} %"


def at_most(bound: Fraction | float | str) -> str:
    """A bound in percent. It is rounded up, as a smaller number would be no bound."""
    return percent(bound, ROUND_CEILING)


def at_least(confidence: Fraction | float | str) -> str:
    """A confidence in percent, rounded down."""
    return percent(confidence, ROUND_FLOOR)
