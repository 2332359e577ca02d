"""Typed terms and formulas: the meaning of a checked contract. A formula is a term of sort BOOL.

The checker makes these from the surface syntax: every name is resolved, every widening explicit, every sort known.
All later stages (Z3, Dafny, monitors, printers, hashes) read only these. Spans are ignored in equality.

Every node names the fields that hold its subterms; `children` and `rebuild` follow from that. The bound variables of a
quantifier are not subterms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from enum import StrEnum
from fractions import Fraction
from operator import attrgetter
from typing import Any

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.sorts import BOOL, DataSort, EnumSort, SequenceSort, SetSort, Sort, TupleSort


class Role(StrEnum):
    """The source of a variable's value."""

    INPUT = "in"
    OUTPUT = "out"
    BOUND = "bound"


class Quantifier(StrEnum):
    FORALL = "forall"
    EXISTS = "exists"
    UNIQUE = "exists_unique"
    """Existence and uniqueness of the whole tuple of bound variables."""


class Builtin(StrEnum):
    """An operator that is written like a function: ``xor(p, q)``. `avow.language.operators` defines their meanings."""

    XOR = "xor"
    ABS = "abs"
    MIN = "min"
    MAX = "max"
    MOD = "mod"
    DIV = "div"
    SQRT = "sqrt"
    SIN = "sin"
    COS = "cos"
    ATAN2 = "atan2"


CALLED = ("length", "indices", "norm", "dot")
"""Words that are written like operators, and stand for other terms."""


CIRCULAR = (Builtin.SIN, Builtin.COS, Builtin.ATAN2)
"""Operators of which solvers know bounds only (`avow.language.facts`)."""


class Past(StrEnum):
    """An operator that refers to more than one step of a run. `avow.formulas.temporal` defines their meanings."""

    PREVIOUS = "previous"
    ROSE = "rose"
    FELL = "fell"
    CHANGED = "changed"
    ONCE = "once"
    HISTORICALLY = "historically"
    HELD = "held"
    SINCE = "since"
    COUNTED = "counted"
    NEXT = "next"
    WITHIN = "within"
    FOR = "for"
    UNTIL = "until"
    EVENTUALLY = "eventually"
    ARRIVED = "arrived"
    STEPS = "steps"
    """A node's pace, as a clause by itself: ``steps(at most 100 ms)``; its limit is the time between steps."""


RESPONSES = frozenset((Past.NEXT, Past.WITHIN, Past.FOR, Past.UNTIL, Past.EVENTUALLY))
"""Operators that refer to later steps; allowed only as a clause, or as the right side of its outermost `->`."""


class _Node:
    """The base of all terms: `children` and `rebuild`, by the names of the fields that hold subterms."""

    __slots__ = ()
    _subterms = ""
    """These names, in reading order; a field with a tuple of subterms comes last, with a star."""

    @property
    def children(self) -> tuple[Term, ...]:
        """The direct subterms in reading order."""
        return ()

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        """The term with other direct subterms."""
        return self  # type: ignore[return-value]  # every subclass is one of the terms

    def __init_subclass__(cls) -> None:
        names = cls._subterms.split()
        if names and "rebuild" not in vars(cls):
            cls.rebuild = _rebuilding(names)  # type: ignore[method-assign,assignment]
        if names:
            cls.children = property(_listing(names))  # type: ignore[assignment]


def _listing(names: Sequence[str]) -> Callable[[Any], tuple[Term, ...]]:
    """A function that reads the fields of these names."""
    several = names[-1].startswith("*")
    if several and len(names) == 1:
        return attrgetter(names[0][1:])
    if several:
        first, rest = names[0], names[1][1:]
        return lambda term: (getattr(term, first), *getattr(term, rest))
    return attrgetter(*names) if len(names) > 1 else lambda term: (getattr(term, names[0]),)


def _rebuilding(names: Sequence[str]) -> Callable[[Any, tuple[Term, ...]], Any]:
    """A function that makes a new term with other values in these fields."""
    at = {name.lstrip("*"): slice(k, None) if name.startswith("*") else k for k, name in enumerate(names)}

    def rebuild(self: Any, parts: tuple[Term, ...]) -> Any:
        fields = self.__dataclass_fields__
        return type(self)(*[parts[at[name]] if name in at else getattr(self, name) for name in fields])

    return rebuild


@dataclass(frozen=True, slots=True)
class Literal(_Node):
    """A truth value, number or string; decimals are exact fractions."""

    value: bool | int | Fraction | str
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)
    unit: str = field(default="", compare=False, repr=False)
    """The unit that is written with it (``2 s``), as base unit."""


@dataclass(frozen=True, slots=True)
class EnumValue(_Node):
    """An element of an enumeration."""

    name: str
    sort: EnumSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Variable(_Node):
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
class Construct(_Node):
    """``move(x, y)``: a value of an algebraic data type."""

    _subterms = "*arguments"

    constructor: str
    arguments: tuple[Term, ...]
    sort: DataSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Apply(_Node):
    """``in.at(x, y)``: a function-typed variable applied to all its arguments."""

    _subterms = "function *arguments"

    function: Term
    arguments: tuple[Term, ...]
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Index(_Node):
    """``s(i)``: the element of a sequence at position i, counted from 0; without a value outside the sequence."""

    _subterms = "sequence index"

    sequence: Term
    index: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Length(_Node):
    """``length(s)``, a natural number."""

    _subterms = "sequence"

    sequence: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Item(_Node):
    """``p.x``: an item of a record, by its position."""

    _subterms = "record"

    record: Term
    position: int
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        whole = parts[0]
        return whole.items[self.position] if isinstance(whole, TupleTerm) else replace(self, record=whole)


@dataclass(frozen=True, slots=True)
class Argument(_Node):
    """The argument at `position` of the constructor that a value was made with: y of ``move(x, y)`` at 1; without a
    value if it was made with another one. It does not occur in contracts: `avow.formulas.one_point_rule` substitutes it
    for a variable, and only beside the condition that the value was made so (`made_with`)."""

    _subterms = "value"

    value: Term
    constructor: str
    position: int
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        whole = parts[0]
        if isinstance(whole, Construct) and whole.constructor == self.constructor:
            return whole.arguments[self.position]
        return replace(self, value=whole)


@dataclass(frozen=True, slots=True)
class Widen(_Node):
    """An INTEGER or NATURAL term used where a REAL is expected; `sort` is REAL."""

    _subterms = "term"

    term: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Arithmetic(_Node):
    """``+ - * /``; both sides have the sort of the whole, up to NATURAL within INTEGER. ``/`` is REAL."""

    _subterms = "left right"

    operator: str
    left: Term
    right: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Negative(_Node):
    """Unary minus; INTEGER or REAL."""

    _subterms = "term"

    term: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class TupleTerm(_Node):
    _subterms = "*items"
    items: tuple[Term, ...]
    sort: TupleSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SequenceTerm(_Node):
    """``<a, b, c>``."""

    _subterms = "*items"

    items: tuple[Term, ...]
    sort: SequenceSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SequenceRange(_Node):
    """``<a upto b>``: the integers from a to b, both included; empty if b < a."""

    _subterms = "low high"

    low: Term
    high: Term
    sort: SequenceSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SetTerm(_Node):
    """``{red, orange}``."""

    _subterms = "*items"

    items: tuple[Term, ...]
    sort: SetSort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Compare(_Node):
    """``== != < <= > >=`` between terms of one sort (NATURAL and INTEGER count as one)."""

    _subterms = "left right"

    operator: str
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class In(_Node):
    """``t in S`` where S is a set literal or a sequence; ``!in`` is its `Not`."""

    _subterms = "item collection"

    item: Term
    collection: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Not(_Node):
    _subterms = "body"
    body: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class And(_Node):
    _subterms = "*items"
    items: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Or(_Node):
    _subterms = "*items"
    items: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Implies(_Node):
    _subterms = "left right"
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Iff(_Node):
    _subterms = "left right"
    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Quantified(_Node):
    """``forall(x, y in REAL | body)``. A bound variable never shadows another name in scope."""

    _subterms = "body"

    quantifier: Quantifier
    variables: tuple[Variable, ...]
    body: Term
    span: Span | None = field(default=None, compare=False, repr=False)
    sort: Sort = BOOL


@dataclass(frozen=True, slots=True)
class Operation(_Node):
    """``min(a, b)``: a built-in operator applied to arguments that have been converted to its sorts.

    The second argument of `mod` and `div` is a positive whole literal, so that both are total."""

    _subterms = "*arguments"

    operator: Builtin
    arguments: tuple[Term, ...]
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Conditional(_Node):
    """``if F then s else t``; both branches have the sort of the whole, up to NATURAL within INTEGER."""

    _subterms = "condition then otherwise"

    condition: Term
    then: Term
    otherwise: Term
    sort: Sort
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Limit:
    """``[5 steps]``, ``[< 200 ms]``: a limit on age, inclusive unless `relation` is strict.
    `amount` is a number of steps (a whole number) or of seconds (REAL); `relation` is `<=` `<` `>=` `>`, empty if the
    operator determines it."""

    relation: str
    amount: Literal
    steps: bool

    @property
    def number(self) -> Fraction:
        assert not isinstance(self.amount.value, str)
        return Fraction(self.amount.value)


@dataclass(frozen=True, slots=True)
class History(_Node):
    """``once[5 steps](F)``, ``F since G``: a property of the run up to now, or (a response) a demand on it from now on.

    The arguments are in the order in which they are written; those of `counted(F since G)` are F and G."""

    operator: Past
    arguments: tuple[Term, ...]
    sort: Sort
    limit: Limit | None = None
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def children(self) -> tuple[Term, ...]:
        return self.arguments if self.limit is None else (*self.arguments, self.limit.amount)

    def rebuild(self, parts: tuple[Term, ...]) -> Term:
        return History(self.operator, parts[: len(self.arguments)], self.sort, self.limit, self.span)


Term = (
    Literal | EnumValue | Variable | Construct | Apply | Index | Length | Item | Argument | Widen | Arithmetic
    | Negative | TupleTerm | SequenceTerm | SequenceRange | SetTerm | Compare | In | Not | And | Or | Implies | Iff
    | Quantified | Operation | Conditional | History
)  # fmt: skip

TRUE = Literal(True, BOOL)
FALSE = Literal(False, BOOL)
