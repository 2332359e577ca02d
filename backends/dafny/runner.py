"""Bounded runs of Dafny: the verified members, and the missing bodies and assumptions that Dafny itself finds.

Up to version 3 it is called with the options of 2.3, from version 4 on with its commands (`modern`).
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from avow.backend_kit.protocol import Limits
from avow.base.files import text_or_nothing
from avow.base.records import dataclass
from avow.isolation.outside import Outside

from . import modern
from .answer import Complaint, Member, complaints, counted, quiet, read_members
from .dafny_tool import dafny, has_commands

_ANSWER = "answer.xml"
_RESOLVED = "resolved.txt"
_FINISHED = re.compile(r"Dafny program verifier finished with \d+ verified, \d+ errors?")


@dataclass(frozen=True, slots=True)
class Run:
    """One run. `members` is None if there is no readable answer."""

    command: tuple[str, ...]
    code: int | None
    members: tuple[Member, ...] | None
    complaints: tuple[Complaint, ...]
    counted: int | None
    output: str
    resolved: str | None
    """The program after resolution and refinement, as Dafny prints it; None if this version has no such option."""

    @property
    def timed_out(self) -> bool:
        return self.code is None


@dataclass(frozen=True, slots=True)
class Audit:
    """Dafny's other complaints. `complaints` is None if the list is incomplete."""

    complaints: tuple[Complaint, ...] | None
    output: str


def verify(files: Mapping[str, str], limits: Limits, outside: Outside) -> Run:
    """Verify all files together. Raises ToolMissing."""
    each = max(1, min(30, int(limits.seconds / 2)))
    if not has_commands(dafny().version):
        flags = ("/nologo", "/compile:0", f"/timeLimit:{each}", "/errorLimit:20")
        answers = (f"/xml:{_ANSWER}", f"/rprint:{_RESOLVED}")
        done = _run((*flags, *answers), files, limits, outside)
        members = read_members(done.answers[_ANSWER]) if done.answers[_ANSWER] else None
        return _answer(done, members, done.answers[_RESOLVED])
    done = _run(modern.verify_arguments(each, lenient=True), files, limits, outside)
    if modern.is_unknown_option(done.output):
        done = _run(modern.verify_arguments(each, lenient=False), files, limits, outside)
    log = done.answers[modern.LOG]
    return _answer(done, modern.read_log(log, done.output) if log else None)


def audit(files: Mapping[str, str], limits: Limits, outside: Outside) -> Audit:
    """Have Dafny list its unproved assumptions, without verifying; nothing is compiled or executed. Raises ToolMissing.

    2.3 complains of every missing body and assumption when it translates the files; 4 has a command for it."""
    if has_commands(dafny().version):
        done = _run(("audit",), files, limits, outside)
        return Audit(None if done.code is None else modern.read_audit(done.output), done.output)
    done = _run(("/nologo", "/compile:0", "/noVerify", "/spillTargetCode:3"), files, limits, outside)
    found = complaints(done.output)
    finished = done.code in (0, 3) and _FINISHED.search(done.output) is not None
    if not finished or (done.code == 3 and not any(c.message.startswith("Error") for c in found)):
        return Audit(None, done.output)
    return Audit(found, done.output)


@dataclass(frozen=True, slots=True)
class _Done:
    command: tuple[str, ...]
    code: int | None
    output: str
    answers: Mapping[str, str]


def _answer(done: _Done, members: tuple[Member, ...] | None, resolved: str | None = None) -> Run:
    return Run(done.command, done.code, members, complaints(done.output), counted(done.output), done.output, resolved)


def _run(first: Sequence[str], files: Mapping[str, str], limits: Limits, outside: Outside) -> _Done:
    megabytes: int | None = limits.megabytes
    env: dict[str, str] = {}
    if has_commands(dafny().version):
        # .NET reserves far more addresses than it uses: a limit on addresses would prevent it from starting.
        env, megabytes = {"DOTNET_GCHeapHardLimit": f"{limits.megabytes * 2**20:x}"}, None
        runtime = shutil.which("dotnet")
        if runtime is not None:
            env["DOTNET_ROOT"] = os.path.dirname(os.path.realpath(runtime))  # noqa: PTH120
    # The files' names are ours (derived by `file_stem`): none can be read as an option or refer to another folder.
    command = ("dafny", *first, *files)
    with tempfile.TemporaryDirectory(prefix="avow-dafny-") as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        done = outside.run(command, cwd=folder, seconds=limits.seconds, megabytes=megabytes, env=env)
        answers = {each: text_or_nothing(folder / each) for each in (_ANSWER, _RESOLVED, modern.LOG)}
    return _Done(command, done.code, quiet(done.stdout + done.stderr), answers)
