"""What a file's text is made of: declarations, nodes, and their clauses (`avow.language.outline` finds them)."""

from __future__ import annotations

from dataclasses import field

from avow.base.records import dataclass
from avow.language.contract import ClauseKind
from avow.language.lexer import Token
from avow.language.syntax import Declaration, Define, PortList, TermSyntax, TopicList


@dataclass(frozen=True, slots=True)
class ClauseSyntax:
    kind: ClauseKind
    name: Token | None
    sentence: Token | None
    formula: TermSyntax | None
    """None: it was in error, which has been reported."""
    inside: tuple[int, int]
    """Where the formula stands, between the parentheses."""
    start: int
    end: int


@dataclass(slots=True)
class NodeSyntax:
    """`broken` are names that a part in error seems to declare; nothing more should be said about them."""

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
    """Where each declaration, node, and part of a node stands: what a comment before it is about."""
