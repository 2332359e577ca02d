"""Bounded runs of Dafny: what was verified, and what Dafny itself finds left without a body or assumed."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from avow import process
from avow.backend import Limits, Tool
from avow.backends.dafny.answer import Complaint, Member, complaints, counted, quiet, read_members
from avow.tools import find_tool

INSTALL = "apt-get install dafny"

_ANSWER = "answer.xml"
_MODEL = "model.txt"
_MAX_MODEL = 4_000_000


def dafny() -> Tool:
    """Dafny as found now. Never raises."""
    # Any run prints its version in the XML only; without a file it says it in a usage line.
    return find_tool("dafny", ("/version",), install=INSTALL, pattern=r"\d+\.\d+\.\d+(\.\d+)?")


@dataclass(frozen=True, slots=True)
class Run:
    """One run. `members` is None where there is no readable answer."""

    command: tuple[str, ...]
    code: int | None
    members: tuple[Member, ...] | None
    complaints: tuple[Complaint, ...]
    counted: int | None
    output: str
    model: str
    """The prover's models of what it could not prove, as Boogie prints them."""

    @property
    def timed_out(self) -> bool:
        return self.code is None


def verify(files: Mapping[str, str], limits: Limits) -> Run:
    """Verify all files together. Raises ToolMissing."""
    each = max(1, min(30, int(limits.seconds / 2)))
    flags = ("/nologo", "/compile:0", f"/timeLimit:{each}", "/errorLimit:20", f"/xml:{_ANSWER}", f"/mv:{_MODEL}")
    return _run(flags, files, limits, answer=True)


def audit(files: Mapping[str, str], limits: Limits) -> Run:
    """Have Dafny translate the files without verifying them: it then complains of every missing body and assumption.
    Nothing is compiled or executed. Raises ToolMissing."""
    return _run(("/nologo", "/compile:0", "/noVerify", "/spillTargetCode:3"), files, limits, answer=False)


def _run(flags: Sequence[str], files: Mapping[str, str], limits: Limits, *, answer: bool) -> Run:
    # The names are ours (derived by `file_stem`): none can be taken for an option or lead elsewhere.
    command = ("dafny", *flags, *files)
    with tempfile.TemporaryDirectory(prefix="avow-dafny-") as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        done = process.run(command, cwd=folder, seconds=limits.seconds, megabytes=limits.megabytes)
        xml = _read(folder / _ANSWER) if answer else ""
        model = _read(folder / _MODEL)[:_MAX_MODEL] if answer else ""
    output = quiet(done.stdout + done.stderr)
    members = read_members(xml) if xml else None
    return Run(command, done.code, members, complaints(output), counted(output), output, model)


def _read(path: Path) -> str:
    """Empty where there is no such file: what is missing is noticed by what it should have said."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
