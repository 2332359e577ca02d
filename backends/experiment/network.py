"""The columns that a neural network adds to a table: its outputs for each row's inputs, in float32 by onnxruntime."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.given import existing_file
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.plain import decimal, exact
from avow.base.records import dataclass
from avow.base.tools import onnxruntime_tool

from .table import Row, Table


class Missing(Exception):  # noqa: N818 - it says what is missing
    """onnxruntime is not installed; the text says how to install it."""


@dataclass(frozen=True, slots=True)
class Input:
    """An input of the network is `scale` times the column plus `offset`."""

    column: str
    scale: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)


def with_outputs(job: Job, table: Table, run: bool) -> Table:
    """The table with a column for each output of the plan's network. Without `run` these columns hold an example each:
    reports of faults must not wait for a network. Raises Rejected with all faults, and Missing."""
    option = job.options["network"]
    found: list[Diagnostic] = []
    path = None
    try:
        path = existing_file(job, "network", option["file"], wrong="EXP101", absent="EXP102")
    except Rejected as rejected:
        found += rejected.diagnostics
    inputs = [_input(entry) for entry in option["inputs"]]
    found += [fault for one in inputs if (fault := table.confused(one.column)) is not None]
    outputs: Mapping[str, Any] = option["outputs"]
    for name in outputs.keys() & set(table.columns):
        found.append(table.fault(1, "EXP112", f"the column '{name}' is that of an output of the network, too"))
    if found or path is None:
        raise Rejected(*found)
    cells = (
        _run(job, path, table, inputs, outputs)
        if run
        else ({n: _example(o) for n, o in outputs.items()},) * len(table.rows)
    )
    rows = tuple(replace(row, cells={**row.cells, **more}) for row, more in zip(table.rows, cells, strict=True))
    return replace(table, columns=(*table.columns, *outputs), rows=rows)


def _run(
    job: Job, path: Path, table: Table, inputs: Sequence[Input], outputs: Mapping[str, Any]
) -> Iterator[dict[str, str]]:
    tool = onnxruntime_tool()
    if not tool.present:
        raise Missing(f"onnxruntime is missing: {tool.install}")
    from avow.backend_kit.network import Session  # slow to import

    try:
        session = Session(path)
    except Exception as error:  # onnxruntime has many kinds
        raise Rejected(_fault(job, f"{path.name} cannot be loaded: {' '.join(str(error).split())}")) from None
    wanted = math.prod(session.shape)
    if wanted != len(inputs):
        raise Rejected(_fault(job, f"{path.name} has {wanted} inputs, and {len(inputs)} are given"))
    found, rows = [], []
    for row in table.rows:
        point = [_number(row, one) for one in inputs]
        values = [] if None in point else session.outputs([value for value in point if value is not None])
        if not values or not all(map(math.isfinite, values)):
            column = next((one.column for one, value in zip(inputs, point, strict=True) if value is None), "")
            why = (
                f"'{row.cells[column]}' in column '{column}' is no number"
                if column
                else "an output of the network is no number"
            )
            found.append(table.fault(row.line, "EXP113", why))
            continue
        try:
            rows.append({name: _cell(output, values) for name, output in outputs.items()})
        except IndexError:
            raise Rejected(_fault(job, f"{path.name} has {len(values)} outputs, from 0 to {len(values) - 1}")) from None
    if found:
        raise Rejected(*found)
    return iter(rows)


def _input(entry: Any) -> Input:
    if isinstance(entry, str):
        return Input(entry)
    return Input(entry["column"], Fraction(str(entry.get("scale", 1))), Fraction(str(entry.get("offset", 0))))


def _number(row: Row, one: Input) -> float | None:
    try:
        return float(one.scale * exact(row.cells[one.column]) + one.offset)
    except (ValueError, OverflowError):
        return None


def _cell(output: Any, values: Sequence[float]) -> str:
    match output:
        case {"argmax": members}:
            first = output.get("from", 0)
            scores = [values[first + k] for k in range(len(members))]
            return str(members[scores.index(max(scores))])
        case {"index": index, "threshold": least}:
            return "true" if Fraction(values[index]) >= Fraction(str(least)) else "false"
    value = Fraction(values[output])
    return decimal(value) or str(value)


def _example(output: Any) -> str:
    match output:
        case {"argmax": members}:
            return str(members[0])
        case {"threshold": _}:
            return "false"
    return "0"


def _fault(job: Job, message: str) -> Diagnostic:
    return Diagnostic("EXP101", message, job.method.options.at("network"))
