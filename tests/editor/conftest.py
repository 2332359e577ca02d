"""A client of the language server, over its standard input and output; what it waits for are messages, not time."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pygls")

from lsprotocol import types
from pygls.lsp.client import LanguageClient

PATIENCE = 300
"""Seconds after which a message that does not come is a failure: no test is about time."""


class Editor:
    """The client's side of a conversation. Every call waits for its answer."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.client = LanguageClient("tests", "1")
        self.published: dict[str, list[types.Diagnostic]] = {}
        self.refreshed = 0
        self.news = asyncio.Event()
        self.versions: dict[str, int] = {}

        @self.client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def _(params: types.PublishDiagnosticsParams) -> None:
            self.published[params.uri] = list(params.diagnostics)
            self.news.set()

        @self.client.feature(types.WORKSPACE_INLAY_HINT_REFRESH)
        def _(_params: None) -> None:
            self.refreshed += 1
            self.news.set()

    def wait(self, what: Coroutine[Any, Any, Any]) -> Any:
        return self.loop.run_until_complete(asyncio.wait_for(what, PATIENCE))

    def start(self) -> types.InitializeResult:
        async def started() -> types.InitializeResult:
            await self.client.start_io(sys.executable, "-m", "avow", "lsp")
            able = types.ClientCapabilities(
                text_document=types.TextDocumentClientCapabilities(
                    completion=types.CompletionClientCapabilities(
                        completion_item=types.ClientCompletionItemOptions(snippet_support=True)
                    )
                ),
                workspace=types.WorkspaceClientCapabilities(
                    inlay_hint=types.InlayHintWorkspaceClientCapabilities(refresh_support=True)
                ),
            )
            answer = await self.client.initialize_async(types.InitializeParams(able))
            self.client.initialized(types.InitializedParams())
            return answer

        found: types.InitializeResult = self.wait(started())
        return found

    def stop(self) -> None:
        async def stopped() -> None:
            await self.client.shutdown_async(None)
            self.client.exit(None)
            await self.client.stop()

        self.wait(stopped())
        self.loop.close()

    # -- texts ---------------------------------------------------------------------------------------------------------

    def open(self, path: Path | str, text: str | None = None) -> str:
        """The document's URI; its messages have come."""
        uri = path if isinstance(path, str) else path.as_uri()
        said = text if text is not None else Path(path).read_text("utf-8")
        self.versions[uri] = 1
        self.client.text_document_did_open(types.DidOpenTextDocumentParams(types.TextDocumentItem(uri, "rcl", 1, said)))
        self.symbols(uri)
        return uri

    def write(self, uri: str, text: str) -> None:
        """The whole text anew; its messages have come."""
        self.versions[uri] += 1
        whole = types.TextDocumentContentChangeWholeDocument(text)
        about = types.VersionedTextDocumentIdentifier(self.versions[uri], uri)
        self.client.text_document_did_change(types.DidChangeTextDocumentParams(about, [whole]))
        self.symbols(uri)

    def symbols(self, uri: str) -> list[types.DocumentSymbol]:
        params = types.DocumentSymbolParams(types.TextDocumentIdentifier(uri))
        return list(self.wait(self.client.text_document_document_symbol_async(params)) or [])

    def codes(self, uri: str) -> list[str]:
        return [str(d.code) for d in self.published.get(uri, [])]

    def until(self, true: Callable[[], bool]) -> None:
        """Waits until messages have made something true."""
        self.news.clear()
        while not true():
            self.wait(self.news.wait())
            self.news.clear()


@pytest.fixture(scope="session")
def running() -> Iterator[tuple[Editor, types.InitializeResult]]:
    found = Editor()
    yield found, found.start()
    found.stop()


@pytest.fixture
def editor(running: tuple[Editor, types.InitializeResult]) -> Editor:
    return running[0]
