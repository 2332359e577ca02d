"""Truth of a formula over concrete values: exact evaluation, and where that cannot answer, the solver."""

from __future__ import annotations

from collections.abc import Mapping

from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Value
from avow.language.subterms import ports_of
from avow.language.terms import Term, Variable
from avow.solving.replay import opaque_sorts, replay


def judge(term: Term, valuation: Mapping[str, Value], *, effort: int = 5_000) -> bool | None:
    """Whether the formula holds of the values; None where neither evaluation nor Z3 can tell.

    What lies outside a partial operation (division by zero) is unspecified: True and False hold whatever it yields.
    """
    try:
        return bool(evaluate(term, valuation))
    except NotEvaluable:
        pass
    sorts = _free_sorts(term)
    if not sorts.keys() <= valuation.keys():
        return None
    return replay([term], {v: valuation[v.qualified] for v in sorts.values()}, effort=effort)


def judge_open(term: Term, valuation: Mapping[str, Value], *, effort: int = 5_000) -> bool | None:
    """Whether the formula holds of the values, whatever those are that the valuation leaves out; None where that
    depends on them, or where Z3 cannot tell."""
    if opaque_sorts(term):  # how many elements they have is not known
        return None
    known = {v: valuation[v.qualified] for v in _free_sorts(term).values() if v.qualified in valuation}
    return replay([term], known, effort=effort)


def _free_sorts(term: Term) -> dict[str, Variable]:
    """The inputs and outputs that a formula mentions, by qualified name."""
    return {port.qualified: port for port in ports_of(term)}
