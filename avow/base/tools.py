"""Outside tools, and finding them. Asking a program for its version may take a second, so the answer is kept for as
long as all that the program is made of is the same."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from avow.base import process
from avow.base.files import sha256
from avow.base.notes import cache_folder, read_note, write_note
from avow.base.programs import kept_digest, program_digest
from avow.base.records import dataclass
from avow.base.tuning.running import VERSION_SECONDS


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool as found on this machine. `version` is None where it is missing; `install` is one command."""

    name: str
    version: str | None
    path: str | None
    install: str
    optional: bool = True
    """Its absence leaves something unasked, but no method without an engine."""
    package: str = ""
    """The Python package that it is, where it is no program of its own."""
    parts: tuple[str, ...] = ()
    """Further programs that it runs, and folders that it is made of."""

    @property
    def present(self) -> bool:
        return self.version is not None

    @property
    def places(self) -> tuple[str, ...]:
        """All that its key covers."""
        return (self.path, *self.parts) if self.path is not None else ()


def z3_tool() -> Tool:
    """The solver that Avow brings along."""
    return Tool("z3", package_version("z3-solver"), None, "pip install z3-solver", optional=False, package="z3")


@functools.cache
def find_tool(
    name: str,
    arguments: Sequence[str] = ("--version",),
    *,
    install: str,
    pattern: str = r"\d+(\.\d+)+",
    optional: bool = True,
) -> Tool:
    """The program `name` on the PATH, with its version ("unknown" where it says none). Never raises."""
    path = shutil.which(name)
    if path is None:
        return Tool(name, None, None, install, optional)
    return Tool(name, _version(path, tuple(arguments), pattern), path, install, optional)


@functools.cache
def package_version(name: str) -> str:
    """Of an installed distribution. Raises `importlib.metadata.PackageNotFoundError`."""
    from importlib import metadata  # slow to import

    return metadata.version(name)


@functools.cache
def package_digest(name: str) -> str:
    """SHA-256 of all files of an installed top-level package, byte code aside; empty where there is none. Nothing is
    imported. Kept, one for each environment."""
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        return ""
    place = os.path.normpath(spec.submodule_search_locations[0])
    walked = (walk for walk in os.walk(place) if not walk[0].endswith("__pycache__"))
    files = sorted(os.path.join(folder, name) for folder, _, names in walked for name in names)  # noqa: PTH118 - many
    return kept_digest(f"package-{name}-{sha256(place)[:12]}", {file[len(place) + 1 :]: file for file in files})


LIBRARIES = ("z3", "cvc5", "lark", "yaml")
"""Packages by which any answer may come about: solvers, of which the second need not be there, and readers of texts."""


@functools.cache
def libraries() -> str:
    """Those of this machine, each by digest: part of every key. Nothing is imported."""
    return ", ".join(f"{name} {package_digest(name) or 'missing'}" for name in LIBRARIES)


def _version(path: str, arguments: tuple[str, ...], pattern: str) -> str:
    key = json.dumps([str(Path(path).resolve()), program_digest((path,)), arguments, pattern])
    known = _read()
    if key in known:
        return known[key]
    try:
        done = process.run([path, *arguments], seconds=VERSION_SECONDS)
    except (process.ToolMissing, OSError):
        return "unknown"
    found = re.search(pattern, done.stdout + "\n" + done.stderr)
    version = found.group(0) if found else "unknown"
    if not done.timed_out:
        _remember(key, version)
    return version


def _file() -> Path:
    return cache_folder() / "tools.json"


def _read() -> dict[str, str]:
    return read_note(dict[str, str], _file()) or {}


def _remember(key: str, version: str) -> None:
    with contextlib.suppress(OSError):  # a read-only home costs a second each time, no more
        write_note(_file(), {**_read(), key: version})
