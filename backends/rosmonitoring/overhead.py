"""The measured cost of monitors on a running robot. It is shown with the evidence, and is no evidence itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Span
from avow.base.files import inside
from avow.system.tables import read_csv

NONE, ALL = "none", "all"
"""Which monitors ran: none, all, or those of the named node."""


@dataclass(frozen=True, slots=True)
class Runs:
    """Runs with the same monitors: their number, and the mean time in seconds at which they reached each place."""

    count: int
    means: tuple[float, ...]

    def against(self, other: Runs, place: int = -1) -> str:
        return f"{100 * (self.means[place] / other.means[place] - 1):+.2f} %"


def overheads(job: Job) -> tuple[str, tuple[Diagnostic, ...]]:
    """The report's text on the cost of the monitors, and the errors in the tables that the plan names."""
    costs: list[str] = []
    wrong: list[Diagnostic] = []
    for at, entry in enumerate(job.options.get("overhead", ())):
        span = job.method.options.at("overhead", at)
        path = inside(job.root, entry["data"])
        try:
            if path is None or not path.is_file():
                raise ValueError("there is no such file in the system's folder")
            costs.append(_summary(entry, _read(path), job.node.name))
        except ValueError as error:
            wrong.append(Diagnostic("MON108", f"overhead: {entry['data']}: {error}", span))
    return "; ".join(costs), tuple(wrong)


def _summary(entry: Mapping[str, Any], found: tuple[tuple[str, ...], Mapping[str, Runs]], node: str) -> str:
    """``55.8 s to the door without monitors, 55.9 s (+0.2 %) with all of them; …``"""
    places, runs = found
    bare = runs[NONE]
    about = f"{entry['how']}, on {entry['machine']}, {entry['date']}"
    parts = [f"{_time(bare.means[-1])} to {places[-1]} without monitors, the mean of {bare.count} runs"]
    for key, words in ((node, "with this node's"), (ALL, "with all of them")):
        if key in runs:
            one = runs[key]
            steps = ", ".join(f"{one.against(bare, k)} {place}" for k, place in enumerate(places[:-1]))
            steps = f"; on the way {steps}" if steps else ""
            parts.append(f"{_time(one.means[-1])} ({one.against(bare)}) {words}, of {one.count}{steps}")
    return f"{about}: {'; '.join(parts)}"


def _time(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 10 else f"{1000 * seconds:.4g} ms"


def _read(path: Path) -> tuple[tuple[str, ...], Mapping[str, Runs]]:
    """The places, and the runs by their monitors. Raises ValueError."""
    table, faults = read_csv(path.stem, path, Span(str(path), 1, 1, 1, 1))
    if table is None:
        raise ValueError("; ".join(fault.message.partition(": ")[2] for fault in faults))
    if table.columns[:1] != ("monitors",) or len(table.columns) < 2:
        raise ValueError("its first column is `monitors`, each other one a place that the robot reaches")
    rows: dict[str, list[tuple[float, ...]]] = {}
    for row in table.rows:
        rows.setdefault(row[0], []).append(tuple(_seconds(cell) for cell in row[1:]))
    if NONE not in rows:
        raise ValueError(f"no run without monitors (`{NONE}`)")
    means = {key: Runs(len(runs), tuple(map(fmean, zip(*runs, strict=True)))) for key, runs in rows.items()}
    return table.columns[1:], means


def _seconds(cell: str) -> float:
    try:
        found = float(cell)
    except ValueError:
        found = math.nan
    if not 0 < found < math.inf:
        raise ValueError(f"{cell[:40]!r} is no number of seconds above 0")
    return found
