"""No text, and no place in it, brings an exception; what is true of every answer."""

from __future__ import annotations

import random

import pytest

pytest.importorskip("pygls")

from editor.test_client import CONTRACT, PLAN

from avow.lsp.completion import offers
from avow.lsp.features import Document, analyse, definition, hover, name_at, references
from avow.lsp.plan_keys import about_key, plan_offers
from avow.lsp.plan_names import PlanText, plan_occurrences
from avow.lsp.protocol import Lines, outline
from avow.lsp.renaming import renamed_with

PIECES = (
    "(",
    ")",
    "{",
    "}",
    "in.",
    "out.",
    ".",
    ",",
    "forall(",
    "|",
    "node ",
    "context {",
    "assume",
    "guarantee G (",
    '"',
)
PIECES += (
    "//",
    "/*",
    "*/",
    "[5",
    "]",
    "held[",
    "since",
    "x",
    "😀",
    "\r\n",
    "\0",
    "->",
    "A",
    "topics(",
    "matches(",
    ": ",
    ";",
)


def texts(count: int) -> list[str]:
    chosen = random.Random(7)
    found = [CONTRACT[:cut] for cut in range(0, len(CONTRACT), 61)]
    for _ in range(count):
        text = CONTRACT
        for _ in range(chosen.randint(1, 4)):
            at = chosen.randrange(len(text))
            text = text[:at] + chosen.choice(PIECES) + text[at + chosen.choice((0, 0, 1, 5, 40)) :]
        found.append(text)
    return found


def check(document: Document, places: range) -> None:
    lines = Lines(document.text)
    part = document.taken_apart
    outline(document, lines)
    for one in document.names:
        assert not one.written or document.text[one.start : one.end] == one.meaning.name
    for offset in places:
        assert lines.offset(lines.position(offset)) == offset
        found = offers(part, document.project.contract, offset)
        assert len({offer.label for offer in found}) == len(found)
        hover(document, offset)
        definition(document, offset)
        name = name_at(document, offset)
        if name is not None:
            assert name in references(document, offset)
            assert all(renamed_with(name.meaning, one.meaning) for one in references(document, offset))


def test_any_contract() -> None:
    for k, text in enumerate(texts(40)):
        document = analyse(text, "untitled:any")
        check(document, range(k % 17, len(document.text), 17))


@pytest.mark.nightly
def test_any_contract_everywhere() -> None:
    for text in texts(600):
        document = analyse(text, "untitled:any")
        check(document, range(len(document.text)))


def test_any_plan() -> None:
    contract = analyse(CONTRACT, "untitled:any").project.contract
    chosen = random.Random(11)
    for k in range(120):
        text = PLAN
        for _ in range(k % 4):
            at = chosen.randrange(len(text))
            text = text[:at] + chosen.choice(
                ("\n", "- ", ": ", "{", "}", "'", '"', "  ", "agent.", "😀", "#", "&a ", "*a")
            )
            text += PLAN[at + chosen.choice((0, 1, 9)) :]
        for one in plan_occurrences(PlanText("plan.yaml", text), contract):
            assert text[one.start : one.end] == one.meaning.name
        for offset in range(k % 5, len(text), 5):
            plan_offers(text, contract, offset)
            about_key(text, offset)


def test_line_ends_of_windows() -> None:
    """The editor's columns are those of the text without them."""
    document = analyse(CONTRACT.replace("\n", "\r\n"), "untitled:any")
    assert document.text == CONTRACT
    windows = PLAN.replace("\n", "\r\n")
    found = plan_occurrences(PlanText("plan.yaml", windows), document.project.contract)
    plain = plan_occurrences(PlanText("plan.yaml", PLAN), document.project.contract)
    assert [o.meaning for o in found] == [o.meaning for o in plain]
    assert [Lines(windows).position(o.start) for o in found] == [Lines(PLAN).position(o.start) for o in plain]
