"""Typed terms and formulas: what a checked contract means. A formula is a term of sort BOOL.

The checker makes these from the surface syntax: every name is resolved, every widening explicit, every sort known.
All later stages (Z3, Dafny, monitors, printers, hashes) read this and nothing else. Spans do not count in equality.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction

from avow.base.diagnostics import Span
from avow.language.sorts import BOOL, DataSort, EnumSort, SequenceSort, SetSort, Sort, TupleSort


class Role(StrEnum):
    """Where a variable's value comes from."""

    INPUT = "in"
    OUTPUT = "out"
    BOUND = "bound"


class Quantifier(StrEnum):
    FORALL = "forall"
    EXISTS = "exists"
    UNIQUE = "exists_unique"
    """Existence and uniqueness of the whole tuple of bound variables."""


@dataclass(frozen=True, slots=True)
class Literal:
    """A truth value, number or string; decimals are exact fractions."""

    value: bool | int | Fraction | str
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class EnumValue:
    """An element of an enumeration."""

    name: str
    sort: EnumSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Variable:
    """An input, an output or a bound variable; `name` has no prefix."""

    role: Role
    name: str
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def qualified(self) -> str:
        """``in.r``, ``out.status``, or the bare name of a bound variable."""
        return self.name if self.role is Role.BOUND else f"{self.role}.{self.name}"


@dataclass(frozen=True, slots=True)
class Construct:
    """``move(x, y)``: a value of an algebraic data type."""

    constructor: str
    arguments: tuple[Term, ...]
    sort: DataSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Apply:
    """``in.at(x, y)``: a function-typed variable applied to all its arguments."""

    function: Term
    arguments: tuple[Term, ...]
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Index:
    """``s(i)``: the element of a sequence at position i, counted from 0; unspecified outside the sequence."""

    sequence: Term
    index: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Length:
    """``length(s)``, a natural number."""

    sequence: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Widen:
    """An INTEGER or NATURAL term used where a REAL is wanted; `sort` is REAL."""

    term: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """``+ - * /``; both sides have the sort of the whole, up to NATURAL within INTEGER. ``/`` is REAL."""

    operator: str
    left: Term
    right: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Negative:
    """Unary minus; INTEGER or REAL."""

    term: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class TupleTerm:
    items: tuple[Term, ...]
    sort: TupleSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SequenceTerm:
    """``<a, b, c>``."""

    items: tuple[Term, ...]
    sort: SequenceSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SequenceRange:
    """``<a upto b>``: the integers from a to b, both included; empty where b < a."""

    low: Term
    high: Term
    sort: SequenceSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SetTerm:
    """``{red, orange}``."""

    items: tuple[Term, ...]
    sort: SetSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Compare:
    """``== != < <= > >=`` between terms of one sort (NATURAL and INTEGER count as one)."""

    operator: str
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class In:
    """``t in S`` where S is a set literal or a sequence; ``!in`` is its `Not`."""

    item: Term
    collection: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Not:
    body: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class And:
    items: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Or:
    items: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Implies:
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Iff:
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Quantified:
    """``forall(x, y in REAL | body)``. A bound variable never shadows another name in scope."""

    quantifier: Quantifier
    variables: tuple[Variable, ...]
    body: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


Term = (
    Literal
    | EnumValue
    | Variable
    | Construct
    | Apply
    | Index
    | Length
    | Widen
    | Arithmetic
    | Negative
    | TupleTerm
    | SequenceTerm
    | SequenceRange
    | SetTerm
    | Compare
    | In
    | Not
    | And
    | Or
    | Implies
    | Iff
    | Quantified
)

TRUE = Literal(True, BOOL)
FALSE = Literal(False, BOOL)


def children(term: Term) -> tuple[Term, ...]:
    """The direct subterms, in reading order (the bound variables of a quantifier are not subterms)."""
    match term:
        case Literal() | EnumValue() | Variable():
            return ()
        case Construct(arguments=arguments):
            return arguments
        case Apply(function=function, arguments=arguments):
            return (function, *arguments)
        case Index(sequence=sequence, index=index):
            return (sequence, index)
        case Length(sequence=sequence):
            return (sequence,)
        case Widen(term=inner) | Negative(term=inner):
            return (inner,)
        case Arithmetic(left=left, right=right) | Compare(left=left, right=right):
            return (left, right)
        case Implies(left=left, right=right) | Iff(left=left, right=right):
            return (left, right)
        case TupleTerm(items=items) | SequenceTerm(items=items) | SetTerm(items=items):
            return items
        case And(items=items) | Or(items=items):
            return items
        case SequenceRange(low=low, high=high):
            return (low, high)
        case In(item=item, collection=collection):
            return (item, collection)
        case Not(body=body) | Quantified(body=body):
            return (body,)


def subterms(term: Term) -> Iterator[Term]:
    """The term and everything in it, in reading order; however deep it is."""
    stack = [term]
    while stack:
        current = stack.pop()
        yield current
        stack.extend(reversed(children(current)))
