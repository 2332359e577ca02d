"""Of what a tool's program is made: what it says of its version need not change when what it loads does."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from avow.base import process
from avow.base.files import digest_or_missing, identity, sha256
from avow.base.notes import cache_folder, read_note, write_note
from avow.base.records import dataclass
from avow.base.tuning.running import VERSION_SECONDS
from avow.base.tuning.sizes import PROGRAM_FILES, SCRIPT_BYTES

_SHARED = frozenset({"bin", "sbin", "lib", "lib64", "tmp", "etc", "dev"})
"""Folders of many programs: what lies in one says nothing of a program in it."""


def program_digest(places: tuple[str, ...]) -> str:
    """SHA-256 of all files of `program_files` of these; empty where there are none. Kept."""
    if not places:
        return ""
    files = sorted({file for place in places for file in program_files(place)})
    return kept_digest(f"program-{sha256(json.dumps(places))[:16]}", {str(file): str(file) for file in files})


@dataclass(frozen=True, slots=True)
class _Digest:
    """Of files with these identities."""

    of: str
    digest: str


def kept_digest(name: str, files: Mapping[str, str]) -> str:
    """SHA-256 of files (what each is called → its path). Kept, sealed, under that name, while each file is the same by
    its identity: there are many, and some are large."""
    mark = sha256(json.dumps([[file, _mark(file)] for file in files.values()]))
    note = cache_folder() / f"{name}.json"
    known = read_note(_Digest, note)
    if known is None or known.of != mark:
        said = [[called, digest_or_missing(Path(file))] for called, file in files.items()]
        known = _Digest(mark, sha256(json.dumps(said)))
        with contextlib.suppress(OSError):  # a read-only home costs that each time
            write_note(note, known)
    return known.digest


@functools.cache
def program_files(path: str) -> tuple[Path, ...]:
    """The program; of a script, what it names by its whole path, with what lies beside that where it has a folder of
    its own; of a binary, the libraries that it is linked with; of a folder, what is in its `bin` and `lib`."""
    found: dict[Path, None] = {}
    binaries: list[Path] = []
    waiting = [Path(path)]
    while waiting and len(found) < PROGRAM_FILES:
        file = Path(os.path.realpath(waiting.pop()))
        if file not in found and file.is_file():
            found[file] = None
            begin = _begin(file)
            waiting += _named(begin)
            if begin[:4] == b"\x7fELF":
                binaries.append(file)
        else:
            found |= dict.fromkeys(p for folder in program_folders(str(file)) for p in folder.rglob("*") if p.is_file())
    linked: set[Path] = set()
    for binary in binaries:
        if binary not in linked:
            linked |= _linked(binary)
    return tuple(sorted({*found, *linked}))


def program_folders(path: str) -> tuple[Path, ...]:
    """Of a program that is a folder, those of which every file counts; none of any other."""
    place = Path(os.path.realpath(path))
    if not place.is_dir():
        return ()
    return tuple(folder for name in ("bin", "lib") if (folder := place / name).is_dir()) or (place,)


def _begin(file: Path) -> bytes:
    try:
        with file.open("rb") as opened:
            return opened.read(SCRIPT_BYTES)
    except OSError:
        return b""


def _named(script: bytes) -> Iterator[Path]:
    if script[:2] != b"#!":
        return
    for name in re.findall(rb"(?<![\w$}])/[\w./+@-]+", script):
        named = Path(os.fsdecode(name))
        if named.is_file():
            yield named
            if named.parent.name not in _SHARED:
                yield from sorted(named.parent.iterdir())


def _linked(binary: Path) -> frozenset[Path]:
    """The libraries that it is loaded with, those of its libraries among them."""
    try:
        listed = process.run(["ldd", str(binary)], seconds=VERSION_SECONDS, tied=False).stdout
    except process.ToolMissing:
        return frozenset()
    named = re.findall(r"^\t(?:.* => )?(/.+) \(0x[0-9a-f]+\)$", listed, re.MULTILINE)
    return frozenset(Path(os.path.realpath(name)) for name in named)


def _mark(file: str) -> tuple[int | str, ...]:
    try:
        return identity(os.stat(file), file)  # noqa: PTH116 - asked of each file of several packages
    except OSError:
        return ()
