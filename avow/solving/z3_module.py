"""Z3, imported at first use: most readers of obligations never use it, and its import is slow."""

from __future__ import annotations

import ctypes
import importlib
import sys
from typing import Any

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Names of glibc's options, from its malloc.h."""


def _keep_memory() -> None:
    """Have the C library keep freed memory, up to 256 MB, for later requests.

    Every Z3 context takes 16 MB for its tables and frees them. glibc would return them to the system each time, and the
    fresh, zeroed pages of the next context would cost several times as much as the context itself.
    """
    if sys.platform != "linux":
        return
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # another C library
        return
    mallopt(_MMAP_THRESHOLD, 32 << 20)
    mallopt(_TRIM_THRESHOLD, 256 << 20)


class _Later:
    def __init__(self) -> None:
        self._used = False

    def __getattr__(self, name: str) -> Any:
        if not self._used:
            self._used = True
            _keep_memory()
        value = getattr(importlib.import_module("z3"), name)
        setattr(self, name, value)
        return value


z3: Any = _Later()
