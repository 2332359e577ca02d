"""Avow's own code as an input: after an edit of a translator or checker, every answer that it gave is re-run."""

from __future__ import annotations

import functools
import hashlib
import json
import sys
from pathlib import Path

import avow
from avow.backend_kit.protocol import Backend
from avow.base.files import digest_file, identity, sha256

_ROOMS = (
    "base",
    "isolation",
    "ros",
    "drive",
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
    """Digest of the code behind the answers of the core's own engines."""
    return _digest(_of(_ROOMS))


def backend_digest(tool: Backend) -> str:
    """Digest of the code behind a backend's answers: the core's, and the backend's own package or module."""
    return _digest((*_of(_ROOMS_OF_BACKENDS), *_own(type(tool).__module__)))


def code_mark() -> str:
    """Digest of this package's files as they are on disk now, by their identity: a long-running process imported those
    that were there when it started."""
    return sha256(json.dumps([[str(file), identity(file.stat(), file)] for file in sorted(_PACKAGE.rglob("*.py"))]))


@functools.cache
def reading_digest() -> str:
    """Digest of the code behind what is cached of the nodes' texts: the core's, and this package's."""
    return _digest((*_of(_ROOMS), _PACKAGE / "pipeline"))


def report_digest() -> str:
    """Digest of the code and templates behind a report, given the evidence."""
    return _digest(_of((*_ROOMS_OF_BACKENDS, "assurance", "report", "evidence", "pipeline")))


TRUSTED = {
    "parser and type checker (avow/language)": ("language",),
    "dataflow graph and plan (avow/system, avow/ros)": ("system", "ros"),
    "formulas put together and renamed, clauses with memory as one step (avow/formulas)": ("formulas",),
    "wiring of a system as the kernel is told it (avow/calculus)": (
        "calculus/wiring.py",
        "calculus/variables.py",
        "calculus/chance.py",
        "sanity/claims.py",
    ),
    "which claim an obligation is, and its certificate (avow/calculus)": (
        "calculus/obligations.py",
        "calculus/certificates.py",
        "pipeline/recheck.py",
    ),
    "solvers' processes (avow/solving)": ("solving/apart.py",),
    "digests and files (avow/base)": ("base",),
    "kernel (avow/kernel)": ("kernel",),
    "theorem (kernel.dfy)": ("calculus/proofs/kernel.dfy",),
    "its instances (instances.dfy)": ("calculus/proofs/instances.dfy",),
    "accounting (avow/assurance)": ("assurance",),
}
"""The parts of Avow that must be trusted for a certified claim, and their files."""


@functools.cache
def trusted_parts() -> tuple[tuple[str, str], ...]:
    """Those parts, each with the SHA-256 of its files; of a single file, the file's own."""
    found = []
    for what, rooms in TRUSTED.items():
        places = tuple(_PACKAGE / room for room in rooms)
        single = len(places) == 1 and places[0].is_file()
        found.append((what, digest_file(places[0]) if single else _digest(places)))
    return tuple(found)


@functools.cache
def _of(rooms: tuple[str, ...]) -> tuple[Path, ...]:
    return tuple(_PACKAGE / room for room in rooms)


@functools.cache
def _own(name: str) -> tuple[Path, ...]:
    file = getattr(sys.modules.get(name), "__file__", None)
    if file is None:
        return ()
    path = Path(file)
    return (path.parent,) if path.name == "__init__.py" or path.parent.parent.name == "backends" else (path,)


@functools.cache
def _digest(places: tuple[Path, ...]) -> str:
    total = hashlib.sha256()
    for place in places:
        for part in _parts(place):
            total.update(part)
    return total.hexdigest()


@functools.cache
def _parts(place: Path) -> tuple[bytes, ...]:
    """The names and digests of the files of a package, or of one file."""
    found: list[bytes] = []
    for file in sorted(place.rglob("*")) if place.is_dir() else [place]:
        if "__pycache__" not in file.parts and file.is_file():
            found += [f"{file.relative_to(place.parent)}\0".encode(), hashlib.sha256(file.read_bytes()).digest()]
    return tuple(found)
