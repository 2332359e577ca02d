"""Where modules are looked for: never in the folder in which one happens to stand. Imports nothing but the library."""

from __future__ import annotations

import os
import sys


def absolute_only() -> str:
    """PYTHONPATH without entries that mean a place under the folder in which one happens to stand."""
    entries = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return os.pathsep.join(entry for entry in entries if os.path.isabs(entry))  # noqa: PTH117


def leave_here() -> None:
    """Take what such entries put on this process's module path off it, and out of its environment. The folder that
    Avow itself comes from stays."""
    given = os.environ.get("PYTHONPATH")
    if not given:
        return
    relative = {os.path.abspath(entry) for entry in given.split(os.pathsep) if not os.path.isabs(entry)}  # noqa: PTH100, PTH117
    own = os.path.abspath(os.path.join(__file__, "..", "..", ".."))  # noqa: PTH100, PTH118
    sys.path[:] = [place for place in sys.path if os.path.abspath(place) not in relative - {own}]  # noqa: PTH100
    os.environ["PYTHONPATH"] = absolute_only()
