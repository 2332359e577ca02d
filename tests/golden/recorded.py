"""Compares what a test finds with the lines recorded beside this file, or records them anew (AVOW_REFRESH=1)."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

HERE = Path(__file__).parent


def same(name: str, found: Iterable[str], sampled: bool = False) -> None:
    """The lines found are those recorded; a sample's lines are recorded among others, under what stands before `:`."""
    path, lines = HERE / f"{name}.txt", list(found)
    recorded = path.read_text("utf-8").splitlines() if path.exists() else []
    if sampled:
        names = {line.partition(":")[0] for line in lines}
        recorded = [line for line in recorded if line.partition(":")[0] in names]
    changed = list(difflib.unified_diff(recorded, lines, "recorded", "found", n=0, lineterm=""))
    if os.environ.get("AVOW_REFRESH") and not sampled:
        path.write_text("".join(f"{line}\n" for line in lines), "utf-8")
    else:
        assert not changed, "\n".join(changed)


def verdicts(report: Path) -> Iterator[str]:
    case = json.loads(report.read_text("utf-8"))
    yield f"{case['system']}: {case['answers']['verdict']} [exit code {case['exit_code']}]"
    for view in case["obligations"]:
        asked = view["obligation"]
        counting = [each["entry"]["evidence"] for each in view["evidence"] if each["counts"]]
        methods = sorted(f"{record['method']} {record['verdict']}" for record in counting)
        place = "/".join(asked[part] for part in ("node", "kind", "name"))
        changed = "" if view["standing"] == view["status"] else f" (all considered: {view['standing']})"
        yield f"  {place}: {view['status']}{changed} <- {', '.join(methods) or 'nothing'}"
