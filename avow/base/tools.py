"""Outside tools: where they are, and which files they consist of. Asking a program for its version may take a second,
so the answer is cached while all files of the program are the same: its version text may stay the same when a library
changes."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path

from avow.base import process
from avow.base.files import digest_or_missing, identity, sha256
from avow.base.notes import cache_folder, read_note, write_note
from avow.base.records import dataclass
from avow.base.tuning.running import TRIAL_SECONDS, VERSION_SECONDS
from avow.base.tuning.sizes import PROGRAM_FILES, SCRIPT_BYTES


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool as found on this machine. `version` is None if it is missing; `install` is one command."""

    name: str
    version: str | None
    path: str | None
    install: str
    optional: bool = True
    """Whether its absence disables a part of a method, and not the method."""
    package: str = ""
    """Its Python package, if it is not a program of its own."""
    parts: tuple[str, ...] = ()
    """Further programs that it runs, and folders with its files."""
    trial: Callable[[], str] | None = field(default=None, compare=False)
    """Does a one-line job with the tool, for `avow doctor`; returns what went wrong, empty if nothing did."""

    @property
    def present(self) -> bool:
        return self.version is not None

    @property
    def places(self) -> tuple[str, ...]:
        """All that its key covers."""
        return (self.path, *self.parts) if self.path is not None else ()


def z3_tool() -> Tool:
    """The solver that comes with Avow."""
    install = "pip install z3-solver"
    return Tool("z3", package_version("z3-solver"), None, install, False, package="z3", trial=_try_z3)


def _try_z3() -> str:
    return works("import z3; s = z3.Solver(); s.add(z3.Int('x') > 0, z3.Int('x') < 1); assert s.check() == z3.unsat")


def works(line: str) -> str:
    """What goes wrong when a new Python runs this line; empty if nothing does."""
    return tried([(sys.executable, "line.py")], "line.py", line, "")


def tried(commands: Sequence[Sequence[str]], file: str, text: str, expected: str) -> str:
    """Run these commands in a temporary folder that holds one file. Returns the first error of a command that fails, or
    of the last one if its output lacks `expected`; empty if all is well."""
    with tempfile.TemporaryDirectory(prefix="avow-trial-", ignore_cleanup_errors=True) as folder:
        (Path(folder) / file).write_text(text, encoding="utf-8")
        for k, command in enumerate(commands):
            try:
                done = process.run(command, cwd=Path(folder), seconds=TRIAL_SECONDS)
            except process.ToolMissing as missing:
                return str(missing)
            said = f"{done.stdout}\n{done.stderr}"
            if done.code != 0 or (k + 1 == len(commands) and expected not in said):
                lines = [line.strip() for line in said.splitlines() if line.strip()]
                wrong = [line for line in lines if "error" in line.lower() or "cannot" in line]
                return (wrong or lines or [f"`{command[0]}` ended with code {done.code}"])[0][:200]
    return ""


@functools.cache
def find_tool(
    name: str,
    arguments: Sequence[str] = ("--version",),
    *,
    install: str,
    pattern: str = r"\d+(\.\d+)+",
    optional: bool = True,
) -> Tool:
    """The program `name` on the PATH, with its version ("unknown" if it prints none). Never raises."""
    path = shutil.which(name)
    if path is None:
        return Tool(name, None, None, install, optional)
    return Tool(name, _version(path, tuple(arguments), pattern), path, install, optional)


def package_tool(name: str, install: str, line: str) -> Tool:
    """An installed distribution, tried by a line of Python. Never raises."""
    from importlib import metadata  # slow to import

    try:
        version = package_version(name)
    except metadata.PackageNotFoundError:
        return Tool(name, None, None, install, package=name)
    return Tool(name, version, None, install, package=name, trial=functools.partial(works, line))


PERCEPTION = "pip install 'avow[perception]'"


def onnxruntime_tool() -> Tool:
    """What runs neural networks. Never raises."""
    line = "import onnxruntime; assert 'CPUExecutionProvider' in onnxruntime.get_available_providers()"
    return package_tool("onnxruntime", PERCEPTION, line)


@functools.cache
def package_version(name: str) -> str:
    """The version of an installed distribution. Raises `importlib.metadata.PackageNotFoundError`."""
    from importlib import metadata  # slow to import

    return metadata.version(name)


@functools.cache
def package_digest(name: str) -> str:
    """SHA-256 of all files of an installed top-level package, byte code aside; empty if there is none. Imports nothing.
    Cached for each environment."""
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        return ""
    place = os.path.normpath(spec.submodule_search_locations[0])
    walked = (walk for walk in os.walk(place) if not walk[0].endswith("__pycache__"))
    files = sorted(os.path.join(folder, name) for folder, _, names in walked for name in names)  # noqa: PTH118 - many
    return _kept_digest(f"package-{name}-{sha256(place)[:12]}", {file[len(place) + 1 :]: file for file in files})


LIBRARIES = ("z3", "cvc5", "lark", "yaml")
"""Packages that any answer may depend on: solvers (the second is optional) and parsers."""


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


# -- the files of a program --------------------------------------------------------------------------------------------

_SHARED = frozenset({"bin", "sbin", "lib", "lib64", "tmp", "etc", "dev"})
"""Folders of many programs: their other files say nothing about one program."""


def program_digest(places: tuple[str, ...]) -> str:
    """SHA-256 of all files of `program_files` of these; empty where there are none. Kept."""
    if not places:
        return ""
    files = sorted({file for place in places for file in program_files(place)})
    return _kept_digest(f"program-{sha256(json.dumps(places))[:16]}", {str(file): str(file) for file in files})


@dataclass(frozen=True, slots=True)
class _Digest:
    """Of files with these identities."""

    of: str
    digest: str


def _kept_digest(name: str, files: Mapping[str, str]) -> str:
    """SHA-256 of files (label → path). Cached, sealed, under that name while each file's identity is the same: there
    are many, and some are large."""
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
    """The files of a program: for a script, the files that it names by absolute path, with those beside them if they
    have a folder of their own; for a binary, the libraries that it is linked with; for a folder, the files in its `bin`
    and `lib`."""
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
    """For a program that is a folder, the folders whose files all count; none for any other."""
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
    """The libraries that it is loaded with, including those of its libraries."""
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
