"""A run of the pipeline, as an object: what its tasks and its reporter share. Light: an idle run needs it too."""

from __future__ import annotations

import re
from dataclasses import field
from typing import IO, TYPE_CHECKING
from urllib.parse import unquote

from avow.base.records import dataclass
from avow.base.workspace import Workspace
from avow.pipeline.results import Results
from avow.pipeline.run_info import Run, new_run
from avow.pipeline.shortcut import Shortcut

if TYPE_CHECKING:
    from avow.assurance.model import Case
    from avow.pipeline.workload import Survey


@dataclass(slots=True)
class State:
    """The state of a run of one workspace."""

    workspace: Workspace
    run: Run = field(default_factory=new_run)
    results: Results = field(default_factory=Results)
    surveyed: list[Survey] = field(default_factory=list)
    """Every system that could be read; none if nothing had to be read."""
    changed: list[str] = field(default_factory=list)
    """The systems whose report was written anew."""
    cases: dict[str, Case] = field(default_factory=dict)
    """System → the case of its report, where this run wrote it."""
    certified: dict[str, str] = field(default_factory=dict)
    """System → what the kernel re-established in this run, in words."""
    read: bool = False
    """Contracts were read: the run had something to do."""
    answer: IO[str] | None = None
    """Where the run's results go as JSON, if requested; text for people goes to standard error then."""
    shortcut: Shortcut = field(init=False)

    def __post_init__(self) -> None:
        self.shortcut = Shortcut(self.workspace)


def task_name(folder: str) -> str:
    """A folder's name as part of a task's: doit would reject all tasks for one ``=``, and ``:`` separates names."""
    return re.sub("[%:=]", lambda found: f"%{ord(found[0]):02X}", folder)


def system_of(task: str) -> str:
    """The system or folder of a task, from the task's name; empty for a task of all systems."""
    return unquote(task.partition(":")[2].partition(":")[0])
