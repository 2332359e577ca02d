"""What lies beside a generated test or in the system's folder: kept cases, the scenario's rows, the subject's text."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from avow.base.codec import from_text
from avow.formulas.values import Value
from avow.language.sorts import BoolSort, FunctionSort, Sort

from .convention import Malformed, received
from .exchange import Question
from .generate import Inputs
from .pools import parse_cell


def kept_inputs(path: Path, sorts: Mapping[str, Sort]) -> tuple[Inputs, ...]:
    """The kept cases that are inputs of the contract as it is now; of a run, those of its steps."""
    found: list[Inputs] = []
    for case in (step for run in kept_runs(path) for step in run):
        with contextlib.suppress(Malformed, KeyError, ValueError, TypeError, AttributeError):
            found.append({name: received(case[name], sort, name) for name, sort in sorts.items()})
    return tuple(found)


def kept_runs(path: Path) -> tuple[tuple[Any, ...], ...]:
    """The kept cases as data: each the inputs of the steps of a run; of a function that is asked one step, of one."""
    return from_text(tuple[tuple[Any, ...], ...], path.read_bytes()) if path.is_file() else ()


def table_rows(
    scenario: Mapping[str, Sequence[Sequence[str]]], sorts: Mapping[str, Sort]
) -> dict[str, tuple[tuple[Value, ...], ...]]:
    """The scenario's rows for the ports that it interprets, as values; a row that does not fit is left out."""
    found: dict[str, tuple[tuple[Value, ...], ...]] = {}
    for name, table in scenario.items():
        sort = sorts.get(name)
        if isinstance(sort, FunctionSort):
            columns = sort.parameters if isinstance(sort.result, BoolSort) else (*sort.parameters, sort.result)
            read = [tuple(parse_cell(cell, s) for cell, s in zip(row, columns, strict=False)) for row in table]
            fitting = [row for row in read if len(row) == len(columns) and None not in row]
            found[name] = tuple(tuple(v for v in row if v is not None) for row in fitting)
    return found


def system_root(asked: Question, folder: Path) -> Path:
    """The system's folder: known from the environment, or beside the artifacts."""
    root = os.environ.get("AVOW_SYSTEM_ROOT")
    if root:
        return Path(root)
    for parent in folder.resolve().parents:
        candidate = parent / "contracts" / asked.folder
        if (candidate / asked.subject.file).is_file():
            return candidate
    return folder
