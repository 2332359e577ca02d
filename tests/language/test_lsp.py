"""A conversation with `avow lsp`, as an editor has it: whatever is sent, it answers and lives on."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pygls")

TYPES = "context { Colour : {red, green}; }\n"
NODE = '// 😀\nnode n { inputs( a : Colour ) outputs( b : BOOL ) topics() guarantee "😀" ( a == red -> b ) }\n'
PLAN = "system: s\ncontract: [types.rcl, nodes.rcl]\nlints_off: [RCL405]\n"


class Editor:
    """The client's side: what the server publishes is in `shown`, by URI."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, "-m", "avow", "lsp"]
        self.server = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self.number = self.published = 0
        self.shown: dict[str, list[dict[str, Any]]] = {}

    def send(self, **message: Any) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self.server.stdin is not None
        self.server.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.server.stdin.flush()

    def tell(self, method: str, **params: Any) -> None:
        self.send(method=method, params=params)

    def ask(self, method: str, **params: Any) -> Any:
        self.number += 1
        self.send(id=self.number, method=method, params=params)
        while True:
            message = self.receive()
            if message.get("method") == "textDocument/publishDiagnostics":
                self.published += 1
                self.shown[message["params"]["uri"]] = message["params"]["diagnostics"]
            elif message.get("id") == self.number and "method" not in message:
                return message.get("result", message.get("error"))

    def receive(self) -> dict[str, Any]:
        assert self.server.stdout is not None
        length = 0
        while (line := self.server.stdout.readline()) != b"\r\n":
            assert line, "the server is gone"
            if line.lower().startswith(b"content-length:"):
                length = int(line.split(b":")[1])
        found: dict[str, Any] = json.loads(self.server.stdout.read(length))
        return found

    def open(self, uri: str, text: str) -> list[str]:
        self.tell("textDocument/didOpen", textDocument={"uri": uri, "languageId": "rcl", "version": 1, "text": text})
        return self.codes(uri)

    def change(self, uri: str, *changes: dict[str, Any]) -> list[str]:
        self.tell("textDocument/didChange", textDocument={"uri": uri, "version": 2}, contentChanges=list(changes))
        return self.codes(uri)

    def codes(self, uri: str) -> list[str]:
        self.ask("textDocument/documentSymbol", textDocument={"uri": uri})
        return [d["code"] for d in self.shown.get(uri, [])]

    def at(self, method: str, uri: str, line: int, character: int) -> Any:
        position = {"line": line, "character": character}
        return self.ask(f"textDocument/{method}", textDocument={"uri": uri}, position=position)


@pytest.fixture(scope="module")
def editor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    found = Editor(tmp_path_factory.mktemp("editor"))
    found.ask("initialize", processId=None, rootUri=None, capabilities={})
    found.tell("initialized")
    yield found
    found.ask("shutdown")
    found.tell("exit")
    assert found.server.wait(20) == 0


def insertion(line: int, start: int, end: int, text: str) -> dict[str, Any]:
    return {
        "range": {"start": {"line": line, "character": start}, "end": {"line": line, "character": end}},
        "text": text,
    }


def units(text: str) -> int:
    return len(text.encode("utf-16-le")) // 2


def test_a_system_of_two_files(editor: Editor, tmp_path: Path) -> None:
    folder = tmp_path / "a b%20"
    folder.mkdir()
    for name, text in (("types.rcl", TYPES), ("nodes.rcl", NODE), ("plan.yaml", PLAN)):
        (folder / name).write_text(text, "utf-8")
    types, nodes, plan = ((folder / name).as_uri() for name in ("types.rcl", "nodes.rcl", "plan.yaml"))
    assert editor.open(nodes, NODE) == [], "the other file has the type, and the plan switches RCL405 off"
    assert editor.open(types, TYPES) == []
    line = NODE.split("\n")[1]
    column = units(line[: line.index("red")])
    assert [place["uri"] for place in editor.at("definition", nodes, 1, column)] == [types]
    assert "Colour" in editor.at("hover", nodes, 1, column)["contents"]["value"]
    # not saved, and counted in UTF-16: the other file is told
    start = TYPES.index("red")
    assert editor.change(types, insertion(0, start, start + 3, "blue")) == []
    assert editor.codes(nodes) == ["RCL201"]
    assert editor.shown[nodes][0]["range"]["start"] == {"line": 1, "character": column}
    assert editor.change(nodes, insertion(1, column, column + 3, "blue")) == []
    editor.tell("textDocument/didClose", textDocument={"uri": types})
    assert editor.codes(nodes) == []
    assert editor.shown[types] == []
    assert editor.open(plan, PLAN) == []
    (folder / "plan.yaml").write_text(PLAN.replace("contract:", "contracts:"), "utf-8")
    editor.tell("textDocument/didSave", textDocument={"uri": plan})
    assert "PLAN103" in editor.codes(plan)


@pytest.mark.parametrize(
    "uri", ["untitled:Untitled-1", "git:/tmp/x.rcl?%7B%7D", "", "file:///", "file:///t/%ff%00.rcl", "no uri", "\0"]
)
def test_documents_that_are_no_files(editor: Editor, uri: str) -> None:
    assert editor.open(uri, TYPES + NODE + "node m {") == ["RCL405", "RCL115"]
    line = NODE.split("\n")[1]
    for method in ("hover", "definition"):
        answer = editor.at(method, uri, 2, units(line[: line.index("red")]))
        assert not answer or "code" not in answer
    assert editor.change(uri, {"text": TYPES + NODE}) == ["RCL405"]
    assert editor.at("definition", uri, 2, units(line[: line.index("Colour")]))[0]["uri"] == uri


@pytest.mark.slow
def test_whatever_is_sent(editor: Editor) -> None:
    uri = "untitled:any"
    for text in ("", "\ud83d", "node \ud800 {", "\0", "x" * 5_000_000, "(" * 50_000, "node n {\r inputs()\r\n}"):
        assert editor.open(uri, text)
    for line, character in ((0, 0), (99_999, 0), (0, 99_999), (2**31 - 1, 2**31 - 1)):
        assert editor.at("hover", uri, line, character) is None
    assert editor.at("hover", "file:///no/such/file.rcl", 0, 0) is None
    editor.change("file:///never/opened.rcl", {"text": "node"})
    editor.send(id=10_001, method="textDocument/hover", params={"unknown": 1})
    assert editor.ask("textDocument/noSuchThing")["code"] == -32601
    assert editor.open(uri, TYPES + NODE) == ["RCL405"]


@pytest.mark.nightly
def test_a_large_text_is_checked_when_its_author_pauses(editor: Editor) -> None:
    uri = "untitled:large"
    text = TYPES + "".join(NODE.replace("node n", f"node n{i}").split("\n")[1] + "\n" for i in range(600))
    assert set(editor.open(uri, text)) == {"RCL405", "RCL006"}
    before = editor.published
    for _ in range(200):
        editor.tell(
            "textDocument/didChange",
            textDocument={"uri": uri, "version": 3},
            contentChanges=[insertion(0, 0, 0, "// ")],
        )
    assert "RCL208" in editor.codes(uri)
    assert editor.published - before < 20, "not once for each letter"
