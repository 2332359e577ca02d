"""Between two of the numbers that a contract names, all readings are alike.

A variable that clauses only ever compare with numbers matters through its place among these. The place is found in
floating point, away from the numbers by more than any rounding of reading and comparing; what lies nearer is left to
exact calculation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from fractions import Fraction

from avow.language.sorts import RealSort
from avow.language.terms import (
    Arithmetic,
    Compare,
    In,
    Literal,
    Negative,
    SequenceRange,
    SetTerm,
    Term,
    Variable,
    Widen,
)
from avow.ros.definitions import FLOATS, Scalar

from ..rules import Fields, Rule
from ..wires import LARGEST_SINGLE


def regions(rule: Rule, formulas: Iterable[Term]) -> list[float] | None:
    """Ascending bounds: a reading whose `bisect` among them is even lies in a region all of whose readings make the
    same formulas true; one whose place is odd is too near to a number to tell. None where the variable is not only
    compared."""
    if not isinstance(rule, Fields) or not isinstance(rule.variable.sort, RealSort) or rule.take or len(rule.paths) > 1:
        return None
    wire = rule.wire(0)
    if wire is not None and not (isinstance(wire, Scalar) and wire.name in FLOATS):
        return None
    found: set[Fraction] = set()
    for formula in formulas:
        for number in _compared(formula, rule.variable):
            if number is None:
                return None
            found.add(number)
    try:
        near = [(float(n), abs(float(n)) * 2.0**-20 + 1e-40) for n in found]
    except OverflowError:
        return None
    spans = [(middle - room, middle + room) for middle, room in near]
    return _merged([(-math.inf, -LARGEST_SINGLE / 2), *spans, (LARGEST_SINGLE / 2, math.inf)])


def _merged(spans: list[tuple[float, float]]) -> list[float]:
    bounds: list[float] = []
    for low, high in sorted(spans):
        if bounds and low <= bounds[-1]:
            bounds[-1] = max(bounds[-1], high)
        else:
            bounds += [low, high]
    return bounds


def _compared(term: Term, variable: Variable) -> Iterator[Fraction | None]:
    """The numbers that the variable is compared with; None where it occurs in another way."""
    match term:
        case Variable():
            if term.qualified == variable.qualified:
                yield None
        case Compare(left=left, right=right) if _is(left, variable) or _is(right, variable):
            yield number_of(right if _is(left, variable) else left)
        case In(item=item, collection=SetTerm(items=items)) if _is(item, variable):
            yield from map(number_of, items)
        case In(item=item, collection=SequenceRange(low=low, high=high)) if _is(item, variable):
            yield from (number_of(low), number_of(high))
        case _:  # compares nothing itself
            for child in term.children:
                yield from _compared(child, variable)


def _is(term: Term, variable: Variable) -> bool:
    return isinstance(term, Variable) and term.qualified == variable.qualified


def number_of(term: Term) -> Fraction | None:
    """The value of a term without variables."""
    match term:
        case Literal(value=int() | Fraction() as value) if not isinstance(value, bool):
            return Fraction(value)
        case Widen(term=inner):
            return number_of(inner)
        case Negative(term=inner):
            number = number_of(inner)
            return None if number is None else -number
        case Arithmetic(operator="+" | "-" | "*" as operator, left=left, right=right):
            one, other = number_of(left), number_of(right)
            if one is None or other is None:
                return None
            return one + other if operator == "+" else one - other if operator == "-" else one * other
        case _:  # no number
            return None
