"""Places in the user's text, and findings about them.

Errors are values: a pass returns (or collects) `Diagnostic`s; text, JSON, SARIF and the language server are printers
of them. Only at a boundary where nothing more can be done are they raised, together, as `Rejected` (exit code 2).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from enum import StrEnum

from avow.base.records import dataclass


class Severity(StrEnum):
    """How much a diagnostic matters: an error stops the stage, a warning does not."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of text; lines and columns count from 1, the end is exclusive."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A finding at a place. `code` is declared, with its explanation, in `avow.base.codes`."""

    code: str
    message: str
    span: Span | None = None
    severity: Severity = Severity.ERROR
    hint: str | None = None
    notes: tuple[tuple[str, Span | None], ...] = field(default=())

    @property
    def is_error(self) -> bool:
        return self.severity is Severity.ERROR


class Rejected(Exception):  # noqa: N818 - it reads as what happened to the input
    """Input that cannot be used: carries every diagnostic found, so that all are reported in one go."""

    def __init__(self, *diagnostics: Diagnostic) -> None:
        super().__init__("; ".join(f"{d.span or '<input>'}: {d.message} [{d.code}]" for d in diagnostics))
        self.diagnostics = diagnostics


def refuse(found: Iterable[Diagnostic]) -> None:
    """Raises Rejected with the errors among them, if there are any."""
    errors = [diagnostic for diagnostic in found if diagnostic.is_error]
    if errors:
        raise Rejected(*errors)


class Hinted(Exception):  # noqa: N818 - it is what was found wrong
    """What was found wrong, and a remedy if there is one."""

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint


class Malformed(Hinted):
    """A text that is not what it should be: its first fault. `line` and `column` count from 1."""

    def __init__(self, message: str, line: int = 1, column: int = 1, hint: str | None = None) -> None:
        super().__init__(message, hint)
        self.line, self.column = line, column
