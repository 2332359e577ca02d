"""Clauses ready to be judged of many cases, and the triggers without which a guarantee says nothing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from avow.backend_kit.programs.judging import Formula
from avow.evaluation.evaluate import NotEvaluable
from avow.formulas.conditions import conditions
from avow.formulas.formula import conjunction, free_variables
from avow.formulas.temporal.cell import CELL
from avow.formulas.temporal.cells import Records
from avow.formulas.temporal.responses import due
from avow.formulas.values import Value
from avow.language.printer import show_term
from avow.language.subterms import histories
from avow.language.terms import TRUE, And, Quantified, Quantifier, Role, Term, Variable

from .generate import Inputs
from .tuning import CONFIDENCE


@dataclass(frozen=True, slots=True)
class Judged(Formula):
    """A formula, ready to be judged of many cases."""

    text: str
    ports: tuple[str, ...]
    """Inputs that it speaks of."""


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
    hits: list[int]
    """How often each trigger was met by a drawn case."""
    edge_hits: list[int]
    """How often by a case at a threshold, which was not drawn."""
    run_hits: list[int]
    """In how many runs each was met."""
    undecided: int = 0
    failure: tuple[Inputs, dict[str, Value]] | None = None


def judged(name: str, formula: Term, text: str, records: Records) -> Judged:
    """A clause; what it remembers of other steps is among the records."""
    made = Formula.made(name, records.clause(formula) if histories(formula) else formula)
    ports = sorted(v.name for v in free_variables(made.term) if v.role is Role.INPUT and CELL not in v.name)
    return Judged(name, made.term, made.evaluator, text, tuple(ports))


def guarantee(name: str, formula: Term, text: str, records: Records) -> Guarantee:
    """The guarantee with its triggers; of a response, that all of what it demands came due."""
    response = due(formula)
    if response is None:
        found = tuple(_trigger(name, c.outer, c.parts, records) for c in conditions(formula))
    elif response.full == TRUE:
        found = ()
    else:
        aim = _trigger(name, response.outer, response.triggers, records)
        full = judged(name, _bound(response.outer, response.full), f"{aim.whole.text}, and what it demands", records)
        found = (Trigger(full, aim.parts),)
    none = [0] * len(found)
    return Guarantee(judged(name, formula, text, records), found, list(none), list(none), list(none))


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


def _trigger(name: str, outer: tuple[Variable, ...], given: tuple[Term, ...], records: Records) -> Trigger:
    joined = conjunction(given)
    items = joined.items if isinstance(joined, And) else (joined,)
    bound = frozenset(outer)
    alone = [item for item in items if not free_variables(item) & bound]
    together = conjunction(item for item in items if free_variables(item) & bound)
    whole = _bound(outer, joined)
    parts = [judged(name, part, "", records) for part in (*alone, _bound(outer, together)) if _of_inputs(part)]
    return Trigger(judged(name, whole, show_term(whole, "unicode").replace("\n", " "), records), tuple(parts))


def _bound(outer: tuple[Variable, ...], formula: Term) -> Term:
    free = free_variables(formula)
    used = tuple(v for v in outer if v in free)
    return Quantified(Quantifier.EXISTS, used, formula) if used else formula


def _of_inputs(formula: Term) -> bool:
    return all(v.role is Role.INPUT for v in free_variables(formula))


def failure_bound(cases: int) -> float:
    """With 95 % confidence, no more than this part of such cases fails, none of so many having failed (1 - 0.05^(1/n);
    "rule of three": about 3/n)."""
    return 1.0 if cases == 0 else 1 - math.pow(1 - CONFIDENCE, 1 / cases)
