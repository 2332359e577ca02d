"""Clang: the harness with its sanitizers, and the plain program, from the same generated files."""

from __future__ import annotations

import os
import re
from enum import StrEnum
from pathlib import Path

from avow.base.files import read_text
from avow.base.process import Completed, ToolMissing
from avow.base.records import dataclass
from avow.base.tools import Tool
from avow.isolation.observed import Observed, folded, recorded
from avow.isolation.outside import Outside

from .clang_tool import clang
from .reading import Reading
from .tables import TABLES, Drawable, native, tables
from .tuning import BUILD_MEGABYTES, BUILD_SECONDS
from .unseen import WATCHED, Line, Unseen, own, unseen

_INSTALL_RUN_TIME = "sudo apt install --install-recommends clang; a package of its own, libclang-rt-*-dev, has them"
_RUN_TIME = re.compile(r"cannot find \S*libclang_rt\.")
"""What the linker says where clang was installed without them."""
LINK = "avow-adapter.hpp"
"""The adapter by another name: its own path may hold what no line of C++ can say."""
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
_FILLED = ("-ftrivial-auto-var-init=pattern", "-DAVOW_FILLED")
_FUZZED = ("-fsanitize=fuzzer,address,undefined", "-fno-sanitize-coverage=trace-cmp")


class Build(StrEnum):
    """What is built, by the name of the program."""

    FUZZED = "fuzz"
    """The harness."""
    SANITIZED = "sanitized"
    """The plain program with sanitizers: what tells where a fault is."""
    PLAIN = "replay"
    """The program whose answers are judged."""
    FILLED = "filled"
    """The plain program, in which variables and memory that nothing was written to hold other bytes."""


_FLAGS = {
    Build.FUZZED: (*_SANITIZED, *_FUZZED),
    Build.SANITIZED: _SANITIZED,
    Build.PLAIN: _PLAIN,
    Build.FILLED: (*_PLAIN, *_FILLED),
}


class NotBuilt(Exception):  # noqa: N818 - it names what happened
    """Clang refuses the source; the message is its first error."""


@dataclass(frozen=True, slots=True)
class Built:
    """What one build made, and what it read."""

    program: Path
    read: tuple[Path, ...]
    linked: str = ""
    """What the linker said of the functions that are watched."""


def write(reading: Reading, made: Drawable, folder: Path) -> None:
    """The generated files and the fixed ones."""
    for name, text in {**native(), TABLES: tables(reading, made)}.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / LINK).symlink_to(reading.adapter)


def looked_into(reading: Reading, folder: Path, outside: Outside, linked: str, seconds: float) -> Unseen:
    """What no run shows of the source; `linked` as the plain build has it. Raises NotBuilt and ToolMissing."""
    alone = _preprocessed(reading, folder, outside, _PLAIN, seconds)
    fuzzing = _preprocessed(reading, folder, outside, _FLAGS[Build.FUZZED], seconds)
    found = unseen(alone, fuzzing, linked)
    return Unseen(*(plainly(said, reading, folder) for said in (found.undeclared, found.faults)))


def _preprocessed(
    reading: Reading, folder: Path, outside: Outside, flags: tuple[str, ...], seconds: float
) -> list[Line]:
    lines: list[Line] = []
    for source in (folder / "replay.cpp", *reading.sources):
        words = [*_COMMON, *flags, *_includes(reading, folder), "-E", str(source)]
        done = _clang(_there(), words, folder, outside, seconds)
        if done.code != 0:
            raise NotBuilt(_first(done, reading, folder))
        lines += own(done.stdout, folder, reading.adapter)
    return lines


def _there() -> Tool:
    tool = clang()
    if tool.path is None:
        raise ToolMissing(f"clang++ is not here ({tool.install})")
    return tool


def _includes(reading: Reading, folder: Path) -> list[str]:
    around = [f"-I{folder}", "-iquote", str(reading.adapter.parent), *(f"-I{path}" for path in reading.include)]
    return [*around, f'-DADAPTER="{LINK}"']


def build(name: Build, reading: Reading, folder: Path, outside: Outside, seconds: float) -> Built:
    """Raises NotBuilt and ToolMissing."""
    tool, flags = _there(), _FLAGS[name]
    main = "harness.cpp" if name is Build.FUZZED else "replay.cpp"
    objects: list[str] = []
    read: list[Path] = []
    for k, source in enumerate((folder / main, *reading.sources)):
        object_file = folder / f"{name}-{k}.o"
        listed = folder / f"{name}-{k}.d"
        words = [*_COMMON, *flags, *_includes(reading, folder), "-MD", "-MF", str(listed)]
        done = _clang(tool, [*words, "-c", str(source), "-o", str(object_file)], folder, outside, seconds)
        if done.code != 0 or not object_file.is_file():
            raise NotBuilt(_first(done, reading, folder))
        objects.append(str(object_file))
        read += _listed(listed, folder)
    program = folder / name
    watched = [f"-Wl,-y,{function}" for function in WATCHED]
    done = _clang(tool, [*flags, *watched, *objects, "-o", str(program), "-lpthread"], folder, outside, seconds)
    if done.code != 0 or not program.is_file():
        if _RUN_TIME.search(done.stderr):
            raise ToolMissing(f"clang's run-time libraries, which it links, are not here ({_INSTALL_RUN_TIME})")
        raise NotBuilt(_first(done, reading, folder))
    return Built(program, tuple(dict.fromkeys(read)), done.stdout + done.stderr)


def _clang(tool: Tool, words: list[str], folder: Path, outside: Outside, seconds: float) -> Completed:
    limit = max(5.0, min(seconds, BUILD_SECONDS))
    return outside.run([str(tool.path), *words], cwd=folder, seconds=limit, megabytes=BUILD_MEGABYTES)


def _first(done: Completed, reading: Reading, folder: Path) -> str:
    """Clang's first error, with a place that is the same on every machine."""
    if done.timed_out:
        return "clang did not end in the time given"
    lines = [line for line in done.stderr.splitlines() if "error:" in line or "undefined reference" in line]
    said = (lines or done.stderr.strip().splitlines() or [f"clang ended with code {done.code}"])[0]
    return plainly(said, reading, folder)[:300]


def plainly(said: str, reading: Reading, folder: Path) -> str:
    """What a tool says, with places that are the same on every machine."""
    root = reading.job.root.resolve()
    own = reading.adapter.relative_to(root) if reading.adapter.is_relative_to(root) else reading.adapter
    said = said.replace(str(folder / LINK), str(own)).replace(LINK, str(own))
    return said.replace(str(root) + os.sep, "").replace(str(folder) + os.sep, "")


def _listed(path: Path, folder: Path) -> list[Path]:
    """What a build read: as make writes it, beside what we generated."""
    try:
        text = read_text(path, "utf-8", errors="replace")
    except OSError:
        return []
    words = re.findall(r"(?:\\.|\$\$|[^\s\\])+", text.partition(": ")[2].replace("\\\n", " "))
    found = [Path(re.sub(r"\\(.)", r"\1", word).replace("$$", "$")) for word in words]
    return [p.resolve() for p in found if not p.resolve().is_relative_to(folder.resolve())]


def observed(reading: Reading, built: tuple[Built, ...], outside: Outside) -> tuple[Observed, ...]:
    """What the builds read; the folders in which another file of the same name would have been found first; and what
    was looked for, where that is traced."""
    read = dict.fromkeys(path for one in built for path in one.read)
    folders = dict.fromkeys([reading.adapter.parent, *reading.include])
    told = recorded([*(("read", str(p)) for p in read), *(("list", str(p)) for p in folders)])
    return folded((*told, *outside.observed()))
