"""The runs of an experiment: a CSV file, read strictly, and the measure of each run."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from avow.backend_kit.given import file_text
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.plain import alike
from avow.base.records import dataclass

from .expression import Expression, Interval
from .options import ID_COLUMNS
from .quantity import decimal
from .tuning import RUNS, TABLE_BYTES


@dataclass(frozen=True, slots=True)
class Run:
    """One run: its name, its line in the file, the columns that the measure reads, and the measure."""

    name: str
    line: int
    values: tuple[tuple[str, str], ...]
    measure: Interval

    @property
    def measured(self) -> tuple[Fraction | None, ...]:
        """The numbers that the measure reads: where two runs agree in them, nothing says that they are two."""
        return tuple(decimal(text) for _, text in self.values)


@dataclass(frozen=True, slots=True)
class Runs:
    runs: tuple[Run, ...]
    warnings: tuple[Diagnostic, ...]


def read_runs(path: Path, measure: Expression, id_column: str | None) -> Runs:
    """Every run of the file. Raises Rejected, with the place of everything that is not as it should be."""
    return _RunsReader(path, measure, id_column).read()


class _RunsReader:
    def __init__(self, path: Path, measure: Expression, id_column: str | None) -> None:
        self.path = path
        self.measure = measure
        self.id_column = id_column
        self.problems: list[Diagnostic] = []

    def read(self) -> Runs:
        rows = self.rows()
        if not rows:
            raise self.fail(1, "EXP111", "the file is empty: it needs a line with the names of the columns")
        first, *others = rows
        columns = self.header(*first)
        if self.problems:
            raise Rejected(*self.problems)
        if not others:
            raise self.fail(first[0], "EXP111", "the file has no runs, only the names of its columns")
        names: dict[str, int] = {}
        runs = [run for line, cells in others if (run := self.run(line, cells, columns, names)) is not None]
        if self.problems:
            raise Rejected(*self.problems)
        return Runs(tuple(runs), tuple(self.copies(runs)))

    def rows(self) -> list[tuple[int, list[str]]]:
        text = file_text(self.path, "EXP102", "EXP111", TABLE_BYTES)
        if "\0" in text:
            raise self.fail(text[: text.index("\0")].count("\n") + 1, "EXP111", "a NUL character in the data")
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        rows: list[tuple[int, list[str]]] = []
        try:
            for cells in reader:
                one_column = bool(rows) and len(rows[0][1]) == 1
                if cells and (one_column or len(cells) > 1 or cells[0].strip()):
                    rows.append((reader.line_num, [cell.strip() for cell in cells]))
                if len(rows) > RUNS + 1:
                    raise self.fail(reader.line_num, "EXP111", f"more than {RUNS} runs")
        except csv.Error as error:
            raise self.fail(reader.line_num, "EXP111", f"not CSV: {error}") from None
        return rows

    def header(self, line: int, columns: list[str]) -> list[str]:
        for name in sorted({c for c in columns if columns.count(c) > 1}):
            self.add(line, "EXP112", f"the column '{name}' is there twice")
        wanted = [*self.measure.columns, *([self.id_column] if self.id_column else [])]
        for name in wanted:
            others = [other for other in columns if other != name and alike(other) == alike(name)]
            if name in columns and others:
                told = ", ".join(map(repr, others))
                self.add(line, "EXP112", f"nobody can tell the column '{name}' from {told}")
        for name in wanted:
            if name not in columns:
                self.add(line, "EXP112", f"there is no column '{name}'", f"columns: {', '.join(columns)}")
        if self.id_column is None:
            self.id_column = next((name for name in ID_COLUMNS if name in columns), None)
        return columns

    def run(self, line: int, cells: list[str], columns: list[str], names: dict[str, int]) -> Run | None:
        if len(cells) != len(columns):
            self.add(line, "EXP113", f"{len(cells)} cells, but {len(columns)} columns")
            return None
        row = dict(zip(columns, cells, strict=True))
        name = row[self.id_column] if self.id_column else str(len(names) + 1)
        if not name:
            self.add(line, "EXP113", "the run has no name")
        if name in names:
            self.add(line, "EXP113", f"a second run named '{name}'; the first is in line {names[name]}")
        names.setdefault(name, line)
        values = {column: self.cell(line, column, row[column]) for column in self.measure.columns}
        numbers = {column: value for column, value in values.items() if value is not None}
        if len(numbers) < len(values):
            return None
        try:
            measured = self.measure.evaluate(numbers)
        except ValueError as error:
            self.add(line, "EXP114", f"the measure cannot be computed for this run: {error}")
            return None
        if measured.low < 0:
            hint = "a signed difference would count any overshoot as a success; use abs(…) or hypot(…)"
            self.add(line, "EXP114", "the measure of this run is negative", hint)
            return None
        return Run(name, line, tuple((c, row[c]) for c in self.measure.columns), measured)

    def cell(self, line: int, column: str, text: str) -> Fraction | None:
        number = decimal(text)
        if number is None:
            shown = f"'{text}'" if text else "an empty cell"
            hint = "cells hold plain finite decimal numbers, without units"
            self.add(line, "EXP113", f"column '{column}': {shown} is not a number", hint)
        return number

    def copies(self, runs: Sequence[Run]) -> list[Diagnostic]:
        """Runs that agree in all that is measured: measured runs rarely do, copied lines always."""
        seen: dict[object, int] = {}
        found = []
        for run in runs:
            if run.measured in seen:
                message = f"this run agrees with the one in line {seen[run.measured]} in all that is measured"
                hint = "equal runs count once; where they are no copies, record more digits, or what was measured apart"
                found.append(Diagnostic("EXP115", message, self.place(run.line), Severity.WARNING, hint=hint))
            seen.setdefault(run.measured, run.line)
        if len(found) > 3:
            return [replace(found[0], message=f"{found[0].message}; so do {len(found) - 1} more with another")]
        return found

    def place(self, line: int) -> Span:
        return Span(str(self.path), line, 1, line + 1, 1)

    def add(self, line: int, code: str, message: str, hint: str | None = None) -> None:
        self.problems.append(Diagnostic(code, message, self.place(line), hint=hint))

    def fail(self, line: int, code: str, message: str) -> Rejected:
        return Rejected(Diagnostic(code, message, self.place(line)))
