"""Outside tools, and finding them. Asking a program for its version may take a second, so the answer is kept for as
long as the program's file is the same."""

from __future__ import annotations

import functools
import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from avow.base import process
from avow.base.files import write
from avow.base.notes import cache_folder
from avow.tuning.running import VERSION_SECONDS


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool as found on this machine. `version` is None where it is missing; `install` is one command."""

    name: str
    version: str | None
    path: str | None
    install: str
    optional: bool = True
    """Its absence leaves something unasked, but no method without an engine."""

    @property
    def present(self) -> bool:
        return self.version is not None


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


def _version(path: str, arguments: tuple[str, ...], pattern: str) -> str:
    try:
        stat = Path(path).stat()
    except OSError:
        return "unknown"
    key = json.dumps([str(Path(path).resolve()), stat.st_mtime_ns, stat.st_size, arguments, pattern])
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
    try:
        data = json.loads(_file().read_text())
    except (OSError, ValueError):
        return {}
    return {str(k): str(v) for k, v in data.items()} if isinstance(data, dict) else {}


def _remember(key: str, version: str) -> None:
    try:
        write(_file(), json.dumps({**_read(), key: version}))
    except OSError:  # a read-only home costs a second each time, no more
        return
