"""Negation normal form: `not` only before atoms, no `->`; `<=>` and `if` remain, since expanding them may double their
parts."""

from __future__ import annotations

from avow.formulas.formula import conjunction, disjunction, negation
from avow.language import terms as t
from avow.language.operators import definition
from avow.language.sorts import BOOL, BoolSort

_DUAL = {t.Quantifier.FORALL: t.Quantifier.EXISTS, t.Quantifier.EXISTS: t.Quantifier.FORALL}


def push_negations(term: t.Term) -> t.Term:
    """The same meaning, with every `not` before an atom, `exists_unique`, or one side of an `<=>`."""
    return _push(term, True)


def _push(term: t.Term, positive: bool) -> t.Term:
    match term:
        case t.Not(body=body):
            return _push(body, not positive)
        case t.And(items=items) | t.Or(items=items):
            parts = [_push(item, positive) for item in items]
            both = isinstance(term, t.And) == positive
            return conjunction(parts) if both else disjunction(parts)
        case t.Implies(left=left, right=right):
            parts = [_push(left, not positive), _push(right, positive)]
            return disjunction(parts) if positive else conjunction(parts)
        case t.Iff(left=left, right=right):
            return _iff(_push(left, True), _push(right, positive))
        case t.Operation(sort=BoolSort()) if (defined := definition(term)) is not None:
            return _push(defined, positive)
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            one, other = _push(then, positive), _push(otherwise, positive)
            return t.Conditional(_push(condition, True), one, other, BOOL, term.span)
        case t.Compare(operator="==" | "!=" as operator, left=left, right=right) if left.sort == BOOL:
            same = positive == (operator == "==")
            return _iff(_push(left, True), _push(right, same))
        case t.Compare(operator="!=", left=left, right=right):
            return t.Not(t.Compare("==", left, right)) if positive else t.Compare("==", left, right)
        case t.Quantified(quantifier=quantifier, variables=variables, body=body) if positive or quantifier in _DUAL:
            inner = _push(body, positive if quantifier in _DUAL else True)
            return t.Quantified(quantifier if positive else _DUAL[quantifier], variables, inner, term.span)
        case _:  # an atom
            return term if positive else negation(term)


def _iff(left: t.Term, right: t.Term) -> t.Term:
    for one, other in ((left, right), (right, left)):
        if isinstance(one, t.Literal):
            return other if one.value else _push(other, False)
    return t.Iff(left, right)
