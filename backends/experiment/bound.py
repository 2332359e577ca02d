"""The upper bound that a guarantee gives as a whole: what a tolerance is held against.

A comparison bounds by T where it can be written `quantity <= T`, with T > 0 its numbers together and the quantity one
of outputs, or of values that every answer has to satisfy (`forall`). It counts where nothing stands beside it but
conjuncts and a trigger: one of several alternatives bounds nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from avow.base.records import dataclass
from avow.formulas.negation_normal_form import push_negations
from avow.language.bounds import constant
from avow.language.operators import FLIPPED, OPPOSITE
from avow.language.subterms import subterms
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
    Negative,
    Not,
    Or,
    Quantified,
    Quantifier,
    Role,
    Term,
    Variable,
    Widen,
)

from .statistics import root


@dataclass(frozen=True, slots=True)
class Bound:
    """`quantity <= value`, or `quantity < value` where strict."""

    value: Fraction
    strict: bool


def upper_bound(formula: Term) -> Bound | str:
    """The least upper bound that the whole formula gives, or why it gives none."""
    found: list[Bound] = []
    for compared, universal in _conjuncts(push_negations(formula), frozenset()):
        bound = _bound(compared, universal)
        if isinstance(bound, str):
            return bound
        if bound is not None:
            found.append(bound)
    if not found:
        return "it bounds nothing from above, whatever else holds, by a number"
    return min(found, key=lambda b: (b.value, not b.strict))


def _conjuncts(term: Term, universal: frozenset[Variable]) -> Iterator[tuple[Compare, frozenset[Variable]]]:
    match term:
        case And(items=items):
            for item in items:
                yield from _conjuncts(item, universal)
        case Or(items=items):
            rest = [item for item in items if not _trigger(item)]
            if len(rest) == 1:
                yield from _conjuncts(rest[0], universal)
        case Quantified(quantifier=Quantifier.FORALL, variables=variables, body=body):
            yield from _conjuncts(body, universal | set(variables))
        case Quantified(quantifier=Quantifier.EXISTS, variables=variables, body=body):
            yield from _conjuncts(body, universal - set(variables))
        case Compare(operator=operator) if operator in FLIPPED:
            yield term, universal
        case Not(body=Compare(operator=operator, left=left, right=right)) if operator in FLIPPED:
            yield Compare(OPPOSITE[operator], left, right), universal
        case _:  # bounds nothing
            return


def _trigger(item: Term) -> bool:
    """Says when the guarantee applies: of inputs, or the negation of a relation or an equation that picks values."""
    match item:
        case Not(body=Apply()):
            return True
        case Not(body=Compare(operator="==") as equation) if Role.BOUND in _roles(equation):
            return True
        case _:  # judged by its variables
            orders = [p for p in subterms(item) if isinstance(p, Compare) and p.operator in FLIPPED]
            return not _roles(item) & {Role.OUTPUT} and all(_roles(p) <= {Role.INPUT} for p in orders)


def _roles(term: Term) -> set[Role]:
    return {part.role for part in subterms(term) if isinstance(part, Variable)}


def _bound(compared: Compare, universal: frozenset[Variable]) -> Bound | str | None:
    sides = (compared.left, compared.right)
    low, high = sides if compared.operator in ("<", "<=") else sides[::-1]
    number, terms = Fraction(0), []
    for sign, term in (*_summands(low, 1), *_summands(high, -1)):
        value = constant(term)
        if value is not None:
            number += sign * value
        else:
            terms.append((sign, term))
    measured = [(sign, term) for sign, term in terms if _measured(term, universal)]
    if not measured:
        return None
    strict, value = "=" not in compared.operator, -number
    if value < 0:
        return "it bounds something from below, which no tolerance shows"
    if value == 0:  # `0 <= x` says which side, `x <= 0` allows nothing; what has no number has no tolerance
        alone = len(terms) == len(measured) and all(sign > 0 for sign, _ in terms)
        return Bound(value, strict) if alone else None
    if all(sign > 0 and _is_square(term) for sign, term in terms):
        least, greatest = root(value)
        return Bound(least, strict) if least == greatest else "it bounds a square by what is no square"
    if any(isinstance(part, Arithmetic) and part.operator not in "+-" for _, t in measured for part in subterms(t)):
        return "it bounds a multiple, not the quantity"
    return Bound(value, strict)


def _measured(term: Term, universal: frozenset[Variable]) -> bool:
    return any(isinstance(p, Variable) and (p.role is Role.OUTPUT or p in universal) for p in subterms(term))


def _summands(term: Term, sign: int) -> Iterator[tuple[int, Term]]:
    match term:
        case Arithmetic(operator="+" | "-" as operator, left=left, right=right):
            yield from _summands(left, sign)
            yield from _summands(right, sign if operator == "+" else -sign)
        case Negative(term=inner):
            yield from _summands(inner, -sign)
        case Widen(term=inner):
            yield from _summands(inner, sign)
        case _:  # one summand
            yield sign, term


def _is_square(term: Term) -> bool:
    return isinstance(term, Arithmetic) and term.operator == "*" and term.left == term.right
