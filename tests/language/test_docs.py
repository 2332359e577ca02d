"""docs/language.md: every example is what it says, and every code is listed. AVOW_REFRESH=1 rewrites the list."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from avow.base.codes import CODES, FRAME, Code
from avow.base.rendering import render
from avow.language.format import format_text
from avow.language.load import check_text

PAGE = Path(__file__).parents[2] / "docs" / "language.md"
BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
HEADING = "## Every code\n"


def blocks() -> list[tuple[str, str]]:
    text = PAGE.read_text("utf-8")
    return BLOCK.findall(text[: text.index(HEADING)])


def test_there_are_examples() -> None:
    assert sum(info.startswith("rcl") for info, _ in blocks()) >= 9


@pytest.mark.parametrize(("info", "text"), [b for b in blocks() if b[0].startswith("rcl")])
def test_examples(info: str, text: str) -> None:
    contract, found = check_text(text, "example.rcl")
    wanted = info.partition("error=")[2]
    errors = {d.code for d in found if d.is_error}
    assert errors == ({wanted} if wanted else set()), [f"{d.span}: {d.message}" for d in found]
    assert (contract is None) == bool(wanted)
    assert check_text(format_text(text, "f"), "f")[0] == (contract and check_text(text, "f")[0])
    assert "RCL401" not in {d.code for d in found}, "the page should not show what it warns of"


def test_the_message_shown_is_the_one_given() -> None:
    found = blocks()
    at = next(i for i, (info, _) in enumerate(found) if info == "rcl error=RCL201")
    errors = [d for d in check_text(found[at][1], "sensor.rcl")[1] if d.is_error]
    assert found[at + 1] == ("text", render(errors, {"sensor.rcl": found[at][1]}).rstrip("\n") + "\n")


def section(code: Code) -> str:
    lines = [f"**{code.code}, {code.title}.** {code.explanation}", ""]
    example = code.example
    if example and len(example) < 400 and "\0" not in example and "((((" not in example:
        lines += ["```text", example, "```", ""]
    return "\n".join(lines)


def test_every_code_is_listed() -> None:
    text = PAGE.read_text("utf-8")
    head, found = text[: text.index(HEADING)], text[text.index(HEADING) :]
    frame = FRAME.format(clause="…")
    intro = f"{HEADING}\nExamples that are only a clause stand at the place of the `…` here:\n\n```text\n{frame}```\n\n"
    groups = {"0": "Files", "1": "Syntax", "2": "Names", "3": "Types", "4": "Lints"}
    page = intro
    for digit, title in groups.items():
        page += f"### {title}\n\n" + "\n".join(section(c) for c in CODES.values() if c.code[3] == digit) + "\n"
    page = page.rstrip("\n") + "\n"
    if os.environ.get("AVOW_REFRESH"):
        PAGE.write_text(head + page, "utf-8")
        found = page
    assert found == page, "AVOW_REFRESH=1 .venv/bin/pytest tests/language/test_docs.py"
