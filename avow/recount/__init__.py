"""Recomputes every number on a report's first page, apart from the code that wrote it.

    recount(folder)                        what the page in a report's folder says wrongly; nothing where it is right
    python -m avow.recount REPORT...       the same as a command

The page is read as text. Each number on it has to be one that a rule recomputes from the facts in report.json
(obligations with their records, requirements, assumptions, gates, proofs), or part of a text that was quoted to the
letter. A number of neither kind is an error too, so that nothing new stands on the page unchecked. The counts and
sentences that report.json itself has for the page are never used. The package imports nothing else of Avow, and
nothing that is not in Python's library: it can be copied and run where Avow is not.
"""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

from avow.recount.facts import Facts
from avow.recount.page import Block, blocks
from avow.recount.rules import RULES

NUMBER = re.compile(r"\d+(?:[.,]\d+)*")
_TEXT = re.compile(r"[^\W\d]|\d[.-]\d+[.-]\d|\d{32}")
"""What makes a text more than a number: a letter, dots and dashes as in a version or a date, the length of a digest."""
_DONE = "·"


def recount(folder: Path) -> list[str]:
    """Every number of `folder`/index.html that report.json beside it does not bear out. Raises OSError, ValueError."""
    data = (folder / "report.json").read_bytes()
    page = (folder / "index.html").read_text("utf-8", errors="replace")
    return recounted(page, data)


def recounted(page: str, data: bytes) -> list[str]:
    """The same, of a page's text and the bytes of report.json. Raises ValueError where these are no JSON."""
    facts, mark = Facts(json.loads(data)), hashlib.sha256(data).hexdigest()
    named = set(re.findall(r"SHA-256 <code>([0-9a-f]{64})<", page))
    quoted = facts.quoted | named
    letters = sorted((text for text in quoted if NUMBER.search(text) and _TEXT.search(text)), key=len, reverse=True)
    other = [f"report.json is not the one that the page names: its SHA-256 is {mark}"] if named - {mark} else []
    return other + [fault for block in blocks(page) for fault in _wrong(block, facts, letters)]


def _wrong(block: Block, facts: Facts, letters: list[str]) -> list[str]:
    text, found = block.text, []
    if not NUMBER.search(text):
        return []
    for said in block.quotes:  # a requirement may be called "1": only as a whole text of its own
        if said in facts.quoted and not _TEXT.search(said):
            text = text.replace(f" {said} ", f" {_DONE} ", 1)
    for rule in RULES:
        if rule.section in (block.section, ""):
            for match in reversed(list(rule.pattern.finditer(text))):
                true = rule.numbers(facts, match, block)
                if true is None:
                    continue
                if true != match.groups():
                    ours = ", ".join(map(str, true))
                    found.append(f"{block.section}: “{match.group().strip()}”: the evidence gives {ours}")
                text = text[: match.start()] + _DONE + text[match.end() :]
    if NUMBER.search(text):
        for quote in letters:
            if quote in text:
                text = re.sub(rf"(?<![\w.]){re.escape(quote)}(?!\w)", _DONE, text)
    return found + [f"{block.section}: “{near}”: report.json gives no such number" for near in _near(text)]


def _near(text: str) -> list[str]:
    return [text[max(0, m.start() - 40) : m.end() + 30].strip() for m in NUMBER.finditer(text)]
