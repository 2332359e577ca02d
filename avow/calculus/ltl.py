"""Temporal properties over an explicit graph of steps: is there a run that violates the property, and which?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import assert_never

from avow.base.tuning.effort import PRODUCT_STEPS
from avow.formulas import ltl
from avow.formulas.lasso import Lasso as Lasso
from avow.formulas.lasso import accepted_run, monitor, rejected_prefix
from avow.formulas.ltl import TooLarge
from avow.solving.limits import spend, spent
from avow.system.temporal import Operator, Property, State


def normal(formula: Property, positive: bool = True) -> ltl.Normal[State]:
    """Negation normal form, of the formula or of its negation."""
    if isinstance(formula, State):
        return ltl.Lit(formula, positive)
    parts = formula.parts
    match formula.operator:
        case Operator.NOT:
            return normal(parts[0], not positive)
        case Operator.AND | Operator.OR:
            items = [normal(part, positive) for part in parts]
            return ltl.join(items, (formula.operator is Operator.AND) == positive)
        case Operator.IMPLIES:
            return ltl.join([normal(parts[0], not positive), normal(parts[1], positive)], not positive)
        case Operator.IFF:
            one, other = parts
            same = ltl.join([normal(one), normal(other, positive)], True)
            opposite = ltl.join([normal(one, False), normal(other, not positive)], True)
            return ltl.join([same, opposite], False)
        case Operator.NEXT:
            return ltl.Next(normal(parts[0], positive))
        case Operator.ALWAYS:
            return ltl.always(normal(parts[0], positive), positive)
        case Operator.EVENTUALLY:
            return ltl.eventually(normal(parts[0], positive), positive)
        case Operator.UNTIL:
            return ltl.until(normal(parts[0], positive), normal(parts[1], positive), positive)
        case _:
            assert_never(formula.operator)


def demands_progress(formula: Property) -> bool:
    """Whether the property demands that something happens eventually: then a system that stops violates it."""
    return any(isinstance(part, ltl.Until) for part in ltl.parts(normal(formula)))


class TooLong(Exception):  # noqa: N818 - it names what happened
    """No answer within the effort limit, or the property is too large to check."""


Judge = Callable[[int, State], bool]


def violation(
    formula: Property,
    initial: Iterable[int],
    successors: Callable[[int], Sequence[int]],
    holds: Judge,
    deadline: float | None = None,
) -> Lasso | None:
    """A run of the graph that violates the property, or None. Every step must have a successor for a run to count.

    `deadline` is in units of `avow.solving.limits.spent`; raises TooLong after it.
    """
    automaton, label, tick = _search(normal(formula, positive=False), holds, deadline)
    return accepted_run(initial, successors, label, automaton, tick=tick)


def refuted_prefix(
    formula: Property,
    initial: Iterable[int],
    successors: Callable[[int], Sequence[int]],
    holds: Judge,
    deadline: float | None = None,
) -> tuple[int, ...] | None:
    """The steps of a shortest prefix of a run all of whose continuations violate the property, or None.

    `deadline` is in units of `avow.solving.limits.spent`; raises TooLong after it.
    """
    automaton, label, tick = _search(normal(formula), holds, deadline)
    return rejected_prefix(initial, successors, label, monitor(automaton), tick)


def _search(
    wanted: ltl.Normal[State], holds: Judge, deadline: float | None
) -> tuple[ltl.Automaton[State], Callable[[int], int], Callable[[], None]]:
    """The automaton of a property, the state formulas that it reads at each step, and the counter of a search through
    it."""
    try:
        automaton = ltl.build(wanted)
    except TooLarge:
        raise TooLong from None

    @cache
    def label(step: int) -> int:
        return sum(1 << at for at, state in enumerate(automaton.leaves) if holds(step, state))

    def tick() -> None:
        spend(PRODUCT_STEPS)
        if deadline is not None and spent() > deadline:
            raise TooLong

    return automaton, label, tick


def refuted_at(formula: Property, run: Sequence[Mapping[State, bool]]) -> int | None:
    """The first step of a prefix of a run after which every continuation violates the property; None if there is none.

    Raises TooLong.
    """
    following = [*((k + 1,) for k in range(len(run) - 1)), ()]
    found = refuted_prefix(formula, range(min(1, len(run))), following.__getitem__, lambda k, state: run[k][state])
    return None if found is None else len(found) - 1
