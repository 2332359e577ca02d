"""Strict YAML for configuration: every piece keeps its place, nothing is guessed.

`yaml.safe_load` accepts duplicate keys silently, reads ``off`` as False, ``1:30`` as 90 and ``010`` as 8, expands
aliases without bound, and loses positions. This reader works on PyYAML's parse events: scalars are null, true, false,
JSON numbers or text; duplicate keys, tags and merge keys are errors; aliases may be used, within bounds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import field
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.plain import invisible
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.base.tuning.sizes import PLAN_BYTES, PLAN_DEPTH, PLAN_PIECES
from avow.system.plan import Located

_INTEGER = re.compile(r"-?(0|[1-9][0-9]*)\Z")
_DECIMAL = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]{1,3})?\Z")
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}


@dataclass(slots=True)
class Piece:
    """A scalar (`value`), a list (`items`) or a mapping (`entries`: key → piece), with its place.

    `text` is a scalar exactly as written, for cells of tables, where ``2.30`` must not become another number.
    """

    span: Span
    value: Any = None
    text: str = ""
    items: list[Piece] | None = None
    entries: dict[str, Piece] | None = None
    keys: dict[str, Span] = field(default_factory=dict)
    size: int = 1
    """The number of pieces in it, itself included, aliases expanded."""
    depth: int = 0

    @property
    def data(self) -> Any:
        """Plain data."""
        if self.entries is not None:
            return {key: piece.data for key, piece in self.entries.items()}
        if self.items is not None:
            return [piece.data for piece in self.items]
        return self.value

    def located(self) -> Located:
        """The same as plain data with a map of positions."""
        return Located(self.data, self.span, dict(_places(self, ())))

    def at(self, *path: str | int) -> Piece | None:
        """The piece at a path, or None."""
        piece: Piece | None = self
        for step in path:
            if piece is None:
                return None
            if isinstance(step, int):
                items = piece.items
                piece = items[step] if items is not None and 0 <= step < len(items) else None
            else:
                piece = piece.entries.get(step) if piece.entries is not None else None
        return piece

    def each(self, *path: str | int) -> list[Piece]:
        """The pieces of the list at a path; a piece that is not a list counts as a list of one."""
        piece = self.at(*path)
        return [] if piece is None else [piece] if piece.items is None else piece.items

    def texts(self, *path: str | int) -> tuple[str, ...]:
        """The texts of `each`."""
        return tuple(item.text for item in self.each(*path))

    def said(self, *path: str | int) -> str | None:
        """The text at a path; None if it is missing."""
        piece = self.at(*path)
        return None if piece is None else piece.text

    def words(self) -> dict[str, str]:
        """The texts of a mapping, with single blanks."""
        return {key: " ".join(part.text.split()) for key, part in (self.entries or {}).items() if part.items is None}

    def keyed(self, *path: str | int) -> Iterator[tuple[str, Span, Piece]]:
        """Each key of the mapping at a path, with its position and its value."""
        piece = self.at(*path)
        if piece is not None and piece.entries is not None:
            for name, inner in piece.entries.items():
                yield name, piece.key_span(name), inner

    def key_span(self, key: str) -> Span:
        """The place of a key of this mapping."""
        return self.keys.get(key, self.span)


def read_yaml(data: bytes, file: str) -> tuple[Piece, tuple[Diagnostic, ...]]:
    """The document in `data`, and its faults that do not prevent reading it (duplicate keys, tags).

    Raises Rejected, with the place, for anything that is not one YAML document.
    """
    if len(data) > PLAN_BYTES:
        raise Rejected(_error(f"the file has {len(data)} bytes; at most {PLAN_BYTES} are read", file, 1, 1))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8", errors="replace")
        line, column = _position(before, len(before))
        raise Rejected(_error("not UTF-8 text", file, line, column)) from None
    try:
        builder = _Builder(file)
        return builder.build(text), tuple(builder.problems)
    except yaml.reader.ReaderError as error:
        line, column = _position(text, int(error.position))
        shown = f"character U+{ord(text[error.position]):04X}" if error.position < len(text) else "a character"
        raise Rejected(_error(f"{shown} does not belong in YAML", file, line, column)) from None
    except yaml.MarkedYAMLError as error:
        mark, begun = error.problem_mark or error.context_mark, error.context_mark
        if begun and re.search("flow|simple key|quoted", error.context or ""):
            mark = begun  # what is not ended is the fault, not the line at which that is noticed
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        problem, hint = _in_words(error.problem or "not YAML")
        raise Rejected(_error(problem, file, line, column, hint)) from None
    except yaml.YAMLError:
        raise Rejected(_error("not YAML", file, 1, 1)) from None


_PROBLEMS = (
    (r"character '\\t'", "a tab stands where YAML wants spaces", "indent with spaces"),
    (r"character '(.)'.*cannot start", "no plain text can begin with {0}", "put the text in quotes"),
    (
        r"mapping values are not allowed",
        "a `:` stands where no key can be",
        "check the indentation of this line and of the line before, or put the text in quotes",
    ),
    (r"could not find expected ':'", "a key without its `:`", "write `key: value`"),
    (
        r"expected <block end>, but found '(.*)'",
        "this line is indented as none above it",
        "the keys of a mapping, and the items of a list, stand in one column: move this line, or those above it",
    ),
    (r"expected ',' or '(.)'", "a `,` or the closing `{0}` is missing", None),
    (r"unexpected end of stream|found document separator", "a quotation mark or a bracket is not closed", None),
    (
        r"unknown escape character '(.*)'",
        "`\\{0}` means nothing in double quotes",
        "use single quotes, or double the backslash",
    ),
    (
        r"did not find expected|expected the node content|expected <document start>",
        "something else is expected here",
        None,
    ),
)
"""PyYAML's message, as a pattern, and the same for people, with a hint."""


def _in_words(problem: str) -> tuple[str, str | None]:
    for pattern, words, hint in _PROBLEMS:
        found = re.search(pattern, problem)
        if found:
            return words.format(*(f"`{part}`" if "{0}`" not in words else part for part in found.groups())), hint
    return f"not YAML: {problem}", None


def scalar(text: str) -> Any:
    """The meaning of a plain (unquoted) scalar: null, a truth value, a JSON number, else text."""
    if text in _WORDS:
        return _WORDS[text]
    if len(text) <= 300:
        if _INTEGER.match(text):
            return int(text)
        if _DECIMAL.match(text):
            number = float(text)
            return number if math.isfinite(number) else text
    return text


@dataclass(slots=True)
class _Frame:
    piece: Piece
    anchor: str | None
    key: str | None = None


class _Builder:
    """Builds pieces from events with a stack of its own: Python's recursion limit does not apply, only our own."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.stack: list[_Frame] = []
        self.anchors: dict[str, Piece] = {}
        self.root: Piece | None = None
        self.problems: list[Diagnostic] = []

    def build(self, text: str) -> Piece:
        documents = 0
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            match event:
                case yaml.DocumentStartEvent():
                    documents += 1
                    if documents > 1:
                        raise self.reject(event, "PLAN101", "a second document; one file holds one")
                case yaml.ScalarEvent():
                    self.refuse_tag(event)
                    self.scalar(event)
                case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                    self.refuse_tag(event)
                    self.open(event)
                case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                    self.close(event)
                case yaml.AliasEvent():
                    self.alias(event)
        if self.root is None:
            raise Rejected(_error("the file is empty", self.file, 1, 1))
        return self.root

    def scalar(self, event: yaml.ScalarEvent) -> None:
        text = str(event.value)
        plain = event.style is None
        if unseen := invisible(text):
            self.problem(event, "PLAN101", f"the text holds the invisible character {unseen}")
        if self.wants_key():
            self.key(event, text)
            return
        piece = Piece(self.span(event), scalar(text) if plain else text, text)
        self.remember(event.anchor, piece)
        self.put(event, piece)

    def open(self, event: Any) -> None:
        if self.wants_key():
            raise self.reject(event, "PLAN102", "a key must be plain text")
        if len(self.stack) >= PLAN_DEPTH:
            raise self.reject(event, "PLAN101", f"nested deeper than {PLAN_DEPTH} levels")
        mapping = isinstance(event, yaml.MappingStartEvent)
        piece = Piece(self.span(event), items=None if mapping else [], entries={} if mapping else None)
        self.stack.append(_Frame(piece, event.anchor))

    def close(self, event: Any) -> None:
        frame = self.stack.pop()
        end = self.span(event)
        start = frame.piece.span
        frame.piece.span = Span(self.file, start.line, start.column, end.end_line, end.end_column)
        self.remember(frame.anchor, frame.piece)
        self.put(event, frame.piece)

    def alias(self, event: Any) -> None:
        if self.wants_key():
            raise self.reject(event, "PLAN102", "a key must be plain text")
        piece = self.anchors.get(event.anchor)
        if piece is None:
            near = did_you_mean(event.anchor, self.anchors)
            hint = near or f"write the value here, or `&{event.anchor}` before it above"
            raise self.reject(event, "PLAN101", f"the alias *{event.anchor} is used before or without its anchor", hint)
        self.put(event, piece)

    def remember(self, anchor: str | None, piece: Piece) -> None:
        if anchor is not None:
            self.anchors[anchor] = piece

    def wants_key(self) -> bool:
        return bool(self.stack) and self.stack[-1].piece.entries is not None and self.stack[-1].key is None

    def key(self, event: Any, key: str) -> None:
        frame = self.stack[-1]
        frame.key = key
        if key == "<<":
            self.problem(event, "PLAN102", "merge keys (<<) are not read; write the keys out")
        if (first := frame.piece.keys.setdefault(key, self.span(event))) != self.span(event):
            self.problem(event, "PLAN102", f"the key {key!r} is given twice", ("first given here", first))

    def put(self, event: Any, piece: Piece) -> None:
        if len(self.stack) + piece.depth > PLAN_DEPTH:
            raise self.reject(event, "PLAN101", f"nested deeper than {PLAN_DEPTH} levels")
        if not self.stack:
            self.root = piece
            return
        frame = self.stack[-1]
        frame.piece.depth = max(frame.piece.depth, piece.depth + 1)
        if frame.piece.items is not None:
            frame.piece.items.append(piece)
        elif frame.piece.entries is not None and frame.key is not None:
            frame.piece.entries[frame.key] = piece
            frame.key = None
        frame.piece.size += piece.size
        if frame.piece.size > PLAN_PIECES:
            raise self.reject(event, "PLAN101", f"more than {PLAN_PIECES} pieces once its aliases are expanded")

    def refuse_tag(self, event: Any) -> None:
        if event.tag is not None:
            self.problem(event, "PLAN101", f"the tag {event.tag} is not read; write plain values")

    def span(self, event: Any) -> Span:
        start, end = event.start_mark, event.end_mark
        return Span(self.file, start.line + 1, start.column + 1, end.line + 1, end.column + 1)

    def problem(self, event: Any, code: str, message: str, *notes: tuple[str, Span | None]) -> None:
        self.problems.append(Diagnostic(code, message, self.span(event), notes=notes))

    def reject(self, event: Any, code: str, message: str, hint: str | None = None) -> Rejected:
        return Rejected(Diagnostic(code, message, self.span(event), hint=hint))


def _places(piece: Piece, path: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], Span]]:
    yield path, piece.span
    if piece.entries is not None:
        for key, child in piece.entries.items():
            yield from _places(child, (*path, key))
    for index, child in enumerate(piece.items or ()):
        yield from _places(child, (*path, index))


def _position(text: str, offset: int) -> tuple[int, int]:
    before = text[:offset]
    return before.count("\n") + 1, offset - (before.rfind("\n") + 1) + 1


def _error(message: str, file: str, line: int, column: int, hint: str | None = None) -> Diagnostic:
    return Diagnostic("PLAN101", message, Span(file, line, column, line, column + 1), hint=hint)
