"""The language server over pygls: diagnostics, hover, definition, outline, formatting."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.lsp.server import LanguageServer

from avow import __version__
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.language.format import format_text
from avow.language.load import read_source
from avow.language.outline import FileSyntax
from avow.language.source import Source
from avow.lsp import answers
from avow.lsp.answers import Document, StatusLookup, Symbol
from avow.lsp.surroundings import about_plan, companions, file_of
from avow.system.load import PLAN_FILE
from avow.tuning.running import CHARACTERS_PER_SECOND, NOTICED_SECONDS

_SEVERITIES = {
    Severity.ERROR: types.DiagnosticSeverity.Error,
    Severity.WARNING: types.DiagnosticSeverity.Warning,
    Severity.NOTE: types.DiagnosticSeverity.Information,
}
_KINDS = {
    "node": types.SymbolKind.Class,
    "type": types.SymbolKind.Struct,
    "constant": types.SymbolKind.Constant,
    "assumption": types.SymbolKind.Event,
    "guarantee": types.SymbolKind.Function,
}


def _nothing(file: str) -> StatusLookup:
    return lambda node, clause: None


def make_server(status: Callable[[str], StatusLookup] = _nothing) -> LanguageServer:
    """A server with every answer registered; `status` gives, for a file, how the clauses in it stand in the ledger."""
    server = LanguageServer("avow", __version__, text_document_sync_kind=types.TextDocumentSyncKind.Incremental)
    documents: dict[str, Document] = {}
    open_now: set[str] = set()
    later: dict[str, asyncio.TimerHandle] = {}
    """Documents that have changed and are read again in a moment, if nothing more comes in before."""

    def publish(uri: str, document: Document) -> None:
        documents[uri] = document
        if uri not in open_now:
            return  # asked about, but not open
        server.text_document_publish_diagnostics(
            types.PublishDiagnosticsParams(
                uri=uri, diagnostics=[_diagnostic(d, document) for d in document.diagnostics]
            )
        )

    def refresh(uri: str) -> tuple[str, ...]:
        """Reads a document again; the other files of its system."""
        file = file_of(uri)
        text = _text(server, uri)
        waiting = later.pop(uri, None)
        if waiting is not None:
            waiting.cancel()
        if Path(file).name == PLAN_FILE:
            publish(uri, Document(file, text, about_plan(file), None, FileSyntax(), ()))
            return ()
        others, off = companions(file, {d.file: d.text for u, d in documents.items() if u != uri})
        publish(uri, answers.analyse(text, file, documents.get(uri), others, off))
        return tuple(other.file for other in others)

    def refresh_all(uri: str) -> None:
        """Reads a document again, and those open beside it that use what it declares."""
        files = {Path(f).resolve() for f in refresh(uri)}
        folder = Path(file_of(uri)).parent if Path(file_of(uri)).name == PLAN_FILE else None
        for other, document in list(documents.items()):
            path = Path(document.file)
            if other != uri and (path.resolve() in files or path.parent == folder):
                refresh(other)

    def current(uri: str) -> Document:
        if uri in later:
            refresh_all(uri)
        elif uri not in documents:
            refresh(uri)
        return documents[uri]

    def opened(params: types.DidOpenTextDocumentParams) -> None:
        open_now.add(params.text_document.uri)
        refresh_all(params.text_document.uri)

    def changed(params: types.DidChangeTextDocumentParams) -> None:
        uri = params.text_document.uri
        if Path(file_of(uri)).name == PLAN_FILE:
            return  # a plan is read from the disk, once it is saved
        pause = len(_text(server, uri)) / CHARACTERS_PER_SECOND
        if pause < NOTICED_SECONDS:
            refresh_all(uri)
            return
        if uri in later:
            later[uri].cancel()
        later[uri] = asyncio.get_running_loop().call_later(pause, refresh_all, uri)

    def saved(params: types.DidSaveTextDocumentParams) -> None:
        refresh_all(params.text_document.uri)

    def closed(params: types.DidCloseTextDocumentParams) -> None:
        uri = params.text_document.uri
        documents.pop(uri, None)
        open_now.discard(uri)
        if uri in later:
            later.pop(uri).cancel()
        server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri=uri, diagnostics=[]))

    def hover(params: types.HoverParams) -> types.Hover | None:
        document = current(params.text_document.uri)
        said = answers.hover(document, _offset(document.text, params.position), status(document.file))
        return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, said)) if said else None

    def definition(params: types.DefinitionParams) -> types.Location | None:
        document = current(params.text_document.uri)
        span = answers.definition(document, _offset(document.text, params.position))
        if span is None:
            return None
        if span.file == document.file:
            return types.Location(params.text_document.uri, _range(span, document.text))
        for uri, other in documents.items():
            if Path(other.file).resolve() == Path(span.file).resolve():
                return types.Location(uri, _range(span, other.text))
        source = read_source(Path(span.file))
        text = source.text if isinstance(source, Source) else ""
        return types.Location(Path(span.file).resolve().as_uri(), _range(span, text))

    def outline(params: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        document = current(params.text_document.uri)
        return [_symbol(s, document) for s in answers.symbols(document)]

    def formatting(params: types.DocumentFormattingParams) -> list[types.TextEdit]:
        document = current(params.text_document.uri)
        try:
            formatted = format_text(document.text, document.file)
        except Rejected:
            return []
        lines = document.text.count("\n") + 1
        whole = types.Range(types.Position(0, 0), types.Position(lines, 0))
        return [types.TextEdit(whole, formatted)] if formatted != document.text else []

    for feature, answer in (
        (types.TEXT_DOCUMENT_DID_OPEN, opened),
        (types.TEXT_DOCUMENT_DID_CHANGE, changed),
        (types.TEXT_DOCUMENT_DID_SAVE, saved),
        (types.TEXT_DOCUMENT_DID_CLOSE, closed),
        (types.TEXT_DOCUMENT_HOVER, hover),
        (types.TEXT_DOCUMENT_DEFINITION, definition),
        (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, outline),
        (types.TEXT_DOCUMENT_FORMATTING, formatting),
    ):
        server.feature(feature)(answer)
    return server


def serve(status: Callable[[str], StatusLookup] = _nothing) -> None:
    """Run on standard input and output until the editor leaves."""
    make_server(status).start_io()


def _text(server: LanguageServer, uri: str) -> str:
    """A document's text; of one that is not open, the file's; nothing where there is none."""
    try:
        text: str = server.workspace.get_text_document(uri).source
    except (OSError, ValueError):
        return ""
    return text


# --- the protocol's words --------------------------------------------------------------------------------------------


def _units(text: str) -> int:
    """The length in UTF-16 code units, in which the protocol counts columns."""
    return len(text.encode("utf-16-le", "surrogatepass")) // 2


def _position(line: int, column: int, lines: list[str]) -> types.Position:
    content = lines[line - 1] if 0 < line <= len(lines) else ""
    return types.Position(max(line - 1, 0), _units(content[: max(column - 1, 0)]))


def _range(span: Span, text: str) -> types.Range:
    lines = text.split("\n")
    return types.Range(_position(span.line, span.column, lines), _position(span.end_line, span.end_column, lines))


def _offset(text: str, position: types.Position) -> int:
    lines = text.split("\n")
    if position.line >= len(lines):
        return len(text)
    line = lines[position.line]
    column = units = 0
    while column < len(line) and units < position.character:
        units += _units(line[column])
        column += 1
    return sum(len(row) + 1 for row in lines[: position.line]) + column


def _diagnostic(diagnostic: Diagnostic, document: Document) -> types.Diagnostic:
    nowhere = Span(document.file, 1, 1, 1, 1)
    message = diagnostic.message + (f"\n{diagnostic.hint}" if diagnostic.hint else "")
    related = [
        types.DiagnosticRelatedInformation(
            types.Location(Path(place.file).resolve().as_uri(), _range(place, document.text)), note
        )
        for note, place in diagnostic.notes
        if place is not None and place.file == document.file
    ]
    arguments: dict[str, Any] = {"related_information": related} if related else {}
    return types.Diagnostic(
        range=_range(diagnostic.span or nowhere, document.text),
        message=message,
        severity=_SEVERITIES[diagnostic.severity],
        code=diagnostic.code,
        source="avow",
        **arguments,
    )


def _symbol(symbol: Symbol, document: Document) -> types.DocumentSymbol:
    place = _range(symbol.span, document.text)
    return types.DocumentSymbol(
        name=symbol.name or "(no name)",
        kind=_KINDS[symbol.kind],
        range=place,
        selection_range=place,
        detail=symbol.detail,
        children=[_symbol(s, document) for s in symbol.inner],
    )
