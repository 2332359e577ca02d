"""Many questions of one kind, asked cheaply: do these hypotheses imply this goal, yes or no?

A proof needs no core, no model and no replay, so that a verification condition is one check: one context, each formula
translated once, and one solver in which a question is pushed and popped. If a partial operation occurs, there is no
answer, and the whole question (`avow.solving.questions.entails`) has to be asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Any

from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.formulas.formula import free_variables, negation
from avow.language.terms import Term
from avow.solving.checking import Status, put
from avow.solving.limits import allowed
from avow.solving.questions import entails
from avow.solving.replay import is_partial
from avow.solving.translation import Expr, Translator, Unsupported
from avow.solving.z3_module import z3


@dataclass(slots=True)
class Settler:
    """The solver of one program, or of one node. Not thread-safe."""

    seed: int = 0
    checks: int = 0
    """The number of calls of the solver."""
    _translator: Translator = field(default_factory=Translator)
    _exprs: dict[Term, tuple[Expr, ...] | None] = field(default_factory=dict)
    _solver: Any = None

    def settles(self, hypotheses: Iterable[Term], goal: Term, *, effort: int) -> Status:
        """`unsat`: the hypotheses imply the goal, for all values of the free variables; that is proved. `sat`: it
        cannot be proved (the model is not used, so that nothing is refuted). `unknown` means nothing."""
        try:
            facts = [self._facts(term) for term in (*hypotheses, negation(goal))]
            exprs = [expr for fact in facts if fact is not None for expr in fact]
            return "unknown" if None in facts else self._ask(exprs, effort)
        except (Unsupported, z3.Z3Exception):
            self._solver = None
            return "unknown"

    def proves(self, hypotheses: Sequence[Term], goal: Term, *, effort: int) -> bool:
        """Whether the hypotheses imply the goal; by the whole question, if the short one is not conclusive."""
        match self.settles(hypotheses, goal, effort=effort):
            case "unsat":
                return True
            case "sat":
                return False
            case _:  # not decided: asked in full
                answer = entails(hypotheses, goal, effort=effort, seed=self.seed)
                return answer.verdict is Verdict.PROVED

    def _facts(self, term: Term) -> tuple[Expr, ...] | None:
        """A formula, and its variables' type constraints; None if a partial operation occurs. Raises Unsupported."""
        if term not in self._exprs:
            if is_partial(term):
                self._exprs[term] = None
            else:
                expr = self._translator.term(term)
                self._exprs[term] = (*self._translator.background(free_variables(term)), expr)
        return self._exprs[term]

    def _ask(self, exprs: list[Expr], effort: int) -> Status:
        limit = allowed(effort)
        if limit <= 0:
            return "unknown"
        known = self._translator.opaque_facts()
        if self._solver is None:
            self._solver = z3.Solver(ctx=self._translator.context)
        status = self._check(self._solver, [*known, *exprs], limit, pop=True)
        if status == "unknown":
            # pushed questions are not simplified first, and a solver that has given up once may do so again
            self._solver = None
            status = self._check(z3.Solver(ctx=self._translator.context), [*known, *exprs], allowed(limit), pop=False)
        return status

    def _check(self, solver: Any, exprs: list[Expr], limit: int, *, pop: bool) -> Status:
        if limit <= 0:
            return "unknown"
        if pop:
            solver.push()
        solver.add(*exprs)
        self.checks += 1
        status = put(self._translator, solver, limit, self.seed).status
        if pop:
            solver.pop()
        return status
