"""Diagnostics for people (with the source line and a caret under the place), as JSON, and as SARIF 2.1.0.

Text from files may contain anything: unprintable characters are made visible and never reach the terminal, and long
lines are cut around the place. The JSON is flat, and has every key.
"""

from __future__ import annotations

import os
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from avow.base.codes import advice, known
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.plain import count
from avow.base.records import dataclass
from avow.base.tuning.shown import SOURCE_COLUMNS
from avow.base.tuning.sizes import SOURCE_SHOWN

_TAB = 4
_COLOURS = {Severity.ERROR: "31", Severity.WARNING: "33", Severity.NOTE: "36"}


def render(diagnostics: Iterable[Diagnostic], sources: Mapping[str, str] | None = None, *, colour: bool = False) -> str:
    """The diagnostics for a terminal, one block each. `sources` maps a file's name to its text; other files are read
    from the disk if possible, and else shown without a source line."""
    lines = _Lines(dict(sources or {}))
    return "\n".join(_block(d, lines, colour) for d in diagnostics)


def summary(diagnostics: Iterable[Diagnostic]) -> str:
    """``2 errors, 1 warning``, or ``no errors``."""
    found = Counter(d.severity for d in diagnostics)
    return ", ".join(count(found[severity], severity) for severity in Severity if found[severity]) or "no errors"


class _Lines:
    """Lines of files, read when first asked for."""

    def __init__(self, sources: dict[str, str]) -> None:
        self._texts = sources
        self._split: dict[str, list[str]] = {}

    def get(self, file: str, line: int) -> str | None:
        if file not in self._split:
            text = self._texts.get(file)
            if text is None:
                try:
                    text = _read(Path(file))
                except (OSError, ValueError):
                    text = ""
            self._split[file] = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
        lines = self._split[file]
        return lines[line - 1] if 0 < line <= len(lines) and any(lines) else None


def _read(path: Path) -> str:
    """A file's text; empty for a device or a pipe, which may have no end. Raises OSError, ValueError."""
    if not path.is_file():
        return ""
    with path.open("rb") as stream:
        return stream.read(SOURCE_SHOWN).decode("utf-8", "replace")


def _block(diagnostic: Diagnostic, lines: _Lines, colour: bool) -> str:
    def paint(text: str, style: str) -> str:
        return f"\x1b[{style}m{text}\x1b[0m" if colour else text

    tint = _COLOURS[diagnostic.severity]
    head = paint(f"{diagnostic.severity}[{diagnostic.code}]", f"1;{tint}")
    out = [f"{head}: {paint(printable(diagnostic.message), '1')}"]
    span = diagnostic.span
    margin = " " * (len(str(span.line)) if span is not None else 1)
    bar = paint("|", "34")
    if span is not None:
        out.append(f"{margin}{paint('-->', '34')} {printable(str(span))}")
        line = lines.get(span.file, span.line)
        if line is not None:
            shown, indent, length = _excerpt(line, span)
            out.append(f"{margin} {bar}")
            out.append(f"{paint(str(span.line), '34')} {bar} {shown}")
            out.append(f"{margin} {bar} {' ' * indent}{paint('^' * length, tint)}")
    if told := advice(diagnostic):
        out.append(f"{margin} = {paint('help', '1')}: {printable(told)}")
    for text, place in diagnostic.notes:
        where = f" ({printable(str(place))})" if place is not None else ""
        out.append(f"{margin} = {paint('note', '1')}: {printable(text)}{where}")
    return "\n".join(out) + "\n"


def printable(text: str) -> str:
    """The text with control characters and other terminal controls made visible."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else "\ufffd" for c in text.replace("\t", " ").replace("\n", " "))


def _cells(character: str) -> int:
    """How many columns of a terminal the character takes."""
    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def _excerpt(line: str, span: Span) -> tuple[str, int, int]:
    """The line as shown, the caret's indentation, and how long it is."""
    line = line.rstrip("\r\n")
    start = min(max(span.column - 1, 0), len(line))
    end = span.end_column - 1 if span.end_line == span.line else len(line)
    end = max(min(end, len(line)), start + 1)
    first, last, before, after = 0, len(line), "", ""
    if len(line) > SOURCE_COLUMNS:
        first = max(0, start - SOURCE_COLUMNS // 2)
        last = min(len(line), first + SOURCE_COLUMNS)
        before, after = ("…" if first else ""), ("…" if last < len(line) else "")
        end = min(end, last)
    shown, indent, length = before, len(before), 0
    for i in range(first, last):
        character = line[i]
        piece = " " * _TAB if character == "\t" else printable(character)
        width = sum(map(_cells, piece))
        if i < start:
            indent += width
        elif i < end:
            length += width
        shown += piece
    return shown + after, indent, max(length, 1)


# --- for machines ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ShownDiagnostic:
    """A diagnostic. Its file has the name given on the command line; lines and columns count from 1, columns in
    characters (code points), the end is exclusive; without a place, these are null."""

    file: str | None
    line: int | None
    column: int | None
    end_line: int | None
    end_column: int | None
    severity: Severity
    code: str
    message: str
    hint: str | None


@dataclass(frozen=True, slots=True)
class CheckDocument:
    """The findings about files."""

    diagnostics: tuple[ShownDiagnostic, ...]


def told(diagnostics: Iterable[Diagnostic]) -> CheckDocument:
    """For machines: docs/schemas/check.schema.json follows from it."""
    return CheckDocument(tuple(map(_shown, diagnostics)))


def _shown(d: Diagnostic) -> ShownDiagnostic:
    s, said = d.span, (d.severity, d.code, d.message, advice(d) or None)
    if s is None:
        return ShownDiagnostic(None, None, None, None, None, *said)
    return ShownDiagnostic(s.file, s.line, s.column, s.end_line, s.end_column, *said)


def to_sarif(diagnostics: Sequence[Diagnostic], *, version: str = "") -> dict[str, Any]:
    """A SARIF 2.1.0 log with one run. Paths are kept as given: relative ones are relative to the working folder."""
    used, codes = sorted({d.code for d in diagnostics}), known()
    rules = []
    for code in used:
        rule: dict[str, Any] = {"id": code}
        if code in codes:
            rule["shortDescription"] = {"text": codes[code].title}
            rule["fullDescription"] = {"text": codes[code].explanation}
            rule["defaultConfiguration"] = {"level": str(codes[code].severity)}
        rules.append(rule)
    driver: dict[str, Any] = {"name": "avow", "rules": rules}
    if version:
        driver["version"] = version
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [
            {
                "tool": {"driver": driver},
                "columnKind": "unicodeCodePoints",
                "results": [_as_result(d, used.index(d.code)) for d in diagnostics],
            }
        ],
    }


def _as_result(diagnostic: Diagnostic, rule: int) -> dict[str, Any]:
    text = diagnostic.message + (f" ({told})" if (told := advice(diagnostic)) else "")
    result: dict[str, Any] = {
        "ruleId": diagnostic.code,
        "ruleIndex": rule,
        "level": str(diagnostic.severity),
        "message": {"text": text},
    }
    if diagnostic.span is not None:
        result["locations"] = [{"physicalLocation": sarif_place(diagnostic.span)}]
    related = [
        {"id": i, "physicalLocation": sarif_place(place), "message": {"text": note}}
        for i, (note, place) in enumerate(diagnostic.notes, 1)
        if place is not None
    ]
    if related:
        result["relatedLocations"] = related
    return result


def sarif_place(span: Span) -> dict[str, Any]:
    """A `physicalLocation`."""
    path = PurePath(span.file)
    uri = quote(os.fsencode(path.as_posix()))
    if path.is_absolute():
        uri = "file://" + uri
    return {
        "artifactLocation": {"uri": uri},
        "region": {
            "startLine": max(span.line, 1),
            "startColumn": max(span.column, 1),
            "endLine": max(span.end_line, 1),
            "endColumn": max(span.end_column, 1),
        },
    }
