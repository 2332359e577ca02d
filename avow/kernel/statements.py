"""The claims of a system: formulas over the values of all ports at a step and at the step before.

An input *is* the variable of its source: its value now, or, over a delayed edge, that of the step before; so the wiring
stands in every claim's text. A claim is known by the SHA-256 of that text. Names of clauses play no part: where two
guarantees swap names nothing changes, and where a wire moves every claim that crosses it does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

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
    environment: tuple[tuple[str, str, Term], ...] = ()
    """(name, node, formula over that node's inputs): what the plan assumes of the environment."""
    initials: tuple[tuple[str, str, Term], ...] = ()
    """(node, output, formula over it and the node's inputs): what delayed edges deliver first."""
    requirements: tuple[tuple[str, Term], ...] = ()
    """(id, formula over ``node.port``)."""


class Kind(StrEnum):
    ASSUMPTION = "assumption"
    GUARANTEE = "guarantee"
    ENVIRONMENT = "environment"
    INITIAL = "initial"
    REQUIREMENT = "requirement"


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
        if self.node is None:
            return symbol(f"?{self.name}" if self.rigid else f"?{self.name}~{self.back + shift}")
        return symbol(f"{self.name}~{self.back + shift}")


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
    def sources(self) -> frozenset[tuple[str, int]]:
        """The nodes whose outputs it speaks of, and how many steps ago."""
        return frozenset((p.node, p.back) for p in self.places.values() if p.node is not None)

    @property
    def outside_only(self) -> bool:
        """Whether it speaks only of values that no node provides."""
        return all(p.node is None for p in self.places.values())

    @property
    def unary(self) -> bool:
        """Whether it speaks of the state before a step alone: the values before it, and those that never change."""
        return all(p.rigid if p.node is None else p.back == 1 for p in self.places.values())


@dataclass(frozen=True, slots=True)
class Statements:
    """All claims of a system as it is now, by what they say."""

    by_digest: Mapping[str, tuple[Statement, ...]]
    assumptions: Mapping[str, tuple[str, ...]]
    """Node → digests of all its assumptions."""
    refused: Mapping[tuple[Kind, str, str], str]
    """Claims that have no text, and why."""

    def find(self, digest: str, kind: Kind, node: str | None = None) -> Statement | None:
        """The claim of this kind (and node) that says so, if there is one."""
        found = self.by_digest.get(digest, ())
        return next((s for s in found if s.kind is kind and node in (None, s.node)), None)


def statements(wiring: Wiring) -> Statements:
    """Every claim of a system."""
    found: dict[str, list[Statement]] = {}
    assumptions: dict[str, list[str]] = {node.name: [] for node in wiring.nodes}
    refused: dict[tuple[Kind, str, str], str] = {}
    complete = {node.name: True for node in wiring.nodes}
    for statement in _all(wiring):
        try:
            mark = _digest(statement)
        except Untranslatable as problem:
            refused[statement.kind, statement.node, statement.name] = str(problem)
            if statement.kind is Kind.ASSUMPTION:
                complete[statement.node] = False
            continue
        known = Statement(statement.kind, statement.node, statement.name, statement.term, statement.places, mark)
        found.setdefault(mark, []).append(known)
        if statement.kind is Kind.ASSUMPTION:
            assumptions[statement.node].append(mark)
    # a node with an assumption that has no text: nothing may be concluded from its guarantees
    usable = {name: tuple(marks) for name, marks in assumptions.items() if complete[name]}
    return Statements({mark: tuple(same) for mark, same in found.items()}, usable, refused)


def _all(wiring: Wiring) -> Iterator[Statement]:
    nodes = {node.name: node for node in wiring.nodes}
    for node in wiring.nodes:
        for kind, clauses in ((Kind.ASSUMPTION, node.assumptions), (Kind.GUARANTEE, node.guarantees)):
            for clause in clauses:
                yield _stated(wiring, nodes, kind, node.name, clause.name, clause.formula)
    for name, at, formula in wiring.environment:
        yield _stated(wiring, nodes, Kind.ENVIRONMENT, at, name, formula)
    for at, port, formula in wiring.initials:
        yield _stated(wiring, nodes, Kind.INITIAL, at, port, formula)
    for name, formula in wiring.requirements:
        yield _stated(wiring, nodes, Kind.REQUIREMENT, "", name, formula)


def _stated(wiring: Wiring, nodes: Mapping[str, Node], kind: Kind, node: str, name: str, term: Term) -> Statement:
    places: dict[Variable, Place] = {}
    for variable in _free(term):
        at, port = (node, variable.name) if node else variable.name.split(".", 1)
        if at not in nodes:
            continue
        if variable.role is Role.INPUT:
            places[variable] = _input(wiring, nodes, at, port)
        elif variable.role is Role.OUTPUT:
            # an initial condition speaks of the output before the first step
            back = 1 if kind is Kind.INITIAL else 0
            places[variable] = Place(f"{at}.{port}", at, back, nodes[at].output(port).sort)
    return Statement(kind, node, name, term, places)


def _input(wiring: Wiring, nodes: Mapping[str, Node], node: str, port: str) -> Place:
    wire = wiring.wires.get((node, port))
    if wire is None:
        name = wiring.outside[node, port]
        return Place(name, None, 0, nodes[node].input(port).sort, name in wiring.rigid)
    sort = nodes[wire.node].output(wire.port).sort
    return Place(f"{wire.node}.{wire.port}", wire.node, 1 if wire.delayed else 0, sort)


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


def _digest(statement: Statement) -> str:
    text = Text()
    body = text.formula(statement.term, statement.symbols())
    return sha256("\n".join([*text.declarations.values(), body]))
