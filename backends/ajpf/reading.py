"""How an implication of the contract is read in time: demands as ``[] (H -> <> C)``, prohibitions as
``[] (H -> [] ~C)``.

H and C are the antecedent and the consequent, mapped. If the consequent is about inputs too, these belong to the moment
of the trigger and move to H. Alternatives in H give a property each, each with a vacuity of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from avow.formulas.renaming import bound_names
from avow.language.printer import show_term
from avow.language.terms import FALSE, TRUE, Not, Or, Quantified, Quantifier, Term, Variable

from . import psl
from .checker import Property
from .mapping import Mapped, Mapper, NotCovered, Unit, clauses, has_output, to_formula
from .matching import match
from .options import Extra
from .psl import Always, Eventually, Formula, Implies, Release
from .shape import conjunction, conjuncts, shape
from .timing import Timed
from .tuning import ALTERNATIVES


@dataclass(frozen=True, slots=True)
class Left:
    """A prohibition of the guarantee, in the contract's words, and the plan's property that stands for it."""

    forbidden: str
    extra: str
    ban: Formula
    """That it must not hold at the moment of the trigger: the least that the guarantee requires."""


def read_properties(
    antecedent: Term,
    consequent: Term,
    others: tuple[Variable, ...],
    mapper: Mapper,
    stand_ins: Sequence[Extra],
    timing: Timed | None = None,
) -> Iterator[Property | Left]:
    """The properties, without keys; empty if the consequent is true anyway. With `timing`, the demand is about future
    steps."""
    left, right = shape(antecedent), shape(consequent)
    if left == FALSE:
        yield _eventually(psl.FALSE, psl.TRUE)
        return
    if timing is None and not has_output(right):
        left, right = _turned(left, right, others)
    shared = sorted({v.name for v in others} & bound_names(right))
    if shared:
        raise NotCovered(f"{shared[0]} joins what triggers the guarantee and what it demands", consequent.span)
    bound = tuple(v for v in others if v.name in bound_names(left))
    trigger = mapper.map(shape(Quantified(Quantifier.EXISTS, bound, left)) if bound else left)
    condition = to_formula(trigger)
    if timing is not None and timing.ends is not None:
        kept, ended = to_formula(mapper.map(right)), to_formula(mapper.map(shape(timing.ends)))
        for alternative in _alternatives(condition):
            yield _until(alternative, kept, ended)
        return
    demands, bans = _parted(mapper.map(right))
    if timing is not None and bans:
        raise NotCovered(f"`{timing.operator}` of what is forbidden has no property", consequent.span)
    for inputs, demanded in demands:
        for alternative in _alternatives(_when(condition, inputs)):
            yield _eventually(alternative, demanded)
    for inputs, units in bans:
        kept = psl.disjunction([u.formula for u in units])
        if kept == psl.TRUE:
            continue
        least = Always(Implies(_when(condition, inputs), kept))
        stand_in = _stand_in(units, least, stand_ins)
        if stand_in is not None:
            yield stand_in
            continue
        for alternative in _alternatives(_when(condition, inputs)):
            yield _never(alternative, kept)


def _turned(left: Term, right: Term, others: tuple[Variable, ...]) -> tuple[Term, Term]:
    """A demand of inputs alone forbids the outputs of its trigger: ``out.spray -> in.inside`` is ``in.outside -> not
    out.spray``. (As a trigger, the last action would meet inputs that came after it.)"""
    acts = conjunction([part for part in conjuncts(left) if has_output(part)])
    rest = conjunction([part for part in conjuncts(left) if not has_output(part)])
    bound = tuple(v for v in others if v.name in bound_names(acts) - bound_names(rest))
    done = Quantified(Quantifier.EXISTS, bound, acts) if bound else acts
    return (left, right) if acts == TRUE else (rest, shape(Or((right, Not(done)))))


def _when(condition: Formula, inputs: Sequence[Unit]) -> Formula:
    return psl.conjunction([condition, *(psl.negation(u.formula) for u in inputs)])


def _eventually(trigger: Formula, goal: Formula) -> Property:
    if goal == psl.FALSE:
        return Property("", Always(psl.negation(trigger)), trigger)
    return Property("", Always(Implies(trigger, Eventually(goal))), trigger, goal)


def _never(trigger: Formula, kept: Formula) -> Property:
    """A forbidden formula must not hold from the trigger on. ("Eventually not" would require almost nothing: the agent
    could do what is forbidden, and something else before or afterwards.)"""
    return Property("", Always(Implies(trigger, Always(kept))), trigger, forbidden=psl.negation(kept))


def _until(trigger: Formula, kept: Formula, ended: Formula) -> Property:
    """A condition that holds from the trigger on, until another holds, which need not happen."""
    whole = Always(Implies(trigger, Release(ended, psl.disjunction([kept, ended]))))
    why = "it fails in some state of the agent, and a step of the contract may have several: that refutes nothing"
    return Property("", whole, trigger, indecisive=why)


def _stand_in(units: Sequence[Unit], least: Formula, extras: Sequence[Extra]) -> Left | None:
    """The property of the plan that says when all that the clause forbids must not hold."""
    banned = [u.term for u in units if u.forbids]
    for extra in extras:
        assert extra.forbids is not None
        pattern, names = extra.forbids, bound_names(extra.forbids)
        if len(banned) == len(units) and all(any(True for _ in match(pattern, t, names, {})) for t in banned):
            return Left(" and ".join(map(show_term, banned)), extra.name, least)
    return None


_Clause = tuple[Unit, ...]


def _parted(goal: Mapped) -> tuple[list[tuple[_Clause, Formula]], list[tuple[_Clause, _Clause]]]:
    """The demands of the consequent, grouped by the input parts that it offers as alternatives; and its prohibitions:
    clauses with such alternatives, and the parts that must be kept."""
    if all(unit.output and not unit.forbids for unit in _units(goal)):
        formula = to_formula(goal)
        return ([] if formula == psl.TRUE else [((), formula)]), []
    demands: dict[_Clause, list[Formula]] = {}
    bans: dict[tuple[_Clause, _Clause], None] = {}
    for clause in clauses(goal):
        inputs = tuple(u for u in clause if not u.output)
        outputs = tuple(u for u in clause if u.output)
        formula = psl.disjunction([u.formula for u in outputs])
        if any(u.forbids for u in outputs):
            bans[inputs, outputs] = None
        elif formula != psl.TRUE:
            demands.setdefault(inputs, []).append(formula)
    return [(inputs, psl.conjunction(outputs)) for inputs, outputs in demands.items()], list(bans)


def _units(mapped: Mapped) -> Iterator[Unit]:
    if isinstance(mapped, Unit):
        yield mapped
    else:
        for item in mapped.items:
            yield from _units(item)


def _alternatives(trigger: Formula) -> Sequence[Formula]:
    """The disjuncts of a trigger, unless there are too many."""
    if isinstance(trigger, psl.Or):
        return trigger.items if len(trigger.items) <= ALTERNATIVES else [trigger]
    if not isinstance(trigger, psl.And):
        return [trigger]
    rows: list[list[Formula]] = [[]]
    for item in trigger.items:
        choices = item.items if isinstance(item, psl.Or) else (item,)
        rows = [[*row, choice] for row in rows for choice in choices]
        if len(rows) > ALTERNATIVES:
            return [trigger]
    return [psl.conjunction(row) for row in rows]
