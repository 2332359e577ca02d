"""Responses in past-time form: `T -> within[n steps](R)` is violated if T held n steps ago and R has not held since."""

from __future__ import annotations

from dataclasses import replace

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.temporal.cell import Unsaid
from avow.language import terms as t
from avow.language.sorts import BOOL
from avow.language.subterms import histories


def in_the_past(formula: t.Term) -> t.Term:
    """The clause without responses: its demands on later steps, expressed over earlier ones. `F within[d s] G` with two
    arguments is the instant right after d s with F, the first of them with G. Raises Unsaid if it demands that
    something happens eventually, which no finite prefix of a run can violate."""
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
            missed = _going_on(negation(wanted), trigger, replace(limit, relation=">=" if limit.steps else ">"))
            by_an_instant = replace(missed, operator=t.Past.WITHIN, limit=limit)
            exact = limit.steps or _begins_at_an_instant(wanted)
            return negation(missed if exact else disjunction((missed, by_an_instant)))
        case t.Past.FOR:
            return t.Implies(t.History(t.Past.ONCE, (trigger,), BOOL, limit, span), wanted, span)
        case t.Past.UNTIL:
            return t.Implies(_going_on(negation(response.arguments[1]), trigger), wanted, span)
        case _:
            raise Unsaid(f"`{response.operator}`, which no first steps of a run can break", span)


def _going_on(holds: t.Term, trigger: t.Term, limit: t.Limit | None = None) -> t.History:
    return t.History(t.Past.SINCE, (holds, conjunction((trigger, holds))), BOOL, limit)


def _begins_at_an_instant(formula: t.Term) -> bool:
    """Whether a formula is never false at an instant and true right after it, as `not arrived(in.p)` is."""
    at_steps = (t.Past.ARRIVED, t.Past.ROSE, t.Past.FELL, t.Past.CHANGED, t.Past.PREVIOUS)
    match formula:
        case t.And() | t.Or() | t.History(operator=t.Past.ONCE | t.Past.HELD):
            return all(map(_begins_at_an_instant, formula.children))
        case _:  # changes at steps alone, or in ways of which none is known
            return not histories(formula) or (isinstance(formula, t.History) and formula.operator in at_steps)


def pending(formula: t.Term) -> t.Term | None:
    """The past-time formula for when a response clause demands something of future steps (for some values of its
    quantified variables); None if it is not a response, or one that no finite prefix can violate."""
    if (found := responding(formula)) is None:
        return None
    waits = _waits(conjunction(found[1]), found[2])
    return None if waits is None else _somewhere(found[0], waits)


def _waits(trigger: t.Term, response: t.History) -> t.Term | None:
    limit = response.limit
    match response.operator:
        case t.Past.NEXT:
            return trigger
        case t.Past.WITHIN:
            assert limit is not None
            early = replace(limit, relation="<" if limit.steps else "<=")
            return _going_on(negation(response.arguments[0]), trigger, early)
        case t.Past.FOR:
            assert limit is not None
            return _going_on(t.TRUE, trigger, replace(limit, relation="<"))
        case t.Past.UNTIL:
            return _going_on(negation(response.arguments[1]), trigger)
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
    waiting = t.History(t.Past.PREVIOUS, (_going_on(negation(wanted), trigger), t.FALSE), BOOL)
    met = conjunction((wanted, disjunction((trigger, waiting))))
    return _somewhere(found[0], met)


def _somewhere(outer: tuple[t.Variable, ...], formula: t.Term) -> t.Term:
    return t.Quantified(t.Quantifier.EXISTS, outer, formula) if outer else formula
