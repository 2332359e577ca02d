"""What `dodo.py` yields: every stage as a doit task. Light, so that a run with nothing to do costs next to nothing;
the stages themselves are in `avow.pipeline.stages`."""

from __future__ import annotations

import gc
import os
import resource
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from avow.base.module_path import leave_here
from avow.base.suggestions import did_you_mean
from avow.base.tuning.running import BYTE_CODE_ROOM, COLLECTED
from avow.base.workspace import Workspace
from avow.pipeline.reporter import reporter_of
from avow.pipeline.run_info import new_run
from avow.pipeline.settings import FRESH
from avow.pipeline.state import State

if TYPE_CHECKING:
    from avow.pipeline.remote import Remote

Task = dict[str, Any]


class Pipeline:
    """A run of the pipeline in one workspace, for `dodo.py` and for commands.

    `asked` is doit's command line without the program's name: if it asks for verification only, a run with nothing to
    do reads no contract. `answer` gets the results as JSON; all else goes to standard error then. `remote` executes the
    jobs that can run on other machines.
    """

    def __init__(
        self, root: Path, asked: Sequence[str], answer: IO[str] | None = None, remote: Remote | None = None
    ) -> None:
        leave_here()
        sys.dont_write_bytecode = not _has_room()  # else a container's run compiles all of it every time
        gc.set_threshold(COLLECTED)  # a run's objects mostly stay alive, so collections find little
        if _runs(asked) and not {"-a", "--always-execute"}.isdisjoint(asked):
            os.environ[FRESH] = "1"  # use no earlier run: otherwise each stage would find nothing to do
        if asked and asked[0] in _OF_MEMORY:
            print(f"doit keeps no memory here for `{asked[0]}`: the ledger says what is settled.", file=sys.stderr)
            print("`doit -a` (`avow verify --fresh`) settles everything anew.", file=sys.stderr)
            raise SystemExit(2)
        self._state = State(Workspace(root), new_run(remote), answer=answer)
        self._wanted = wanted(asked)
        for name in self._wanted[1:]:  # `doit verify NAME`
            if (self._state.workspace.contracts / name).is_dir():
                print(f"error: {name} is a system, and no task: write `doit verify:{name}`", file=sys.stderr)
                raise SystemExit(2)

    def config(self) -> dict[str, Any]:
        """DOIT_CONFIG for the workspace. Exits with code 2 if the artifacts' folder cannot be written."""
        try:
            self._state.workspace.artifacts.mkdir(exist_ok=True)
        except OSError as error:
            print(f"error: there can be no artifacts here: {error}", file=sys.stderr)
            raise SystemExit(2) from error
        return {
            "default_tasks": ["verify"],
            "reporter": reporter_of(self._state),
            # doit's own memory is of no use, and a run killed while writing it would keep the next one from starting
            "dep_file": ":memory:",
            "backend": "sqlite3",
            "continue": True,
            "num_process": 2,
            "par_type": "thread",
            "verbosity": 2,
            **({"outfile": sys.stderr} if self._state.answer else {}),
        }

    def tasks(self) -> Iterator[Task]:
        """All tasks for all systems under contracts/."""
        state = self._state
        settled = state.shortcut.nothing_to_do(self._wanted)
        if settled is not None:
            for result in settled:
                action = partial(state.results.note, result, gated=True)
                yield {"basename": "verify", "name": result.system, "actions": [action], "uptodate": [False]}
            return
        from avow.backend_kit.registry import trust_plugins
        from avow.pipeline.stages import stages

        if any(name.partition(":")[0] not in ("report", "check") for name in self._wanted) or not self._wanted:
            trust_plugins()

        made: set[str] = set()
        for task in stages(state):
            made |= {task["basename"], f"{task['basename']}:{task['name']}"}
            yield task
        own = vars(sys.modules.get("dodo", sys))  # dodo.py may have tasks of its own
        for name in self._wanted if _runs(self._wanted) else ():
            known = name in made or f"task_{name.partition(':')[0]}" in own or "*" in name
            if not known and (hint := did_you_mean(name, made)):  # any other name may be a file
                print(f"there is no task {name}: {hint}", file=sys.stderr)
                raise SystemExit(2)


def _has_room() -> bool:
    """Whether byte code can be kept: on a full disk Python writes half of a file unnoticed and fails on it later."""
    place = os.statvfs(Path(__file__).parent)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return limit == resource.RLIM_INFINITY and place.f_bavail * place.f_frsize > BYTE_CODE_ROOM


_OF_MEMORY = ("forget", "ignore", "reset-dep", "dumpdb")
"""doit's commands about its own memory of executed tasks."""


def _runs(asked: Sequence[str]) -> bool:
    """Whether doit's command runs tasks, as it does if none is named."""
    first = next((word for word in asked if not word.startswith("-")), "run")
    return first not in ("list", "info", "clean", "forget", "help", "ignore", "dumpdb", "strace", "auto", "reset-dep")


def execute(
    root: Path, tasks: Sequence[str], jobs: int = 2, answer: IO[str] | None = None, remote: Remote | None = None
) -> int:
    """Run tasks of a workspace as doit does, in its folder; the exit code. `answer`, `remote`: as `Pipeline` has
    them."""
    from doit.cmd_base import ModuleTaskLoader
    from doit.doit_cmd import DoitMain

    os.chdir(root)
    asked = ["run", "-n", str(jobs), *tasks]
    run = Pipeline(root, asked, answer, remote)
    return int(DoitMain(ModuleTaskLoader({"DOIT_CONFIG": run.config(), "task_avow": run.tasks})).run(asked) or 0)


def wanted(arguments: Sequence[str]) -> tuple[str, ...]:
    """The tasks that doit is to run; empty for a command line that is not plainly a run."""
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
