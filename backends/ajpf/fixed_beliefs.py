"""What stands of an agent whatever its plans do: what its reasoning rules derive, and first beliefs that nothing drops.

A property that follows from these alone shows nothing of what the agent decides: `tautology` takes them as laws.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from . import psl
from .beliefs import renamed_rule
from .psl import Atom, Formula, Modality
from .syntax import Bindings, Condition, DeedKind, Program, Rule, Struct, Term, Var, apply, named_apart, unify
from .tautology import Laws
from .tuning import STANDING_ATOMS, STANDING_INSTANCES


def standing(programs: Sequence[Program], percepts: Sequence[Struct]) -> Laws:
    """Laws for the beliefs that some atoms ask for. `percepts` are all that there may be."""
    by_name = {program.name: program for program in programs}

    def laws(atoms: tuple[Atom, ...]) -> Iterator[Formula]:
        known = list(dict.fromkeys(atom for atom in atoms if atom.modality is Modality.BELIEVES))
        for atom in known:  # it grows: what a body asks for may be derived too
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
    """Whether a first belief is such that no deed drops it and no percept takes it along when it goes."""
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
    """The body's variables as the facts that are spoken of bind them; those of one condition alone may stay free."""
    if not body:
        yield bindings
        return
    first, rest = body[0], body[1:]
    assert isinstance(first.term, Struct)
    if first.positive and _free(apply(first.term, bindings)):
        for fact in facts:
            found = unify(first.term, named_apart(fact), bindings)
            if found is not None and not _free(fact):
                yield from _instances(rest, found, facts)
    shared = {name for c in rest if c.term is not None for name in _free(apply(c.term, bindings))}
    if not shared & set(_free(apply(first.term, bindings))):
        yield from _instances(rest, bindings, facts)


def _free(term: Term) -> list[str]:
    if isinstance(term, Var):
        return [term.name]
    return [name for arg in term.args for name in _free(arg)]


def _shown(term: Term) -> Struct:
    """As a property asks for it: ``_`` for what is free."""
    assert isinstance(term, Struct)
    return Struct(term.functor, tuple(Var("_") if isinstance(arg, Var) else _shown(arg) for arg in term.args))
