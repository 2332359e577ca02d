"""The harness with its sanitizers, and the plain program, from the same generated files."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path

from avow.base.files import read_regular, read_text
from avow.base.notes import cache_folder
from avow.base.process import Completed, ToolMissing
from avow.base.records import dataclass
from avow.base.tools import Tool
from avow.isolation.observed import Observed, folded, recorded
from avow.isolation.outside import Outside

from .clang_tool import fuzzes, tools
from .reading import Reading
from .tables import TABLES, Drawable, native, tables
from .tuning import BUILD_MEGABYTES, BUILD_SECONDS, FIRST_BUILD_SECONDS
from .unseen import Line, Unseen, own, undefined, unseen

LINK = "avow-adapter.hpp"
"""A link to the adapter: its own path may contain characters that C++ cannot include."""
_COMMON = (
    "-std=c++17",
    "-g1",
    "-ffp-contract=off",
    "-fno-fast-math",
    "-Wno-builtin-macro-redefined",
    '-D__DATE__="Jan 01 1970"',
    '-D__TIME__="00:00:00"',
    '-D__TIMESTAMP__="Thu Jan 01 00:00:00 1970"',
)
# Comparisons are not traced: the addresses among them would make each process find other runs.
_SANITIZED = (
    "-O1",
    "-fno-omit-frame-pointer",
    "-fno-pie",
    "-no-pie",
    "-fno-sanitize-recover=all",
    "-fsanitize=address,undefined",
    "-D_GLIBCXX_ASSERTIONS",
)
_PLAIN = ("-O2",)
# Without sanitizers' builds the plain program itself ends by a signal if its behaviour is undefined.
_TRAPPED = ("-fsanitize=undefined", "-fsanitize-trap=undefined", "-D_LIBCPP_HARDENING_MODE=_LIBCPP_HARDENING_MODE_FAST")
_FILLED = ("-ftrivial-auto-var-init=pattern", "-DAVOW_FILLED")
_FUZZED = ("-fsanitize=fuzzer,address,undefined", "-fno-sanitize-coverage=trace-cmp")


class Build(StrEnum):
    """The builds, by the name of the program."""

    FUZZED = "fuzz"
    """The harness."""
    SANITIZED = "sanitized"
    """The plain program with sanitizers: it reports where a fault is."""
    PLAIN = "replay"
    """The program whose answers are judged."""
    FILLED = "filled"
    """The plain program, in which uninitialised variables and memory hold other bytes."""


_FLAGS = {
    Build.FUZZED: (*_SANITIZED, *_FUZZED),
    Build.SANITIZED: _SANITIZED,
    Build.PLAIN: _PLAIN,
    Build.FILLED: (*_PLAIN, *_FILLED),
}


class NotBuilt(Exception):  # noqa: N818 - it names what happened
    """The compiler rejects the source, and the message is its first error; or (`late`) it did not end."""

    def __init__(self, why: str, late: bool = False) -> None:
        super().__init__(why)
        self.late = late


@dataclass(frozen=True, slots=True)
class Built:
    """The result of one build, and the files that it read."""

    program: Path
    read: tuple[Path, ...]
    asked: tuple[str, ...] = ()
    """The undefined names in its objects."""


def write(reading: Reading, made: Drawable, folder: Path) -> None:
    """The generated files and the fixed ones."""
    for name, text in {**native(), TABLES: tables(reading, made)}.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / LINK).symlink_to(reading.adapter)


def looked_into(reading: Reading, folder: Path, outside: Outside, asked: Iterable[str], seconds: float) -> Unseen:
    """The parts of the source's behaviour that no run shows; `asked` are the plain build's undefined names. Raises
    NotBuilt and ToolMissing."""
    alone = _preprocessed(reading, folder, outside, _flags(Build.PLAIN), seconds)
    fuzzed = Build.FUZZED if fuzzes(_there()) else Build.PLAIN
    found = unseen(alone, _preprocessed(reading, folder, outside, _flags(fuzzed), seconds), asked)
    return Unseen(*(plainly(text, reading, folder) for text in (found.undeclared, found.faults)))


def _preprocessed(
    reading: Reading, folder: Path, outside: Outside, flags: tuple[str, ...], seconds: float
) -> list[Line]:
    lines: list[Line] = []
    for source in (folder / "replay.cpp", *reading.sources):
        words = [*_COMMON, *flags, *_includes(reading, folder), "-E", str(source)]
        done = _clang(_there(), words, folder, outside, seconds)
        if done.code != 0:
            raise NotBuilt(_first(done, reading, folder), done.timed_out)
        lines += own(done.stdout, folder, reading.adapter)
    return lines


def _flags(name: Build) -> tuple[str, ...]:
    return _FLAGS[name] if fuzzes(_there()) else (*_FLAGS[name], *_TRAPPED)


def _there() -> Tool:
    tool = tools()[0]
    if not tool.present:
        raise ToolMissing(missing(tool))
    return tool


def missing(tool: Tool) -> str:
    """The missing tool, and the command that installs it."""
    return f"clang++ is {'not here' if tool.path is None else 'here without libFuzzer'}: {tool.install}"


def _includes(reading: Reading, folder: Path) -> list[str]:
    around = [f"-I{folder}", "-iquote", str(reading.adapter.parent), *(f"-I{path}" for path in reading.include)]
    return [*around, f'-DADAPTER="{LINK}"']


def build(name: Build, reading: Reading, folder: Path, outside: Outside, seconds: float) -> Built:
    """Raises NotBuilt and ToolMissing."""
    tool, flags = _there(), _flags(name)
    main = "harness.cpp" if name is Build.FUZZED else "replay.cpp"
    objects: list[str] = []
    read: list[Path] = []
    for k, source in enumerate((folder / main, *reading.sources)):
        object_file = folder / f"{name}-{k}.o"
        listed = folder / f"{name}-{k}.d"
        words = [*_COMMON, *flags, *_includes(reading, folder), "-MD", "-MF", str(listed)]
        done = _clang(tool, [*words, "-c", str(source), "-o", str(object_file)], folder, outside, seconds)
        if done.code != 0 or not object_file.is_file():
            raise NotBuilt(_first(done, reading, folder), done.timed_out)
        objects.append(str(object_file))
        read += _listed(listed, folder)
    program = folder / name
    done = _clang(tool, [*flags, *objects, "-o", str(program), "-lpthread"], folder, outside, seconds)
    if done.code != 0 or not program.is_file():
        raise NotBuilt(_first(done, reading, folder), done.timed_out)
    try:
        asked = tuple(dict.fromkeys(n for o in objects for n in undefined(read_regular(Path(o)))))
    except ValueError as error:
        raise NotBuilt(str(error)) from None
    return Built(program, tuple(dict.fromkeys(read)), asked)


def _clang(tool: Tool, words: list[str], folder: Path, outside: Outside, seconds: float) -> Completed:
    if fuzzes(tool):
        limit = max(5.0, min(seconds, BUILD_SECONDS))
        return outside.run([str(tool.path), *words], cwd=folder, seconds=limit, megabytes=BUILD_MEGABYTES)
    kept = {f"ZIG_{which}_CACHE_DIR": str(_wheel_cache()) for which in ("GLOBAL", "LOCAL")}
    limit = max(FIRST_BUILD_SECONDS, seconds)
    return outside.run([str(tool.path), "c++", *words], cwd=folder, seconds=limit, env=kept)


def _wheel_cache() -> Path:
    """The folder of the standard library that the wheel's compiler has built."""
    return cache_folder() / "zig"


def _first(done: Completed, reading: Reading, folder: Path) -> str:
    """The compiler's first error, with a place that is the same on every machine."""
    if done.timed_out:
        return "the compiler did not end in time: run it again on a machine with less to do, or allow more `seconds`"
    lines = [line for line in done.stderr.splitlines() if "error:" in line or "undefined reference" in line]
    text = (lines or done.stderr.strip().splitlines() or [f"the compiler ended with code {done.code}"])[0]
    name, missing = reading.adapter.name, ""
    if re.search("(unknown type name|undeclared identifier) 'AvowNode'", text):
        missing = f"{name} defines no `struct AvowNode` (`cpp` names the adapter; other files go under `sources`): "
    elif re.match(rf"{re.escape(str(folder))}\S*|(harness|replay)\.cpp", text) and LINK not in text.partition(" ")[0]:
        missing = f"{name} has no `void step(const avow::Inputs&, avow::Outputs&)` that can be called: "
    absent = "; name the folder that holds it under `include`" if text.endswith("file not found") else ""
    return (missing + plainly(text, reading, folder))[:300] + absent


def plainly(text: str, reading: Reading, folder: Path) -> str:
    """A tool's message, with places that are the same on every machine."""
    root = reading.job.root.resolve()
    own = reading.adapter.relative_to(root) if reading.adapter.is_relative_to(root) else reading.adapter
    text = text.replace(str(folder / LINK), str(own)).replace(LINK, str(own))
    return text.replace(str(root) + os.sep, "").replace(str(folder) + os.sep, "")


def _listed(path: Path, folder: Path) -> list[Path]:
    """The files that a build read, from make's list, without the generated ones."""
    try:
        text = read_text(path, "utf-8", errors="replace")
    except OSError:
        return []
    words = re.findall(r"(?:\\.|\$\$|[^\s\\])+", text.partition(": ")[2].replace("\\\n", " "))
    found = [Path(re.sub(r"\\(.)", r"\1", word).replace("$$", "$")) for word in words]
    return [p.resolve() for p in found if not p.resolve().is_relative_to(folder.resolve())]


def observed(reading: Reading, built: tuple[Built, ...], outside: Outside) -> tuple[Observed, ...]:
    """The files that the builds read; the folders in which another file of the same name would have been found first;
    and the searched paths, if they are traced."""
    read = dict.fromkeys(path for one in built for path in one.read)
    folders = dict.fromkeys([reading.adapter.parent, *reading.include])
    seen = recorded([*(("read", str(p)) for p in read), *(("list", str(p)) for p in folders)])
    kept = f"{_wheel_cache()}{os.sep}"
    return folded((*seen, *(each for each in outside.observed() if not f"{each.path}{os.sep}".startswith(kept))))
