"""A formula over a box of values, in exact fractions: true everywhere, false everywhere, or neither is shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from avow.language import terms as t
from avow.language.bounds import bounds
from avow.language.operators import FLIPPED


@dataclass(frozen=True, slots=True)
class Span:
    """All numbers from `low` to `high`."""

    low: Fraction
    high: Fraction

    def __add__(self, other: Span) -> Span:
        return Span(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Span:
        return Span(-self.high, -self.low)

    def __mul__(self, other: Span) -> Span:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Span(min(ends), max(ends))

    def __or__(self, other: Span) -> Span:
        return Span(min(self.low, other.low), max(self.high, other.high))

    def within(self, other: Span) -> bool:
        return other.low <= self.low and self.high <= other.high

    def widened(self, share: int) -> Span:
        """By one of so many parts of its width on each side; not at all for 0."""
        more = (self.high - self.low) / share if share else Fraction(0)
        return Span(self.low - more, self.high + more)


Box = Mapping[str, Span]
"""By qualified name; a name that is left out may have any value."""


def holds(formula: t.Term, box: Box) -> bool | None:
    """Whether a formula (`avow.formulas.cases.lifted`) is true of all values in the box, or false of all; None if
    neither is shown."""
    match formula:
        case t.Literal(value=bool() as known):
            return known
        case t.Not(body=body):
            return _not(holds(body, box))
        case t.And(items=items):
            return _all(holds(item, box) for item in items)
        case t.Or(items=items):
            return _not(_all(_not(holds(item, box)) for item in items))
        case t.Implies(left=left, right=right):
            return _not(_all((holds(left, box), _not(holds(right, box)))))
        case t.Iff(left=left, right=right):
            one, other = holds(left, box), holds(right, box)
            return None if one is None or other is None else one == other
        case t.Compare(operator=operator, left=left, right=right):
            first, second = span(left, box), span(right, box)
            return None if first is None or second is None else _compared(operator, first, second)
    return None


def span(term: t.Term, box: Box) -> Span | None:
    """All values that the term has in the box, and perhaps more; None if no bounds are known."""
    match term:
        case t.Literal(value=int() | Fraction() as value):
            return Span(Fraction(value), Fraction(value))
        case t.Variable():
            return box.get(term.qualified)
        case t.Widen(term=inner):
            return span(inner, box)
        case t.Negative(term=inner):
            found = span(inner, box)
            return None if found is None else -found
        case t.Arithmetic(operator=operator, left=left, right=right):
            one, other = span(left, box), span(right, box)
            if one is None or other is None or (operator == "/" and other.low <= 0 <= other.high):
                return None
            match operator:
                case "+":
                    return one + other
                case "-":
                    return one + -other
                case "*":
                    return one * other
                case _:  # /
                    return one * Span(1 / other.high, 1 / other.low)
    return None


def _not(one: bool | None) -> bool | None:
    return None if one is None else not one


def _all(parts: Iterable[bool | None]) -> bool | None:
    found = list(parts)
    return False if False in found else None if None in found else True


def _compared(operator: str, left: Span, right: Span) -> bool | None:
    match operator:
        case "<":
            return True if left.high < right.low else False if left.low >= right.high else None
        case "<=":
            return True if left.high <= right.low else False if left.low > right.high else None
        case ">" | ">=":
            return _compared(FLIPPED[operator], right, left)
        case "==":
            return _all((_compared("<=", left, right), _compared("<=", right, left)))
        case _:  # !=
            return _not(_compared("==", left, right))


def box_of(assumptions: Iterable[t.Term]) -> dict[str, Span]:
    """The spans of the variables that comparisons with constants bound on both sides, of a variable or of its absolute
    value. All that meets the assumptions is within."""
    low, high = dict[str, list[Fraction]](), dict[str, list[Fraction]]()
    waiting = [*assumptions]
    while waiting:
        match waiting.pop():
            case t.And(items=items):
                waiting += items
            case t.Compare(operator="==", left=left, right=right):
                waiting += [t.Compare("<=", left, right), t.Compare("<=", right, left)]
            case t.Compare() as compared:
                for bound in (each for each in bounds(compared) if each.term is compared):
                    above = bound.sign in ("<", "<=")
                    side = compared.left if bound.sign == compared.operator else compared.right
                    match side:
                        case t.Variable():
                            (high if above else low).setdefault(side.qualified, []).append(bound.number)
                        case t.Operation(operator=t.Builtin.ABS, arguments=(t.Variable() as inner,)) if above:
                            low.setdefault(inner.qualified, []).append(-bound.number)
                            high.setdefault(inner.qualified, []).append(bound.number)
    return {name: Span(max(low[name]), min(high[name])) for name in low if name in high}
