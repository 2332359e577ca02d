"""What `dodo.py` yields: every stage as a doit task. Light, so that a run with nothing to do costs next to nothing;
the stages themselves are in `avow.pipeline.stages`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from avow.base.workspace import Workspace
from avow.pipeline import shortcut
from avow.pipeline.reporter import PipelineReporter
from avow.pipeline.results import note

Task = dict[str, Any]


def config(root: Path) -> dict[str, Any]:
    """DOIT_CONFIG for a workspace. Ends with code 2 where there can be no artifacts."""
    try:
        (root / "artifacts").mkdir(exist_ok=True)
    except OSError as error:
        print(f"error: there can be no artifacts here: {error}", file=sys.stderr)
        raise SystemExit(2) from error
    return {
        "default_tasks": ["verify"],
        "reporter": PipelineReporter,
        # doit's own memory is of no use here, and a run killed while writing it would keep the next one from starting
        "dep_file": ":memory:",
        "backend": "sqlite3",
        "continue": True,
        "num_process": 2,
        "par_type": "thread",
        "verbosity": 2,
    }


def pipeline(root: Path, wanted: Sequence[str] | None = None) -> Iterator[Task]:
    """All tasks for all systems under `root`/contracts; `wanted` are the names of those that will be run (by default,
    as doit's command line has them)."""
    workspace = Workspace(root)
    settled = shortcut.nothing_to_do(workspace, _wanted(sys.argv[1:]) if wanted is None else wanted)
    if settled is not None:
        for result in settled:
            action = partial(note, result, gated=True)
            yield {"basename": "verify", "name": result.system, "actions": [action], "uptodate": [False]}
        return
    from avow.pipeline.stages import stages

    yield from stages(workspace)


def _wanted(arguments: Sequence[str]) -> tuple[str, ...]:
    """The tasks that doit is asked to run; empty for anything that is not plainly a run."""
    names: list[str] = []
    rest = list(arguments[1:] if arguments[:1] == ["run"] else arguments)
    while rest:
        word = rest.pop(0)
        if word in ("-n", "--process", "-P", "--parallel-type"):
            rest[:1] = []
        elif word.startswith("-n") or word in ("-c", "--continue"):
            continue
        elif word.startswith("-") or "=" in word:
            return ()
        else:
            names.append(word)
    return tuple(names) or ("verify",)
