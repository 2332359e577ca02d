"""Fills in the digests of a review, in place in the reviewer's own file; all else stays as it was written.

An existing digest that is out of date is replaced only with the date of the renewed review: a stamp means "I have read
this", so it must not be refreshed by habit.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from avow.backend_kit.given import job_for
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import inside, read_regular, write
from avow.base.persons import wrong_day
from avow.language.contract import Node
from avow.system.strict_yaml import Piece, read_yaml

from .backend import record_name
from .record import current_file, current_meaning, load, record_in

_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
_PLAIN = re.compile(r"[\w./-]+", re.ASCII)


def stamp(folder: Path, node: str, *, method: str | None = None, renewed: str | None = None) -> tuple[str, ...]:
    """Stamp the review of a node of the system in `folder`; returns one line for each digest that was filled in.

    `method` distinguishes several reviews of one node. `renewed` is the date (ISO) of a renewed review: without it, an
    existing digest is never replaced. Raises Rejected.
    """
    path, job = record_of(folder, node, method)
    return stamp_record(path, job.root, job.node, job.method.guarantees, renewed=renewed)


def record_of(folder: Path, node: str, method: str | None) -> tuple[Path, Job]:
    """The path of the record of a node's review, and its job. Raises Rejected."""
    hint = "add one to plan.yaml: review: {record: reviews/….yaml}"
    job = job_for(folder, node, "review", method, wrong="REV120", hint=hint)
    name = record_name(job)
    path = inside(job.root, name) if name else None
    if path is None:
        place = job.method.options.span
        raise Rejected(Diagnostic("REV101", "the review names no record in the system's folder", place))
    return path, job


def stamp_record(
    path: Path, root: Path, node: Node, guarantees: Iterable[str], *, renewed: str | None = None
) -> tuple[str, ...]:
    """The same for one record. Raises Rejected, and then leaves the file as it was."""
    piece, problems = load(path)
    if problems or piece.entries is None:
        raise Rejected(*(problems or [Diagnostic("REV111", "expected keys and values", piece.span)]))
    editor = _Editor(read_regular(path).decode("utf-8-sig"))
    for item in (piece.entries.get("read") or piece).items or ():
        _stamp_file(item, root, editor)
    _stamp_clauses(piece, node, tuple(guarantees), editor)
    if editor.changed and renewed is None:
        hint = "read it again, then stamp with the date of the renewed review"
        changed = [(f"{what} has changed since it was reviewed", span) for what, span in editor.changed]
        raise Rejected(*(Diagnostic("REV121", message, span, hint=hint) for message, span in changed))
    date = piece.entries.get("date")
    if editor.changed and renewed is not None and date is not None:
        if not wrong_day(date.text) and renewed < date.text:  # an invalid or future day is corrected by it
            message = f"the review of {date.text} cannot have been renewed on {renewed}"
            raise Rejected(Diagnostic("REV112", message, date.span))
        editor.replace(date.span, renewed)
        editor.said.append(f"date: {renewed}")
    if not editor.said:
        return ()
    stamped = editor.result()
    again, problems = read_yaml(stamped.encode(), str(path))
    record_in(again, problems)
    old, new = _besides(piece), _besides(again)
    if old != new:
        differing = next((key for key in {**old, **new} if old.get(key) != new.get(key)), "")
        place = piece.entries.get(differing, piece).span
        message = f"with its digests filled in, the record would say something else under '{differing}'"
        raise Rejected(Diagnostic("REV122", message, place))
    write(path, stamped)
    return tuple(editor.said)


def _besides(record: Piece) -> dict[str, object]:
    """The content of a record without digests and date: stamping must not change it."""
    found: dict[str, object] = {}
    for key, piece in (record.entries or {}).items():
        if key == "read" and piece.items is not None:
            read = [_without(item, "sha256") for item in piece.items]
            found[key] = [item["file"] if isinstance(item, dict) and [*item] == ["file"] else item for item in read]
        elif key == "clauses" and piece.entries is not None:
            judged = {name: _without(entry, "meaning") for name, entry in piece.entries.items()}
            found[key] = {name: rest for name, rest in judged.items() if isinstance(rest, dict) and rest}
        elif key not in ("date", "clauses"):
            found[key] = piece.data
    if not found.get("clauses"):
        found.pop("clauses", None)
    return found


def _without(piece: Piece, key: str) -> object:
    return piece.data if piece.entries is None else {k: v.data for k, v in piece.entries.items() if k != key}


def _stamp_file(item: Piece, root: Path, editor: _Editor) -> None:
    entry = item if item.entries is None else item.entries.get("file")
    if entry is None or entry.items is not None or entry.entries is not None:
        return
    now = current_file(root, entry.text)
    if now is None:
        raise Rejected(Diagnostic("REV102", f"there is no file '{entry.text}' in the system's folder", entry.span))
    if item.entries is None:
        editor.replace(item.span, f"{{file: {_quoted(entry.text)}, sha256: {now}}}")
        editor.said.append(f"{entry.text}: {now}")
        return
    _fill(item, "sha256", now, entry.text, editor)


def _stamp_clauses(piece: Piece, node: Node, guarantees: tuple[str, ...], editor: _Editor) -> None:
    assert piece.entries is not None
    clauses = piece.entries.get("clauses")
    fresh = {name: current_meaning(node, name) for name in guarantees}
    if clauses is None or not clauses.entries:
        lines = [f"  {_quoted(name)}: {meaning}" for name, meaning in fresh.items()]
        if clauses is None:
            editor.append("\n".join(["clauses:", *lines]))
        elif clauses.entries is not None or (clauses.items is None and clauses.value is None):
            editor.replace(clauses.span, "\n" + "\n".join(lines))
        else:
            raise Rejected(Diagnostic("REV111", "'clauses' must be keys and values", clauses.span))
        editor.said.extend(f"{name}: {meaning}" for name, meaning in fresh.items())
        return
    for name, meaning in fresh.items():
        entry = clauses.entries.get(name)
        if entry is not None and entry.entries is not None:
            _fill(entry, "meaning", meaning, name, editor)
        else:
            _fill(clauses, name, meaning, name, editor)


def _fill(mapping: Piece, key: str, value: str, what: str, editor: _Editor) -> None:
    assert mapping.entries is not None
    entry = mapping.entries.get(key)
    if entry is not None and entry.text == value:
        return
    editor.said.append(f"{what}: {value}")
    if entry is None:
        editor.insert(mapping, f"{_quoted(key)}: {value}")
        return
    if entry.text.strip() not in ("", "?", "~"):
        editor.changed.append((what, entry.span))
    editor.replace(entry.span, value)


def _quoted(text: str) -> str:
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)


@dataclass(frozen=True, slots=True)
class _Edit:
    start: int
    end: int
    text: str


class _Editor:
    """Edits parts of a text, and records which digests were filled in and which had changed; positions are those of the
    text before any change."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(match.end() for match in _BREAK.finditer(text))]
        self.edits: list[_Edit] = []
        self.said: list[str] = []
        self.changed: list[tuple[str, Span]] = []

    def replace(self, span: Span, text: str) -> None:
        start, end = self.offset(span.line, span.column), self.offset(span.end_line, span.end_column)
        gap = " " if start == end and start and not self.text[start - 1].isspace() and text[:1] != "\n" else ""
        self.edits.append(_Edit(start, end, gap + text))

    def insert(self, mapping: Piece, entry: str) -> None:
        """A new entry before the first one of a mapping."""
        start = self.offset(mapping.span.line, mapping.span.column)
        if self.text[start : start + 1] == "{":
            gap = ", " if mapping.entries else ""
            self.edits.append(_Edit(start + 1, start + 1, entry + gap))
            return
        self.edits.append(_Edit(start, start, f"{entry}\n{' ' * (mapping.span.column - 1)}"))

    def append(self, text: str) -> None:
        end = len(self.text)
        gap = "" if not self.text or self.text.endswith("\n") else "\n"
        self.edits.append(_Edit(end, end, f"{gap}{text}\n"))

    def offset(self, line: int, column: int) -> int:
        return self.starts[min(line, len(self.starts)) - 1] + column - 1

    def result(self) -> str:
        text = self.text
        # Insertions at one place keep their order: later ones are made first.
        ordered = sorted(enumerate(self.edits), key=lambda pair: (pair[1].start, pair[1].end, pair[0]), reverse=True)
        for _, edit in ordered:
            text = text[: edit.start] + edit.text + text[edit.end :]
        return text
