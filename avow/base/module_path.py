"""Keeps the working folder off the module path. Imports only the standard library."""

from __future__ import annotations

import builtins
import importlib.util
import os
import sys


def absolute_only() -> str:
    """PYTHONPATH without entries relative to the working folder."""
    entries = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return os.pathsep.join(entry for entry in entries if os.path.isabs(entry))  # noqa: PTH117


def is_led_here() -> bool:
    """Whether modules other than Avow's own would be found in the working folder."""
    here, own = os.path.realpath(os.curdir), os.path.realpath(_OWN)
    return here != own and here in map(os.path.realpath, sys.path)


_OWN = os.path.join(__file__, "..", "..", "..")  # noqa: PTH118
"""The folder that Avow itself comes from."""


def leave_here() -> None:
    """Remove such entries from this process's module path and environment. The folder that Avow itself comes from
    stays."""
    given = os.environ.get("PYTHONPATH")
    if not given:
        return
    relative = {os.path.abspath(entry) for entry in given.split(os.pathsep) if not os.path.isabs(entry)}  # noqa: PTH100, PTH117
    own = os.path.abspath(_OWN)  # noqa: PTH100
    sys.path[:] = [place for place in sys.path if os.path.abspath(place) not in relative - {own}]  # noqa: PTH100
    os.environ["PYTHONPATH"] = absolute_only()
    keep_z3()


def keep_z3() -> None:
    """Make Z3's module load the library that came with it. By default it searches the working folder first, then the
    PATH."""
    spec = importlib.util.find_spec("z3")
    for place in (spec.submodule_search_locations if spec is not None else None) or ():
        here = os.path.abspath(place)  # noqa: PTH100
        beside = [os.path.join(here, "lib"), here, os.path.join(sys.prefix, "lib")]  # noqa: PTH118
        setattr(builtins, "Z3_LIB_DIRS", beside)  # noqa: B010 - Z3's own name for it, which no type knows
