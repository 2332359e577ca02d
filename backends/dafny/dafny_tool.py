"""Is Dafny here, and in which version? Apart from `runner`, as every run asks and few run it."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace

from avow.base.tools import Tool, find_tool

INSTALL = "apt-get install dafny"

_MONO = ("/usr/lib/mono", "/etc/mono")


def dafny() -> Tool:
    """Dafny as found now. Never raises."""
    # Any run prints its version in the XML only; without a file it says it in a usage line.
    found = find_tool("dafny", ("/version",), install=INSTALL, pattern=r"\d+\.\d+\.\d+(\.\d+)?")
    if found.version == "unknown":
        found = find_tool("dafny", ("--version",), install=INSTALL, pattern=r"\d+\.\d+\.\d+(\.\d+)?")
    # Its prover; what runs it, from version 4 on, and before.
    parts = (shutil.which("z3"), shutil.which("dotnet"), *(place for place in _MONO if os.path.isdir(place)))  # noqa: PTH112
    return replace(found, parts=tuple(part for part in parts if part is not None))
