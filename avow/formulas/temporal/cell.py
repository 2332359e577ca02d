"""State variables (cells): values that one step leaves to the next."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from fractions import Fraction
from typing import assert_never

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.formulas.formula import equation, free_variables
from avow.language import sorts as s
from avow.language import terms as t

CELL = "#"
"""A character in the name of every state variable, and of no port."""


class Unsaid(Exception):  # noqa: N818 - it names what happened
    """A clause that has no formula of one step; `reason` is for people."""

    def __init__(self, reason: str, span: Span | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.span = span


@dataclass(frozen=True, slots=True)
class Cell:
    """A state variable: a value that one step leaves to the next."""

    before: t.Variable
    """The value that the previous step left: a function of the `parameters`, if there are any. Its name identifies the
    record, so that formulas that read different records have different digests."""
    parameters: tuple[t.Variable, ...]
    initial: t.Term | None
    """The value before the first step, at every argument; None: any value, which is never read."""
    now: t.Term
    """The value that this step leaves, at the `parameters`: over the node's ports and the state that the previous step
    left."""
    record: t.History | None = field(default=None, compare=False, repr=False)
    """The term that it is kept for; None for the flag of the first step, and for values that last through a silence."""

    @property
    def name(self) -> str:
        return self.before.name

    @property
    def sort(self) -> s.Sort:
        return self.before.sort

    @property
    def read(self) -> t.Term:
        """The value that the previous step left at the `parameters`."""
        return at(self.before, self.parameters)

    def begins(self, cell: t.Variable | None = None) -> t.Term:
        """The formula that a variable (by default the cell's own) has the cell's value before the first step."""
        if self.initial is None:
            return t.TRUE
        return self._everywhere(equation(at(cell or self.before, self.parameters), self.initial))

    def leaves(self, after: t.Variable) -> t.Term:
        """The formula that a variable has the value that this step leaves."""
        return self._everywhere(equation(at(after, self.parameters), self.now))

    def _everywhere(self, formula: t.Term) -> t.Term:
        return t.Quantified(t.Quantifier.FORALL, self.parameters, formula) if self.parameters else formula


def some_value(sort: s.Sort) -> t.Term | None:
    """A literal value of a sort; None for an unspecified type, which has no literals, and for functions."""
    match sort:
        case s.BoolSort():
            return t.FALSE
        case s.NaturalSort() | s.IntegerSort():
            return t.Literal(0, s.NATURAL)
        case s.RealSort():
            return t.Literal(Fraction(0), s.REAL)
        case s.StringSort():
            return t.Literal("", sort)
        case s.EnumSort(members=(first, *_)):
            return t.EnumValue(first, sort)
        case s.SequenceSort():
            return t.SequenceTerm((), sort)
        case s.TupleSort(items=items):
            parts = tuple(map(some_value, items))
            return t.TupleTerm(tuple(p for p in parts if p is not None), sort) if None not in parts else None
        case s.DataSort(constructors=constructors):
            for made in constructors:
                arguments = tuple(map(some_value, made.parameters))
                if None not in arguments:
                    return t.Construct(made.name, tuple(a for a in arguments if a is not None), sort)
            return None
        case s.EnumSort() | s.OpaqueSort() | s.FunctionSort() | s.SetSort():  # no literal of it
            return None
        case _:
            assert_never(sort)


def at(variable: t.Variable, parameters: tuple[t.Variable, ...]) -> t.Term:
    sort = variable.sort
    return t.Apply(variable, parameters, sort.result) if parameters and isinstance(sort, s.FunctionSort) else variable


def at_the_parameters(name: str, parts: Iterable[t.Term], sort: s.Sort) -> tuple[t.Variable, tuple[t.Variable, ...]]:
    """The variable of a cell for a record over some terms, and its parameters: their bound variables."""
    bound = {v for part in parts for v in free_variables(part) if v.role is t.Role.BOUND}
    parameters = tuple(sorted(bound, key=lambda v: v.name))
    kept = s.FunctionSort(tuple(v.sort for v in parameters), sort) if parameters else sort
    return t.Variable(t.Role.INPUT, name, kept), parameters
