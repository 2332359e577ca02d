"""Variables that no part of a conjunction restricts to finitely many values: a solver finds values for them.

``exists(a in REAL | forall(x in REAL | in.p(x) -> a - 1 <= x and x <= a + 1))``: a solution is checked against the
parts like any other candidate; that none exists relies on the solver.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from avow.base.tuning.effort import SOLVED_EFFORT
from avow.evaluation.compiler import Compiler, Env, NotEvaluable
from avow.formulas.disjunctions import Part
from avow.formulas.formula import conjunction, disjunction, equation, free_variables, negation
from avow.formulas.values import FunctionValue, SequenceValue
from avow.language.subterms import subterms
from avow.language.terms import Quantified, Role, Variable
from avow.solving.questions import solve
from avow.solving.replay import opaque_sorts
from avow.solving.translation import kept_session


def solved_step(
    compiler: Compiler, parts: Sequence[Part], variables: Sequence[Variable], *, unique: bool
) -> Callable[[Env], Iterator[None]]:
    """Binds the variables to values that satisfy every part, if any exist; with `unique`, then to different ones."""
    formula = conjunction(p.term if p.positive else negation(p.term) for p in parts)
    bound = (v for part in subterms(formula) if isinstance(part, Quantified) for v in part.variables)
    # a solver treats elements of unspecified types, and the values of a scenario, differently from the evaluation
    refused = opaque_sorts(formula) or any(v.sort in compiler.domains for v in (*variables, *bound))
    known = {v: compiler.slot(v) for v in free_variables(formula) - frozenset(variables)}
    slots = {v: compiler.bind(v) for v in variables}
    first = {v: Variable(Role.BOUND, f"{v.name} (first)", v.sort) for v in variables}
    another = disjunction(negation(equation(v, other)) for v, other in first.items())
    listed = ", ".join(v.name for v in variables)

    def run(env: Env) -> Iterator[None]:
        given = {v: env[slot] for v, slot in known.items()}
        if refused or any(map(_is_open, given.values())):
            raise NotEvaluable(f"nothing restricts {listed} to finitely many values")
        for formulas in ([formula], [formula, another])[: 2 if unique else 1]:
            with kept_session():
                answer = solve(formulas, given=given, variables=variables, effort=SOLVED_EFFORT, values="unused")
            if answer.status == "unsat":
                return
            if answer.values.keys() < slots.keys():
                raise NotEvaluable(f"nothing restricts {listed} to finitely many values, and the solver finds none")
            for variable, slot in slots.items():
                env[slot] = answer.values[variable]
                given[first[variable]] = answer.values[variable]
            yield None

    return run


def _is_open(value: Any) -> bool:
    """Whether it is, or contains, a table that is only partly known."""
    match value:
        case FunctionValue(table=table):
            return table.__class__ is not dict
        case SequenceValue(items=items) | tuple(items):
            return any(map(_is_open, items))
        case _:  # it is known completely
            return False
