"""What a program under test was observed to use: files that it read, files that it looked for in vain, folders that it
listed.

Programs read files that no plan declares. So the observed inputs are part of what an answer depends on: a record is
current only while each of them is unchanged.

In a record each is a row, as there may be thousands.
"""

from __future__ import annotations

import json
import os
import re
import site
import stat
import sys
import sysconfig
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from avow.base.files import digest_file, identity, sha256
from avow.base.module_path import absolute_only
from avow.base.process import HOME_PREFIX
from avow.base.tuning.sizes import FOLDED


class Seen(StrEnum):
    """The kind of later comparison."""

    READ = "read"
    """A file; the digest is of its bytes."""
    MISSING = "missing"
    """A missing file. The digest is empty."""
    LISTING = "listing"
    """A folder; the digest is of the names in it."""
    FOLDER = "folder"
    """Everything directly in a folder: names, kinds, and the bytes of files. It replaces many rows (`folded`)."""
    STATE = "state"
    """Metadata was read: kind, size and mode."""
    KIND = "kind"
    """Its existence, its kind (file, folder, link), and a link's target."""
    MODULES = "modules"
    """The initial module path; the digest covers PYTHONPATH and the files that extend it (`_modules`)."""
    OUTSIDE = "outside"
    """An input whose content cannot be recorded: the network, another program, a device. The digest is empty. An answer
    that rests on it is re-run in every run, never reused."""


class Observed(NamedTuple):
    """One input of the answer. `path` is absolute, or relative to the workspace in a record."""

    kind: Seen
    path: str
    digest: str = ""


def look(kind: Seen, path: str) -> str:
    """The current digest. An input that changed its kind has another digest."""
    if kind is Seen.MODULES:
        return _modules()
    try:
        info = os.stat(path)  # noqa: PTH116 - names that are not UTF-8 are kept as bytes
        match kind:
            case Seen.READ:
                return digest_file(Path(path))
            case Seen.MISSING:
                return "there"
            case Seen.LISTING:
                # files left by Python and Avow are no inputs
                return sha256(json.dumps(_names(path)))
            case Seen.FOLDER:
                return sha256(json.dumps([[name, _content(os.path.join(path, name))] for name in _names(path)]))  # noqa: PTH118
            case Seen.STATE:
                size = "" if stat.S_ISDIR(info.st_mode) else str(info.st_size)
                return sha256(f"{info.st_mode} {size} {_link(path)}")
            case Seen.KIND:
                return sha256(f"{stat.S_IFMT(info.st_mode)} {_link(path)}")
            case Seen.OUTSIDE:
                return ""
    except (OSError, ValueError):
        return _link(path) if kind in (Seen.MISSING, Seen.OUTSIDE) else "gone"


def _modules() -> str:
    """The folders on the initial module path of the program's Python, and the files there that add others or run at its
    start."""
    found = [absolute_only()]
    for folder in dict.fromkeys(site.getsitepackages()):
        names = _names(folder) if os.path.isdir(folder) else []  # noqa: PTH112
        places = [os.path.join(folder, n) for n in names if n.endswith(".pth") or n.startswith(_AT_START)]  # noqa: PTH118
        found += [folder, *(part for place in places for part in (place, _content(place)))]
    return sha256(json.dumps(found))


_AT_START = ("sitecustomize", "usercustomize")


def _names(folder: str) -> list[str]:
    return sorted(name for name in os.listdir(folder) if name != "__pycache__")  # noqa: PTH208


def _content(path: str) -> str:
    return look(Seen.READ if os.path.isfile(path) else Seen.KIND, path)  # noqa: PTH113


def marks(observed: Observed) -> tuple[object, ...] | None:
    """An identity that shows, without reading, that the bytes of a row are unchanged; None if reading again is as
    cheap."""
    try:
        if observed.kind is Seen.READ:
            return identity(os.stat(observed.path), observed.path)  # noqa: PTH116
        if observed.kind is Seen.FOLDER:
            with os.scandir(observed.path) as entries:
                found = [(entry.name, entry) for entry in entries if entry.name != "__pycache__"]
                return tuple(
                    (name, *identity(entry.stat(), entry.path)) for name, entry in sorted(found, key=lambda f: f[0])
                )
    except (OSError, ValueError):
        return None
    return None


def folded(observed: Iterable[Observed]) -> tuple[Observed, ...]:
    """Fewer rows that cover the same inputs: a path below a missing folder is missing with it, and many files of one
    folder become that folder. Shared folders of many programs are not folded: their other files are no inputs."""
    rows = {(o.path, o.kind): o for o in map(_missing, observed)}
    beside: dict[str, set[str]] = {}
    for path, kind in rows:
        if kind in _OF_FILES:
            beside.setdefault(os.path.dirname(path), set()).add(path)  # noqa: PTH120
    for folder, many in beside.items():
        if len(many) >= FOLDED and os.path.basename(folder) not in _SHARED and not folder.endswith(_LIBRARIES):  # noqa: PTH119
            rows[folder, Seen.FOLDER] = Observed(Seen.FOLDER, folder, look(Seen.FOLDER, folder))
    whole = {path for path, kind in rows if kind is Seen.FOLDER}
    read = {path for path, kind in rows if kind is Seen.READ}

    def stands(path: str, kind: Seen) -> bool:
        """Whether no other row covers this one."""
        if kind in _OF_FILES and os.path.dirname(path) in whole:  # noqa: PTH120
            return False
        return kind not in (Seen.LISTING, Seen.KIND, Seen.STATE) or path not in whole | read

    return tuple(rows[key] for key in sorted(rows) if stands(*key))


_OF_FILES = frozenset({Seen.READ, Seen.MISSING, Seen.STATE, Seen.KIND})
_SHARED = frozenset({"", "bin", "sbin", "lib", "lib64", "etc", "tmp", "home", "root"})
_LIBRARIES = f"/lib/{sysconfig.get_config_var('MULTIARCH')}"


def _missing(observed: Observed) -> Observed:
    """For a missing path, its first missing ancestor."""
    path = observed.path
    if observed.kind is not Seen.MISSING:
        return observed
    while (above := os.path.dirname(path)) != path and not os.path.lexists(above):  # noqa: PTH120
        path = above
    return observed._replace(path=path)


def _link(path: str) -> str:
    """A link's target; empty if it is no link."""
    try:
        return sha256(os.fsencode(os.readlink(path)).hex())  # noqa: PTH115
    except (OSError, ValueError):
        return ""


def recorded(events: Iterable[tuple[str, str]]) -> tuple[Observed, ...]:
    """The inputs for the (event, path) pairs of a program's process, each once, with current digests."""
    found: dict[tuple[str, Seen], Observed] = {}
    for event, path in events:
        kind = _kind(event, path)
        if kind is not None and os.sep + HOME_PREFIX not in path:  # a tool's empty home folder is no input
            found.setdefault((path, kind), Observed(kind, path, look(kind, path)))
    return tuple(found[key] for key in sorted(found))


def _kind(event: str, path: str) -> Seen | None:
    if event == "outside":
        return Seen.OUTSIDE
    if _of_python(path):
        return None
    looked = event in ("state", "kind", "link")
    if f"{path}/".startswith("/proc/"):  # processes come and go
        return None if event in ("state", "kind") and _OF_EVERY_PROCESS.fullmatch(path) else Seen.OUTSIDE
    if f"{path}/".startswith("/sys/") and not looked:
        return Seen.OUTSIDE
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116
    except (OSError, ValueError):
        return Seen.MISSING
    if stat.S_ISDIR(mode):
        return Seen.LISTING if event in ("read", "list", "import") else Seen.STATE if event == "state" else Seen.KIND
    if event == "state":
        return Seen.STATE
    if event in ("kind", "link"):
        return Seen.KIND
    if stat.S_ISREG(mode):
        return Seen.READ
    return None if path in _EMPTY else Seen.OUTSIDE


_OF_EVERY_PROCESS = re.compile(r"/proc(/(thread-)?self(/(?!(cwd|root)$)\w+|/fd/\d+)?)?")
"""Whether a path is the same for every process. The targets of its links may differ between processes."""


_EMPTY = ("/dev/null", "/dev/zero", "/dev/full")

_PYTHON = tuple(dict.fromkeys(sysconfig.get_path(name) for name in ("stdlib", "platstdlib")))
_INSTALLED = tuple(dict.fromkeys(sysconfig.get_path(name) for name in ("purelib", "platlib")))


def _of_python(path: str) -> bool:
    """Whether a path belongs to the interpreter that runs Avow; its version and program identify all of it."""
    if path.endswith("/__pycache__") or ("/__pycache__/" in path and path.endswith(".pyc")):
        return True  # of a package, whose source is recorded
    installed = (*_INSTALLED, *(f"{folder}/dist-packages" for folder in _PYTHON))
    return _within(path, _PYTHON) and not _within(path, installed)


def _within(path: str, folders: Iterable[str]) -> bool:
    return any(f"{path}{os.sep}".startswith(f"{folder}{os.sep}") for folder in folders)


def as_here(kind: Seen) -> Observed:
    """The folders of modules: imports from elsewhere are re-run."""
    return Observed(kind, "module path", look(kind, "module path"))


def interpreter() -> Observed:
    """The Python that runs a program under test."""
    path = os.path.realpath(sys.executable)
    return Observed(Seen.READ, path, look(Seen.READ, path))
