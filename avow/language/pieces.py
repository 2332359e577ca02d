"""Checks a contract node by node: the result for a node depends only on its text and the files' common declarations.

The results are cached between runs (`avow.base.remembered.Shelf`), so that after an edit only one node is read and
checked. This applies only if the contract has no errors and every node begins a line. Otherwise, and if a node's text
can change the meaning of the others (a type that is written in place), the contract is read whole
(`avow.language.load`), with the same result.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from avow.base.diagnostics import Diagnostic
from avow.base.records import dataclass
from avow.base.remembered import Shelf, Stretch
from avow.language.contract import Contract, Node
from avow.language.declarations import Declarations
from avow.language.lexer import Token, tokens
from avow.language.lints import LintedFile, allows, of_all, of_node, spoken, tell
from avow.language.nodes import check_node, check_ports
from avow.language.outline import read
from avow.language.source import Reports, Source, in_order
from avow.language.syntax import FileSyntax

_BEGINS = re.compile(r"^[ \t]*node\b", re.MULTILINE)


class _Whole(Exception):  # noqa: N818 - it says what to do
    """The contract has to be read whole."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """The result for a node's text. Offsets count from its beginning."""

    node: Node
    lints: tuple[Diagnostic, ...]
    spoken: frozenset[str]
    """The names that it mentions."""
    parts: tuple[tuple[int, int], ...]
    allows: tuple[Token, ...]
    """Comments that allow a lint."""


@dataclass(slots=True)
class _Head:
    """The text before a file's first node, and the places of its nodes."""

    source: Source
    lines: int
    stretches: tuple[tuple[int, Stretch, str], ...]
    """Offset, place and text of each node's piece."""
    syntax: FileSyntax
    reports: Reports
    allows: tuple[Token, ...]
    first: int


def by_pieces(
    sources: Sequence[Source], off: frozenset[str], shelf: Shelf
) -> tuple[Contract, tuple[Diagnostic, ...]] | None:
    """As `check_sources`; None if the contract has to be read whole."""
    try:
        return _by_pieces(sources, off, shelf)
    except _Whole:
        return None


def _by_pieces(sources: Sequence[Source], off: frozenset[str], shelf: Shelf) -> tuple[Contract, tuple[Diagnostic, ...]]:
    heads = [_head(source) for source in sources]
    declarations = Declarations()
    for head in heads:
        declarations.add(head.syntax.declarations, head.reports)
    declarations.elaborate()
    _sound(heads)
    lines = {head.source.file: head.source.line + head.lines for head in heads}
    texts = [
        text for head in heads for text in (head.source.file, head.reports.source.text) if head.syntax.declarations
    ]
    environment = declarations.environment
    before = _size(declarations)
    digests, pieces = list[str](), list[list[_Piece]]()
    for head in heads:
        pieces.append([])
        for _, stretch, text in head.stretches:
            place = Stretch(stretch.file, stretch.first, stretch.end, lines)

            def made(stretch: Stretch = stretch, text: str = text) -> _Piece:
                found = _piece(Source(stretch.file, text, stretch.first), declarations)
                _sound(heads)
                if _size(declarations) != before:
                    raise _Whole
                return found

            digest = shelf.digest("piece", *texts, "node", text)
            piece = shelf.answer(digest, place, made)
            shelf.is_of(piece.node, digest, place)
            digests.append(digest)
            pieces[-1].append(piece)
    every = [piece for some in pieces for piece in some]
    if len({piece.node.name for piece in every}) < len(every):
        raise _Whole
    contract = Contract(
        tuple(source.file for source in sources),
        tuple(environment.types.items()),
        tuple(environment.constants.items()),
        tuple(piece.node for piece in every),
        tuple(entry.found for entry in declarations.definitions.values() if entry.found is not None),
    )
    files = [_linted(head, some) for head, some in zip(heads, pieces, strict=True)]
    found = [
        *(lint for piece in every for lint in piece.lints),
        *of_all(contract, files, (piece.spoken for piece in every)),
    ]
    tell(found, files, off)
    return contract, tuple(d for file in files for d in in_order(file.reports))


def _head(source: Source) -> _Head:
    begins = [match.start() for match in _BEGINS.finditer(source.text)]
    if not begins:
        raise _Whole
    text = source.text[: begins[0]]
    reports = Reports(Source(source.file, text, source.line, source.column))
    comments: list[Token] = []
    found = tokens(reports, comments)
    syntax = read(found, reports) if found else FileSyntax()
    if syntax.nodes:
        raise _Whole
    line, stretches = source.line + text.count("\n"), list[tuple[int, Stretch, str]]()
    for begin, end in pairwise((*begins, len(source.text))):
        piece = source.text[begin:end]
        following = line + piece.count("\n") + (not piece.endswith("\n"))
        stretches.append((begin, Stretch(source.file, line, following), piece))
        line = following
    first = found[0].start if found else source.text.index("node", begins[0])
    return _Head(source, text.count("\n"), tuple(stretches), syntax, reports, tuple(filter(allows, comments)), first)


def _sound(heads: Sequence[_Head]) -> None:
    if any(head.reports.found for head in heads):
        raise _Whole


def _size(declarations: Declarations) -> tuple[int, ...]:
    """The sizes of the tables that a node's text may extend: if one grows, the next node could change its meaning."""
    e = declarations.environment
    return tuple(len(names) for names in (e.types, e.constants, e.elements, e.anonymous, e.places, e.broken))


def _piece(source: Source, declarations: Declarations) -> _Piece:
    """The result for one node's text, given the declarations of the files' heads."""
    reports = Reports(source)
    comments: list[Token] = []
    found = tokens(reports, comments)
    syntax = read(found, reports)
    if reports.found or syntax.declarations or syntax.broken or len(syntax.nodes) != 1:
        raise _Whole
    (tree,) = syntax.nodes
    node = check_node(tree, *check_ports(tree, declarations, reports), declarations, reports)
    if reports.found:
        raise _Whole
    file = LintedFile(syntax, tuple(comments), found[0].start, reports)
    return _Piece(
        node,
        tuple(of_node(file, tree, node)),
        spoken(tree),
        tuple(syntax.parts),
        tuple(filter(allows, comments)),
    )


def _linted(head: _Head, pieces: Sequence[_Piece]) -> LintedFile:
    """The lints' input for a file whose nodes have already been checked."""
    begun = list(zip((begin for begin, _, _ in head.stretches), pieces, strict=True))
    comments = (c._replace(start=at + c.start, end=at + c.end) for at, piece in begun for c in piece.allows)
    parts = ((at + start, at + end) for at, piece in begun for start, end in piece.parts)
    syntax = FileSyntax(head.syntax.declarations, parts=[*head.syntax.parts, *parts])
    return LintedFile(syntax, (*head.allows, *comments), head.first, Reports(head.source))
