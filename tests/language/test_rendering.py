"""Diagnostics on the terminal, as JSON and as SARIF."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from avow.base.diagnostics import Diagnostic, Span
from avow.base.rendering import render, summary, to_sarif
from avow.language.load import check_text

TEXT = "node n {\n\tinputs() outputs(日本 : BOOL, b : BOOL) topics()\n  guarantee( bb )\n}\n"


def test_golden(root: Path) -> None:
    found = check_text(TEXT, "dir/f.rcl")[1]
    golden = root / "tests" / "language" / "golden" / "rendered.txt"
    if os.environ.get("AVOW_REFRESH"):
        golden.write_text(render(found, {"dir/f.rcl": TEXT}), "utf-8")
    assert render(found, {"dir/f.rcl": TEXT}) == golden.read_text("utf-8")
    assert summary(found) == "2 errors"


def test_the_caret_stands_under_the_place() -> None:
    text = f"node n {{ inputs() outputs(b : BOOL) topics() guarantee( {'b or ' * 60}wrong ) }}"
    (found,) = [d for d in check_text(text, "f")[1] if d.is_error]
    _, _, _, line, caret, *_ = render([found], {"f": text}).split("\n")
    at = caret.index("^")
    assert line[at : at + caret.count("^")] == "wrong"
    assert len(line) < 120


@pytest.mark.parametrize("colour", [False, True])
def test_nothing_steers_the_terminal(colour: bool) -> None:
    text = 'node n { inputs() outputs(b : BOOL) topics() guarantee( "\x1b[2J\x07\u202e\x9b" == b ) }'
    shown = render(check_text(text, "f\x1b[0m")[1], {"f\x1b[0m": text}, colour=colour)
    own = re.sub(r"\x1b\[(0|1|3[0-9]|1;3[0-9])m", "", shown) if colour else shown
    assert not any(c in own for c in "\x1b\x07\u202e\x9b")


def test_without_source_or_place() -> None:
    shown = render([Diagnostic("X1", "lost", Span("/no/such/file", 3, 1, 3, 2)), Diagnostic("X2", "nowhere")])
    assert "/no/such/file:3:1" in shown
    assert "nowhere" in shown


def test_sarif() -> None:
    text = "context { A : {a}; A : {b}; }"
    log = to_sarif(check_text(text, "some dir/f.rcl")[1], version="1")
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    (result,) = run["results"]
    assert run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"] == result["ruleId"] == "RCL210"
    place = result["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == "some%20dir/f.rcl"
    assert place["region"] == {"startLine": 1, "startColumn": 20, "endLine": 1, "endColumn": 21}
    assert result["relatedLocations"][0]["message"]["text"] == "`A` is first declared here"
