"""A client drives `avow lsp`: every feature, on right and wrong texts."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pygls")

from editor.conftest import Editor
from lsprotocol import types

from avow.system.load import load_system

CONTRACT = """\
// Two nodes. 😀
// They talk.
context {
  Colour : {red, green};
  Command : { go(REAL), stop };
  Limit = 120;
}

node sensor {
  inputs( r : REAL )
  outputs( colour : Colour )
  topics( float64 r matches(in.r), string colour matches(out.colour) )
  guarantee low "😀 a low reading is green" ( in.r < Limit -> out.colour == green )
  guarantee high "a high one is red" ( in.r >= Limit -> out.colour == red )
}

node agent {
  inputs( colour : Colour )
  outputs( command : Command )
  topics( string colour matches(in.colour), string command matches(out.command) )
  guarantee halt "it stops" ( forall(x in REAL | colour == red -> command == stop and command != go(x)) )
}
"""
PLAN = """\
system: s
contract: system.rcl
requirements:
  R1:
    text: It stops when the reading is high.
    formula: sensor.r >= Limit -> agent.command == stop
    supported_by: [sensor.high, agent.halt]
nodes:
  sensor:
    methods: [{hypothesis: {subject: "sensor.py:step", guarantees: [low]}}]
expected:
  - {obligation: agent/sanity/determined-command, verdict: refuted, reason: it may go as it likes}
"""


def place(text: str, needle: str, plus: int = 0) -> types.Position:
    at = text.index(needle) + plus
    before = text[:at].rpartition("\n")[2]
    return types.Position(text.count("\n", 0, at), len(before.encode("utf-16-le")) // 2)


def shown(text: str, where: types.Range) -> str:
    """The text of a range within one line."""
    line = text.split("\n")[where.start.line].encode("utf-16-le")
    return line[2 * where.start.character : 2 * where.end.character].decode("utf-16-le")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "system.rcl").write_text(CONTRACT, "utf-8")
    (tmp_path / "plan.yaml").write_text(PLAN, "utf-8")
    (tmp_path / "sensor.py").write_text("def step(r): return {'colour': 'green'}\n", "utf-8")
    return tmp_path


def at(uri: str, text: str, needle: str, plus: int = 0) -> dict[str, Any]:
    return {"text_document": types.TextDocumentIdentifier(uri), "position": place(text, needle, plus)}


def test_it_says_what_it_can(running: tuple[Editor, types.InitializeResult]) -> None:
    able = running[1].capabilities
    for feature in (
        *(able.completion_provider, able.rename_provider, able.references_provider, able.code_action_provider),
        *(able.inlay_hint_provider, able.hover_provider, able.definition_provider, able.document_symbol_provider),
        *(able.document_formatting_provider, able.document_highlight_provider),
    ):
        assert feature


def labels(editor: Editor, uri: str, text: str, needle: str, plus: int = 0) -> dict[str, types.CompletionItem]:
    asked = editor.client.text_document_completion_async(types.CompletionParams(**at(uri, text, needle, plus)))
    return {item.label: item for item in editor.wait(asked).items}


def test_completion(editor: Editor, folder: Path) -> None:
    uri = editor.open(folder / "system.rcl")
    formula = labels(editor, uri, CONTRACT, "in.r < Limit")
    assert {"in.r", "out.colour", "red", "Limit", "forall", "previous", "held", "min", "and", "TRUE"} <= formula.keys()
    assert formula["held"].insert_text == "held[${9:5} steps](${1:F})"
    assert formula["held"].insert_text_format == types.InsertTextFormat.Snippet
    assert formula["go"].insert_text == "go(${1:REAL})"
    assert formula["in.r"].detail == "REAL"
    assert "x" in labels(editor, uri, CONTRACT, "colour == red -> command")
    assert set(labels(editor, uri, CONTRACT, "in.r < Limit", 3)) == {"r"}
    assert {"Colour", "REAL"} <= labels(editor, uri, CONTRACT, "Colour )").keys()
    assert "guarantee" in labels(editor, uri, CONTRACT, "guarantee low")
    assert {"in.r", "out.colour"} == labels(editor, uri, CONTRACT, "in.r), string").keys()
    assert {"node", "context"} == labels(editor, uri, CONTRACT, "node agent").keys()
    assert labels(editor, uri, CONTRACT, "a low reading") == {}, "within a sentence"
    assert labels(editor, uri, CONTRACT, "They talk") == {}, "within a comment"
    broken = CONTRACT.replace("out.colour == green )", "out.")
    editor.write(uri, broken)
    assert "colour" in labels(editor, uri, broken, "-> out.", 7), "while it is being typed"
    editor.write(uri, CONTRACT)
    paced = CONTRACT.replace("  guarantee low", "  steps( at most 20 ms )\n  guarantee low")
    editor.write(uri, paced)
    assert "in.r" in labels(editor, uri, paced, "in.r < Limit")
    assert "steps" in labels(editor, uri, paced, "steps(")
    editor.write(uri, CONTRACT)
    plan = editor.open(folder / "plan.yaml")
    assert {"requirements", "nodes", "expected"} <= labels(editor, plan, PLAN, "system").keys()
    assert {"criticality", "methods"} <= labels(editor, plan, PLAN, "methods").keys()
    assert {"low", "high", "r", "colour"} == labels(editor, plan, PLAN, "sensor.high", 7).keys()


def references(editor: Editor, uri: str, text: str, needle: str, plus: int = 0) -> dict[str, list[str]]:
    context = types.ReferenceContext(include_declaration=True)
    params = types.ReferenceParams(context=context, **at(uri, text, needle, plus))
    texts = {"system.rcl": CONTRACT, "plan.yaml": PLAN}
    found: dict[str, list[str]] = {}
    for location in editor.wait(editor.client.text_document_references_async(params)) or []:
        name = location.uri.rpartition("/")[2]
        line = location.range.start.line
        found.setdefault(name, []).append(f"{line}:{shown(texts[name], location.range)}")
    return found


def test_references_and_definitions_go_over_all_files(editor: Editor, folder: Path) -> None:
    uri, plan = editor.open(folder / "system.rcl"), editor.open(folder / "plan.yaml")
    in_both = {"system.rcl": ["13:high"], "plan.yaml": ["6:high"]}
    assert references(editor, uri, CONTRACT, "high") == in_both
    assert references(editor, plan, PLAN, "sensor.high", 8) == in_both
    assert references(editor, uri, CONTRACT, "stop }") == {
        "system.rcl": ["4:stop", "20:stop"],
        "plan.yaml": ["5:stop"],
    }
    assert references(editor, uri, CONTRACT, "command == stop") == {
        "system.rcl": ["18:command", "19:command", "20:command", "20:command"],
        "plan.yaml": ["5:command", "11:command"],
    }
    assert references(editor, uri, CONTRACT, "x in REAL") == {"system.rcl": ["20:x", "20:x"]}
    assert references(editor, uri, CONTRACT, "a low reading") == {}
    params = types.DefinitionParams(**at(plan, PLAN, "Limit ->"))
    (found,) = editor.wait(editor.client.text_document_definition_async(params))
    assert (found.uri, shown(CONTRACT, found.range)) == (uri, "Limit")


def renamed(editor: Editor, uri: str, text: str, needle: str, new: str, plus: int = 0) -> dict[str, str]:
    """The files as they are after a rename."""
    params = types.RenameParams(new_name=new, **at(uri, text, needle, plus))
    edit = editor.wait(editor.client.text_document_rename_async(params))
    texts = {"system.rcl": CONTRACT, "plan.yaml": PLAN}
    for target, edits in edit.changes.items():
        name = target.rpartition("/")[2]
        lines = [line.encode("utf-16-le") for line in texts[name].split("\n")]
        for one in sorted(edits, key=lambda e: (e.range.start.line, e.range.start.character), reverse=True):
            line = lines[one.range.start.line]
            start, end = 2 * one.range.start.character, 2 * one.range.end.character
            lines[one.range.start.line] = line[:start] + one.new_text.encode("utf-16-le") + line[end:]
        texts[name] = "\n".join(line.decode("utf-16-le") for line in lines)
    return texts


@pytest.mark.parametrize(
    ("needle", "new", "contract", "plan"),
    [
        ("high", "hot", 1, 1),
        ("sensor", "probe", 1, 3),
        ("Limit =", "Most", 3, 1),
        ("red,", "crimson", 3, 0),
        ("stop }", "halt_", 2, 1),
        ("Colour", "Shade", 3, 0),
        ("x in REAL", "y", 2, 0),
        ("r : REAL", "rate", 4, 1),
        ("colour : Colour )\n  outputs", "shade", 7, 0),
    ],
)
def test_a_rename_changes_every_file_and_no_meaning(
    editor: Editor, folder: Path, needle: str, new: str, contract: int, plan: int
) -> None:
    uri = editor.open(folder / "system.rcl")
    found = renamed(editor, uri, CONTRACT, needle, new)
    word = rf"(?<![\w']){new}(?![\w'])"

    assert len(re.findall(word, found["system.rcl"])) == contract
    assert len(re.findall(word, found["plan.yaml"])) == plan
    for name, text in found.items():
        (folder / name).write_text(text, "utf-8")
    load_system(folder)


@pytest.mark.parametrize(
    ("needle", "new", "why"),
    [
        ("high", "low", "low"),
        ("sensor", "agent", "agent"),
        ("red,", "green", "green"),
        ("red,", "Limit", "Limit"),
        ("Limit =", "colour", "colour"),
        ("x in REAL", "colour", "colour"),
        ("r : REAL", "colour", "colour"),
        ("r : REAL", "1r", "is no name"),
        ("r : REAL", "r : BOOL", "is no name"),
        ("r : REAL", "forall", "is no name"),
        ("stop }", "once", "word of the language"),
    ],
)
def test_a_rename_that_would_change_what_is_said_is_refused(
    editor: Editor, folder: Path, needle: str, new: str, why: str
) -> None:
    uri = editor.open(folder / "system.rcl")
    with pytest.raises(Exception, match=why):
        renamed(editor, uri, CONTRACT, needle, new)


def test_a_contract_with_errors_is_not_renamed(editor: Editor, folder: Path) -> None:
    uri = editor.open(folder / "system.rcl")
    editor.write(uri, CONTRACT.replace("-> out.colour == red", "-> out.colour == "))
    with pytest.raises(Exception, match="errors"):
        renamed(editor, uri, CONTRACT, "Limit =", "Most")


FAULTS = {
    "== gren": ("== green", "RCL201"),
    "&& out": ("-> out", "RCL101"),
    "out.colou ==": ("out.colour ==", "RCL203"),
    ": Colou ": (": Colour ", "RCL208"),
    "garantee low": ("guarantee low", "RCL113"),
    "output(": ("outputs(", "RCL113"),
    "Limit = 120\n": ("Limit = 120;\n", "RCL113"),
    ">= Limit => out": (">= Limit -> out", "RCL101"),
    "colour = red": ("colour == red -> c", "RCL120"),
}


@pytest.mark.parametrize("wrong", FAULTS)
def test_a_hint_can_be_done(editor: Editor, wrong: str) -> None:
    right, code = FAULTS[wrong]
    text = CONTRACT.replace(right, {"colour = red": "colour = red -> c"}.get(wrong, wrong), 1)
    uri = editor.open("untitled:fix", text)
    (found,) = [d for d in editor.published[uri] if d.severity == types.DiagnosticSeverity.Error]
    assert found.code == code
    actions = editor.wait(
        editor.client.text_document_code_action_async(
            types.CodeActionParams(types.TextDocumentIdentifier(uri), found.range, types.CodeActionContext([found]))
        )
    )
    if wrong == "&& out":
        assert actions, "`and` is what it looks like"
        return
    assert actions, found.message
    (edit,) = actions[0].edit.changes[uri]
    lines = text.split("\n")
    line = lines[edit.range.start.line].encode("utf-16-le")
    start, end = 2 * edit.range.start.character, 2 * edit.range.end.character
    lines[edit.range.start.line] = (line[:start] + edit.new_text.encode("utf-16-le") + line[end:]).decode("utf-16-le")
    editor.write(uri, "\n".join(lines))
    assert not [d for d in editor.published[uri] if d.severity == types.DiagnosticSeverity.Error]


def test_a_plans_hint_can_be_done(editor: Editor, folder: Path) -> None:
    text = PLAN.replace("sensor.high", "sensor.hihg")
    (folder / "plan.yaml").write_text(text, "utf-8")
    uri = editor.open(folder / "plan.yaml")
    titles = set()
    for found in editor.published[uri]:
        params = types.CodeActionParams(
            types.TextDocumentIdentifier(uri), found.range, types.CodeActionContext([found])
        )
        titles |= {action.title for action in editor.wait(editor.client.text_document_code_action_async(params))}
    assert titles == {"Write `sensor.high`"}


def test_the_outline_and_the_layout(editor: Editor, folder: Path) -> None:
    uri = editor.open(folder / "system.rcl")
    document = types.TextDocumentIdentifier(uri)
    assert [s.name for s in editor.symbols(uri)] == ["Colour", "Command", "Limit", "sensor", "agent"]
    editor.write(uri, CONTRACT.replace("guarantee low", "guarantee   low"))
    params = types.DocumentFormattingParams(document, types.FormattingOptions(2, insert_spaces=True))
    (edit,) = editor.wait(editor.client.text_document_formatting_async(params))
    assert "guarantee low" in edit.new_text


def test_an_error_in_a_node_leaves_the_others_as_they_were(editor: Editor) -> None:
    text = CONTRACT.replace("-> out.colour == green", "-> out.colour == ").replace("!= go(x)", "!= go(x, x)")
    text = text.replace("inputs( r : REAL )", "inputs( r : REAL, unused : BOOL )")
    uri = editor.open("untitled:two", text + CONTRACT.partition("node agent")[2].join(["node third", ""]))
    codes = editor.codes(uri)
    assert {"RCL120", "RCL305"} <= set(codes)
    assert codes.count("RCL305") == 1
    hovered = editor.wait(
        editor.client.text_document_hover_async(types.HoverParams(**at(uri, text, "in.r >= Limit", 3)))
    )
    assert "REAL" in hovered.contents.value
    hovered = editor.wait(
        editor.client.text_document_hover_async(types.HoverParams(**at(uri, text, "in.r < Limit", 3)))
    )
    assert "REAL" in hovered.contents.value, "also in the clause that is broken"


def said(editor: Editor, uri: str, text: str, needle: str, plus: int = 0) -> str:
    """What is shown where the mouse rests."""
    asked = editor.client.text_document_hover_async(types.HoverParams(**at(uri, text, needle, plus)))
    return str(editor.wait(asked).contents.value)


def hints(editor: Editor, uri: str, text: str) -> dict[str, str]:
    """Each hint by the word before it."""
    whole = types.Range(types.Position(0, 0), types.Position(text.count("\n"), 0))
    params = types.InlayHintParams(types.TextDocumentIdentifier(uri), whole)
    found = editor.wait(editor.client.text_document_inlay_hint_async(params)) or []
    lines = [line.encode("utf-16-le") for line in text.split("\n")]
    before = [lines[h.position.line][: 2 * h.position.character].decode("utf-16-le") for h in found]
    return {words.split()[-1]: str(h.label) for words, h in zip(before, found, strict=True)}


def test_sanity_is_asked_in_the_background(editor: Editor) -> None:
    text = CONTRACT.replace("in.r >= Limit ->", "in.r < 0 and in.r > 1 ->")
    uri = editor.open("untitled:sanity", text)
    editor.until(lambda: "not-tautological-high" in editor.codes(uri))
    (found,) = [d for d in editor.published[uri] if d.code == "not-tautological-high"]
    assert (shown(text, found.range), found.source) == ("high", "avow sanity")
    editor.until(lambda: "agent" in hints(editor, uri, text))
    seen = hints(editor, uri, text)
    assert "not-tautological-high" in seen["high"]
    assert seen["low"] == "✓ sane"
    assert "refuted" in said(editor, uri, text, "high")


@pytest.mark.slow
def test_what_is_edited_is_asked_again_in_the_background(editor: Editor) -> None:
    text = CONTRACT.replace("in.r >= Limit ->", "in.r < 0 and in.r > 1 ->")
    uri = editor.open("untitled:edited", text)
    editor.until(lambda: "agent" in hints(editor, uri, text))
    # what has become sound is sound at once where it was asked before, and is asked where it was not
    editor.write(uri, CONTRACT)
    assert "not-tautological-high" not in editor.codes(uri)
    editor.until(lambda: hints(editor, uri, CONTRACT).get("high") == "✓ sane")
    # a node with an error is not asked about, and does not keep the others from it
    broken = CONTRACT.replace("out.colour == green", "out.colour == ").replace("command != go(x)", "command != command")
    editor.write(uri, broken)
    editor.until(lambda: "halt" in hints(editor, uri, broken))
    assert "low" not in hints(editor, uri, broken)


@pytest.mark.slow
def test_sanity_of_two_documents_that_change_one_after_the_other(editor: Editor) -> None:
    one, two = (CONTRACT.replace("Limit = 120", f"Limit = {limit}") for limit in (121, 122))
    first, second = editor.open("untitled:first", one), editor.open("untitled:second", two)
    for uri, text in ((first, one), (second, two)):
        editor.until(lambda uri=uri, text=text: hints(editor, uri, text).get("low") == "✓ sane")  # type: ignore[misc]
