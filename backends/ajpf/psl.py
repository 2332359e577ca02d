"""AJPF's property specification language: formulas, and how they are written so that AJPF reads what is meant.

AJPF's grammar has traps: ``||`` binds tighter than ``&``,
``->`` associates to the left, ``<>[]p`` loses its inner operator. The printer brackets whatever is no proposition.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum

from avow.formulas.flattening import joined

from .syntax import Struct, Term, Var

KEYWORDS = frozenset({"A", "E", "U", "R", "B", "G", "F", "I", "D", "P", "T", "ItD"})
"""Words of the language: an agent may not be called so."""

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


def changed(formula: Formula, change: Callable[[Formula], Formula]) -> Formula:
    """The formula, with each of its parts changed."""
    match formula:
        case Atom() | Truth():
            return formula
        case And(items=items) | Or(items=items):
            return type(formula)(tuple(map(change, items)))
        case Not(body=body) | Always(body=body) | Eventually(body=body):
            return type(formula)(change(body))
        case Implies(left=left, right=right) | Until(left=left, right=right) | Release(left=left, right=right):
            return type(formula)(change(left), change(right))


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


def show(formula: Formula) -> str:
    """As AJPF reads it."""
    match formula:
        case Atom(modality=Modality.PERCEPT, term=term):
            return f"P({show_term(term)})"
        case Atom(modality=modality, agent=agent, term=term):
            return f"{modality}({agent}, {show_term(term)})"
        case Truth(value=value):
            return "T" if value else "F"
        case Not(body=body):
            return f"~{_operand(body)}"
        case Always(body=body):
            return f"[] {_operand(body)}"
        case Eventually(body=body):
            return f"<> {_operand(body)}"
        case And(items=items):
            return " & ".join(map(_operand, items)) if items else "T"
        case Or(items=items):
            return " || ".join(map(_operand, items)) if items else "F"
        case Implies(left=left, right=right):
            return f"{_operand(left)} -> {_operand(right)}"
        case Until(left=left, right=right):
            return f"{_operand(left)} U {_operand(right)}"
        case Release(left=left, right=right):
            return f"{_operand(left)} R {_operand(right)}"


def _operand(formula: Formula) -> str:
    if isinstance(formula, And | Or) and len(formula.items) < 2:
        return _operand(formula.items[0]) if formula.items else ("T" if isinstance(formula, And) else "F")
    return show(formula) if isinstance(formula, Atom | Truth) else f"({show(formula)})"


def show_term(term: Term) -> str:
    if isinstance(term, Var):
        return "_"
    return f"{term.functor}({', '.join(map(show_term, term.args))})" if term.args else term.functor


def show_template(formula: Formula) -> str:
    """For people: index terms as the plan writes them."""
    return re.sub(r"([+-])\((\w+), (\w+)\)", r"\2 \1 \3", show(formula))
