"""A run's settings in the environment, and how the commands set them."""

from __future__ import annotations

import os
from pathlib import Path

from avow.isolation.level import SANDBOX

EXPLAIN = "AVOW_EXPLAIN"
"""Environment variable that makes gates explain what they lack (`avow verify --explain` sets it)."""

FRESH = "AVOW_FRESH"
"""Environment variable that makes a run repeat everything (`avow verify --fresh` sets it)."""

SECONDS = "AVOW_SECONDS"
"""Environment variable with the time for one question, in place of the plan's (`avow verify --seconds` sets it)."""

KEY = "AVOW_KEY"
"""Environment variable with a private key's file: reports' attestations are signed with it (`avow verify --key`)."""

ON = "AVOW_ON"
"""Environment variable with the cluster that jobs are sent to (`avow verify --on` sets it)."""


def asked_seconds() -> float | None:
    """The value of `SECONDS`; None if it is no time."""
    try:
        seconds = float(os.environ.get(SECONDS, ""))
    except ValueError:
        return None
    return seconds if 0 < seconds < float("inf") else None


def signing_key() -> Path | None:
    """The private key that signs attestations, if there is one."""
    name = os.environ.get(KEY, "")
    return Path(name).absolute() if name else None


def asked_of_runs(*, fresh: bool, explain: bool, sandbox: bool, seconds: float | None) -> None:
    """Apply the options of `avow verify` to the runs of this process; `seconds` is the time for one question."""
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
