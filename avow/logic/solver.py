"""Z3, imported when it is first used: most of what reads obligations never asks it, and its import takes a while."""

from __future__ import annotations

import importlib
from typing import Any


class _Later:
    def __getattr__(self, name: str) -> Any:
        value = getattr(importlib.import_module("z3"), name)
        setattr(self, name, value)
        return value


z3: Any = _Later()
