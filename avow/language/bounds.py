"""The comparisons of a formula with constants: ``in.r < 120``, ``0 <= in.r``."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from avow.base.optional import complete
from avow.base.records import dataclass
from avow.language import terms as t
from avow.language.enclosures import NotEvaluable, Number
from avow.language.operators import FLIPPED, OPERATORS, OPPOSITE, implementation
from avow.language.sorts import BoolSort, IntegerSort, NaturalSort, RealSort


@dataclass(frozen=True, slots=True)
class Bound:
    """A comparison with a constant, read with the constant on the right. If it is in a condition, or under `not` or
    `or`, a sentence may express it by the opposite (`turned`): ``if less than 3 …`` beside ``… or 3 <= in.r``."""

    term: t.Compare
    sign: str
    number: Fraction
    turned: bool

    def may_mean(self, signs: frozenset[str]) -> bool:
        return self.sign in signs or (self.turned and OPPOSITE[self.sign] in signs)


def bounds(formula: t.Term) -> Iterator[Bound]:
    """Every comparison of order with a constant, in reading order."""
    stack = [(formula, False)]
    while stack:
        term, turned = stack.pop()
        match term:
            case t.Compare(operator=sign, left=left, right=right) if sign in FLIPPED:
                if (number := constant(right)) is not None:
                    yield Bound(term, sign, number, turned)
                elif (number := constant(left)) is not None:
                    yield Bound(term, FLIPPED[sign], number, turned)
            case t.Implies(left=left, right=right):
                stack += [(right, turned), (left, True)]
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                stack += [(otherwise, turned), (then, turned), (condition, True)]
            case t.Iff() | t.Or() | t.Not() | t.Operation(sort=BoolSort()):
                stack += [(part, True) for part in reversed(term.children)]
            case _:  # other terms do not turn their parts
                stack += [(part, turned) for part in reversed(term.children)]


def constant(term: t.Term) -> Fraction | None:
    """The value of a numeric term without variables; None for every other term, and if it is irrational."""
    number = closed(term)
    return Fraction(number) if isinstance(number, int | Fraction) else None


def closed(term: t.Term) -> Number | None:
    """The value of a numeric term without variables; None for every other term."""
    match term:
        case t.Literal(value=int() | Fraction() as value) if not isinstance(value, bool):
            return value
        case t.Widen() | t.Negative() | t.Arithmetic() | t.Operation(sort=RealSort() | IntegerSort() | NaturalSort()):
            parts: list[Number] | None = complete(map(closed, term.children))
            if parts is None or isinstance(term, t.Widen):
                return parts[0] if parts else None
            if isinstance(term, t.Negative):
                return -parts[0]
            try:
                found: Number = implementation(OPERATORS[term.operator].evaluate)(*parts)
            except NotEvaluable:
                return None
            return found
    return None
