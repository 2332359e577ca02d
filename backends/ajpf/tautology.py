"""Formulas that hold for every agent: a table can turn a claim into one, which then shows nothing.

Decided without the agent: on all words over the formula's atoms, except those that no agent can produce: if a special
case holds (``D(a, go(1))``), so does its generalisation (``D(a, go(_))``); only one action is the last one; an intended
goal is wanted. (Not for beliefs: a reasoning rule with a negation may derive ``f(1)`` and not ``f(_)``.)

Facts about one agent whatever its plans do (beliefs that its rules derive, initial beliefs that nothing drops) are
further laws: a property that follows from these alone shows nothing about the agent's decisions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import permutations

from avow.base.graphs import strong_components

from . import psl
from .beliefs import renamed_rule
from .psl import Atom, Formula, Modality
from .syntax import Condition, DeedKind, Program, Rule
from .terms import Bindings, Struct, Term, Var, apart, apply, is_ground, named_apart, rename, unify, variables
from .tuning import STANDING_ATOMS, STANDING_INSTANCES, TAUTOLOGY_CASES

_EXISTENTIAL = (Modality.DID, Modality.WANTS, Modality.INTENDS, Modality.INTENDS_TO_DO, Modality.PERCEPT)


Laws = Callable[[tuple[Atom, ...]], Iterable[Formula]]
"""The facts known about the states of one agent, as far as they concern some atoms (`standing`)."""


def _no_laws(atoms: tuple[Atom, ...]) -> Iterable[Formula]:
    return ()


def is_valid(formula: Formula, laws: Laws = _no_laws) -> bool:
    """Whether a property holds on every run of every agent that satisfies the laws. Raises ltl.TooLarge."""
    automaton = psl.automaton_of(psl.Not(formula))
    known: dict[int, bool] = {}

    def possible(node: int) -> bool:
        if node not in known:
            literals = []
            for at, leaf in enumerate(automaton.leaves):
                if automaton.positive[node] >> at & 1:
                    literals.append(leaf)
                if automaton.negative[node] >> at & 1:
                    literals.append(psl.Not(leaf))
            known[node] = is_satisfiable(psl.And(tuple(literals)), laws)
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


def is_satisfiable(formula: Formula, laws: Laws = _no_laws) -> bool:
    """For a formula without temporal operators; also true if deciding it would take too long."""
    atoms = tuple(dict.fromkeys(psl.atoms(formula)))
    conditions = (formula, *_laws(atoms), *laws(atoms))
    pending: list[dict[Atom, bool]] = [{}]
    for _ in range(TAUTOLOGY_CASES):
        if not pending:
            return False
        assigned = pending.pop()
        values = [_value(condition, assigned) for condition in conditions]
        if False in values:
            continue
        if None not in values:
            return True
        undecided = psl.atoms(conditions[values.index(None)])
        first = next(atom for atom in undecided if atom not in assigned)
        pending += [{**assigned, first: True}, {**assigned, first: False}]
    return True


def _value(formula: Formula, assigned: Mapping[Atom, bool]) -> bool | None:
    """The truth value, or None if atoms without a value decide it."""
    match formula:
        case psl.Truth(value=value):
            return value
        case Atom():
            return assigned.get(formula)
        case psl.Not(body=body):
            inner = _value(body, assigned)
            return None if inner is None else not inner
        case psl.And(items=items) | psl.Or(items=items):
            deciding = isinstance(formula, psl.Or)
            values = {_value(item, assigned) for item in items}
            return deciding if deciding in values else None if None in values else not deciding
        case psl.Implies(left=left, right=right):
            return _value(psl.Or((psl.Not(left), right)), assigned)
    raise AssertionError(formula)


def _laws(atoms: tuple[Atom, ...]) -> Iterator[Formula]:
    for one, other in permutations(atoms, 2):
        if one.agent != other.agent:
            continue
        if one.modality is other.modality in _EXISTENTIAL and _covers(other.term, one.term):
            yield psl.Implies(one, other)
        if (one.modality, other.modality) == (Modality.INTENDS, Modality.WANTS) and one.term == other.term:
            yield psl.Implies(one, other)
        if one.modality is other.modality is Modality.DID and not _overlap(one.term, other.term):
            yield psl.Not(psl.And((one, other)))


def _covers(general: Struct, special: Struct) -> bool:
    """Each ``_`` of the general term stands for anything, on its own; each of the special one for something."""
    return unify(named_apart(general), rename(special, {"_": Struct("_")}), {}) is not None


def _overlap(one: Struct, other: Struct) -> bool:
    return unify(named_apart(one), apart(named_apart(other), "'"), {}) is not None


# Facts about one agent whatever its plans do


def standing(programs: Sequence[Program], percepts: Sequence[Struct]) -> Laws:
    """Laws for the beliefs in some atoms. `percepts` are all possible ones."""
    by_name = {program.name: program for program in programs}

    def laws(atoms: tuple[Atom, ...]) -> Iterator[Formula]:
        known = list(dict.fromkeys(atom for atom in atoms if atom.modality is Modality.BELIEVES))
        for atom in known:  # it grows: the beliefs in a body may be derived too
            program = by_name.get(atom.agent)
            if program is None:
                continue
            if _stays(program, atom.term, percepts):
                yield atom
            for at, rule in enumerate(program.rules):
                for body in _bodies(program, rule, f"'{at}", atom, known):
                    yield psl.Implies(body, atom)
                    if len(known) < STANDING_ATOMS:
                        known += [a for a in psl.atoms(body) if a not in known]

    return laws


def _stays(program: Program, wanted: Struct, percepts: Sequence[Struct]) -> bool:
    """Whether an initial belief is dropped by no deed and by no percept that disappears."""
    own = named_apart(wanted)
    dropped = [d.term for plan in program.plans for d in plan.deeds if d.kind is DeedKind.DROP_BELIEF]
    return any(
        unify(own, belief, {}) is not None
        and belief not in percepts
        and all(unify(term, belief, {}) is None for term in dropped)
        for belief in program.beliefs
    )


def _bodies(program: Program, rule: Rule, suffix: str, atom: Atom, known: Sequence[Atom]) -> Iterator[Formula]:
    """Instances of the rule's body that make the atom true."""
    renamed = renamed_rule(rule, suffix)
    bindings = unify(named_apart(atom.term), renamed.head, {})
    cut = any(c.is_cut for other in program.rules for c in other.body if other.head.functor == rule.head.functor)
    if bindings is None or cut or not all(_plain(c) for c in renamed.body):
        return
    derived = {(other.head.functor, len(other.head.args)) for other in program.rules}
    facts = [a.term for a in known if a.agent == atom.agent and (a.term.functor, len(a.term.args)) not in derived]
    for count, found in enumerate(_instances(renamed.body, bindings, facts)):
        if count == STANDING_INSTANCES:
            return
        parts = [Atom(Modality.BELIEVES, atom.agent, _shown(apply(c.term, found))) for c in renamed.body if c.term]
        signs = [c.positive for c in renamed.body if c.term]
        yield psl.conjunction([a if sign else psl.negation(a) for a, sign in zip(parts, signs, strict=True)])


def _plain(condition: Condition) -> bool:
    return isinstance(condition.term, Struct) and condition.test is None and not condition.is_goal


def _instances(body: Sequence[Condition], bindings: Bindings, facts: Sequence[Struct]) -> Iterator[Bindings]:
    """The body's variables as bound by the known facts; those of a single condition may stay free."""
    if not body:
        yield bindings
        return
    first, rest = body[0], body[1:]
    assert isinstance(first.term, Struct)
    if first.positive and not is_ground(apply(first.term, bindings)):
        for fact in facts:
            found = unify(first.term, named_apart(fact), bindings)
            if found is not None and is_ground(fact):
                yield from _instances(rest, found, facts)
    shared = {name for c in rest if c.term is not None for name in variables(apply(c.term, bindings))}
    if shared.isdisjoint(variables(apply(first.term, bindings))):
        yield from _instances(rest, bindings, facts)


def _shown(term: Term) -> Struct:
    """The term as in a property: ``_`` for free variables."""
    made = rename(term, {name: Var("_") for name in variables(term)})
    assert isinstance(made, Struct)
    return made
