"""The comparisons of a formula with constants: ``in.r < 120``, ``0 <= in.r``."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from avow.base.records import dataclass
from avow.language import terms as t
from avow.language.operators import FLIPPED, OPPOSITE
from avow.language.sorts import BoolSort


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
    """The value of a numeric term without variables; None for every other term."""
    match term:
        case t.Literal(value=bool() | str()):
            return None
        case t.Literal(value=value):
            return Fraction(value)
        case t.Widen(term=inner):
            return constant(inner)
        case t.Negative(term=inner):
            number = constant(inner)
            return None if number is None else -number
        case t.Arithmetic(operator=operator, left=left, right=right):
            first = constant(left)
            second = constant(right) if first is not None else None
            if first is None or second is None or (operator == "/" and second == 0):
                return None
            match operator:
                case "+":
                    return first + second
                case "-":
                    return first - second
                case "*":
                    return first * second
                case _:  # /
                    return first / second
    return None
