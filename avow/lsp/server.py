"""The language server over pygls: connects each request with its answer (`avow.lsp.features` and its neighbours)."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcInvalidRequest
from pygls.lsp.server import LanguageServer

from avow import __version__
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tuning.running import CHARACTERS_PER_SECOND, NOTICED_SECONDS, SANITY_PAUSE
from avow.language.format import format_text
from avow.language.load import check_in_part, clean_text
from avow.lsp import features, protocol
from avow.lsp.background import Asked, askable, is_bad
from avow.lsp.completion import offers
from avow.lsp.features import Document, StatusLookup
from avow.lsp.names import CLAUSES, Occurrence, What
from avow.lsp.plan_keys import about_key, plan_offers
from avow.lsp.plan_names import PlanText
from avow.lsp.project import faults_of_plan, file_of, is_plan
from avow.lsp.protocol import Lines
from avow.lsp.quick_fixes import fixes
from avow.lsp.renaming import Edit, Refused, is_renameable, rename
from avow.sanity.document import Result


def _nothing(file: str) -> StatusLookup:
    return lambda node, clause: None


class Server:
    """The open documents, the known results about them, and the answer to each request. `status` gives, for a file, the
    status of its clauses in the ledger."""

    def __init__(self, language_server: LanguageServer, status: Callable[[str], StatusLookup]) -> None:
        self.server = language_server
        self.status = status
        self.documents: dict[str, Document] = {}
        self.open_now: set[str] = set()
        self.later: dict[str, asyncio.TimerHandle] = {}
        """Documents that have changed and are read again shortly, unless another change arrives first."""
        self.asked = Asked(self.settled)
        self.soon: asyncio.TimerHandle | None = None

    # -- texts ---------------------------------------------------------------------------------------------------------

    def text(self, uri: str) -> str:
        """A document's text; for one that is not open, the file's; empty if there is none."""
        try:
            text: str = self.server.workspace.get_text_document(uri).source
        except (OSError, ValueError):
            return ""
        return text

    def refresh(self, uri: str) -> tuple[str, ...]:
        """Reads a document again; returns the files of its system."""
        file = file_of(uri)
        waiting = self.later.pop(uri, None)
        if waiting is not None:
            waiting.cancel()
        texts = {d.file: d.text for u, d in self.documents.items() if u != uri and u in self.open_now}
        document = self.documents[uri] = features.analyse(self.text(uri), file, texts)
        self.publish(uri)
        plan = (document.project.plan.file,) if document.project.plan is not None else ()
        return (*(source.file for source in document.project.sources), *plan)

    def refresh_all(self, uri: str) -> None:
        """Reads a document again, and the open ones of the same system."""
        files = {Path(f).resolve() for f in self.refresh(uri)}
        folder = Path(file_of(uri)).parent if is_plan(file_of(uri)) else None
        for other, document in list(self.documents.items()):
            path = Path(document.file)
            if other != uri and (path.resolve() in files or path.parent == folder):
                self.refresh(other)
        if self.soon is not None:
            self.soon.cancel()
        self.soon = asyncio.get_running_loop().call_later(SANITY_PAUSE, self.ask, uri)

    def current(self, uri: str) -> Document:
        if uri in self.later:
            self.refresh_all(uri)
        elif uri not in self.documents:
            self.refresh(uri)
        return self.documents[uri]

    def opened(self, params: types.DidOpenTextDocumentParams) -> None:
        self.open_now.add(params.text_document.uri)
        self.refresh_all(params.text_document.uri)

    def changed(self, params: types.DidChangeTextDocumentParams) -> None:
        uri = params.text_document.uri
        self.asked.give_up()
        pause = len(self.text(uri)) / CHARACTERS_PER_SECOND
        if pause < NOTICED_SECONDS:
            self.refresh_all(uri)
            return
        if uri in self.later:
            self.later[uri].cancel()
        self.later[uri] = asyncio.get_running_loop().call_later(pause, self.refresh_all, uri)

    def saved(self, params: types.DidSaveTextDocumentParams) -> None:
        self.refresh_all(params.text_document.uri)

    def closed(self, params: types.DidCloseTextDocumentParams) -> None:
        uri = params.text_document.uri
        self.documents.pop(uri, None)
        self.open_now.discard(uri)
        if uri in self.later:
            self.later.pop(uri).cancel()
        self.server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri=uri, diagnostics=[]))

    def stopped(self, _: None) -> None:
        if self.soon is not None:
            self.soon.cancel()
        self.asked.give_up()

    # -- sanity --------------------------------------------------------------------------------------------------------

    def ask(self, uri: str) -> None:
        """Request the sanity of the nodes of the open systems, first those of the document changed last."""
        self.soon = None
        open_now = sorted(self.open_now & self.documents.keys(), key=lambda each: each != uri)
        projects = [self.documents[each].project for each in open_now]
        self.asked.ask([(project.sources, project.contract) for project in projects])

    def settled(self) -> None:
        """More is known: the messages and hints of every open document are shown again."""
        for uri in self.open_now & self.documents.keys():
            self.publish(uri)
        workspace = self.server.client_capabilities.workspace
        if workspace is not None and workspace.inlay_hint is not None and workspace.inlay_hint.refresh_support:
            self.server.workspace_inlay_hint_refresh(None)

    def sane(self, document: Document) -> Iterator[tuple[Occurrence, tuple[Result, ...]]]:
        """The known answers about each node and clause of a document, at its name."""
        nodes = {node.name: node for node in askable(document.project.sources, document.project.contract)}
        for name in document.names:
            if name.file != document.file or not name.declares or name.meaning.what not in (*CLAUSES, What.NODE):
                continue
            is_node = name.meaning.what is What.NODE
            node = nodes.get(name.meaning.name if is_node else name.meaning.owner)
            clause = None if is_node else name.meaning.name
            if node is not None and (answered := self.asked.about(node, clause)):
                yield name, answered

    def publish(self, uri: str) -> None:
        if uri not in self.open_now:
            return  # requested, but not open
        document = self.documents[uri]
        lines = Lines(document.text)
        found = [protocol.diagnostic(d, document, lines) for d in document.diagnostics]
        for name, answered in self.sane(document):
            place = lines.range(name.start, name.end)
            found += [protocol.refuted(a, place) for a in answered if is_bad(a) and a.severity != "note"]
        self.server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri=uri, diagnostics=found))

    def inlay_hints(self, document: Document, lines: Lines, params: types.InlayHintParams) -> list[types.InlayHint]:
        found = []
        for name, answered in self.sane(document):
            place = lines.position(name.end if name.written else name.start)
            if not params.range.start.line <= place.line <= params.range.end.line:
                continue
            told = "\n".join(
                f"{a.verdict}: {a.claim}{f' ({a.explanation})' if a.explanation else ''}" for a in answered
            )
            found.append(types.InlayHint(place, _mark(answered), tooltip=told, padding_left=True, padding_right=True))
        return found

    # -- questions -----------------------------------------------------------------------------------------------------

    def hover(self, document: Document, lines: Lines, params: types.HoverParams) -> types.Hover | None:
        offset = lines.offset(params.position)
        said = features.hover(document, offset, self.status(document.file), self.asked.about)
        if said is None and is_plan(document.file):
            said = about_key(document.text, offset)
        return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, said)) if said else None

    def definition(self, document: Document, lines: Lines, params: types.DefinitionParams) -> list[types.Location]:
        found = features.definition(document, lines.offset(params.position))
        return [types.Location(*place) for place in self.places(document, found)]

    def references(self, document: Document, lines: Lines, params: types.ReferenceParams) -> list[types.Location]:
        offset = lines.offset(params.position)
        found = features.references(document, offset, params.context.include_declaration)
        return [types.Location(*place) for place in self.places(document, found)]

    def highlights(
        self, document: Document, lines: Lines, params: types.DocumentHighlightParams
    ) -> list[types.DocumentHighlight]:
        found = features.references(document, lines.offset(params.position))
        return [types.DocumentHighlight(lines.range(o.start, o.end)) for o in found if o.file == document.file]

    def places(self, document: Document, found: Sequence[Occurrence | Edit]) -> Iterator[tuple[str, types.Range]]:
        """The document and range of each of these places in a system."""
        lines = {file: Lines(document.project.text_of(file)) for file in {o.file for o in found}}
        for one in found:
            yield self.uri_of(one.file), lines[one.file].range(one.start, one.end)

    def uri_of(self, file: str) -> str:
        """The URI of a file in the editor."""
        open_ = next((uri for uri, d in self.documents.items() if d.file == file), None)
        return open_ if open_ is not None else Path(file).resolve().as_uri()

    def prepare_rename(
        self, document: Document, lines: Lines, params: types.PrepareRenameParams
    ) -> types.PrepareRenamePlaceholder | None:
        name = features.name_at(document, lines.offset(params.position))
        if name is None or not is_renameable(document.project, name.meaning):
            return None
        return types.PrepareRenamePlaceholder(lines.range(name.start, name.end), name.meaning.name)

    def rename(self, document: Document, lines: Lines, params: types.RenameParams) -> types.WorkspaceEdit | None:
        name = features.name_at(document, lines.offset(params.position))
        if name is None:
            return None
        try:
            edits = rename(document.project, name.meaning, params.new_name)
        except Refused as refused:
            raise JsonRpcInvalidRequest(str(refused)) from None
        changes: dict[str, list[types.TextEdit]] = {}
        for edit, (uri, place) in zip(edits, self.places(document, edits), strict=True):
            changes.setdefault(uri, []).append(types.TextEdit(place, edit.text))
        return types.WorkspaceEdit(changes)

    def completion(self, document: Document, lines: Lines, params: types.CompletionParams) -> types.CompletionList:
        offset, contract = lines.offset(params.position), document.project.contract
        if is_plan(document.file):
            found = plan_offers(document.text, contract, offset)
        else:
            found = offers(document.taken_apart, contract, offset)
        snippets = _takes_snippets(self.server.client_capabilities)
        items = [protocol.completion_item(offer, k, snippets) for k, offer in enumerate(found)]
        return types.CompletionList(is_incomplete=False, items=items)

    def code_actions(self, document: Document, lines: Lines, params: types.CodeActionParams) -> list[types.CodeAction]:
        if not document.project.sources:
            return []
        found = []

        def check(text: str) -> tuple[Diagnostic, ...]:
            if is_plan(document.file):
                return faults_of_plan(replace(document.project, plan=PlanText(document.file, text)))
            source = clean_text(text, document.file)
            if isinstance(source, Diagnostic):
                return (source,)
            others = [s for s in document.project.sources if s.file != document.file]
            return check_in_part([source, *others], off=document.project.off)[1]

        for each in document.diagnostics:
            if each.span is None or not _touches(lines.of_span(each.span), params.range):
                continue
            for fix in fixes(each, document.text, check):
                edit = types.TextEdit(lines.range(fix.start, fix.end), fix.text)
                found.append(
                    types.CodeAction(
                        fix.title,
                        types.CodeActionKind.QuickFix,
                        diagnostics=[protocol.diagnostic(each, document, lines)],
                        edit=types.WorkspaceEdit({params.text_document.uri: [edit]}),
                    )
                )
        return found

    def outline(self, document: Document, lines: Lines, _: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        return protocol.outline(document, lines)

    def formatting(self, document: Document, lines: Lines, _: types.DocumentFormattingParams) -> list[types.TextEdit]:
        if is_plan(document.file):
            return []
        try:
            formatted = format_text(document.text, document.file)
        except Rejected:
            return []
        whole = types.Range(types.Position(0, 0), types.Position(document.text.count("\n") + 1, 0))
        return [types.TextEdit(whole, formatted)] if formatted != document.text else []


def _mark(answered: Sequence[Result]) -> str:
    """The text of a hint: the claims that do not hold, or are open, by name; otherwise that all hold.

    Notes are only in its tooltip.
    """
    bad = [a.name for a in answered if is_bad(a) and a.severity != "note"]
    unsettled = [a.name for a in answered if a.verdict == "unknown"]
    if bad:
        return f"✗ {', '.join(bad)}"
    return f"? {', '.join(unsettled)}" if unsettled else "✓ sane"


def _touches(one: types.Range, other: types.Range) -> bool:
    return (one.start.line, one.start.character) <= (other.end.line, other.end.character) and (
        (other.start.line, other.start.character) <= (one.end.line, one.end.character)
    )


def _takes_snippets(capabilities: types.ClientCapabilities) -> bool:
    document = capabilities.text_document
    item = document.completion.completion_item if document is not None and document.completion is not None else None
    return bool(item is not None and item.snippet_support)


def _make_server(status: Callable[[str], StatusLookup] = _nothing) -> LanguageServer:
    """A server with every answer registered; `status` gives, for a file, the status of its clauses in the ledger."""
    language_server = LanguageServer(
        "avow", __version__, text_document_sync_kind=types.TextDocumentSyncKind.Incremental
    )
    server = Server(language_server, status)
    heard: tuple[tuple[str, Callable[[Any], None]], ...] = (
        (types.TEXT_DOCUMENT_DID_OPEN, server.opened),
        (types.TEXT_DOCUMENT_DID_CHANGE, server.changed),
        (types.TEXT_DOCUMENT_DID_SAVE, server.saved),
        (types.TEXT_DOCUMENT_DID_CLOSE, server.closed),
        (types.SHUTDOWN, server.stopped),
    )
    asked: tuple[tuple[str, Callable[[Document, Lines, Any], Any], Any], ...] = (
        (types.TEXT_DOCUMENT_HOVER, server.hover, None),
        (types.TEXT_DOCUMENT_DEFINITION, server.definition, None),
        (types.TEXT_DOCUMENT_REFERENCES, server.references, None),
        (types.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT, server.highlights, None),
        (types.TEXT_DOCUMENT_PREPARE_RENAME, server.prepare_rename, None),
        (types.TEXT_DOCUMENT_RENAME, server.rename, types.RenameOptions(prepare_provider=True)),
        (types.TEXT_DOCUMENT_COMPLETION, server.completion, types.CompletionOptions(trigger_characters=[".", "="])),
        (
            types.TEXT_DOCUMENT_CODE_ACTION,
            server.code_actions,
            types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix]),
        ),
        (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, server.outline, None),
        (types.TEXT_DOCUMENT_INLAY_HINT, server.inlay_hints, None),
        (types.TEXT_DOCUMENT_FORMATTING, server.formatting, None),
    )
    for feature, told in heard:
        language_server.feature(feature)(functools.partial(told))  # a method cannot have the library's attributes
    for feature, answer, options in asked:

        def answering(params: Any, answer: Callable[[Document, Lines, Any], Any] = answer) -> Any:
            document = server.current(params.text_document.uri)
            return answer(document, Lines(document.text), params)

        language_server.feature(feature, options)(answering)
    return language_server


def serve(status: Callable[[str], StatusLookup] = _nothing) -> None:
    """Run on standard input and output until the editor disconnects."""
    _make_server(status).start_io()
