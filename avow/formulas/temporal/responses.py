"""Responses, said by the past: `T -> within[n steps](R)` is broken where, so many steps ago, T was met and R was not
since."""

from __future__ import annotations

from dataclasses import replace

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.temporal.cell import Unsaid
from avow.language.sorts import BOOL
from avow.language.terms import (
    FALSE,
    RESPONSES,
    TRUE,
    History,
    Implies,
    Limit,
    Past,
    Quantified,
    Quantifier,
    Term,
    Variable,
)


def in_the_past(formula: Term) -> Term:
    """A clause without responses: what it demands of later steps, said of earlier ones. Raises Unsaid where it demands
    that something comes at some time, which no first steps of a run can break."""
    match formula:
        case Quantified(quantifier=Quantifier.FORALL):
            return formula.rebuild((in_the_past(formula.body),))
        case Implies() | History() if (found := _response(formula)) is not None:
            triggers, response = found
            return _demanded(conjunction(triggers), response)
        case _:  # it has none
            return formula


def _response(formula: Term) -> tuple[list[Term], History] | None:
    """What stands before a response that is a formula's right side, and the response; None where there is none."""
    triggers = list[Term]()
    while isinstance(formula, Implies):
        triggers.append(formula.left)
        formula = formula.right
    return (triggers, formula) if isinstance(formula, History) and formula.operator in RESPONSES else None


def _demanded(trigger: Term, response: History) -> Term:
    wanted, limit, span = response.arguments[0], response.limit, response.span
    match response.operator:
        case Past.NEXT:
            return Implies(History(Past.PREVIOUS, (trigger, FALSE), BOOL, None, span), wanted, span)
        case Past.WITHIN:
            assert limit is not None
            late = Limit(">=" if limit.steps else ">", limit.amount, limit.steps)
            unmet = negation(wanted)
            return negation(History(Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL, late, span))
        case Past.FOR:
            return Implies(History(Past.ONCE, (trigger,), BOOL, limit, span), wanted, span)
        case Past.UNTIL:
            ended = response.arguments[1]
            waiting = conjunction((trigger, negation(ended)))
            return Implies(History(Past.SINCE, (negation(ended), waiting), BOOL, None, span), wanted, span)
        case _:
            raise Unsaid(f"`{response.operator}`, which no first steps of a run can break", span)


def pending(formula: Term) -> Term | None:
    """When a clause that is a response demands something of steps to come (of any values of its quantified variables),
    as a formula of the past; None where it is no response, or one that no first steps can break."""
    if (found := responding(formula)) is None:
        return None
    waits = _waits(conjunction(found[1]), found[2])
    return None if waits is None else _somewhere(found[0], waits)


def _waits(trigger: Term, response: History) -> Term | None:
    match response.operator:
        case Past.NEXT:
            return trigger
        case Past.WITHIN | Past.FOR:
            assert response.limit is not None
            early = replace(response.limit, relation="<")
            unmet = negation(response.arguments[0]) if response.operator is Past.WITHIN else TRUE
            return History(Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL, early, response.span)
        case Past.UNTIL:
            going = negation(response.arguments[1])
            return History(Past.SINCE, (going, conjunction((trigger, going))), BOOL, None, response.span)
        case _:  # it comes at some time
            return None


@dataclass(frozen=True, slots=True)
class Due:
    """``T -> next(R)`` and its like: `triggers` together are T, `outer` the quantified variables around it."""

    outer: tuple[Variable, ...]
    triggers: tuple[Term, ...]
    full: Term
    """That all of what a trigger demands has come due, of some trigger, as a formula of the past."""


def due(formula: Term) -> Due | None:
    """When a clause that is a response demands something; None of other clauses."""
    found = responding(formula)
    if found is None:
        return None
    outer, triggers, response = found
    full = conjunction(triggers)
    match response.operator:
        case Past.NEXT:
            full = History(Past.PREVIOUS, (full, FALSE), BOOL)
        case Past.WITHIN | Past.FOR:
            assert response.limit is not None
            full = History(Past.SINCE, (TRUE, full), BOOL, replace(response.limit, relation=">="))
        case _:  # with the trigger
            pass
    return Due(outer, triggers, full)


def responding(formula: Term) -> tuple[tuple[Variable, ...], tuple[Term, ...], History] | None:
    """Of a clause that is a response: the variables of the quantifiers around it, what triggers it, and the response;
    None of other clauses."""
    outer = list[Variable]()
    while isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL:
        outer.extend(formula.variables)
        formula = formula.body
    found = _response(formula)
    return None if found is None else (tuple(outer), tuple(found[0]), found[1])


def fulfilled(formula: Term) -> Term | None:
    """When a clause ``T -> within[…](R)`` is met (of any values of its quantified variables), as a formula of the past;
    None of other clauses."""
    found = responding(formula)
    if found is None or found[2].operator is not Past.WITHIN:
        return None
    trigger, wanted = conjunction(found[1]), found[2].arguments[0]
    unmet = negation(wanted)
    waiting = History(Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL)
    met = conjunction((wanted, disjunction((trigger, History(Past.PREVIOUS, (waiting, FALSE), BOOL)))))
    return _somewhere(found[0], met)


def _somewhere(outer: tuple[Variable, ...], formula: Term) -> Term:
    return Quantified(Quantifier.EXISTS, outer, formula) if outer else formula
