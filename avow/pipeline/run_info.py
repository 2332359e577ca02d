"""A run of the pipeline: its name, and what it shares between stages."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from avow.pipeline.settings import FRESH

if TYPE_CHECKING:
    from avow.pipeline.processes import Processes
    from avow.pipeline.recheck import Checked
    from avow.pipeline.remote import Remote


@dataclass(frozen=True)
class Run:
    """A run: its identity, as evidence records name it, and its cached findings."""

    id: str
    fresh: bool
    """It re-runs everything."""
    begun: float = field(default_factory=time.monotonic, compare=False)
    remote: Remote | None = field(default=None, compare=False, repr=False)
    """Where it sends jobs; none: it executes all on this machine."""
    checked: dict[Path, Checked] = field(default_factory=dict, compare=False, repr=False)
    """System's folder → what the kernel re-established for it."""

    @property
    def offered(self) -> Mapping[str, tuple[str, str]] | None:
        """The tools of the machines that jobs are sent to, as `Remote` has them."""
        return self.remote.tools if self.remote else None

    @functools.cached_property
    def processes(self) -> Processes:
        """For its jobs on this machine."""
        from avow.pipeline.processes import Processes  # a run with nothing to do needs none

        return Processes()

    def close(self) -> None:
        """Every job is done."""
        if "processes" in vars(self):
            self.processes.close()

    @property
    def seconds(self) -> float:
        """Wall-clock seconds since it began."""
        return time.monotonic() - self.begun


def new_run(remote: Remote | None = None) -> Run:
    """A run that begins now, in this process."""
    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    return Run(f"{now}-{os.getpid()}", os.environ.get(FRESH, "") not in ("", "0"), remote=remote)


def today() -> date:
    """The day by which what expires is judged."""
    return datetime.now().astimezone().date()
