"""What one run of the pipeline is called, and whether it may believe earlier ones."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime

EXPLAIN = "AVOW_EXPLAIN"
"""Environment variable that makes gates say what they lack (`avow verify --explain` sets it)."""

FRESH = "AVOW_FRESH"
"""Environment variable that makes a run settle everything anew (`avow verify --fresh` sets it)."""


SECONDS = "AVOW_SECONDS"
"""Environment variable with the time for one question, in place of the plan's (`avow verify --seconds` sets it)."""

ON = "AVOW_ON"
"""Environment variable with the cluster that works are sent to (`avow verify --on` sets it)."""


def asked_seconds() -> float | None:
    """What `SECONDS` says; None where it says nothing that is a time."""
    try:
        seconds = float(os.environ.get(SECONDS, ""))
    except ValueError:
        return None
    return seconds if 0 < seconds < float("inf") else None


@dataclass(frozen=True, slots=True)
class Run:
    """The identity of a run, as evidence records name it."""

    id: str
    fresh: bool
    """It settles everything anew."""
    begun: float = field(default_factory=time.monotonic, compare=False)

    @property
    def seconds(self) -> float:
        """Wall-clock seconds since it began."""
        return time.monotonic() - self.begun


def new_run() -> Run:
    """A run that begins now, in this process."""
    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    return Run(f"{now}-{os.getpid()}", os.environ.get(FRESH, "") not in ("", "0"))
