"""Formulas that hold of every agent: what a table can turn a claim into, and what then shows nothing.

Decided without the agent: on all words over the formula's atoms, except those that no agent can give: where a special
case is (``D(a, go(1))``), so is what covers it (``D(a, go(_))``); only one action is the last one; what is intended is
wanted. (Not for beliefs: a reasoning rule with a negation may derive ``f(1)`` and not ``f(_)``.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations, permutations

from avow.base.graphs import strong_components

from . import psl
from .automaton import build
from .psl import Atom, Formula, Modality
from .syntax import Term, Var
from .tuning import TAUTOLOGY_CASES

_EXISTENTIAL = (Modality.DID, Modality.WANTS, Modality.INTENDS, Modality.INTENDS_TO_DO, Modality.PERCEPT)


Laws = Callable[[tuple[Atom, ...]], Iterable[Formula]]
"""What is known of the states of one agent, as far as it bears on some atoms (`standing`)."""


def _no_laws(atoms: tuple[Atom, ...]) -> Iterable[Formula]:
    return ()


@dataclass(slots=True)
class Steps:
    left: int = TAUTOLOGY_CASES


def is_valid(formula: Formula, laws: Laws = _no_laws) -> bool:
    """Whether a property holds on every run of every agent of which the laws are true. Raises automaton.TooLarge."""
    automaton = build(psl.Not(formula))
    known: dict[int, bool] = {}
    steps = Steps()

    def possible(node: int) -> bool:
        if node not in known:
            literals = []
            for at, leaf in enumerate(automaton.leaves):
                if automaton.positive[node] >> at & 1:
                    literals.append(leaf)
                if automaton.negative[node] >> at & 1:
                    literals.append(psl.Not(leaf))
            known[node] = is_satisfiable(psl.And(tuple(literals)), steps, laws)
        return known[node]

    def successors(node: int) -> list[int]:
        return [t for t in automaton.successors[node] if possible(t)]

    for component in strong_components(filter(possible, automaton.initial), successors):
        round_trip = len(component) > 1 or component[0] in successors(component[0])
        if round_trip and all(not accepting.isdisjoint(component) for accepting in automaton.accepting):
            return False
    return True


def constant(formula: Formula) -> bool | None:
    """The truth value that a formula without temporal operators has in every state of every agent, if it has one."""
    if not is_satisfiable(formula):
        return False
    return None if is_satisfiable(psl.Not(formula)) else True


def is_satisfiable(formula: Formula, steps: Steps | None = None, laws: Laws = _no_laws) -> bool:
    """Of a formula without temporal operators; true also where finding out would take too long."""
    atoms = tuple(dict.fromkeys(psl.atoms(formula)))
    whole = psl.And((formula, *_laws(atoms), *laws(atoms)))
    steps = steps or Steps()
    pending: list[dict[Atom, bool]] = [{}]
    while pending:
        assigned = pending.pop()
        steps.left -= 1
        if steps.left < 0:
            return True
        open_atoms: list[Atom] = []
        value = _value(whole, assigned, open_atoms)
        if value is True:
            return True
        if value is None:
            first = open_atoms[0]
            pending += [{**assigned, first: True}, {**assigned, first: False}]
    return False


def _value(formula: Formula, assigned: dict[Atom, bool], open_atoms: list[Atom]) -> bool | None:
    """The truth value as far as the assignment decides it; atoms that it would need next are added to `open_atoms`."""
    match formula:
        case psl.Truth(value=value):
            return value
        case Atom():
            if formula not in assigned:
                open_atoms.append(formula)
            return assigned.get(formula)
        case psl.Not(body=body):
            inner = _value(body, assigned, open_atoms)
            return None if inner is None else not inner
        case psl.And(items=items):
            return _junction(items, False, assigned, open_atoms)
        case psl.Or(items=items):
            return _junction(items, True, assigned, open_atoms)
        case psl.Implies(left=left, right=right):
            return _junction((psl.Not(left), right), True, assigned, open_atoms)
    raise AssertionError(formula)


def _junction(
    items: Iterable[Formula], deciding: bool, assigned: dict[Atom, bool], open_atoms: list[Atom]
) -> bool | None:
    undecided = False
    for item in items:
        value = _value(item, assigned, open_atoms)
        if value is deciding:
            return deciding
        undecided = undecided or value is None
    return None if undecided else not deciding


def _laws(atoms: tuple[Atom, ...]) -> tuple[Formula, ...]:
    found: list[Formula] = []
    for one, other in permutations(atoms, 2):
        same = one.agent == other.agent
        if same and one.modality is other.modality in _EXISTENTIAL and _meet(one.term, other.term, _covered):
            found.append(psl.Implies(one, other))
        if same and (one.modality, other.modality) == (Modality.INTENDS, Modality.WANTS) and one.term == other.term:
            found.append(psl.Implies(one, other))
    for one, other in combinations([a for a in atoms if a.modality is Modality.DID], 2):
        if one.agent == other.agent and not _meet(one.term, other.term, _overlap):
            found.append(psl.Not(psl.And((one, other))))
    return tuple(found)


def _covered(special: Term, general: Term) -> bool | None:
    return True if isinstance(general, Var) else False if isinstance(special, Var) else None


def _overlap(one: Term, other: Term) -> bool | None:
    return True if isinstance(one, Var) or isinstance(other, Var) else None


def _meet(one: Term, other: Term, at_variables: Callable[[Term, Term], bool | None]) -> bool:
    """Each ``_`` stands for anything, on its own."""
    pending = [(one, other)]
    while pending:
        left, right = pending.pop()
        answer = at_variables(left, right)
        if answer is False:
            return False
        if answer is None:
            assert not isinstance(left, Var)
            assert not isinstance(right, Var)
            if left.functor != right.functor or len(left.args) != len(right.args):
                return False
            pending += zip(left.args, right.args, strict=True)
    return True
