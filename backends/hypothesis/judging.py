"""Clauses ready to be judged of many cases, and the triggers without which a guarantee says nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.evaluation.truth import judge
from avow.formulas.conditions import conditions
from avow.formulas.formula import conjunction, free_variables
from avow.formulas.values import Value
from avow.language.printer import show_term
from avow.language.terms import And, Quantified, Quantifier, Role, Term, Variable
from avow.tuning.effort import JUDGE_EFFORT

from . import wire
from .generate import Inputs


@dataclass(slots=True)
class Judged:
    """A formula, ready to be judged of many cases."""

    name: str
    formula: Term
    text: str
    evaluator: Evaluator | None
    ports: tuple[str, ...]
    """Inputs that it speaks of."""

    def holds(self, valuation: Mapping[str, Value]) -> bool | None:
        if self.evaluator is not None:
            try:
                return bool(self.evaluator(valuation))
            except NotEvaluable:
                pass
        return judge(self.formula, valuation, effort=JUDGE_EFFORT)


@dataclass(slots=True)
class Trigger:
    """A condition that has to be met by some case; `parts` together imply it, where they speak of inputs only."""

    whole: Judged
    parts: tuple[Judged, ...]


@dataclass(slots=True)
class Guarantee:
    """A guarantee and the triggers that it has: each has to be met by some case."""

    judged: Judged
    triggers: tuple[Trigger, ...]
    hits: list[int] = field(default_factory=list)
    """How often each trigger was met by a drawn case."""
    edge_hits: list[int] = field(default_factory=list)
    """How often by a case at a threshold, which was not drawn."""
    undecided: int = 0
    failure: tuple[Inputs, dict[str, Value]] | None = None


def judged(clause: Mapping[str, Any]) -> Judged:
    return _ready(clause["name"], wire.decode(clause["formula"]), clause["text"])


def _ready(name: str, formula: Term, text: str) -> Judged:
    try:
        evaluator: Evaluator | None = compile_term(formula)
    except NotEvaluable:
        evaluator = None
    ports = sorted(v.name for v in free_variables(formula) if v.role is Role.INPUT)
    return Judged(name, formula, text, evaluator, tuple(ports))


def guarantee(clause: Judged) -> Guarantee:
    """The guarantee with its triggers."""
    found = tuple(_trigger(clause.name, c.outer, c.parts) for c in conditions(clause.formula))
    return Guarantee(clause, found, [0] * len(found), [0] * len(found))


def blamed(parts: Iterable[Judged], values: Mapping[str, Value]) -> tuple[str, ...] | None:
    """The inputs that the first failing part speaks of; None where none fails (or none can be evaluated)."""
    for part in parts:
        if part.evaluator is None or not part.ports:
            continue
        try:
            if not part.evaluator(values):
                return part.ports
        except NotEvaluable:
            continue
    return None


def _trigger(name: str, outer: tuple[Variable, ...], given: tuple[Term, ...]) -> Trigger:
    joined = conjunction(given)
    items = joined.items if isinstance(joined, And) else (joined,)
    bound = frozenset(outer)
    alone = [item for item in items if not free_variables(item) & bound]
    together = conjunction(item for item in items if free_variables(item) & bound)
    whole = _bound(outer, joined)
    parts = [_ready(name, part, "") for part in (*alone, _bound(outer, together)) if _of_inputs(part)]
    return Trigger(_ready(name, whole, show_term(whole, "unicode").replace("\n", " ")), tuple(parts))


def _bound(outer: tuple[Variable, ...], formula: Term) -> Term:
    free = free_variables(formula)
    used = tuple(v for v in outer if v in free)
    return Quantified(Quantifier.EXISTS, used, formula) if used else formula


def _of_inputs(formula: Term) -> bool:
    return all(v.role is Role.INPUT for v in free_variables(formula))
