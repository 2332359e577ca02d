"""Avow's own code as an input: whoever edits a translator or a checker asks everything anew that it answered."""

from __future__ import annotations

import functools
import hashlib
import sys
from pathlib import Path

import avow
from avow.backend_kit.protocol import Backend

_ROOMS = (
    "base",
    "isolation",
    "language",
    "system",
    "formulas",
    "solving",
    "evaluation",
    "sanity",
    "calculus",
    "kernel",
)
_ROOMS_OF_BACKENDS = (*_ROOMS, "backend_kit")
"""What an answer can depend on. What only renders, records or schedules cannot change one."""

_PACKAGE = Path(avow.__file__).parent


@functools.cache
def engine_digest() -> str:
    """Of the code behind the answers of the core's own engines."""
    return _digest(tuple(_PACKAGE / room for room in _ROOMS))


def backend_digest(tool: Backend) -> str:
    """Of the code behind a backend's answers: the core's, and its own package or module."""
    return _digest((*(_PACKAGE / room for room in _ROOMS_OF_BACKENDS), *_own(tool)))


def _own(tool: Backend) -> tuple[Path, ...]:
    module = sys.modules.get(type(tool).__module__)
    file = getattr(module, "__file__", None)
    if file is None:
        return ()
    path = Path(file)
    return (path.parent,) if path.name == "__init__.py" or path.parent.parent.name == "backends" else (path,)


@functools.cache
def _digest(places: tuple[Path, ...]) -> str:
    total = hashlib.sha256()
    for place in places:
        files = sorted(place.rglob("*")) if place.is_dir() else [place]
        for file in files:
            if "__pycache__" not in file.parts and file.is_file():
                total.update(f"{file.relative_to(place.parent)}\0".encode())
                total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()
