"""A checked program: its statements over typed terms, and what its names mean in the contract.

Program variables are free variables of role BOUND, which every part of the core prints and translates by bare name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import assert_never

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.formulas.formula import free_variables
from avow.language.sorts import DataSort, Sort
from avow.language.terms import Role, Term, Variable


@dataclass(frozen=True, slots=True)
class Skip:
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Assign:
    """``target := value``; `value` has the target's sort, up to INTEGER for NATURAL."""

    target: Variable
    value: Term
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Update:
    """``target[arguments] := value``: the function is changed at one point."""

    target: Variable
    arguments: tuple[Term, ...]
    value: Term
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class If:
    condition: Term
    then: Block
    otherwise: Block
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Match:
    subject: Term
    constructor: str
    variables: tuple[Variable, ...]
    then: Block
    otherwise: Block
    span: Span = field(compare=False, repr=False)

    @property
    def sort(self) -> DataSort:
        assert isinstance(self.subject.sort, DataSort)
        return self.subject.sort


@dataclass(frozen=True, slots=True)
class While:
    condition: Term
    invariant: Term
    variant: Term | None
    body: Block
    span: Span = field(compare=False, repr=False)


Statement = Skip | Assign | Update | If | Match | While
Block = tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Program:
    """`state` are all its variables; `given` those whose first value is an input's. An input that the program assigns
    has a `ghost`: a constant that keeps its first value, of which the contract speaks."""

    body: Block
    state: tuple[Variable, ...]
    assigned: frozenset[Variable]
    ghosts: Mapping[Variable, Variable]

    @property
    def names(self) -> frozenset[str]:
        """Every name that a variable of the program, a ghost or a MATCH pattern has."""
        matched = (v.name for s in statements(self.body) if isinstance(s, Match) for v in s.variables)
        return frozenset((*(v.name for v in (*self.state, *self.ghosts.values())), *matched))

    def unassigned(self, names: frozenset[str]) -> frozenset[str]:
        """Those variables that some path through the program does not assign: a loop may run zero times."""
        return _unassigned(self.body, names)


@dataclass(frozen=True, slots=True)
class Predicate:
    """``out.inspected(i)`` read as a formula over the program's variables and the pattern's `parameters`."""

    parameters: tuple[Variable, ...]
    meaning: Term

    @property
    def free(self) -> frozenset[Variable]:
        """The program's variables that it speaks of."""
        return free_variables(self.meaning) - frozenset(self.parameters)


@dataclass(frozen=True, slots=True)
class Reading:
    """What the contract's ports are in the program: inputs in its first state, outputs in its last."""

    terms: Mapping[tuple[Role, str], Term]
    predicates: Mapping[tuple[Role, str], Predicate]
    hypotheses: tuple[str, ...]
    """Where the plan's table restricts what an input can be."""
    mapped: bool
    """A person's table says more than which variable is which port."""


def statements(block: Block) -> Iterator[Statement]:
    """Every statement, in reading order, without recursion."""
    stack = list(reversed(block))
    while stack:
        statement = stack.pop()
        yield statement
        match statement:
            case If(then=then, otherwise=otherwise) | Match(then=then, otherwise=otherwise):
                stack.extend(reversed((*then, *otherwise)))
            case While(body=body):
                stack.extend(reversed(body))
            case Skip() | Assign() | Update():  # holds no statement
                pass
            case _:
                assert_never(statement)


def _unassigned(block: Block, names: frozenset[str]) -> frozenset[str]:
    for statement in block:
        match statement:
            case Assign(target=target) | Update(target=target):
                names -= {target.name}
            case If(then=then, otherwise=otherwise) | Match(then=then, otherwise=otherwise):
                names = _unassigned(then, names) | _unassigned(otherwise, names)
    return names


def has_loops(program: Program) -> bool:
    return any(isinstance(s, While) for s in statements(program.body))


def variable(name: str, sort: Sort) -> Variable:
    return Variable(Role.BOUND, name, sort)
