"""A second solver's check of the first one's answers: if cvc5 is installed and disagrees, one of the two is wrong.

Such an answer is neither of the two: the caller gives `error`, and reports the disagreement. An `unknown` of cvc5, or a
script that it does not read, has no effect.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Mapping

from avow.base.tuning.effort import SECOND_OPINION_EFFORT
from avow.formulas.formula import conjunction, disjunction
from avow.language.terms import FALSE, Term
from avow.solving import smtlib
from avow.solving.questions import Solution
from avow.solving.translation import Unsupported

CONTRADICTED = "two solvers contradict each other: Z3 says that there are no such values, and cvc5 that there are"


def contradicted(impossible: Iterable[Term], *, effort: int = SECOND_OPINION_EFFORT) -> bool:
    """Whether cvc5 finds one of these formulas satisfiable, all of which Z3 found unsatisfiable."""
    questions = [formula for formula in impossible if formula != FALSE]
    if not questions or importlib.util.find_spec("cvc5") is None:
        return False
    try:
        script = smtlib.formulas_script([disjunction(questions)])
    except Unsupported:
        return False
    return smtlib.ask_cvc5(script, effort=max(1, min(effort, SECOND_OPINION_EFFORT))) == "sat"


def doubted(answer: Solution, formulas: Mapping[str, Term]) -> bool:
    """Whether cvc5 finds the labelled formulas named by an `unsat` satisfiable together. An `unsat` from cvc5 itself is
    not checked again."""
    if answer.status != "unsat" or answer.engine == "cvc5":
        return False
    conflicting = [formula for label, formula in formulas.items() if label in answer.core]
    return contradicted([conjunction(conflicting or formulas.values())])
