"""Responses, said by the past: `T -> within[n steps](R)` is broken where, so many steps ago, T was met and R was not
since."""

from __future__ import annotations

from dataclasses import replace

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.temporal.cell import Unsaid
from avow.language import terms as t
from avow.language.sorts import BOOL


def in_the_past(formula: t.Term) -> t.Term:
    """A clause without responses: what it demands of later steps, said of earlier ones. Raises Unsaid where it demands
    that something comes at some time, which no first steps of a run can break."""
    match formula:
        case t.Quantified(quantifier=t.Quantifier.FORALL):
            return formula.rebuild((in_the_past(formula.body),))
        case t.Implies() | t.History() if (found := _response(formula)) is not None:
            triggers, response = found
            return _demanded(conjunction(triggers), response)
        case _:  # it has none
            return formula


def _response(formula: t.Term) -> tuple[list[t.Term], t.History] | None:
    """What stands before a response that is a formula's right side, and the response; None where there is none."""
    triggers = list[t.Term]()
    while isinstance(formula, t.Implies):
        triggers.append(formula.left)
        formula = formula.right
    return (triggers, formula) if isinstance(formula, t.History) and formula.operator in t.RESPONSES else None


def _demanded(trigger: t.Term, response: t.History) -> t.Term:
    wanted, limit, span = response.arguments[0], response.limit, response.span
    match response.operator:
        case t.Past.NEXT:
            return t.Implies(t.History(t.Past.PREVIOUS, (trigger, t.FALSE), BOOL, None, span), wanted, span)
        case t.Past.WITHIN:
            assert limit is not None
            late = t.Limit(">=" if limit.steps else ">", limit.amount, limit.steps)
            unmet = negation(wanted)
            return negation(t.History(t.Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL, late, span))
        case t.Past.FOR:
            return t.Implies(t.History(t.Past.ONCE, (trigger,), BOOL, limit, span), wanted, span)
        case t.Past.UNTIL:
            ended = response.arguments[1]
            waiting = conjunction((trigger, negation(ended)))
            return t.Implies(t.History(t.Past.SINCE, (negation(ended), waiting), BOOL, None, span), wanted, span)
        case _:
            raise Unsaid(f"`{response.operator}`, which no first steps of a run can break", span)


def pending(formula: t.Term) -> t.Term | None:
    """When a clause that is a response demands something of steps to come (of any values of its quantified variables),
    as a formula of the past; None where it is no response, or one that no first steps can break."""
    if (found := responding(formula)) is None:
        return None
    waits = _waits(conjunction(found[1]), found[2])
    return None if waits is None else _somewhere(found[0], waits)


def _waits(trigger: t.Term, response: t.History) -> t.Term | None:
    match response.operator:
        case t.Past.NEXT:
            return trigger
        case t.Past.WITHIN | t.Past.FOR:
            assert response.limit is not None
            early = replace(response.limit, relation="<")
            unmet = negation(response.arguments[0]) if response.operator is t.Past.WITHIN else t.TRUE
            return t.History(t.Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL, early, response.span)
        case t.Past.UNTIL:
            going = negation(response.arguments[1])
            return t.History(t.Past.SINCE, (going, conjunction((trigger, going))), BOOL, None, response.span)
        case _:  # it comes at some time
            return None


@dataclass(frozen=True, slots=True)
class Due:
    """``T -> next(R)`` and its like: `triggers` together are T, `outer` the quantified variables around it."""

    outer: tuple[t.Variable, ...]
    triggers: tuple[t.Term, ...]
    full: t.Term
    """That all of what a trigger demands has come due, of some trigger, as a formula of the past."""


def due(formula: t.Term) -> Due | None:
    """When a clause that is a response demands something; None of other clauses."""
    found = responding(formula)
    if found is None:
        return None
    outer, triggers, response = found
    full = conjunction(triggers)
    match response.operator:
        case t.Past.NEXT:
            full = t.History(t.Past.PREVIOUS, (full, t.FALSE), BOOL)
        case t.Past.WITHIN | t.Past.FOR:
            assert response.limit is not None
            full = t.History(t.Past.SINCE, (t.TRUE, full), BOOL, replace(response.limit, relation=">="))
        case _:  # with the trigger
            pass
    return Due(outer, triggers, full)


def responding(formula: t.Term) -> tuple[tuple[t.Variable, ...], tuple[t.Term, ...], t.History] | None:
    """Of a clause that is a response: the variables of the quantifiers around it, what triggers it, and the response;
    None of other clauses."""
    outer = list[t.Variable]()
    while isinstance(formula, t.Quantified) and formula.quantifier is t.Quantifier.FORALL:
        outer.extend(formula.variables)
        formula = formula.body
    found = _response(formula)
    return None if found is None else (tuple(outer), tuple(found[0]), found[1])


def fulfilled(formula: t.Term) -> t.Term | None:
    """When a clause ``T -> within[…](R)`` is met (of any values of its quantified variables), as a formula of the past;
    None of other clauses."""
    found = responding(formula)
    if found is None or found[2].operator is not t.Past.WITHIN:
        return None
    trigger, wanted = conjunction(found[1]), found[2].arguments[0]
    unmet = negation(wanted)
    waiting = t.History(t.Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL)
    met = conjunction((wanted, disjunction((trigger, t.History(t.Past.PREVIOUS, (waiting, t.FALSE), BOOL)))))
    return _somewhere(found[0], met)


def _somewhere(outer: tuple[t.Variable, ...], formula: t.Term) -> t.Term:
    return t.Quantified(t.Quantifier.EXISTS, outer, formula) if outer else formula
