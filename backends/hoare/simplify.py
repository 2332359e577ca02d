"""Formulas made shorter, with the same meaning: so that triples and proof outlines read as a person would write them.

No proof rests on this: that a triple means what the contract's own formulas mean is asked of the solver at every run
(`Triple.fidelity`).
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from avow.formulas.formula import conjunction, disjunction, free_variables, opposite
from avow.formulas.traversal import transform
from avow.language.bounds import constant
from avow.language.sorts import BOOL
from avow.language.subterms import subterms
from avow.language.terms import (
    FALSE,
    TRUE,
    And,
    Compare,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Not,
    Or,
    Quantified,
    Quantifier,
    SetTerm,
    Term,
)


def simplify(term: Term) -> Term:
    """An equivalent formula, seldom longer."""
    return transform(term, _step)


def _step(term: Term) -> Term:
    match term:
        case Not(body=body):
            return opposite(body)
        case And(items=items):
            return _and(items)
        case Or(items=items):
            flat = tuple(dict.fromkeys(_flat(disjunction(items), Or)))
            if any(opposite(item) in flat for item in flat):
                return TRUE
            atoms = [opposite(item) for item in flat if not isinstance(item, And | Implies)]
            return disjunction(_known(item, atoms) if isinstance(item, And) else item for item in flat)
        case Implies(left=left, right=right):
            return _implies(left, right)
        case Iff(left=left, right=right):
            if left == right:
                return TRUE
            for one, other in ((left, right), (right, left)):
                if one == TRUE:
                    return other
                if one == FALSE:
                    return opposite(other)
            return term
        case Compare():
            return _compare(term)
        case Quantified(quantifier=Quantifier.UNIQUE, body=body):
            return (
                FALSE if body == FALSE else term
            )  # of what always holds there is one only where the sort has one value
        case Quantified(quantifier=quantifier, variables=variables, body=body, span=span):
            used = free_variables(body)  # no sort is empty
            kept = tuple(v for v in variables if v in used)
            if len(kept) == len(variables):
                return term
            return Quantified(quantifier, kept, body, span) if kept else body
        case In(item=item, collection=SetTerm(items=items)):
            tests = [_compare(Compare("==", item, choice)) if item.sort != BOOL else term for choice in items]
            return TRUE if TRUE in tests else FALSE if all(test == FALSE for test in tests) else term
        case _:  # nothing to simplify at its head
            return term


def _implies(left: Term, right: Term) -> Term:
    if left == TRUE:
        return right
    if right == TRUE or left in (FALSE, right):
        return TRUE
    if right == FALSE:
        return opposite(left)
    if isinstance(right, Implies):
        return _implies(conjunction((left, right.left)), right.right)
    known = _known(right, _flat(left, And))
    return _implies(left, known) if known != right else Implies(left, right)


def _and(items: tuple[Term, ...]) -> Term:
    flat = tuple(dict.fromkeys(_flat(conjunction(items), And)))
    if any(opposite(item) in flat for item in flat):
        return FALSE
    merged = _merged(flat)
    merged = _bounds(merged)
    if FALSE in merged:
        return FALSE
    facts = [item for item in merged if not isinstance(item, Implies | Or | And)]
    result = tuple(item if item in facts else _known(item, facts) for item in merged)
    if result != items:
        return _and(result) if result != flat else conjunction(result)
    return conjunction(result)


def _merged(items: tuple[Term, ...]) -> tuple[Term, ...]:
    """``(a -> q) and (not a -> q)`` is q."""
    result = list(items)
    for item in items:
        if isinstance(item, Implies) and item in result:
            other = Implies(opposite(item.left), item.right)
            if other in result:
                result[result.index(item)] = item.right
                result.remove(other)
    return tuple(result)


def _bounds(items: tuple[Term, ...]) -> tuple[Term, ...]:
    """Of several constant bounds of one term only the tightest; FALSE where they leave nothing."""
    best: dict[tuple[Term, bool], tuple[Fraction, bool, Term]] = {}
    loose: set[Term] = set()
    for item in items:
        found = _bound(item)
        if found is None:
            continue
        term, is_lower, value, strict = found
        old = best.get((term, is_lower))
        if old is None:
            best[term, is_lower] = (value, strict, item)
        elif (
            (value, strict) == old[:2]
            or ((value > old[0]) is is_lower and value != old[0])
            or (strict and value == old[0])
        ):
            loose.add(old[2])
            best[term, is_lower] = (value, strict, item)
        else:
            loose.add(item)
    for (term, is_lower), (value, strict, _) in best.items():
        upper = best.get((term, False)) if is_lower else None
        if upper is not None and (value > upper[0] or (value == upper[0] and (strict or upper[1]))):
            return (FALSE,)
    return tuple(item for item in items if item not in loose)


def _bound(item: Term) -> tuple[Term, bool, Fraction, bool] | None:
    """(term, is it a lower bound, the number, is it strict)."""
    if not isinstance(item, Compare) or item.operator not in {"<", "<=", ">", ">="}:
        return None
    one, other = constant(item.left), constant(item.right)
    if (one is None) == (other is None):
        return None
    strict = item.operator in {"<", ">"}
    if other is not None:
        return item.left, item.operator.startswith(">"), other, strict
    assert one is not None
    return item.right, item.operator.startswith("<"), one, strict


def _known(term: Term, facts: Iterable[Term]) -> Term:
    """The term where the facts hold: a fact in it is true, its opposite false."""
    bound = {v for part in subterms(term) if isinstance(part, Quantified) for v in part.variables}
    usable = [f for f in facts if not (bound & free_variables(f))]
    yes, no = set(usable), {opposite(f) for f in usable}
    if not any(part in yes or part in no for part in subterms(term)):
        return term
    return transform(term, lambda part: TRUE if part in yes else FALSE if part in no else _step(part))


def _flat(term: Term, kind: type[And] | type[Or]) -> tuple[Term, ...]:
    return term.items if isinstance(term, And | Or) and isinstance(term, kind) else (term,)


def _compare(term: Compare) -> Term:
    left, right = term.left, term.right
    if left.sort == BOOL:
        same = _step(Iff(left, right))
        return same if term.operator == "==" else opposite(same)
    if left == right:
        return TRUE if term.operator in {"==", "<=", ">="} else FALSE
    if isinstance(left, EnumValue) and isinstance(right, EnumValue):
        return FALSE if term.operator == "==" else TRUE
    if isinstance(left, Construct) and isinstance(right, Construct):
        return _constructs(term.operator, left, right)
    one, other = constant(left), constant(right)
    if one is not None and other is not None:
        holds = {
            "==": one == other,
            "!=": one != other,
            "<": one < other,
            "<=": one <= other,
            ">": one > other,
            ">=": one >= other,
        }
        return TRUE if holds[term.operator] else FALSE
    return term


def _constructs(operator: str, left: Construct, right: Construct) -> Term:
    """Constructors are injective, and differ from each other."""
    if left.constructor != right.constructor:
        return FALSE if operator == "==" else TRUE
    pairs = zip(left.arguments, right.arguments, strict=True)
    same = _and(tuple(_compare(Compare("==", a, b)) for a, b in pairs))
    return same if operator == "==" else opposite(same)
