"""What an editor asks, answered as plain data: the server (`avow.lsp.server`) only puts it in the protocol's words.

Places are offsets into the text; the server converts them to the protocol's lines and UTF-16 columns.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from avow.base.diagnostics import Diagnostic, Span
from avow.language.contract import Clause, Contract, Node, Port
from avow.language.lexer import Token, tokens
from avow.language.load import check_sources, clean_text
from avow.language.outline import FileSyntax, NodeSyntax, read
from avow.language.printer import show_sort, show_term, show_type
from avow.language.source import Reports, Source
from avow.language.syntax import TypeDeclaration
from avow.language.terms import Quantified, Variable

StatusLookup = Callable[[str, str], str | None]
"""(node, clause) → what the ledger says of it, in a few words; None where it says nothing."""


@dataclass(frozen=True, slots=True)
class Symbol:
    """An entry of the editor's outline."""

    name: str
    detail: str
    kind: str
    """node, type, constant, assumption or guarantee"""
    span: Span
    inner: tuple[Symbol, ...] = ()


@dataclass(frozen=True, slots=True)
class Document:
    """A text as far as it could be understood. `contract` is the last sound one: hovering works while typing."""

    file: str
    text: str
    diagnostics: tuple[Diagnostic, ...]
    contract: Contract | None
    syntax: FileSyntax
    tokens: tuple[Token, ...]


def analyse(
    text: str,
    file: str,
    before: Document | None = None,
    others: tuple[Source, ...] = (),
    off: frozenset[str] = frozenset(),
) -> Document:
    """Check a text. `others` are the other files of its system, `off` the codes of lints that are not wanted; `before`
    is what was known before the last change."""
    source = clean_text(text, file)
    if isinstance(source, Diagnostic):
        return Document(file, text, (source,), before.contract if before else None, FileSyntax(), ())
    contract, found = check_sources([source, *others], off=off)
    reports = Reports(source)
    stream = tokens(reports)
    syntax = read(stream, reports)
    mine = tuple(d for d in found if d.span is None or d.span.file == file)
    known = contract or (before.contract if before is not None else None)
    return Document(file, source.text, mine, known, syntax, tuple(stream))


def token_at(document: Document, offset: int) -> int | None:
    """The position of the token at (or just before) an offset."""
    at = bisect_right(document.tokens, offset, key=lambda t: t.start) - 1
    if at >= 0 and offset <= document.tokens[at].end:
        return at
    return None


def hover(document: Document, offset: int, status: StatusLookup = lambda node, clause: None) -> str | None:
    """Markdown about the thing at an offset: its type, where it comes from, and how its guarantee stands."""
    at = token_at(document, offset)
    if at is None:
        return None
    token = document.tokens[at]
    clause = _clause_at(document, offset)
    if token.type in ("ASSUME", "GUARANTEE") or (clause is not None and _names_clause(document, clause, token)):
        return _about_clause(document, clause, status) if clause is not None else None
    found = _resolve(document, at)
    return found[0] if found is not None else None


def definition(document: Document, offset: int) -> Span | None:
    """Where the name at an offset is declared."""
    at = token_at(document, offset)
    if at is None:
        return None
    found = _resolve(document, at)
    return found[1] if found is not None else None


def symbols(document: Document) -> tuple[Symbol, ...]:
    """The outline: the context's declarations, the nodes, and their clauses."""
    source = Source(document.file, document.text)
    found = [
        Symbol(tree.name.text, kind, kind, source.span(tree.start, tree.end))
        for tree in document.syntax.declarations
        for kind in ("type" if isinstance(tree, TypeDeclaration) else "constant",)
    ]
    for node in document.syntax.nodes:
        inner = []
        counts = {"assumption": 0, "guarantee": 0}
        for clause in node.clauses:
            counts[clause.kind] += 1
            name = clause.name.text if clause.name else f"{clause.kind[0].upper()}{counts[clause.kind]}"
            detail = clause.sentence.text.strip('"') if clause.sentence else ""
            inner.append(Symbol(name, detail, str(clause.kind), source.span(clause.start, clause.end)))
        found.append(Symbol(node.name.text, "node", "node", source.span(node.start, node.end), tuple(inner)))
    return tuple(found)


# --- finding out -----------------------------------------------------------------------------------------------------


def _node_at(document: Document, offset: int) -> NodeSyntax | None:
    return next((n for n in document.syntax.nodes if n.start <= offset <= n.end), None)


def _checked_node(document: Document, offset: int) -> Node | None:
    syntax = _node_at(document, offset)
    if syntax is None or document.contract is None:
        return None
    return next((n for n in document.contract.nodes if n.name == syntax.name.text), None)


def _clause_at(document: Document, offset: int) -> Clause | None:
    """The clause at an offset, by its position in its node."""
    syntax, node = _node_at(document, offset), _checked_node(document, offset)
    if syntax is None or node is None:
        return None
    counts = {"assumption": 0, "guarantee": 0}
    for clause in syntax.clauses:
        counts[clause.kind] += 1
        if clause.start <= offset <= clause.end:
            found = [c for c in node.clauses if c.kind == clause.kind and c.position == counts[clause.kind]]
            return found[0] if found else None
    return None


def _names_clause(document: Document, clause: Clause, token: Token) -> bool:
    node = _node_at(document, token.start)
    return node is not None and any(c.name is not None and c.name.start == token.start for c in node.clauses)


def _about_clause(document: Document, clause: Clause, status: StatusLookup) -> str:
    node = next((n for n in document.contract.nodes if clause in n.clauses), None) if document.contract else None
    lines = [f"**{clause.kind} {clause.name}**"]
    if clause.sentence:
        lines.append(_plain(clause.sentence))
    lines.append(f"```\n{show_term(clause.formula, 'unicode')}\n```")
    said = status(node.name, clause.name) if node is not None else None
    if said:
        lines.append(_plain(said))
    return "\n\n".join(lines)


def _plain(text: str) -> str:
    """Text that Markdown leaves as it is."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]()#+-.!|<>~&" else c for c in text)


def _resolve(document: Document, at: int) -> tuple[str, Span | None] | None:
    """What the name at a token means: Markdown, and the place of its declaration."""
    token = document.tokens[at]
    contract = document.contract
    if token.type == "BUILTIN":
        return f"`{token.text}`: a built-in type", None
    if token.type != "NAME" or contract is None:
        return None
    node = _checked_node(document, token.start)
    before = document.tokens[at - 2] if at > 1 and document.tokens[at - 1].type == "DOT" else None
    if node is not None:
        clause = _clause_at(document, token.start)
        bound = _bound(clause, token.text, document) if clause is not None and before is None else None
        if bound is not None:
            return f"`{bound.name}` : `{show_sort(bound.sort)}` (quantified)", bound.span
        ports = [p for p in (*node.inputs, *node.outputs) if p.name == token.text]
        if before is not None:
            ports = [p for p in ports if p.role == before.text]
        declared_here = [p for p in ports if p.span is not None and _starts(document, p.span, token)]
        ports = declared_here or ports
        if ports:
            return _about_port(ports[0], node), ports[0].span
    return _declared(document, contract, token.text)


def _starts(document: Document, span: Span, token: Token) -> bool:
    return Source(document.file, document.text).place(token.start) == (span.line, span.column)


def _bound(clause: Clause, name: str, document: Document) -> Variable | None:
    stack = [clause.formula]
    while stack:
        term = stack.pop()
        if isinstance(term, Quantified):
            for variable in term.variables:
                if variable.name == name:
                    return variable
        stack.extend(term.children)
    return None


def _about_port(port: Port, node: Node) -> str:
    words = {"in": "input", "out": "output"}
    shown = show_type(port.sort)
    more = f" = `{shown}`" if shown != port.type_name else ""
    topics = [t for t in node.topics if t.port == port]
    carried = "".join(f"\n\ntopic `{t.name}` of `{t.ros_type}`" for t in topics)
    return f"`{port.role}.{port.name}` : `{port.type_name}`{more} ({words[port.role]} of {_plain(node.name)}){carried}"


def _declared(document: Document, contract: Contract, name: str) -> tuple[str, Span | None] | None:
    source = Source(document.file, document.text)
    places = {t.name.text: t.name for t in document.syntax.declarations}
    place = source.span(places[name].start, places[name].end) if name in places else None
    for type_name, sort in contract.types:
        if type_name == name:
            return f"type `{name}` = `{show_type(sort)}`", place
    for constant, term in contract.constants:
        if constant == name:
            return f"constant `{name}` = `{show_term(term, 'rcl')}`", place
    for type_name, sort in contract.types:
        members = getattr(sort, "members", None) or tuple(c.name for c in getattr(sort, "constructors", ()))
        if name in members:
            return f"`{name}`: an element of `{type_name}`", _element_place(document, source, name)
    node = next((n for n in contract.nodes if n.name == name), None)
    return (f"node `{name}`", node.span) if node is not None else None


def _element_place(document: Document, source: Source, name: str) -> Span | None:
    for tree in document.syntax.declarations:
        for token in _tokens_within(document, tree.start, tree.end):
            if token.text == name:
                return source.span(token.start, token.end)
    return None


def _tokens_within(document: Document, start: int, end: int) -> Iterator[Token]:
    at = bisect_right(document.tokens, start - 1, key=lambda t: t.start)
    while at < len(document.tokens) and document.tokens[at].start < end:
        yield document.tokens[at]
        at += 1
