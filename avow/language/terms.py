"""Typed terms and formulas: what a checked contract means. A formula is a term of sort BOOL.

The checker makes these from the surface syntax: every name is resolved, every widening explicit, every sort known.
All later stages (Z3, Dafny, monitors, printers, hashes) read this and nothing else. Spans do not count in equality.

Every node has `children`, its direct subterms in reading order (the bound variables of a quantifier are not subterms),
and `rebuild`, itself with others in their place. A node without one of them is an error of mypy wherever it is used.
"""

from __future__ import annotations

from dataclasses import field, replace
from fractions import Fraction
from typing import TypeVar

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.operator_names import RESPONSES as RESPONSES
from avow.language.operator_names import Builtin as Builtin
from avow.language.operator_names import Past as Past
from avow.language.operator_names import Quantifier as Quantifier
from avow.language.operator_names import Role as Role
from avow.language.sorts import BOOL, DataSort, EnumSort, SequenceSort, SetSort, Sort, TupleSort


class _Leaf:
    """A term without subterms."""

    __slots__ = ()

    @property
    def children(self) -> tuple[Term, ...]:
        return ()

    def rebuild(self: _Self, parts: tuple[Term, ...]) -> _Self:
        return self


class _Pair:
    """A term of two subterms."""

    __slots__ = ()
    left: Term
    right: Term

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.left, self.right)


class _Several:
    """A term of as many subterms as are written."""

    __slots__ = ()
    items: tuple[Term, ...]

    @property
    def children(self) -> tuple[Term, ...]:
        return self.items


_Self = TypeVar("_Self")


@dataclass(frozen=True, slots=True)
class Literal(_Leaf):
    """A truth value, number or string; decimals are exact fractions."""

    value: bool | int | Fraction | str
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class EnumValue(_Leaf):
    """An element of an enumeration."""

    name: str
    sort: EnumSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Variable(_Leaf):
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

    @property
    def children(self) -> tuple[Term, ...]:
        return self.arguments

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Construct(self.constructor, parts, self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Apply:
    """``in.at(x, y)``: a function-typed variable applied to all its arguments."""

    function: Term
    arguments: tuple[Term, ...]
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.function, *self.arguments)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Apply(parts[0], parts[1:], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Index:
    """``s(i)``: the element of a sequence at position i, counted from 0; without a value outside the sequence."""

    sequence: Term
    index: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.sequence, self.index)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Index(parts[0], parts[1], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Length:
    """``length(s)``, a natural number."""

    sequence: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.sequence,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Length(parts[0], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Item:
    """``p.x``: an item of a record, by its position."""

    record: Term
    position: int
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.record,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        whole = parts[0]
        return whole.items[self.position] if isinstance(whole, TupleTerm) else replace(self, record=whole)


@dataclass(frozen=True, slots=True)
class Argument:
    """The argument at `position` of the constructor that a value was made with: y of ``move(x, y)`` at 1; without a
    value where it was made with another one. No contract says it: it is what `avow.formulas.one_point_rule` puts for a
    variable, and only beside the condition that the value was made so (`made_with`)."""

    value: Term
    constructor: str
    position: int
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.value,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        whole = parts[0]
        if isinstance(whole, Construct) and whole.constructor == self.constructor:
            return whole.arguments[self.position]
        return replace(self, value=whole)


@dataclass(frozen=True, slots=True)
class Widen:
    """An INTEGER or NATURAL term used where a REAL is wanted; `sort` is REAL."""

    term: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.term,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Widen(parts[0], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Arithmetic(_Pair):
    """``+ - * /``; both sides have the sort of the whole, up to NATURAL within INTEGER. ``/`` is REAL."""

    operator: str
    left: Term
    right: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Arithmetic(self.operator, parts[0], parts[1], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Negative:
    """Unary minus; INTEGER or REAL."""

    term: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.term,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Negative(parts[0], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class TupleTerm(_Several):
    items: tuple[Term, ...]
    sort: TupleSort
    span: Span | None = field(default=None, compare=False, repr=False)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return TupleTerm(parts, self.sort, self.span)


@dataclass(frozen=True, slots=True)
class SequenceTerm(_Several):
    """``<a, b, c>``."""

    items: tuple[Term, ...]
    sort: SequenceSort
    span: Span | None = field(default=None, compare=False, repr=False)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return SequenceTerm(parts, self.sort, self.span)


@dataclass(frozen=True, slots=True)
class SequenceRange:
    """``<a upto b>``: the integers from a to b, both included; empty where b < a."""

    low: Term
    high: Term
    sort: SequenceSort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.low, self.high)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return SequenceRange(parts[0], parts[1], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class SetTerm(_Several):
    """``{red, orange}``."""

    items: tuple[Term, ...]
    sort: SetSort
    span: Span | None = field(default=None, compare=False, repr=False)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return SetTerm(parts, self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Compare(_Pair):
    """``== != < <= > >=`` between terms of one sort (NATURAL and INTEGER count as one)."""

    operator: str
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Compare(self.operator, parts[0], parts[1], self.span)


@dataclass(frozen=True, slots=True)
class In:
    """``t in S`` where S is a set literal or a sequence; ``!in`` is its `Not`."""

    item: Term
    collection: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.item, self.collection)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return In(parts[0], parts[1], self.span)


@dataclass(frozen=True, slots=True)
class Not:
    body: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.body,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Not(parts[0], self.span)


@dataclass(frozen=True, slots=True)
class And(_Several):
    items: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return And(parts, self.span)


@dataclass(frozen=True, slots=True)
class Or(_Several):
    items: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Or(parts, self.span)


@dataclass(frozen=True, slots=True)
class Implies(_Pair):
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Implies(parts[0], parts[1], self.span)


@dataclass(frozen=True, slots=True)
class Iff(_Pair):
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Iff(parts[0], parts[1], self.span)


@dataclass(frozen=True, slots=True)
class Quantified:
    """``forall(x, y in REAL | body)``. A bound variable never shadows another name in scope."""

    quantifier: Quantifier
    variables: tuple[Variable, ...]
    body: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.body,)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Quantified(self.quantifier, self.variables, parts[0], self.span)


@dataclass(frozen=True, slots=True)
class Operation:
    """``min(a, b)``: a built-in operator applied to arguments that have been brought to the sorts it wants.

    Of `mod` and `div` the second argument is a positive whole number that is written down, so that both are total."""

    operator: Builtin
    arguments: tuple[Term, ...]
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return self.arguments

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Operation(self.operator, parts, self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Conditional:
    """``if F then s else t``; both branches have the sort of the whole, up to NATURAL within INTEGER."""

    condition: Term
    then: Term
    otherwise: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return (self.condition, self.then, self.otherwise)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return Conditional(parts[0], parts[1], parts[2], self.sort, self.span)


@dataclass(frozen=True, slots=True)
class Limit:
    """``[5 steps]``, ``[< 200 ms]``: how old something may be, the limit itself included unless `relation` is strict.
    `amount` is a number of steps (a whole number) or of seconds (REAL); `relation` is `<=` `<` `>=` `>`, empty where
    the operator says which."""

    relation: str
    amount: Term
    steps: bool


@dataclass(frozen=True, slots=True)
class History:
    """``once[5 steps](F)``, ``F since G``: what a run was like up to now, or (a response) has to be like from now on.

    The arguments are in the order in which they are written; of `counted(F since G)` they are F and G."""

    operator: Past
    arguments: tuple[Term, ...]
    sort: Sort
    limit: Limit | None = None
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return self.arguments if self.limit is None else (*self.arguments, self.limit.amount)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        if self.limit is None:
            return History(self.operator, parts, self.sort, None, self.span)
        limit = Limit(self.limit.relation, parts[-1], self.limit.steps)
        return History(self.operator, parts[:-1], self.sort, limit, self.span)


Term = (
    Literal | EnumValue | Variable | Construct | Apply | Index | Length | Item | Argument | Widen | Arithmetic
    | Negative | TupleTerm | SequenceTerm | SequenceRange | SetTerm | Compare | In | Not | And | Or | Implies | Iff
    | Quantified | Operation | Conditional | History
)  # fmt: skip

TRUE = Literal(True, BOOL)
FALSE = Literal(False, BOOL)
