"""The degrees of isolation of a program under test from its judge and from this machine."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from avow.base.verdict import Isolation

SANDBOX = "AVOW_SANDBOX"
"""Environment: ``required`` (`avow verify --sandbox`) runs programs sealed or not at all, ``off`` never seals them.
Otherwise they are sealed if this machine can."""


class Unavailable(Exception):  # noqa: N818 - it names a state
    """A sandbox is required, and there is none on this machine; the message says how to get one."""


def wanted() -> Isolation | None:
    """The level that the user requested; None: the best available."""
    match os.environ.get(SANDBOX, ""):
        case "required":
            return Isolation.SEALED
        case "off":
            return Isolation.PROCESSES
        case _:  # unset, or an unknown word
            return None


def available() -> Isolation:
    """The level at which a program runs here and now. Raises Unavailable."""
    match wanted():
        case Isolation.PROCESSES:
            return Isolation.PROCESSES
        case Isolation.SEALED if not seals():
            raise Unavailable("a sandbox is required, but bubblewrap does not run here (apt install bubblewrap)")
        case _:  # as requested, or the best that this machine can
            return Isolation.SEALED if seals() else Isolation.PROCESSES


@functools.cache
def seals() -> bool:
    """Whether bubblewrap works: tested by running it, as a container may forbid namespaces."""
    if sys.platform != "linux" or shutil.which("bwrap") is None:
        return False
    try:
        command = sealed(["true"])
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def sealed(command: Sequence[str], *writable: Path) -> list[str]:
    """The command within a sandbox: it can write only into the folders `writable`, and has no network and no other
    processes. All files are readable: an answer must not depend on what a sandbox hides."""
    options = ["--unshare-all", "--die-with-parent", "--new-session", "--ro-bind", "/", "/", "--dev", "/dev"]
    options += ["--proc", "/proc"]
    for folder in writable:
        options += ["--bind", str(folder), str(folder)]
    return [shutil.which("bwrap") or "bwrap", *options, "--", *command]
