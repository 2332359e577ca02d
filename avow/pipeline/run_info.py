"""What one run of the pipeline is called, and whether it may believe earlier ones."""

from __future__ import annotations

import functools
import os
import time
from dataclasses import dataclass
from datetime import UTC, datetime

EXPLAIN = "AVOW_EXPLAIN"
"""Environment variable that makes gates say what they lack (`avow verify --explain` sets it)."""

FRESH = "AVOW_FRESH"
"""Environment variable that makes a run settle everything anew (`avow verify --fresh` sets it)."""


@dataclass(frozen=True, slots=True)
class Run:
    id: str
    fresh: bool


@functools.cache
def this_run() -> Run:
    """The run of this process."""
    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    return Run(f"{now}-{os.getpid()}", os.environ.get(FRESH, "") not in ("", "0"))


_started = time.monotonic()


def seconds_so_far() -> float:
    """Wall-clock seconds since this process loaded the pipeline."""
    return time.monotonic() - _started
