"""What one run of the pipeline is called, and whether it may believe earlier ones."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from avow.base.records import dataclass
from avow.isolation.level import SANDBOX
from avow.pipeline.beside import Beside
from avow.pipeline.forks import Forks

if TYPE_CHECKING:
    from avow.pipeline.executors import Elsewhere
    from avow.pipeline.recheck import Checked

EXPLAIN = "AVOW_EXPLAIN"
"""Environment variable that makes gates say what they lack (`avow verify --explain` sets it)."""

FRESH = "AVOW_FRESH"
"""Environment variable that makes a run settle everything anew (`avow verify --fresh` sets it)."""


SECONDS = "AVOW_SECONDS"
"""Environment variable with the time for one question, in place of the plan's (`avow verify --seconds` sets it)."""

KEY = "AVOW_KEY"
"""Environment variable with a private key's file: reports' attestations are signed with it (`avow verify --key`)."""

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
    """A run: its identity, as evidence records name it, and what it found out so far."""

    id: str
    fresh: bool
    """It settles everything anew."""
    begun: float = field(default_factory=time.monotonic, compare=False)
    elsewhere: Elsewhere | None = field(default=None, compare=False, repr=False)
    """Where it sends works; none: it does all on this machine."""
    forks: Forks = field(default_factory=Forks, compare=False, repr=False)
    """Where it does works on this machine."""
    beside: Beside = field(default_factory=Beside, compare=False, repr=False)
    """Where it generates methods' files."""
    checked: dict[Path, Checked] = field(default_factory=dict, compare=False, repr=False)
    """System's folder → what the kernel established again of it."""

    @property
    def offered(self) -> Mapping[str, tuple[str, str]] | None:
        """The tools of the machines that works are sent to, as `Elsewhere` has them."""
        return self.elsewhere.tools if self.elsewhere else None

    @property
    def seconds(self) -> float:
        """Wall-clock seconds since it began."""
        return time.monotonic() - self.begun


def signing_key() -> Path | None:
    """The private key that signs attestations, if there is one."""
    name = os.environ.get(KEY, "")
    return Path(name).absolute() if name else None


def asked_of_runs(*, fresh: bool, explain: bool, sandbox: bool, seconds: float | None) -> None:
    """Let the runs of this process be as the options of `avow verify` say; `seconds` is the time for one question."""
    wanted = {FRESH: "1" if fresh else "", EXPLAIN: "1" if explain else "", SANDBOX: "required" if sandbox else ""}
    os.environ.update({name: value for name, value in wanted.items() if value})
    if seconds is not None:
        os.environ[SECONDS] = str(seconds)


def sign_with(key: object) -> None:
    """Let this run sign its attestations: with the key given (a path), else with that of the environment. Raises
    Rejected for one that cannot be used, before anything is done."""
    from avow.evidence.signing import private_key

    if isinstance(key, Path):
        os.environ[KEY] = str(key.absolute())
    found = signing_key()
    if found is not None:
        private_key(found)


def new_run(elsewhere: Elsewhere | None = None) -> Run:
    """A run that begins now, in this process."""
    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    return Run(f"{now}-{os.getpid()}", os.environ.get(FRESH, "") not in ("", "0"), elsewhere=elsewhere)
