"""The claims of a system: formulas over the values of all ports at a step and at the previous step.

An input *is* the variable of its source: its value now, or, over a delayed edge, that of the previous step; so every
claim's text contains the wiring. A claim is identified by the SHA-256 of that text. Names of clauses do not matter: if
two guarantees swap names nothing changes, and if a wire moves every claim that crosses it does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

from avow.base.files import sha256
from avow.kernel.text import Symbols, Text, Untranslatable, symbol
from avow.language.contract import Node
from avow.language.sorts import Sort
from avow.language.terms import Role, Term, Variable


class Claimed(StrEnum):
    """The kinds of claims: a clause of a node; the plan's assumption about the environment; an output before the first
    step, where delayed edges deliver it; one about every step of the whole system (requirement); that some values, or
    none, satisfy a formula (a guarantee's situation); that a loop has first values; what a step leaves in a memory."""

    ASSUMPTION = "assumption"
    GUARANTEE = "guarantee"
    ENVIRONMENT = "environment"
    INITIAL = "initial"
    REQUIREMENT = "requirement"
    POSSIBLE = "possible"
    IMPOSSIBLE = "impossible"
    START = "start"
    DEFINITION = "definition"


@dataclass(frozen=True, slots=True)
class Place:
    """A value `back` steps ago. `node`: the node whose output it is (`name` is ``node.port``); None: the environment's
    (one name has one value; a rigid one never changes); empty: no node's, a remembered value of the environment."""

    name: str
    node: str | None
    back: int
    sort: Sort
    rigid: bool = False

    def symbol(self, shift: int = 0) -> str:
        """The SMT-LIB variable of the value, if a claim is made about a step `shift` steps ago."""
        when = "" if self.rigid else f"~{self.back + shift}"
        return symbol(f"{'?' if self.node is None else ''}{self.name}{when}")


@dataclass(frozen=True, slots=True)
class Wiring:
    """The kernel's view of a system (trusted): contracts, the value of each port (role, node, name), and the plan's
    formulas: kind, node, name, formula over the node's ports, or over ``node.port`` if `node` is empty."""

    nodes: tuple[Node, ...]
    ports: Mapping[tuple[Role, str, str], Place]
    formulas: tuple[tuple[Claimed, str, str, Term], ...] = ()


@dataclass(frozen=True, slots=True)
class Statement:
    """A claim. `node` and `name` say where it was found, for people; `digest` identifies its content."""

    kind: Claimed
    node: str
    name: str
    term: Term = field(repr=False, compare=False)
    places: Mapping[Variable, Place] = field(repr=False, compare=False)
    digest: str = ""

    def symbols(self, shift: int = 0) -> Symbols:
        """Its variables' names if it is made about a step `shift` steps ago."""
        return lambda variable: (self.places[variable].symbol(shift), self.places[variable].sort)

    @property
    def called(self) -> str:
        return f"{self.node}.{self.name}" if self.node else self.name

    @property
    def sources(self) -> frozenset[Place]:
        return frozenset(place for place in self.places.values() if place.node is not None)

    @property
    def nodes(self) -> frozenset[str]:
        return frozenset(place.node for place in self.places.values() if place.node)

    @property
    def unary(self) -> bool:
        """Whether it refers only to the state before a step: the values before it, and those that never change."""
        return all(place.rigid if place.node is None else place.back == 1 for place in self.places.values())


@dataclass(frozen=True)
class Statements:
    """All claims of the current system that have a text. `assumptions`: node → digests of all of its assumptions; not
    for a node with an assumption that has no text, so that nothing is concluded from its guarantees."""

    every: tuple[Statement, ...]
    assumptions: Mapping[str, frozenset[str]]

    @cached_property
    def by_digest(self) -> Mapping[str, list[Statement]]:
        found: dict[str, list[Statement]] = {}
        for statement in self.every:
            found.setdefault(statement.digest, []).append(statement)
        return found

    def find(self, digest: str, kind: Claimed, node: str | None = None) -> Statement | None:
        """The claim of this kind (and node) with this digest, if there is one."""
        same = self.by_digest.get(digest, ())
        return next((s for s in same if s.kind is kind and node in (None, s.node)), None)


def statements(wiring: Wiring) -> Statements:
    clauses = [(Claimed.ASSUMPTION, n.name, one.name, one.formula) for n in wiring.nodes for one in n.assumptions]
    clauses += [(Claimed.GUARANTEE, n.name, one.name, one.formula) for n in wiring.nodes for one in n.guarantees]
    found, untold = list[Statement](), set[str]()
    for kind, node, name, term in (*clauses, *wiring.formulas):
        try:
            found.append(_stated(wiring, kind, node, name, term))
        except Untranslatable:
            untold |= {node} if kind is Claimed.ASSUMPTION else set()
    assumptions: dict[str, set[str]] = {node.name: set() for node in wiring.nodes}
    for claim in found:
        if claim.kind is Claimed.ASSUMPTION:
            assumptions[claim.node].add(claim.digest)
    return Statements(tuple(found), {n: frozenset(marks) for n, marks in assumptions.items() if n not in untold})


def _stated(wiring: Wiring, kind: Claimed, node: str, name: str, term: Term) -> Statement:
    places: dict[Variable, Place] = {}

    def called(variable: Variable) -> tuple[str, Sort]:
        at, _, port = (node, "", variable.name) if node else variable.name.partition(".")
        if (found := wiring.ports.get((variable.role, at, port))) is None:
            raise Untranslatable(f"{variable.qualified} is no value of the system")
        first = kind is Claimed.INITIAL and variable.role is Role.OUTPUT  # the output before the first step
        places[variable] = replace(found, back=1) if first else found
        return places[variable].symbol(), found.sort

    body = (text := Text()).formula(term, called)
    # a claim about some values differs from one about all
    parts = [*text.declarations.values(), *([kind] if kind in (Claimed.POSSIBLE, Claimed.START) else []), body]
    return Statement(kind, node, name, term, places, sha256("\n".join(parts)))
