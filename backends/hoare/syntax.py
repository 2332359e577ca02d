"""The imperative language as written: statements, with expressions as RCL's own trees, before names have sorts."""

from __future__ import annotations

from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.source import Source
from avow.language.syntax import TermSyntax


@dataclass(frozen=True, slots=True)
class Name:
    """A name that a statement or declaration gives or uses."""

    name: str
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Written:
    """An expression of the plan."""

    tree: TermSyntax
    text: Source


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
    initial: TermSyntax
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Skip:
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Assign:
    """``x := e``, or ``m(i) := e`` and ``m[i] := e`` with `arguments`."""

    target: Name
    arguments: tuple[TermSyntax, ...]
    value: TermSyntax
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class If:
    condition: TermSyntax
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Match:
    """``MATCH e WITH c(x, y) THEN … ELSE …``: the variables name the arguments in the first branch."""

    subject: TermSyntax
    constructor: Name
    variables: tuple[Name, ...]
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class While:
    condition: TermSyntax
    invariant: TermSyntax
    variant: TermSyntax | None
    body: tuple[Statement, ...]
    span: Span = field(compare=False, repr=False)


Statement = Skip | Assign | If | Match | While


@dataclass(frozen=True, slots=True)
class ProgramText:
    """A parsed program."""

    declarations: tuple[Declaration, ...]
    memory: tuple[Memory, ...]
    body: tuple[Statement, ...]
    text: Source = field(compare=False, repr=False)
    span: Span = field(compare=False, repr=False)
