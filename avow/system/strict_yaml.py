"""Strict YAML for configuration: every piece keeps its place, nothing is guessed.

`yaml.safe_load` accepts duplicate keys silently, reads ``off`` as False, ``1:30`` as 90 and ``010`` as 8, expands
aliases without a word, and loses positions. This reader works on PyYAML's nodes: scalars are null, true, false,
JSON numbers or text; duplicate keys, tags and merge keys are errors; aliases may be used.
"""

from __future__ import annotations

import math
import re
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.malformed import yaml_fault
from avow.base.plain import invisible
from avow.base.tuning.sizes import PLAN_BYTES
from avow.system.pieces import Piece as Piece

_INTEGER = re.compile(r"-?(0|[1-9][0-9]*)\Z")
_DECIMAL = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]{1,3})?\Z")
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}


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
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        raise Rejected(_error("not UTF-8 text: save the file as UTF-8", file, line, column)) from None
    try:
        builder = _Builder(file)
        return builder.build(text), tuple(builder.problems)
    except (yaml.YAMLError, RecursionError) as error:
        found = yaml_fault(text, error)
        raise Rejected(_error(str(found), file, found.line, found.column, found.hint)) from None


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
        root = yaml.compose(text, _Composer)
        if root is None:
            raise Rejected(_error("the file is empty", self.file, 1, 1, "write `{}` for a file that sets nothing"))
        return self.piece(root)

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


def _error(message: str, file: str, line: int, column: int, hint: str | None = None) -> Diagnostic:
    return Diagnostic("PLAN101", message, Span(file, line, column, line, column + 1), hint=hint)
