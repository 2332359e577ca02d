"""Negation normal form: `not` only before atoms, no `->`; `<=>` and `if` stay, which may double what they hold."""

from __future__ import annotations

from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.traversal import Steps, run
from avow.language.operators import definition
from avow.language.sorts import BOOL, BoolSort
from avow.language.terms import (
    And,
    Compare,
    Conditional,
    Iff,
    Implies,
    Literal,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Term,
)

_DUAL = {Quantifier.FORALL: Quantifier.EXISTS, Quantifier.EXISTS: Quantifier.FORALL}


def push_negations(term: Term) -> Term:
    """The same meaning, with every `not` before an atom, `exists_unique`, or one side of an `<=>`."""
    return run(_push(term, True))


def _push(term: Term, positive: bool) -> Steps[Term]:
    match term:
        case Not(body=body):
            result: Term = yield _push(body, not positive)
            return result
        case And(items=items) | Or(items=items):
            parts: list[Term] = []
            for item in items:
                part: Term = yield _push(item, positive)
                parts.append(part)
            both = isinstance(term, And) == positive
            return conjunction(parts) if both else disjunction(parts)
        case Implies(left=left, right=right):
            one: Term = yield _push(left, not positive)
            other: Term = yield _push(right, positive)
            return disjunction((one, other)) if positive else conjunction((one, other))
        case Iff(left=left, right=right):
            one = yield _push(left, True)
            other = yield _push(right, positive)
            return _iff(one, other)
        case Operation(sort=BoolSort()) if (defined := definition(term)) is not None:
            result = yield _push(defined, positive)
            return result
        case Conditional(condition=condition, then=then, otherwise=otherwise):
            test: Term = yield _push(condition, True)
            one = yield _push(then, positive)
            other = yield _push(otherwise, positive)
            return Conditional(test, one, other, BOOL, term.span)
        case Compare(operator="==" | "!=" as operator, left=left, right=right) if left.sort == BOOL:
            one = yield _push(left, True)
            other = yield _push(right, positive == (operator == "=="))
            return _iff(one, other)
        case Compare(operator="!=", left=left, right=right):
            return Not(Compare("==", left, right)) if positive else Compare("==", left, right)
        case Quantified(quantifier=quantifier, variables=variables, body=body) if positive or quantifier in _DUAL:
            inner: Term = yield _push(body, positive if quantifier in _DUAL else True)
            return Quantified(quantifier if positive else _DUAL[quantifier], variables, inner, term.span)
        case _:  # an atom
            return term if positive else negation(term)


def _iff(left: Term, right: Term) -> Term:
    for one, other in ((left, right), (right, left)):
        if isinstance(one, Literal):
            return other if one.value else run(_push(other, False))
    return Iff(left, right)
