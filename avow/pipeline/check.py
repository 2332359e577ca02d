"""The check stage, and how it reports what is wrong with contract and plan."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path

from doit.exceptions import TaskError

from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.files import digest_file
from avow.base.notes import read_note, write_note
from avow.base.plain import count
from avow.base.records import dataclass
from avow.base.rendering import printable, render
from avow.base.tuning.shown import WARNINGS
from avow.base.workspace import Workspace
from avow.pipeline import export as exporting
from avow.pipeline.plan_check import diagnostics, left_out
from avow.pipeline.state import task_name
from avow.pipeline.workload import Survey


@dataclass(frozen=True, slots=True)
class Checked:
    """The input of the last check, and the keys of the methods without a finding."""

    key: str
    clean: tuple[str, ...]


def is_current(workspace: Workspace, surveyed: Survey) -> bool:
    stamp = read_note(Checked, _stamp(workspace, surveyed))
    return stamp is not None and stamp.key == _key(surveyed)


def check(workspace: Workspace, surveyed: Survey) -> None:
    """Raises Rejected with all errors; the first few warnings go to the terminal. A method without a finding is not
    checked again while its slice is the same, if the result depends on nothing else."""
    keys = {(w.node, w.method): exporting.key(w) for w in surveyed.catalogue.works if not w.is_engine and w.is_portable}
    before = read_note(Checked, _stamp(workspace, surveyed))
    known = set(before.clean) if before is not None else set()
    clean = {name for name, key in keys.items() if key in known}
    found = diagnostics(surveyed.system, clean, surveyed.shelf)
    if surveyed.shelf is not None:
        surveyed.shelf.keep()
    if any(d.is_error for d in found):
        raise Rejected(*found)
    _tell(workspace, surveyed.system.name, found)
    kept = tuple(sorted(keys[name] for name in clean if name in keys))
    write_note(_stamp(workspace, surveyed), Checked(_key(surveyed), kept))


def _tell(workspace: Workspace, system: str, found: Iterable[Diagnostic]) -> None:
    """The first few warnings, a line each: `avow check` shows all of it, with the source."""
    warned = [d for d in found if d.severity is Severity.WARNING]
    for d in warned[:WARNINGS]:
        place = f"{workspace.relative(Path(d.span.file))}:{d.span.line}: " if d.span else ""
        print(printable(f"warning[{d.code}]: {place}{d.message}"), file=sys.stderr)
    if len(warned) > WARNINGS:
        print(f"and {count(len(warned) - WARNINGS, 'more warning')}: `avow check {system}`", file=sys.stderr)


def show(found: Iterable[Diagnostic]) -> None:
    text = render(tuple(found))
    if text:
        print(text, file=sys.stderr)


def refuse(rejected: Rejected) -> TaskError:
    show(rejected.diagnostics)
    return TaskError(f"{sum(d.is_error for d in rejected.diagnostics)} error(s) in the input")


def refuse_quietly(name: str) -> TaskError:
    return TaskError(f"{name} cannot be read; see check:{task_name(name)}")


def _stamp(workspace: Workspace, surveyed: Survey) -> Path:
    return workspace.artifacts / surveyed.system.name / "check.json"


def _key(surveyed: Survey) -> str:
    keys = sorted(key for work in surveyed.catalogue.works for key in work.keys.values())
    plan = surveyed.system.plan
    graph = plan.model.data.get("graph") if isinstance(plan.model.data, dict) else None
    # No obligation depends on the ROS graph, or on plans that are not included: only this stage reads them.
    beside = [str(found.span) for found in left_out(surveyed.system)]
    return json.dumps([surveyed.digest, digest_file(plan.root / str(graph)) if graph else "", keys, beside])
