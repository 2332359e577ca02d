"""A page as a reader meets it: blocks of text, each in its section, cells of a row beside each other."""

from __future__ import annotations

from dataclasses import dataclass
from html.parser import HTMLParser

CELL = " ␟ "
"""Between the cells of a row: a sign that is in no text."""
_BREAKS = {"p", "li", "h1", "h2", "h3", "tr", "div", "section", "details", "summary", "header", "footer", "ul", "table"}
_VOID = {"meta", "img", "br", "input", "link", "hr"}
_QUESTIONS = {f"q{n}" for n in range(1, 8)}
"""Headings that begin with a number of their own."""


@dataclass(frozen=True)
class Block:
    """`quotes`: the texts in it that the page itself marks as said by somebody."""

    section: str
    text: str
    quotes: tuple[str, ...]


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[tuple[str, bool, bool, str]] = []  # tag, left out, said, section
        self.done: list[Block] = []
        self.parts: list[str] = []
        self.said: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        has = {name: value or "" for name, value in attrs}
        classes = has.get("class", "").split()
        _, hidden, said, section = self.open[-1] if self.open else ("", False, False, "head")
        if tag == "section":
            section = has.get("aria-labelledby") or has.get("id", section)
        if tag in _BREAKS:
            self.flush()
        elif tag == "br":
            self.parts.append(" ")
        elif tag == "td" or (tag == "span" and self.open and self.open[-1][0] == "row"):
            self.parts.append(CELL)
        if tag not in _VOID:
            hidden |= tag in ("style", "script", "title", "thead") or has.get("aria-hidden") == "true"
            hidden |= tag == "h2" and has.get("id", "") in _QUESTIONS
            row = "row" if {"node", "how"} & set(classes) else tag
            self.open.append((row, hidden, said or "said" in classes, section))

    def handle_endtag(self, tag: str) -> None:
        if tag in _BREAKS:
            self.flush()
        if self.open and tag not in _VOID:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        _, hidden, said, _ = self.open[-1] if self.open else ("", False, False, "")
        if not hidden:
            self.parts.append(data)
            if said:
                self.said.append(" ".join(data.split()))

    def flush(self) -> None:
        text = " ".join("".join(self.parts).split())
        if text:
            self.done.append(Block(self.open[-1][3] if self.open else "head", f" {text} ", tuple(self.said)))
        self.parts, self.said = [], []


def blocks(page: str) -> list[Block]:
    reader = _Reader()
    reader.feed(page)
    reader.close()
    reader.flush()
    return reader.done
