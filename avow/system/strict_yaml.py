"""Strict YAML for configuration: every piece keeps its place, nothing is guessed.

`yaml.safe_load` accepts duplicate keys silently, reads ``off`` as False, ``1:30`` as 90 and ``010`` as 8, expands
aliases without a word, and loses positions. This reader works on PyYAML's nodes: scalars are null, true, false,
JSON numbers or text; duplicate keys, tags and merge keys are errors; aliases may be used.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.plain import invisible
from avow.base.records import dataclass
from avow.base.tuning.sizes import PLAN_BYTES
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
    quoted: bool = False

    @property
    def inner(self) -> Span:
        """The place of a scalar's text, without quotation marks."""
        start, end = self.span.column + self.quoted, self.span.end_column - self.quoted
        return replace(self.span, column=start, end_column=end)

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
        return Located(self.data, self.span, dict(_places(self, ())), dict(_keys(self, ())))

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
        if undashed := _undashed(text.splitlines(), line - 1):
            line, problem, hint = undashed + 1, "this line begins no item of the list below", "write `- ` before it"
        raise Rejected(_error(problem, file, line, column, hint)) from None
    except yaml.YAMLError:
        raise Rejected(_error("not YAML", file, 1, 1)) from None


def _undashed(lines: Sequence[str], at: int) -> int | None:
    """The line before line `at` if that one begins an item of a list and this one, in the same column, does not."""
    before = next((k for k in range(at - 1, -1, -1) if lines[k].strip() and lines[k].lstrip()[0] != "#"), None)
    if before is None or at >= len(lines) or not lines[at].lstrip().startswith("- "):
        return None
    indents = {len(line) - len(line.lstrip()) for line in (lines[before], lines[at])}
    return before if len(indents) == 1 and not lines[before].lstrip().startswith("-") else None


_PROBLEMS = (
    (r"character '\\t'", "a tab stands where YAML wants spaces", "indent with spaces"),
    (r"character '(.)'.*cannot start", "no plain text can begin with {0}", "put the text in quotes"),
    (
        r"mapping values are not allowed",
        "a `:` stands where no key can be",
        "check the indentation of this line and of the line before, or put the text in quotes",
    ),
    (r"could not find expected ':'", "a key without its `:`", "write `key: value`"),
    (r"expected <block end>, but found '([\]}])'", "a `{0}` closes no bracket", "remove it, or open the bracket"),
    (
        r"expected <block end>, but found '(.*)'",
        "this line is indented as none above it",
        "the keys of a mapping, and the items of a list, stand in one column: move this line, or those above it",
    ),
    (r"expected ',' or '(.)'", "a `,` or the closing `{0}` is missing", None),
    (r"found another document", "a second document; one file holds one", None),
    (
        r"found undefined alias '(.*)'",
        "the alias `*{0}` is used before or without its anchor",
        "write the value here, or its anchor above",
    ),
    ("second occurrence", "this anchor is given twice", "give one of them another name"),
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


class _Composer(yaml.SafeLoader):
    """YAML's nodes; one without a tag in the text has an empty one."""

    def resolve(self, kind: Any, value: Any, implicit: Any) -> Any:
        return ""


class _Builder:
    """Pieces of a document's nodes. Each node has one piece, so that an alias has the place of its anchor."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.made: dict[yaml.Node, Piece | None] = {}
        """None: it is being made, so that an alias in it would be without end."""
        self.problems: list[Diagnostic] = []

    def build(self, text: str) -> Piece:
        try:
            root = yaml.compose(text, _Composer)
            if root is None:
                raise Rejected(_error("the file is empty", self.file, 1, 1))
            return self.piece(root)
        except RecursionError:
            raise Rejected(_error("nested too deeply", self.file, 1, 1)) from None

    def piece(self, node: yaml.Node) -> Piece:
        if node not in self.made:
            self.made[node] = None
            if node.tag:
                self.problem(node, "PLAN101", f"the tag {node.tag} is not read; write plain values")
            self.made[node] = self.new(node)
        known = self.made[node]
        if known is None:
            raise self.reject(node, "PLAN101", "an alias stands in what it repeats")
        return known

    def new(self, node: yaml.Node) -> Piece:
        if isinstance(node, yaml.ScalarNode):
            text = self.text(node)
            value, quoted = scalar(text) if node.style is None else text, node.style in ("'", '"')
            return Piece(self.span(node), value, text, quoted=quoted)
        found = Piece(self.span(node))
        if isinstance(node, yaml.MappingNode):
            found.entries = {}
            for key, value in node.value:
                found.entries[self.key(key, found)] = self.piece(value)
        else:
            found.items = [self.piece(value) for value in node.value]
        return found

    def key(self, node: yaml.Node, whole: Piece) -> str:
        if not isinstance(node, yaml.ScalarNode):
            raise self.reject(node, "PLAN102", "a key must be plain text")
        key = self.text(node)
        if key == "<<":
            self.problem(node, "PLAN102", "merge keys (<<) are not read; write the keys out")
        if key in whole.keys:
            self.problem(node, "PLAN102", f"the key {key!r} is given twice", ("first given here", whole.keys[key]))
        whole.keys.setdefault(key, self.span(node))
        return key

    def text(self, node: yaml.ScalarNode) -> str:
        text = str(node.value)
        if unseen := invisible(text):
            self.problem(node, "PLAN101", f"the text holds the invisible character {unseen}")
        return text

    def span(self, node: yaml.Node) -> Span:
        start, end = node.start_mark, node.end_mark
        return Span(self.file, start.line + 1, start.column + 1, end.line + 1, end.column + 1)

    def problem(self, node: yaml.Node, code: str, message: str, *notes: tuple[str, Span | None]) -> None:
        self.problems.append(Diagnostic(code, message, self.span(node), notes=notes))

    def reject(self, node: yaml.Node, code: str, message: str) -> Rejected:
        return Rejected(Diagnostic(code, message, self.span(node)))


def _places(piece: Piece, path: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], Span]]:
    yield path, piece.span
    if piece.entries is not None:
        for key, child in piece.entries.items():
            yield from _places(child, (*path, key))
    for index, child in enumerate(piece.items or ()):
        yield from _places(child, (*path, index))


def _keys(piece: Piece, path: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], Span]]:
    yield from (((*path, key), piece.key_span(key)) for key in piece.entries or ())
    for key, child in (piece.entries or {}).items():
        yield from _keys(child, (*path, key))
    for index, child in enumerate(piece.items or ()):
        yield from _keys(child, (*path, index))


def _position(text: str, offset: int) -> tuple[int, int]:
    before = text[:offset]
    return before.count("\n") + 1, offset - (before.rfind("\n") + 1) + 1


def _error(message: str, file: str, line: int, column: int, hint: str | None = None) -> Diagnostic:
    return Diagnostic("PLAN101", message, Span(file, line, column, line, column + 1), hint=hint)
