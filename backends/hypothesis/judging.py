"""Clauses prepared to be judged on many cases, and the triggers without which a guarantee is vacuous."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from avow.backend_kit.programs.judging import Formula
from avow.formulas.conditions import Condition, conditions
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cell import CELL
from avow.formulas.temporal.cells import Records
from avow.formulas.temporal.responses import due
from avow.language.printer import show_term
from avow.language.subterms import histories
from avow.language.terms import TRUE, Quantified, Quantifier, Role, Term

from .tuning import CONFIDENCE


@dataclass(frozen=True, slots=True)
class Judged(Formula):
    """A formula, prepared to be judged on many cases."""

    text: str
    ports: tuple[str, ...]
    """The inputs in it."""


@dataclass(slots=True)
class Guarantee:
    """A guarantee and its triggers: conditions, each of which some case has to meet."""

    judged: Judged
    triggers: tuple[Judged, ...]
    parts: tuple[tuple[Judged, ...], ...]
    """The parts of each trigger: the more parts hold, the nearer a case is."""
    hits: list[int]
    """How often each trigger was met."""
    run_hits: list[int]
    """In how many runs each was met."""
    undecided: int = 0


def judged(name: str, formula: Term, records: Records) -> Judged:
    """A clause; its memory of other steps is among the records."""
    made = Formula.made(name, records.clause(formula) if histories(formula) else formula)
    ports = sorted(v.name for v in free_variables(made.term) if v.role is Role.INPUT and CELL not in v.name)
    return Judged(name, made.term, made.evaluator, _shown(formula), tuple(ports))


def guarantee(name: str, formula: Term, records: Records) -> Guarantee:
    """The guarantee with its triggers; for a response, that its whole demand became due."""
    response = due(formula)
    parts: list[tuple[Judged, ...]] = []
    if response is None:
        met = conditions(formula)
        found = tuple(judged(name, c.formula, records) for c in met)
        each = (tuple(judged(name, Condition(c.outer, (part,)).formula, records) for part in c.parts) for c in met)
        parts = [several if len(several) > 1 else () for several in each]
    elif response.full == TRUE:
        found = ()
    else:
        used = tuple(v for v in response.outer if v in free_variables(response.full))
        full = Quantified(Quantifier.EXISTS, used, response.full) if used else response.full
        told = f"{_shown(formula)} is due before the run ends"
        found, parts = (replace(judged(name, full, records), text=told),), [()]
    none = [0] * len(found)
    return Guarantee(judged(name, formula, records), found, tuple(parts), none, list(none))


def _shown(formula: Term) -> str:
    return show_term(formula, "unicode").replace("\n", " ")


def failure_bound(cases: int) -> float:
    """With 95 % confidence, no more than this part of such cases fails if none of so many failed (1 - 0.05^(1/n);
    "rule of three": about 3/n), rounded up to six decimals."""
    return 1.0 if cases == 0 else math.ceil((1 - math.pow(1 - CONFIDENCE, 1 / cases)) * 10**6) / 10**6


MEANING = (
    "if the cases were independent: with this confidence, a case drawn as these were fails with a probability below "
    "the bound; it is no probability about the robot's own inputs"
)
"""The condition of a bound, for the details of a record."""
