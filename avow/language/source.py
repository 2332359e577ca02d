"""A text with its positions: offsets to lines and columns, and the collection of diagnostics about it."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections import Counter
from dataclasses import field, replace

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.records import dataclass
from avow.base.tuning.shown import ALIKE, DIAGNOSTICS

_LONG_NAME = re.compile(r"(`[^`]{50})[^`]{30,}`")


@dataclass(slots=True)
class Source:
    """A text and its place: lines and columns count from 1.

    `line` and `column` are those of the text's beginning, for a formula inside another file.
    """

    file: str
    text: str
    line: int = 1
    column: int = 1
    _starts: list[int] | None = None

    def place(self, offset: int) -> tuple[int, int]:
        """The line and column of an offset (counted in characters)."""
        starts = self.starts
        row = bisect_right(starts, offset) - 1
        column = offset - starts[row] + (self.column if row == 0 else 1)
        return self.line + row, column

    def offset(self, line: int, column: int) -> int:
        """The offset of a place; the text's end for a place after it."""
        row = max(line - self.line, 0)
        if row >= len(self.starts):
            return len(self.text)
        return min(self.starts[row] + column - (self.column if row == 0 else 1), len(self.text))

    @property
    def starts(self) -> list[int]:
        """The offsets at which lines begin."""
        if self._starts is None:
            starts = [0]
            at = self.text.find("\n")
            while at >= 0:
                starts.append(at + 1)
                at = self.text.find("\n", at + 1)
            self._starts = starts
        return self._starts

    def span(self, start: int, end: int) -> Span:
        line, column = self.place(start)
        end_line, end_column = self.place(max(end, start))
        return Span(self.file, line, column, end_line, end_column)


@dataclass(slots=True)
class Reports:
    """Diagnostics about one text, in the order found; identical ones are kept once. Of those that differ only in their
    place the first `ALIKE` are kept, and all are counted."""

    source: Source
    found: list[Diagnostic] = field(default_factory=list)
    odd: set[int] = field(default_factory=set)
    """The offsets of tokens that replace text that is not RCL, which has been reported."""
    torn: list[int] = field(default_factory=list)
    """The offsets where the lexer skipped text, in ascending order: an error near one is most likely a consequence."""
    _seen: set[tuple[str, str, Span | None]] = field(default_factory=set)
    alike: Counter[tuple[str, str]] = field(default_factory=Counter)

    def add(self, diagnostic: Diagnostic) -> None:
        key = (diagnostic.code, diagnostic.message, diagnostic.span)
        if key in self._seen:
            return
        if self.full:
            return
        self._seen.add(key)
        self.alike[key[:2]] += 1
        if self.alike[key[:2]] > ALIKE:
            return
        self.found.append(diagnostic)

    def error(
        self,
        code: str,
        message: str,
        start: int,
        end: int,
        *,
        hint: str | None = None,
        notes: tuple[tuple[str, Span | None], ...] = (),
    ) -> None:
        if not self.full:
            message, hint = _short(message), hint and _short(hint)
            self.add(Diagnostic(code, message, self.source.span(start, end), Severity.ERROR, hint, notes))

    def is_torn(self, start: int, end: int) -> bool:
        """Whether text was skipped in this part, so that no more should be reported about it."""
        at = bisect_left(self.torn, start)
        return at < len(self.torn) and self.torn[at] <= end

    @property
    def full(self) -> bool:
        """Whether no more diagnostics are kept, so that looking for more is useless."""
        return len(self.found) >= DIAGNOSTICS

    @property
    def failed(self) -> bool:
        return any(d.is_error for d in self.found)


def in_order(reports: Reports) -> list[Diagnostic]:
    """The diagnostics in order of place; at the end, a note if there are more than are kept."""
    found = sorted(reports.found, key=lambda d: (d.span.line, d.span.column) if d.span else (0, 0))
    for (code, message), count in reports.alike.items():
        if count > ALIKE:
            at = next(k for k, d in enumerate(found) if (d.code, d.message) == (code, message))
            found[at] = replace(found[at], message=f"{message} ({count} times, of which {ALIKE} are shown)")
    if reports.full:
        severity = Severity.ERROR if reports.failed else Severity.WARNING
        message = f"there is more to say, but {len(found)} diagnostics of one file are enough"
        found.append(Diagnostic("RCL006", message, found[-1].span, severity))
    return found


def _short(message: str) -> str:
    """The message with very long names in it shortened."""
    return message if len(message) <= 300 else _LONG_NAME.sub(r"\1…`", message)
