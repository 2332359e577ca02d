"""The claims of a system: formulas over the values of all ports at a step and at the step before.

An input *is* the variable of its source: its value now, or, over a delayed edge, that of the step before; so the wiring
stands in every claim's text. A claim is known by the SHA-256 of that text. Names of clauses play no part: where two
guarantees swap names nothing changes, and where a wire moves every claim that crosses it does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

from avow.base.files import digest as sha256
from avow.kernel.text import Symbols, Text, Untranslatable, symbol
from avow.language.contract import Node
from avow.language.sorts import Sort
from avow.language.terms import Quantified, Role, Term, Variable


@dataclass(frozen=True, slots=True)
class Wire:
    """What feeds an input: an output of a node, at the same step or, delayed, of the step before."""

    node: str
    port: str
    delayed: bool = False


@dataclass(frozen=True, slots=True)
class Wiring:
    """A system as the kernel is told of it: contracts, wires, and the formulas of the plan. Trusted, and listed so."""

    nodes: tuple[Node, ...]
    wires: Mapping[tuple[str, str], Wire]
    """(node, input) → what feeds it."""
    outside: Mapping[tuple[str, str], str]
    """(node, input) that nothing feeds → the environment's name of the value (``in.map``): of one name, one value."""
    rigid: frozenset[str]
    """Names of values of the environment that never change."""
    formulas: tuple[tuple[Kind, str, str, Term], ...] = ()
    """(kind, node, name, formula) of the plan's: over the node's ports, or over ``node.port`` where `node` is empty."""


class Kind(StrEnum):
    ASSUMPTION = "assumption"
    GUARANTEE = "guarantee"
    ENVIRONMENT = "environment"
    """What the plan assumes of the environment."""
    INITIAL = "initial"
    """What an output is before the first step, where delayed edges deliver it."""
    REQUIREMENT = "requirement"
    """Of every step of the whole system."""
    POSSIBLE = "possible"
    """That some values are so: first values of a loop, a situation that a guarantee is about."""
    IMPOSSIBLE = "impossible"
    """That no values are so: a situation that a node's own contract excludes."""


@dataclass(frozen=True, slots=True)
class Place:
    """A value that a claim speaks of: of an output (`node`), or of the environment; `back` steps ago."""

    name: str
    node: str | None
    back: int
    sort: Sort
    rigid: bool = False

    def symbol(self, shift: int = 0) -> str:
        """The SMT-LIB variable of the value, where the claim is made of a step `shift` steps ago."""
        when = "" if self.rigid else f"~{self.back + shift}"
        return symbol(f"{'?' if self.node is None else ''}{self.name}{when}")


@dataclass(frozen=True, slots=True)
class Statement:
    """A claim. `node` and `name` say where it was found, for people; what it says is `digest`."""

    kind: Kind
    node: str
    name: str
    term: Term = field(repr=False, compare=False)
    places: Mapping[Variable, Place] = field(repr=False, compare=False)
    digest: str = ""

    def symbols(self, shift: int = 0) -> Symbols:
        """Its variables' names where it is made of a step `shift` steps ago."""

        def called(variable: Variable) -> tuple[str, Sort]:
            place = self.places.get(variable)
            if place is None:
                raise Untranslatable(f"{variable.qualified} is no value of the system")
            return place.symbol(shift), place.sort

        return called

    @property
    def called(self) -> str:
        return f"{self.node}.{self.name}" if self.node else self.name

    @property
    def sources(self) -> frozenset[Place]:
        """The nodes' outputs that it speaks of."""
        return frozenset(place for place in self.places.values() if place.node is not None)

    @property
    def outside_only(self) -> bool:
        """Whether it speaks only of values that no node provides."""
        return not self.sources

    @property
    def unary(self) -> bool:
        """Whether it speaks of the state before a step alone: the values before it, and those that never change."""
        return all(place.rigid if place.node is None else place.back == 1 for place in self.places.values())


@dataclass(frozen=True)
class Statements:
    """All claims of a system as it is now that have a text."""

    every: tuple[Statement, ...]
    assumptions: Mapping[str, frozenset[str]]
    """Node → digests of all its assumptions; not of one with an assumption that has no text: nothing may be concluded
    from its guarantees."""

    @cached_property
    def by_digest(self) -> Mapping[str, list[Statement]]:
        found: dict[str, list[Statement]] = {}
        for statement in self.every:
            found.setdefault(statement.digest, []).append(statement)
        return found

    @cached_property
    def initials(self) -> tuple[Statement, ...]:
        return tuple(statement for statement in self.every if statement.kind is Kind.INITIAL)

    def find(self, digest: str, kind: Kind, node: str | None = None) -> Statement | None:
        """The claim of this kind (and node) that says so, if there is one."""
        same = self.by_digest.get(digest, ())
        return next((s for s in same if s.kind is kind and node in (None, s.node)), None)


def statements(wiring: Wiring) -> Statements:
    """Every claim of a system."""
    nodes = {node.name: node for node in wiring.nodes}
    assumptions: dict[str, set[str]] = {name: set() for name in nodes}
    found: list[Statement] = []
    for kind, node, name, term in _all(wiring):
        places = dict(_places(wiring, nodes, kind, node, term))
        try:
            text = Text()
            body = text.formula(term, Statement(kind, node, name, term, places).symbols())
        except Untranslatable:
            if kind is Kind.ASSUMPTION:
                assumptions.pop(node, None)
            continue
        # that some values are so is another claim than that all are
        mark = sha256("\n".join([*text.declarations.values(), *(("possible",) if kind is Kind.POSSIBLE else ()), body]))
        found.append(Statement(kind, node, name, term, places, mark))
        if kind is Kind.ASSUMPTION and node in assumptions:
            assumptions[node].add(mark)
    return Statements(tuple(found), {name: frozenset(marks) for name, marks in assumptions.items()})


def _all(wiring: Wiring) -> Iterator[tuple[Kind, str, str, Term]]:
    for node in wiring.nodes:
        yield from ((Kind.ASSUMPTION, node.name, clause.name, clause.formula) for clause in node.assumptions)
        yield from ((Kind.GUARANTEE, node.name, clause.name, clause.formula) for clause in node.guarantees)
    yield from wiring.formulas


def _places(
    wiring: Wiring, nodes: Mapping[str, Node], kind: Kind, node: str, term: Term
) -> Iterator[tuple[Variable, Place]]:
    """What its inputs and outputs are values of. A name that is no port's has no place, and the claim no text."""
    for variable in _free(term):
        at, _, port = (node, "", variable.name) if node else variable.name.partition(".")
        if variable.role is Role.OUTPUT and at in nodes:
            # an initial condition speaks of the output before the first step
            back = 1 if kind is Kind.INITIAL else 0
            yield variable, Place(f"{at}.{port}", at, back, nodes[at].output(port).sort)
        elif variable.role is Role.INPUT and (wire := wiring.wires.get((at, port))) is not None:
            sort = nodes[wire.node].output(wire.port).sort
            yield variable, Place(f"{wire.node}.{wire.port}", wire.node, int(wire.delayed), sort)
        elif variable.role is Role.INPUT and at in nodes:
            name = wiring.outside[at, port]
            yield variable, Place(name, None, 0, nodes[at].input(port).sort, name in wiring.rigid)


def _free(term: Term) -> frozenset[Variable]:
    """The inputs and outputs that a formula speaks of, and whatever no quantifier binds."""
    found: set[Variable] = set()
    stack: list[tuple[Term, frozenset[Variable]]] = [(term, frozenset())]
    while stack:
        current, bound = stack.pop()
        if isinstance(current, Variable) and current not in bound:
            found.add(current)
        if isinstance(current, Quantified):
            bound = bound | frozenset(current.variables)
        stack.extend((child, bound) for child in current.children)
    return frozenset(found)
