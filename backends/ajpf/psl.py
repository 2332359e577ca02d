"""AJPF's property specification language: formulas, and how they are printed so that AJPF reads them as intended.

AJPF's grammar has traps: ``||`` binds tighter than ``&``, ``->`` associates to the left, ``<>[]p`` loses its inner
operator. The printer brackets everything but propositions. As automata, properties are over *leaves*: the largest parts
without temporal operators, which are tests of one state.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import assert_never

from avow.formulas import ltl
from avow.formulas.flattening import joined
from avow.formulas.ltl import Automaton

from .terms import Struct
from .terms import show as show_fact

KEYWORDS = frozenset({"A", "E", "U", "R", "B", "G", "F", "I", "D", "P", "T", "ItD"})
"""Words of the language: an agent may not have such a name."""

AGENT_NAME = re.compile(r"[a-z][A-Za-z0-9_]*\Z")


class Modality(StrEnum):
    BELIEVES = "B"
    WANTS = "G"
    INTENDS = "I"
    INTENDS_TO_DO = "ItD"
    DID = "D"
    PERCEPT = "P"


@dataclass(frozen=True, slots=True)
class Atom:
    """``B(ag, f)``; a percept has no agent."""

    modality: Modality
    agent: str
    term: Struct


@dataclass(frozen=True, slots=True)
class Truth:
    value: bool


@dataclass(frozen=True, slots=True)
class Not:
    body: Formula


@dataclass(frozen=True, slots=True)
class And:
    items: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Or:
    items: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Implies:
    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Always:
    body: Formula


@dataclass(frozen=True, slots=True)
class Eventually:
    body: Formula


@dataclass(frozen=True, slots=True)
class Until:
    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Release:
    left: Formula
    right: Formula


Formula = Atom | Truth | Not | And | Or | Implies | Always | Eventually | Until | Release

TRUE = Truth(True)
FALSE = Truth(False)


def parts(formula: Formula) -> tuple[Formula, ...]:
    match formula:
        case Atom() | Truth():
            return ()
        case Not(body=body) | Always(body=body) | Eventually(body=body):
            return (body,)
        case And(items=items) | Or(items=items):
            return items
        case Implies(left=left, right=right) | Until(left=left, right=right) | Release(left=left, right=right):
            return (left, right)


def with_atoms(formula: Formula, change: Callable[[Atom], Formula]) -> Formula:
    """The formula, with each of its atoms mapped."""
    if isinstance(formula, Atom | Truth):
        return change(formula) if isinstance(formula, Atom) else formula
    made = tuple(with_atoms(part, change) for part in parts(formula))
    return type(formula)(made) if isinstance(formula, And | Or) else type(formula)(*made)


def about_acts(formula: Formula) -> bool:
    """Whether it speaks of the last action, which may be older than all else that holds."""
    return any(atom.modality is Modality.DID for atom in atoms(formula))


def atoms(formula: Formula) -> Iterator[Atom]:
    """In reading order, with repetitions."""
    if isinstance(formula, Atom):
        yield formula
    for part in parts(formula):
        yield from atoms(part)


def is_temporal(formula: Formula) -> bool:
    return isinstance(formula, Always | Eventually | Until | Release) or any(map(is_temporal, parts(formula)))


def conjunction(items: list[Formula] | tuple[Formula, ...]) -> Formula:
    """Flat, without repetitions, simplified."""
    return _junction(items, And, TRUE, FALSE)


def disjunction(items: list[Formula] | tuple[Formula, ...]) -> Formula:
    return _junction(items, Or, FALSE, TRUE)


def _junction(
    items: list[Formula] | tuple[Formula, ...], kind: type[And] | type[Or], unit: Truth, zero: Truth
) -> Formula:
    made = joined(items, kind, unit, zero, once=True)
    if isinstance(made, kind) and not {negation(piece) for piece in made.items}.isdisjoint(made.items):
        return zero
    return made


def negation(formula: Formula) -> Formula:
    match formula:
        case Truth(value=value):
            return Truth(not value)
        case Not(body=body):
            return body
        case _:  # no shorter negation
            return Not(formula)


_WRITTEN = {
    Not: "~",
    Always: "[] ",
    Eventually: "<> ",
    And: " & ",
    Or: " || ",
    Implies: " -> ",
    Until: " U ",
    Release: " R ",
}


def show(formula: Formula) -> str:
    """As AJPF reads it: everything but a proposition is in brackets."""
    match formula:
        case Atom(modality=modality, agent=agent, term=term):
            return f"{modality}({f'{agent}, ' if agent else ''}{show_fact(term)})"
        case Truth(value=value):
            return "T" if value else "F"
        case And(items=()) | Or(items=()):
            return "T" if isinstance(formula, And) else "F"
        case Not(body=body) | Always(body=body) | Eventually(body=body):
            return _WRITTEN[type(formula)] + _operand(body)
        case _:  # between its parts
            return _WRITTEN[type(formula)].join(map(_operand, parts(formula)))


def _operand(formula: Formula) -> str:
    while isinstance(formula, And | Or) and len(formula.items) == 1:
        (formula,) = formula.items
    return f"({show(formula)})" if parts(formula) else show(formula)


def show_template(formula: Formula) -> str:
    """For people: index terms as the plan writes them."""
    return re.sub(r"\((\w+ [+-] \w+)\)", r"\1", show(formula))


def automaton_of(formula: Formula) -> Automaton[Formula]:
    """The automaton that accepts exactly the runs on which the formula holds. Raises TooLarge."""
    return ltl.build(_normal(formula, True))


def _normal(formula: Formula, positive: bool) -> ltl.Normal[Formula]:
    if isinstance(formula, Truth):
        return ltl.join((), formula.value is positive)
    if isinstance(formula, Not):
        return _normal(formula.body, not positive)
    if not is_temporal(formula):
        return ltl.Lit(formula, positive)
    match formula:
        case And(items=items) | Or(items=items):
            return ltl.join([_normal(i, positive) for i in items], isinstance(formula, And) is positive)
        case Implies(left=left, right=right):
            return ltl.join([_normal(left, not positive), _normal(right, positive)], not positive)
        case Always(body=body):
            return ltl.always(_normal(body, positive), positive)
        case Eventually(body=body):
            return ltl.eventually(_normal(body, positive), positive)
        case Until(left=left, right=right):
            return ltl.until(_normal(left, positive), _normal(right, positive), positive)
        case Release(left=left, right=right):
            return ltl.until(_normal(left, positive), _normal(right, positive), not positive)
        case Atom():
            raise AssertionError("an atom is not temporal")
        case _:
            assert_never(formula)


def compiled(formula: Formula, places: Mapping[Atom, int]) -> Callable[[int], bool]:
    """A formula without temporal operators as a test of a state's label, a bit set of atoms."""
    match formula:
        case Atom():
            bit = 1 << places[formula]
            return lambda label: bool(label & bit)
        case Truth(value=value):
            return lambda label: value
        case Not(body=body):
            inner = compiled(body, places)
            return lambda label: not inner(label)
        case And(items=items):
            tests = [compiled(i, places) for i in items]
            return lambda label: all(test(label) for test in tests)
        case Or(items=items):
            tests = [compiled(i, places) for i in items]
            return lambda label: any(test(label) for test in tests)
        case Implies(left=left, right=right):
            first, second = compiled(left, places), compiled(right, places)
            return lambda label: not first(label) or second(label)
    raise AssertionError(formula)
