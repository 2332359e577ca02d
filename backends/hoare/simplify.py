"""Formulas made shorter, with the same meaning: so that triples and proof outlines read as a person would write them.

No proof rests on this: that a triple means what the contract's own formulas mean is asked of the solver at every run
(`Triple.fidelity`).
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from avow.formulas.formula import conjunction, disjunction, free_variables, opposite
from avow.formulas.traversal import transform
from avow.language import terms as t
from avow.language.bounds import constant
from avow.language.sorts import BOOL
from avow.language.subterms import subterms


def simplify(term: t.Term) -> t.Term:
    """An equivalent formula, seldom longer."""
    return transform(term, _step)


def _step(term: t.Term) -> t.Term:
    match term:
        case t.Not(body=body):
            return opposite(body)
        case t.And(items=items):
            return _and(items)
        case t.Or(items=items):
            flat = tuple(dict.fromkeys(_flat(disjunction(items), t.Or)))
            if any(opposite(item) in flat for item in flat):
                return t.TRUE
            atoms = [opposite(item) for item in flat if not isinstance(item, t.And | t.Implies)]
            return disjunction(_known(item, atoms) if isinstance(item, t.And) else item for item in flat)
        case t.Implies(left=left, right=right):
            return _implies(left, right)
        case t.Iff(left=left, right=right):
            if left == right:
                return t.TRUE
            for one, other in ((left, right), (right, left)):
                if one == t.TRUE:
                    return other
                if one == t.FALSE:
                    return opposite(other)
            return term
        case t.Compare():
            return _compare(term)
        case t.Quantified(quantifier=t.Quantifier.UNIQUE, body=body):
            return (
                t.FALSE if body == t.FALSE else term
            )  # of what always holds there is one only where the sort has one value
        case t.Quantified(quantifier=quantifier, variables=variables, body=body, span=span):
            used = free_variables(body)  # no sort is empty
            kept = tuple(v for v in variables if v in used)
            if len(kept) == len(variables):
                return term
            return t.Quantified(quantifier, kept, body, span) if kept else body
        case t.In(item=item, collection=t.SetTerm(items=items)):
            tests = [_compare(t.Compare("==", item, choice)) if item.sort != BOOL else term for choice in items]
            return t.TRUE if t.TRUE in tests else t.FALSE if all(test == t.FALSE for test in tests) else term
        case _:  # nothing to simplify at its head
            return term


def _implies(left: t.Term, right: t.Term) -> t.Term:
    if left == t.TRUE:
        return right
    if right == t.TRUE or left in (t.FALSE, right):
        return t.TRUE
    if right == t.FALSE:
        return opposite(left)
    if isinstance(right, t.Implies):
        return _implies(conjunction((left, right.left)), right.right)
    known = _known(right, _flat(left, t.And))
    return _implies(left, known) if known != right else t.Implies(left, right)


def _and(items: tuple[t.Term, ...]) -> t.Term:
    flat = tuple(dict.fromkeys(_flat(conjunction(items), t.And)))
    if any(opposite(item) in flat for item in flat):
        return t.FALSE
    merged = _merged(flat)
    merged = _bounds(merged)
    if t.FALSE in merged:
        return t.FALSE
    facts = [item for item in merged if not isinstance(item, t.Implies | t.Or | t.And)]
    result = tuple(item if item in facts else _known(item, facts) for item in merged)
    if result != items:
        return _and(result) if result != flat else conjunction(result)
    return conjunction(result)


def _merged(items: tuple[t.Term, ...]) -> tuple[t.Term, ...]:
    """``(a -> q) and (not a -> q)`` is q."""
    result = list(items)
    for item in items:
        if isinstance(item, t.Implies) and item in result:
            other = t.Implies(opposite(item.left), item.right)
            if other in result:
                result[result.index(item)] = item.right
                result.remove(other)
    return tuple(result)


def _bounds(items: tuple[t.Term, ...]) -> tuple[t.Term, ...]:
    """Of several constant bounds of one term only the tightest; FALSE where they leave nothing."""
    best: dict[tuple[t.Term, bool], tuple[Fraction, bool, t.Term]] = {}
    loose: set[t.Term] = set()
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
            return (t.FALSE,)
    return tuple(item for item in items if item not in loose)


def _bound(item: t.Term) -> tuple[t.Term, bool, Fraction, bool] | None:
    """(term, is it a lower bound, the number, is it strict)."""
    if not isinstance(item, t.Compare) or item.operator not in {"<", "<=", ">", ">="}:
        return None
    one, other = constant(item.left), constant(item.right)
    if (one is None) == (other is None):
        return None
    strict = item.operator in {"<", ">"}
    if other is not None:
        return item.left, item.operator.startswith(">"), other, strict
    assert one is not None
    return item.right, item.operator.startswith("<"), one, strict


def _known(term: t.Term, facts: Iterable[t.Term]) -> t.Term:
    """The term where the facts hold: a fact in it is true, its opposite false."""
    bound = {v for part in subterms(term) if isinstance(part, t.Quantified) for v in part.variables}
    usable = [f for f in facts if not (bound & free_variables(f))]
    yes, no = set(usable), {opposite(f) for f in usable}
    if not any(part in yes or part in no for part in subterms(term)):
        return term
    return transform(term, lambda part: t.TRUE if part in yes else t.FALSE if part in no else _step(part))


def _flat(term: t.Term, kind: type[t.And] | type[t.Or]) -> tuple[t.Term, ...]:
    return term.items if isinstance(term, t.And | t.Or) and isinstance(term, kind) else (term,)


def _compare(term: t.Compare) -> t.Term:
    left, right = term.left, term.right
    if left.sort == BOOL:
        same = _step(t.Iff(left, right))
        return same if term.operator == "==" else opposite(same)
    if left == right:
        return t.TRUE if term.operator in {"==", "<=", ">="} else t.FALSE
    if isinstance(left, t.EnumValue) and isinstance(right, t.EnumValue):
        return t.FALSE if term.operator == "==" else t.TRUE
    if isinstance(left, t.Construct) and isinstance(right, t.Construct):
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
        return t.TRUE if holds[term.operator] else t.FALSE
    return term


def _constructs(operator: str, left: t.Construct, right: t.Construct) -> t.Term:
    """Constructors are injective, and differ from each other."""
    if left.constructor != right.constructor:
        return t.FALSE if operator == "==" else t.TRUE
    pairs = zip(left.arguments, right.arguments, strict=True)
    same = _and(tuple(_compare(t.Compare("==", a, b)) for a, b in pairs))
    return same if operator == "==" else opposite(same)
