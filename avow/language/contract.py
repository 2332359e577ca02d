"""A checked contract: the language layer's result, which all other layers use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from enum import StrEnum
from fractions import Fraction
from typing import Any

from avow.base.diagnostics import Diagnostic, Span
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.language.sorts import Sort
from avow.language.terms import TRUE, Compare, History, Implies, Limit, Past, Role, Term, Variable

TO_WRITE = "to_write"
"""The name that a draft gives to a guarantee that a person has yet to write."""


class ClauseKind(StrEnum):
    ASSUMPTION = "assumption"
    GUARANTEE = "guarantee"


@dataclass(frozen=True, slots=True)
class Chance:
    """``with probability >= 0.99 given (in.present) ( out.detected )``: whatever happened before, a step that meets
    `given` meets `claim` with a probability of at least `least`; `per_run`: a run meets it at all its steps with that
    probability, and nothing is given."""

    least: Fraction
    """Greater than 0 and less than 1."""
    claim: Term
    given: Term = TRUE
    per_run: bool = False

    @property
    def always(self) -> Term:
        """What a step does that keeps the guarantee."""
        return self.claim if self.given == TRUE else Implies(self.given, self.claim)

    def mapped(self, change: Callable[[Term], Term]) -> Chance:
        """With other formulas."""
        return replace(self, claim=change(self.claim), given=change(self.given))


@dataclass(frozen=True, slots=True)
class Clause:
    """One ``assume(…)`` or ``guarantee(…)``. `name` is the given name, or else ``A1``, ``G2``… by position from 1."""

    kind: ClauseKind
    name: str
    position: int
    formula: Term
    """Its meaning: the formula as written, and that it has a value (`avow.language.definedness`)."""
    sentence: str | None = None
    text: str = field(default="", compare=False)
    """The formula as written in the file."""
    span: Span | None = field(default=None, compare=False, repr=False)
    sentence_span: Span | None = field(default=None, compare=False, repr=False)
    written: Term | None = field(default=None, compare=False, repr=False)
    """The formula as written, without the conditions for a value, if it was read from a file: for messages about the
    text."""
    chance: Chance | None = None
    """Of a guarantee with a probability. Its `formula` is then TRUE, so that nothing uses it as if it always held."""

    @property
    def spoken(self) -> Term:
        """The formula, or what is claimed with a probability: for questions about the text, never as a premise."""
        return self.formula if self.chance is None else self.chance.always

    @property
    def unwritten(self) -> bool:
        """Whether it is a draft's placeholder: a guarantee `to_write` with the formula TRUE."""
        return self.kind is ClauseKind.GUARANTEE and self.name == TO_WRITE and self.spoken == TRUE

    @property
    def pace(self) -> Limit | None:
        """The time between the node's steps, if the clause has the form ``steps(every 20 ms)``."""
        formula = self.formula
        return formula.limit if isinstance(formula, History) and formula.operator is Past.STEPS else None


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output: its name, sort, and the type as written (``WayP``)."""

    role: Role
    name: str
    sort: Sort
    type_name: str
    span: Span | None = field(default=None, compare=False, repr=False)
    parameter: bool = False
    """Whether it is an input that has one value during a run."""
    value: Term | None = None
    """The value of a parameter, if the plan gives one."""
    unit: str = ""
    """As written (`avow.language.units`); empty: any."""

    @property
    def variable(self) -> Variable:
        return Variable(self.role, self.name, self.sort)

    @property
    def declared(self) -> str:
        """``in.r``, ``in.limit (parameter)``: for digests."""
        return self.variable.qualified + " (parameter)" * self.parameter

    @property
    def constancy(self) -> Clause:
        """The assumption that a parameter keeps its value."""
        v = self.variable
        same = Compare("==", v, History(Past.PREVIOUS, (v, v), self.sort))
        said = f"The parameter {self.name} keeps its value during a run"
        text = f"{v.qualified} == previous({v.qualified}, {v.qualified})"
        return Clause(ClauseKind.ASSUMPTION, f"{self.name}_constant", 0, same, said, text, self.span, written=same)


@dataclass(frozen=True, slots=True)
class Topic:
    """``sensor_msgs/Snapshot at matches(in.at)``; `port` is the matched input or output."""

    ros_type: str
    name: str
    port: Port | None
    span: Span | None = field(default=None, compare=False, repr=False)
    frame: str = ""
    """The frame in which the contract speaks of its messages' geometry; empty: none."""

    @property
    def kind(self) -> str:
        """``geometry_msgs/PoseStamped in map``."""
        return f"{self.ros_type} in {self.frame}" if self.frame else self.ros_type


@dataclass(frozen=True, slots=True)
class Partial:
    """A contract in another notation, and the parts that are left out."""

    text: str
    missing: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True)
class Definition:
    """``define hot(i : NATURAL) = in.temp(i) > 80``. The parameters are bound variables of the body, in which other
    definitions are expanded."""

    name: str
    parameters: tuple[Variable, ...]
    body: Term
    text: str = field(default="", compare=False)
    """As written, from `define` on."""
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Node:
    name: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    topics: tuple[Topic, ...]
    assumptions: tuple[Clause, ...]
    guarantees: tuple[Clause, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    relay: bool = field(default=False, compare=False, repr=False)
    """Generated to merge several outputs into one input; not from a contract."""
    definitions: tuple[Definition, ...] = field(default=(), compare=False, repr=False)
    """The definitions that its clauses may use by name; they are expanded in every formula."""
    fixed: tuple[Port, ...] = field(default=(), compare=False, repr=False)
    """The parameters with a value in the plan: they are no inputs, and the value stands for them in every formula."""

    @property
    def parameters(self) -> tuple[Port, ...]:
        """The inputs that are parameters."""
        return tuple(port for port in self.inputs if port.parameter)

    @property
    def implied(self) -> frozenset[str]:
        """The names of the assumptions that follow from a declaration: they are not written in the contract."""
        own = {clause.name: clause.formula for clause in self.assumptions}
        said = (port.constancy for port in self.parameters)
        return frozenset(clause.name for clause in said if own.get(clause.name) == clause.formula)

    @property
    def clauses(self) -> tuple[Clause, ...]:
        return self.assumptions + self.guarantees

    @property
    def unwritten(self) -> bool:
        """Whether a guarantee is still to be written, so that cases it leaves open are not reported."""
        return any(clause.unwritten for clause in self.guarantees)

    def clause(self, name: str) -> Clause:
        """The clause of that name. Raises KeyError."""
        found: Clause = _named(self.assumptions, self.guarantees)[name]
        return found

    def input(self, name: str) -> Port:
        """The input of that name. Raises KeyError."""
        found: Port = _named(self.inputs, ())[name]
        return found

    def output(self, name: str) -> Port:
        """The output of that name. Raises KeyError."""
        found: Port = _named(self.outputs, ())[name]
        return found


@dataclass(frozen=True, slots=True)
class Contract:
    """The declarations of one or more .rcl files. `types` are the context's names for sorts, in order;
    `constants` are names for values (already expanded in every formula)."""

    files: tuple[str, ...]
    types: tuple[tuple[str, Sort], ...]
    constants: tuple[tuple[str, Term], ...]
    nodes: tuple[Node, ...]
    definitions: tuple[Definition, ...] = field(default=(), compare=False, repr=False)
    """The definitions of the context that mention no input or output."""

    def node(self, name: str) -> Node:
        """The node of that name. Raises KeyError."""
        found: Node = _named(self.nodes, ())[name]
        return found


@by_identity(20_000)
def _named(first: tuple[Any, ...], then: tuple[Any, ...]) -> dict[str, Any]:
    """An index by name: a node may have thousands of ports, each of which is looked up. The first of a name is kept."""
    return {each.name: each for each in (*reversed(then), *reversed(first))}
