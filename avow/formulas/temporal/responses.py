"""Responses in past-time form: `T -> within[n steps](R)` is violated if T held n steps ago and R has not held since."""

from __future__ import annotations

from dataclasses import replace

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.temporal.cell import Unsaid
from avow.language import terms as t
from avow.language.sorts import BOOL


def in_the_past(formula: t.Term) -> t.Term:
    """The clause without responses: its demands on later steps, expressed over earlier ones. Raises Unsaid if it
    demands that something happens eventually, which no finite prefix of a run can violate."""
    match formula:
        case t.Quantified(quantifier=t.Quantifier.FORALL):
            return formula.rebuild((in_the_past(formula.body),))
        case t.Implies() | t.History() if (found := _response(formula)) is not None:
            triggers, response = found
            return _demanded(conjunction(triggers), response)
        case _:  # no response in it
            return formula


def _response(formula: t.Term) -> tuple[list[t.Term], t.History] | None:
    """The premises of a response that is a formula's right side, and the response; None if there is none."""
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
    """The past-time formula for when a response clause demands something of future steps (for some values of its
    quantified variables); None if it is not a response, or one that no finite prefix can violate."""
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
        case _:  # eventually
            return None


@dataclass(frozen=True, slots=True)
class Due:
    """``T -> next(R)`` and the like: T is the conjunction of `triggers`, `outer` are the quantified variables around
    it."""

    outer: tuple[t.Variable, ...]
    triggers: tuple[t.Term, ...]
    full: t.Term
    """The past-time formula that everything some trigger demands has come due."""


def due(formula: t.Term) -> Due | None:
    """When a response clause demands something; None for other clauses."""
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
        case _:  # due with the trigger
            pass
    return Due(outer, triggers, full)


def responding(formula: t.Term) -> tuple[tuple[t.Variable, ...], tuple[t.Term, ...], t.History] | None:
    """The variables of the quantifiers around a response clause, its triggers, and the response; None for other
    clauses."""
    outer = list[t.Variable]()
    while isinstance(formula, t.Quantified) and formula.quantifier is t.Quantifier.FORALL:
        outer.extend(formula.variables)
        formula = formula.body
    found = _response(formula)
    return None if found is None else (tuple(outer), tuple(found[0]), found[1])


def fulfilled(formula: t.Term) -> t.Term | None:
    """The past-time formula for when a clause ``T -> within[…](R)`` is met (for some values of its quantified
    variables); None for other clauses."""
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
