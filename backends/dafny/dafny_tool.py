"""Whether Dafny is installed, and its version. Separate from `runner`, as every run needs it and few run Dafny."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import replace

from avow.base.tools import Tool, find_tool, tried

INSTALL = "sudo apt install dafny"

_VERSION = r"\d+\.\d+\.\d+(\.\d+)?"
_MONO = ("/usr/lib/mono", "/etc/mono")


def dafny() -> Tool:
    """The installed Dafny. Never raises."""
    # A normal run prints the version only in the XML; without a file it is in a usage line.
    found = find_tool("dafny", ("/version",), install=INSTALL, pattern=_VERSION, optional=False)
    if found.version == "unknown":
        found = find_tool("dafny", ("--version",), install=INSTALL, pattern=_VERSION, optional=False)
    # Its prover; its runtime, from version 4 on, and before.
    parts = (shutil.which("z3"), shutil.which("dotnet"), *(place for place in _MONO if os.path.isdir(place)))  # noqa: PTH112
    return replace(found, parts=tuple(part for part in parts if part is not None), trial=_trial)


def has_commands(version: str | None) -> bool:
    """Whether this version is called with commands. One that does not report its version is called like 2.3."""
    major = re.match(r"\d+", version or "")
    return major is not None and int(major[0]) >= 4


def _trial() -> str:
    """Verifies a lemma."""
    command = ("dafny", "verify" if has_commands(dafny().version) else "/compile:0", "trial.dfy")
    return tried([command], "trial.dfy", "lemma Half(n: nat) ensures n / 2 <= n { }\n", " verified, 0 errors")
