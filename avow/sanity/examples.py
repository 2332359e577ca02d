"""Values that were found for one claim often show another one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from avow.base.remembered import by_identity
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.formulas.values import Value
from avow.language.terms import Term, Variable


def meets(values: Mapping[Variable, Value], formulas: Iterable[Term]) -> bool:
    """Whether formulas hold of values that were found for another claim: then there is nothing to ask."""
    named = {variable.qualified: value for variable, value in values.items()}
    try:
        return len(named) == len(values) > 0 and all(_compiled(formula)(named) is True for formula in formulas)
    except NotEvaluable:
        return False


@by_identity(500)
def _compiled(formula: Term) -> Evaluator:
    """Raises NotEvaluable."""
    return compile_term(formula)
