"""The surface syntax of files, declarations and formulas: the trees made from the tokens, before any name is resolved.

A frozen dataclass for each kind of node, its fields in reading order, so that `children` finds the trees in it. Names
that are only compared are plain strings; names that a diagnostic may point to are tokens.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum
from typing import Any

from avow.base.records import dataclass
from avow.language.contract import ClauseKind
from avow.language.lexer import Token
from avow.language.terms import Quantifier


class Sign(StrEnum):
    """A connective that chains."""

    IFF = "<=>"
    IMPLIES = "->"
    OR = "or"
    AND = "and"


@dataclass(frozen=True, slots=True)
class _Placed:
    """A piece of syntax with its place; `depth` is its height, so that deep nesting is known before any recursion."""

    start: int
    end: int
    depth: int


# --- formulas and terms ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Connective(_Placed):
    """``a and b and c``: a chain of one connective, however long."""

    sign: Sign
    items: tuple[TermSyntax, ...]


@dataclass(frozen=True, slots=True)
class Negation(_Placed):
    """``not a``."""

    body: TermSyntax


@dataclass(frozen=True, slots=True)
class Comparison(_Placed):
    """``a < b <= c``, ``x in S``, ``x !in S``: a chain with its relations between the operands."""

    operands: tuple[TermSyntax, ...]
    relations: tuple[Token, ...]


@dataclass(frozen=True, slots=True)
class Calculation(_Placed):
    """``a + b - c`` or ``a * b / c``: a chain with its operators between the operands."""

    operands: tuple[TermSyntax, ...]
    operators: tuple[Token, ...]


@dataclass(frozen=True, slots=True)
class Minus(_Placed):
    """``-a``."""

    body: TermSyntax


@dataclass(frozen=True, slots=True)
class Application(_Placed):
    """``f(x, y)``."""

    function: TermSyntax
    arguments: tuple[TermSyntax, ...]


@dataclass(frozen=True, slots=True)
class Ahead(Application):
    """``always F``, in temporal properties only; the function is the operator's name."""


@dataclass(frozen=True, slots=True)
class Name(_Placed):
    """Also of a type, and of a built-in one."""

    text: str


@dataclass(frozen=True, slots=True)
class Number(_Placed):
    digits: str


@dataclass(frozen=True, slots=True)
class Text(_Placed):
    """A string, with its quotation marks."""

    text: str


@dataclass(frozen=True, slots=True)
class Truth(_Placed):
    value: bool


@dataclass(frozen=True, slots=True)
class PortName(_Placed):
    """``in.r``; `role` is ``in`` or ``out``."""

    role: str
    name: str


@dataclass(frozen=True, slots=True)
class NodePort(_Placed):
    """``agent.command`` or ``agent.in.phase``."""

    node: str
    role: str | None
    name: str


@dataclass(frozen=True, slots=True)
class FieldOf(_Placed):
    """``p.x`` of a record; if the record is a bare name, it is a `NodePort`."""

    body: TermSyntax
    name: Token


@dataclass(frozen=True, slots=True)
class Parentheses(_Placed):
    """``(a)``; ``((a))`` becomes one, with the depth of both."""

    body: TermSyntax


@dataclass(frozen=True, slots=True)
class TupleDisplay(_Placed):
    items: tuple[TermSyntax, ...]


@dataclass(frozen=True, slots=True)
class SetDisplay(_Placed):
    items: tuple[TermSyntax, ...]


@dataclass(frozen=True, slots=True)
class SequenceDisplay(_Placed):
    items: tuple[TermSyntax, ...]


@dataclass(frozen=True, slots=True)
class RangeDisplay(_Placed):
    """``<a upto b>``."""

    low: TermSyntax
    high: TermSyntax


@dataclass(frozen=True, slots=True)
class Binder(_Placed):
    """``x, y in REAL``."""

    names: tuple[Token, ...]
    domain: TermSyntax


@dataclass(frozen=True, slots=True)
class Quantification(_Placed):
    quantifier: Quantifier
    binders: tuple[Binder, ...]
    body: TermSyntax


@dataclass(frozen=True, slots=True)
class IfThenElse(_Placed):
    condition: TermSyntax
    then: TermSyntax
    otherwise: TermSyntax


@dataclass(frozen=True, slots=True)
class Quantity(_Placed):
    """``200 ms``, and in a limit ``5 steps``."""

    digits: str
    unit: Token


@dataclass(frozen=True, slots=True)
class LimitSyntax(_Placed):
    """``[<= 200 ms]``, ``[n steps]``; `relation` is empty if there is none."""

    relation: str
    amount: TermSyntax
    unit: Token | None


@dataclass(frozen=True, slots=True)
class Limited(_Placed):
    """``once[5 steps](F)``."""

    name: Token
    limit: LimitSyntax
    arguments: tuple[TermSyntax, ...]


@dataclass(frozen=True, slots=True)
class PaceSyntax(_Placed):
    """``steps(every 20 ms)``, ``steps(at most 100 ms)``; `words` are those before the length."""

    head: TermSyntax
    words: tuple[Token, ...]
    length: Quantity


@dataclass(frozen=True, slots=True)
class Lasting(_Placed):
    """``F since G``, ``F since[<= 5 steps] G``, ``R until U``."""

    word: str
    left: TermSyntax
    limit: LimitSyntax | None
    right: TermSyntax


TermSyntax = (
    Connective
    | Negation
    | Comparison
    | Calculation
    | Minus
    | Application
    | Name
    | Number
    | Text
    | Truth
    | PortName
    | NodePort
    | FieldOf
    | Parentheses
    | TupleDisplay
    | SetDisplay
    | SequenceDisplay
    | RangeDisplay
    | Quantification
    | IfThenElse
    | Quantity
    | Limited
    | PaceSyntax
    | Lasting
)


# --- types -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FunctionType(_Placed):
    parameters: TypeSyntax
    result: TypeSyntax


@dataclass(frozen=True, slots=True)
class ProductType(_Placed):
    """``A x B``; the signs between the factors are names, which should all be ``x``."""

    factors: tuple[TypeSyntax, ...]
    signs: tuple[Token, ...]


@dataclass(frozen=True, slots=True)
class Element(_Placed):
    """``red``, or the constructor ``move(REAL, REAL)``."""

    name: Token
    parameters: tuple[TypeSyntax, ...]


@dataclass(frozen=True, slots=True)
class SetType(_Placed):
    """``{}``, the unspecified type, has no elements."""

    elements: tuple[Element, ...]


@dataclass(frozen=True, slots=True)
class TupleType(_Placed):
    items: tuple[TypeSyntax, ...]


@dataclass(frozen=True, slots=True)
class SequenceType(_Placed):
    item: TypeSyntax


@dataclass(frozen=True, slots=True)
class RecordType(_Placed):
    """``[x : REAL, y : REAL]``."""

    fields: tuple[PortDeclaration, ...]


TypeSyntax = (
    FunctionType | ProductType | Name | SetType | TupleType | RecordType | SequenceType
)  # fmt: skip


# --- declarations ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class TypeDeclaration(_Placed):
    """``Name : type``."""

    name: Token
    type: TypeSyntax


@dataclass(frozen=True, slots=True)
class ConstantDeclaration(_Placed):
    """``Name = value``."""

    name: Token
    value: TermSyntax


@dataclass(frozen=True, slots=True)
class PortDeclaration(_Placed):
    """``r : REAL in m``, or ``parameter r : REAL`` with the word `parameter` as its `marker`."""

    name: Token
    type: TypeSyntax
    marker: Token | None = None
    unit: Token | None = None
    """Its names and signs as one."""


@dataclass(frozen=True, slots=True)
class PortList(_Placed):
    items: tuple[PortDeclaration, ...]


@dataclass(frozen=True, slots=True)
class Define(_Placed):
    """``define hot(i : NATURAL) = in.temp(i) > 80``; `end` is the end of the body."""

    name: Token
    parameters: tuple[PortDeclaration, ...]
    body: TermSyntax


@dataclass(frozen=True, slots=True)
class RosType(_Placed):
    """``package/msg/Type``, without the slashes."""

    names: tuple[Token, ...]


@dataclass(frozen=True, slots=True)
class TopicDeclaration(_Placed):
    """``package/Type name in frame matches(in.port)``; `role`, `port` and `frame` are None if they are not given."""

    type: RosType
    name: Token
    role: str | None
    port: Token | None
    frame: Token | None = None


@dataclass(frozen=True, slots=True)
class TopicList(_Placed):
    items: tuple[TopicDeclaration, ...]


Declaration = TypeDeclaration | ConstantDeclaration | Define
Listing = PortList | TopicList
Syntax = (
    TermSyntax
    | Binder
    | LimitSyntax
    | TypeSyntax
    | Element
    | Declaration
    | Listing
    | PortDeclaration
    | TopicDeclaration
    | RosType
)


# --- files: the parts of their text (`avow.language.outline` finds them) ----------------------------------------------


@dataclass(frozen=True, slots=True)
class ChanceSyntax:
    """``with probability >= 0.99 per run given (F)``, before the formula of a guarantee."""

    least: Token
    per_run: bool
    given: TermSyntax | None
    """None: every step counts."""
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class ClauseSyntax:
    kind: ClauseKind
    name: Token | None
    sentence: Token | None
    formula: TermSyntax | None
    """None: it had errors, which have been reported."""
    inside: tuple[int, int]
    """The offsets of the formula, between the parentheses."""
    start: int
    end: int
    chance: ChanceSyntax | None = None


@dataclass(slots=True)
class NodeSyntax:
    """`broken` are names that a part in error seems to declare; nothing more should be reported about them."""

    name: Token
    start: int
    end: int = 0
    inputs: PortList | None = None
    outputs: PortList | None = None
    topics: TopicList | None = None
    definitions: list[Define] = field(default_factory=list)
    clauses: list[ClauseSyntax] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)


@dataclass(slots=True)
class FileSyntax:
    declarations: list[Declaration] = field(default_factory=list)
    nodes: list[NodeSyntax] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)
    parts: list[tuple[int, int]] = field(default_factory=list)
    """The offsets of each declaration, node, and part of a node: the scope of a comment before it."""


# --- what a tree is made of -------------------------------------------------------------------------------------------


def children(tree: Syntax) -> tuple[Syntax, ...]:
    """The direct subtrees, in reading order, which is the order of every kind's fields."""
    found: list[Any] = []
    for name in type(tree).__match_args__[3:]:
        part = getattr(tree, name)
        if isinstance(part, _Placed):
            found.append(part)
        elif type(part) is tuple:
            found += [each for each in part if isinstance(each, _Placed)]
    return tuple(found)


def walk(tree: Syntax) -> Iterator[Syntax]:
    """The tree and everything in it, in reading order, at any depth."""
    stack = [tree]
    while stack:
        current = stack.pop()
        yield current
        stack.extend(reversed(children(current)))


def unparenthesised(tree: TermSyntax) -> TermSyntax:
    """The tree without enclosing parentheses."""
    while isinstance(tree, Parentheses):
        tree = tree.body
    return tree
