"""Truth of a formula over concrete values: exact evaluation, and if that gives no answer, the solver."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Binary, Value
from avow.language.subterms import ports_of
from avow.language.terms import Term, Variable
from avow.solving.replay import opaque_sorts, replay


def judge(term: Term, valuation: Mapping[str, Value], *, effort: int = 5_000) -> bool | None:
    """Whether the formula holds for the values; None if neither evaluation nor Z3 can decide it.

    Partial operations outside their domain (division by zero) are unspecified: True and False hold for any result.
    """
    try:
        return bool(evaluate(term, valuation))
    except NotEvaluable:
        pass
    sorts = _free_sorts(term)
    if not sorts.keys() <= valuation.keys():
        return None
    return replay([term], {v: valuation[v.qualified] for v in sorts.values()}, effort=effort)


TOLERANCE = ": allow a tolerance in the clause, or see `numbers:`"


def as_shown(term: Term, values: Mapping[str, Value]) -> str:
    """A note on a formula that values break and that holds of the digits by which the values are shown: the exact
    numbers, and what to do. Empty for any other formula."""
    names = {v.qualified for v in ports_of(term)}
    held = {n: v for n, v in values.items() if n in names and isinstance(v, Binary)}
    apart = {n: Fraction(v.digits) for n, v in held.items() if Fraction(v.digits) != v}
    try:
        if not apart or evaluate(term, {**values, **apart}) is not True:
            return ""
    except NotEvaluable:
        return ""
    exactly = (f"{n} is {held[n].digits} {'+-'[held[n] < v]} {float(abs(held[n] - v)):.2g}" for n, v in apart.items())
    told = ", ".join(exactly)
    return f"; exactly, {told}, since no float is the decimal number{TOLERANCE}"


def judge_open(term: Term, valuation: Mapping[str, Value], *, effort: int = 5_000) -> bool | None:
    """Whether the formula holds for the values, whatever the values that the valuation omits; None if that depends on
    them, or if Z3 cannot decide it."""
    if opaque_sorts(term):  # the number of their elements is not known
        return None
    known = {v: valuation[v.qualified] for v in _free_sorts(term).values() if v.qualified in valuation}
    return replay([term], known, effort=effort)


def _free_sorts(term: Term) -> dict[str, Variable]:
    """The inputs and outputs that a formula mentions, by qualified name."""
    return {port.qualified: port for port in ports_of(term)}
