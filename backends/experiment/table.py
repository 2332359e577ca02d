"""The table of an experiment: a CSV file, read strictly, so that no row is left out or counted twice."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path

from avow.backend_kit.given import file_text
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.plain import alike
from avow.base.records import dataclass
from avow.base.suggestions import suggest
from avow.system.tables import other_separator

from .tuning import ROWS, TABLE_BYTES


@dataclass(frozen=True, slots=True)
class Row:
    line: int
    cells: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Table:
    path: Path
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    def fault(self, line: int, code: str, message: str, hint: str | None = None) -> Diagnostic:
        return _fault(self.path, line, code, message, hint)

    def confused(self, wanted: str) -> Diagnostic | None:
        """The error of a column that the plan names, if any."""
        if wanted not in self.columns:
            return self.fault(1, "EXP112", f"there is no column '{wanted}'", suggest(wanted, self.columns))
        others = [name for name in self.columns if name != wanted and alike(name) == alike(wanted)]
        if others:
            return self.fault(1, "EXP112", f"the column '{wanted}' looks like {', '.join(map(repr, others))}")
        return None


def read_table(path: Path) -> Table:
    """Raises Rejected with all errors."""
    lines = list(_lines(path))
    if len(lines) < 2:
        needed = "a line with the names of the columns" if not lines else "at least one row below the names"
        raise Rejected(_fault(path, 1, "EXP111", f"the file needs {needed}"))
    (first, columns), *others = lines
    if sign := other_separator(columns):
        raise Rejected(_fault(path, first, "EXP111", f"{sign!r} separates the columns", "separate them by commas"))
    twice = sorted({name for name in columns if columns.count(name) > 1})
    found = [_fault(path, first, "EXP112", f"the column '{name}' occurs twice") for name in twice]
    found += [
        _fault(path, line, "EXP113", f"{len(cells)} cells, but {len(columns)} columns")
        for line, cells in others
        if len(cells) != len(columns)
    ]
    if found:
        raise Rejected(*found)
    return Table(path, tuple(columns), tuple(Row(n, dict(zip(columns, cells, strict=True))) for n, cells in others))


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    text = file_text(path, "EXP102", "EXP111", TABLE_BYTES)
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise Rejected(_fault(path, line, "EXP111", "a NUL character in the data"))
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    count = 0
    try:
        for cells in reader:
            if cells and (len(cells) > 1 or cells[0].strip()):
                count += 1
                yield reader.line_num, [cell.strip() for cell in cells]
            if count > ROWS + 1:
                raise Rejected(_fault(path, reader.line_num, "EXP111", f"more than {ROWS} rows"))
    except csv.Error as error:
        raise Rejected(_fault(path, reader.line_num, "EXP111", f"not CSV: {error}")) from None


def _fault(path: Path, line: int, code: str, message: str, hint: str | None = None) -> Diagnostic:
    return Diagnostic(code, message, Span(str(path), line, 1, line + 1, 1), hint=hint)
