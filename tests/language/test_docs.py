"""docs/language.md: every example is what it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from avow.base.rendering import render
from avow.language.format import format_text
from avow.language.load import check_text

PAGE = Path(__file__).parents[2] / "docs" / "language.md"
BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks() -> list[tuple[str, str]]:
    return BLOCK.findall(PAGE.read_text("utf-8"))


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
