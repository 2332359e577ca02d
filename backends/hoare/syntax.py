"""The imperative language as written: statements and expressions with their places, before names have sorts."""

from __future__ import annotations

from dataclasses import field
from fractions import Fraction

from avow.base.diagnostics import Span
from avow.base.records import dataclass


@dataclass(frozen=True, slots=True)
class Number:
    """A numeral; `whole` where it has no decimal point."""

    value: Fraction
    whole: bool
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Truth:
    value: bool
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Text:
    """A string literal."""

    value: str
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Name:
    """A bare name (`prefix` None), or a port of the contract: ``in.r``, ``out.status``."""

    name: str
    prefix: str | None
    span: Span = field(compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.prefix}.{self.name}" if self.prefix else self.name


@dataclass(frozen=True, slots=True)
class Call:
    """``f(a, b)``: a function or relation applied, or a value constructed."""

    function: Name
    arguments: tuple[Expression, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Unary:
    """``NOT e`` or ``- e``."""

    operator: str
    operand: Expression
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Binary:
    """Operators in one spelling: ``+ - * / == != < <= > >= and or -> <=>``."""

    operator: str
    left: Expression
    right: Expression
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Chain:
    """``a <= b < c``."""

    items: tuple[Expression, ...]
    operators: tuple[str, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Member:
    """``e in {a, b}`` or ``e !in {a, b}``."""

    item: Expression
    choices: tuple[Expression, ...]
    negated: bool
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Inside:
    """``e in s`` or ``e !in s``: s is a sequence, or a set that the contract names."""

    item: Expression
    collection: Expression
    negated: bool
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Tuple:
    """``(a, b)``."""

    items: tuple[Expression, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Sequence:
    """``[a, b]`` and ``[]``."""

    items: tuple[Expression, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Quantification:
    """``forall(x, y in REAL | e)``; in assertions only."""

    quantifier: str
    groups: tuple[tuple[tuple[Name, ...], str], ...]
    body: Expression
    span: Span = field(compare=False, repr=False)


Expression = (
    Number | Truth | Text | Name | Call | Unary | Binary | Chain | Member | Inside | Tuple | Sequence | Quantification
)


@dataclass(frozen=True, slots=True)
class Declaration:
    """``VAR x, y : REAL;`` or ``INPUT f : NATURAL --> REAL;``."""

    names: tuple[Name, ...]
    parameters: tuple[str, ...]
    sort: str
    is_input: bool
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Memory:
    """``MEMORY n : NATURAL := 0``: a variable that keeps its value from one step to the next."""

    name: Name
    sort: str
    initial: Expression
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Skip:
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Assign:
    """``x := e``, or ``m(i) := e`` and ``m[i] := e`` with `arguments`."""

    target: Name
    arguments: tuple[Expression, ...]
    value: Expression
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class If:
    condition: Expression
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Match:
    """``MATCH e WITH c(x, y) THEN … ELSE …``: the variables name the arguments in the first branch."""

    subject: Expression
    constructor: Name
    variables: tuple[Name, ...]
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class While:
    condition: Expression
    invariant: Expression
    variant: Expression | None
    body: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)


Statement = Skip | Assign | If | Match | While


@dataclass(frozen=True, slots=True)
class Source:
    """A parsed program."""

    declarations: tuple[Declaration, ...]
    memory: tuple[Memory, ...]
    body: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)
