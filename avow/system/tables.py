"""The tables of a plan's scenario: CSV files or rows in place. Cells are kept as exact text."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Span
from avow.base.files import read_regular
from avow.base.suggestions import suggest
from avow.base.tuning.sizes import RANGE_VALUES
from avow.system.plan import Table
from avow.system.strict_yaml import Piece

_COLUMNS_OF = re.compile(r"\s*([^\s(),]+)\s*\(\s*([^()]*)\)\s*\Z")
_CELL = re.compile(r"\b([A-Za-z_][A-Za-z0-9_-]*)\.([A-Za-z_][A-Za-z0-9_]*)")
_RANGE = re.compile(r"\s*(-?[0-9]{1,40})\s*\.\.\s*(-?[0-9]{1,40})\s*\Z")


def read_csv(name: str, path: Path, span: Span) -> tuple[Table | None, tuple[Diagnostic, ...]]:
    """A CSV file whose first row names the columns; every row must have as many cells."""

    def fault(message: str, line: int | None = None) -> tuple[None, tuple[Diagnostic, ...]]:
        at, notes = (Span(str(path), line, 1, line + 1, 1), (("the plan names it here", span),)) if line else (span, ())
        return None, (Diagnostic("PLAN109", f"scenario.{name}: {message}", at, notes=notes),)

    try:
        rows = csv_rows(read_regular(path))
    except OSError as error:
        return fault(f"{path.name} cannot be read: {error.strerror}")
    except ValueError as error:
        return fault(f"{path.name} is no CSV in UTF-8: {error}")
    if not rows:
        return fault(f"{path.name} is empty")
    (first, header), *others = rows
    if "" in header or len(set(header)) != len(header):
        return fault(f"{path.name}: the columns need names, all different", first)
    for line, row in others:
        if len(row) != len(header):
            return fault(f"{path.name}: {len(row)} cells where {len(header)} are wanted", line)
    return Table(name, header, tuple(row for _, row in others), path), ()


def cell_place(table: Table, text: str) -> Span | None:
    """The first line of the table's file that has a cell with this text."""
    if table.path is None:
        return None
    lines = (line for line, cells in csv_rows(read_regular(table.path)) if text in cells)
    return next((Span(str(table.path), line, 1, line + 1, 1) for line in lines), None)


def other_separator(header: Sequence[str]) -> str:
    """What seems to separate the columns in place of a comma: a semicolon or a tab; empty if nothing does."""
    return next((sign for sign in ";\t" if len(header) == 1 and sign in header[0]), "")


def csv_rows(data: bytes) -> list[tuple[int, tuple[str, ...]]]:
    """The rows of a CSV file that are not empty, each with the line on which it ends. Raises ValueError."""
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line} has a character that is not UTF-8: save the file as UTF-8") from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        rows = [(reader.line_num, tuple(cell.strip() for cell in row)) for row in reader if row]
    except csv.Error as error:
        raise ValueError(f"line {reader.line_num or 1}: {error}") from None
    if rows and (sign := other_separator(rows[0][1])):
        raise ValueError(f"line {rows[0][0]}: {sign!r} separates its columns: separate them by commas")
    return rows


def read_rows(name: str, piece: Piece) -> tuple[Table | None, tuple[Diagnostic, ...]]:
    """Rows given in the plan: mappings with the same keys each."""
    rows = piece.items or []
    columns = tuple(rows[0].entries or {}) if rows else ()
    faults: list[Diagnostic] = []
    found: list[tuple[str, ...]] = []
    for number, row in enumerate(rows):
        entries = row.entries or {}
        odd = set(columns) ^ set(entries)
        if odd:
            message = f"scenario.{name}[{number}]: its columns are {', '.join(columns)}; odd: {', '.join(sorted(odd))}"
            faults.append(Diagnostic("PLAN109", message, row.span))
            continue
        found.append(tuple(entries[column].text for column in columns))
    return (None, tuple(faults)) if faults else (Table(name, columns, tuple(found)), ())


def interpretation(text: str, tables: dict[str, Table]) -> tuple[str, tuple[str, ...]]:
    """``places(x, y, id)`` → table and columns. Raises ValueError."""
    found = _COLUMNS_OF.match(text)
    if not found:
        raise ValueError(f"{text!r} has not the form table(column, …)")
    name = found[1]
    columns = tuple(column.strip() for column in found[2].split(",")) if found[2].strip() else ()
    table = tables.get(name)
    if table is None:
        raise ValueError(f"there is no table {name!r}; {suggest(name, tables) or 'the scenario has none'}")
    for column in columns:
        if column not in table.columns:
            raise ValueError(f"the table {name} has no column {column!r}; {suggest(column, table.columns)}")
    return name, columns


def domain(piece: Piece, tables: dict[str, Table]) -> tuple[str, ...]:
    """``table.column``, ``low..high``, a value or a list of values → the values as text. Raises ValueError."""
    if piece.items is not None:
        found: dict[str, None] = {}
        for item in piece.items:
            found.update(dict.fromkeys(_each_row(item.text, tables)))
        return tuple(found)
    text = piece.text
    span = _RANGE.match(text)
    if span:
        low, high = int(span[1]), int(span[2])
        if high < low:
            raise ValueError(f"the range {text} is empty")
        if high - low >= RANGE_VALUES:
            raise ValueError(f"the range {text} has more than {RANGE_VALUES} values")
        return tuple(str(number) for number in range(low, high + 1))
    return _each_row(text, tables)


def _each_row(text: str, tables: dict[str, Table]) -> tuple[str, ...]:
    """``places.id`` or ``move(places.x, places.y)`` with every row's cells; other text unchanged. Raises ValueError."""
    places = [found for found in _CELL.finditer(text) if found[1] in tables]
    if not places:
        return (text,)
    names = {found[1] for found in places}
    if len(names) > 1:
        raise ValueError(f"{text!r} draws on several tables: {', '.join(sorted(names))}")
    table = tables[names.pop()]
    for found in places:
        if found[2] not in table.columns:
            raise ValueError(f"the table {table.name} has no column {found[2]!r}; {suggest(found[2], table.columns)}")
    at = {column: k for k, column in enumerate(table.columns)}
    rows = (
        _CELL.sub(lambda found, row=row: row[at[found[2]]] if found[1] == table.name else found[0], text)  # type: ignore[misc]
        for row in table.rows
    )
    return tuple(dict.fromkeys(rows))


def plain(value: Any) -> str:
    """A YAML scalar as RCL writes it."""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return str(value)
