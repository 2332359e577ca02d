"""Runs the built programs in isolation: a script that reports the result through its channel.

``python runner.py CHANNEL FILE``: the file's request is a campaign of libFuzzer, or runs for the plain program.
"""

from __future__ import annotations

import contextlib
import os
import resource
import secrets
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, assert_never

from avow.base import process
from avow.base.codec import Unreadable, from_text
from avow.base.tuning.running import SUBJECT_PATIENCE, WALL
from avow.base.tuning.sizes import LOG_KEPT
from avow.base.verdict import Isolation
from avow.isolation import judge
from avow.isolation.level import available, sealed
from avow.isolation.observed import Observed, recorded
from avow.isolation.subject import Message, SubjectFailed, SubjectProcess
from avow.isolation.tracing import Trace, remedy, traces

_OPTIONS = {
    "ASAN_OPTIONS": "detect_leaks=0:symbolize=1:handle_abort=0:allocator_may_return_null=0",
    "UBSAN_OPTIONS": "print_stacktrace=0:halt_on_error=1",
}


_CRASHES = frozenset((signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT, signal.SIGTRAP))
"""The signals that end a program with a fault in its own code."""


class _Program(SubjectProcess):
    """A compiled program of the user's in a process of its own. It reads a line ``TURN|COMMAND|COMMAND…`` and answers
    with one line of JSON that has the same turn: anything that its own code writes into the channel is not an answer.
    It is not observed from within: strace reports what it reads.

    Each case is ``{"command": text}``; the text holds neither ``|`` nor the end of a line."""

    def __init__(self, path: Path, patience: float, root: Path) -> None:
        super().__init__(path, "", patience, root)
        self._turn = ""
        self._traces: list[Trace] = []
        self._looked: dict[tuple[str, str], None] = {}

    def crashed(self) -> str:
        """The signal with which its own code ended; empty if it ended otherwise."""
        code = self.code or 0
        number = -code if code < 0 else code - 128
        return signal.Signals(number).name if number in _CRASHES else ""

    def observed(self) -> tuple[Observed, ...]:
        """The reads that strace reported; unknown without strace."""
        for trace in self._traces:
            events = trace.read_all(str(self.path), self.root)
            self._looked.update(dict.fromkeys(events or [("outside", f"what no trace reports of {self.path.name}")]))
        self._traces.clear()
        built = str(self.path.parent) + os.sep
        return recorded(each for each in self._looked if not each[1].startswith(built))

    def _place(self) -> str:
        return ""

    def _command(self, there: int, back: int) -> list[str]:
        return [str(self.path), str(there), str(back)]

    def _around(self, command: list[str]) -> list[str]:
        if not traces():
            self._looked["outside", f"what {self.path.name} reads, which nothing records here ({remedy()})"] = None
            return command
        self._traces.append(Trace())
        return self._traces[-1].around(command)

    def _written(self, cases: Sequence[Mapping[str, Any]]) -> bytes:
        self._turn = secrets.token_hex(8)
        return "|".join((self._turn, *(str(case["command"]) for case in cases))).encode() + b"\n"

    def _in_turn(self, message: Message) -> bool:
        return message.turn == self._turn


@dataclass(frozen=True, slots=True)
class Campaign:
    """A request for one run of libFuzzer."""

    folder: str
    kept: str
    options: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Campaigned:
    """`done`: it ended normally, after so many runs; this does not depend on the program's output."""

    code: int | None
    done: int
    fault: str
    log: str
    isolation: Isolation


@dataclass(frozen=True, slots=True)
class Runs:
    """A request for runs, each a list of commands, of the program and of its `twin`, if one is named; up to `crashes`
    of them may end it."""

    program: str
    twin: str
    runs: tuple[tuple[str, ...], ...]
    crashes: int


@dataclass(frozen=True, slots=True)
class Run:
    """The answers of one run, and the signal that ended it, if one did."""

    replies: tuple[Any, ...]
    crash: str


@dataclass(frozen=True, slots=True)
class Answered:
    runs: tuple[Run, ...]
    fault: str
    silent: bool
    unsteady: int | None
    """The first run with a different answer from the twin."""
    observed: tuple[Observed, ...]
    isolation: Isolation


@dataclass(frozen=True, slots=True)
class Show:
    """A request for one run of the program with sanitizers."""

    program: str
    commands: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Shown:
    """Its answers up to its end, and the report with which it ends."""

    replies: tuple[Any, ...]
    code: int | None
    log: str


@dataclass(frozen=True, slots=True)
class Question:
    """The request to the process, in a file; `root` is the system's folder."""

    ask: Campaign | Runs | Show
    root: str
    seconds: float


def campaign(asked: Campaign, question: Question) -> Campaigned:
    level = available()
    folder, kept = Path(asked.folder), Path(asked.kept)
    nonce = secrets.token_hex(16)
    channel = judge.Channel()
    source, nonces = os.pipe()
    os.write(nonces, nonce.encode() + b"\n")
    os.close(nonces)
    command = [str(folder / "fuzz"), *asked.options, f"-artifact_prefix={kept}/fault-", str(kept / "corpus")]
    if level is Isolation.SEALED:
        command = sealed(command, kept)
    variables = {"AVOW_CHANNEL": str(channel.theirs), "AVOW_NONCE": str(source), "HOME": str(kept), "TMPDIR": str(kept)}
    code, left, answer, printed = _ended(command, kept, question, channel, variables, source)
    words = answer.split()
    closed = len(words) == 3 and answer.endswith("\n") and words[0] == nonce
    done = closed and words[1] == "done" and code == 0
    # a report of a sanitizer leaves its symbolizer behind; the run that it is about is judged by itself
    fault = "the source left processes behind" if left and code == 0 and level is not Isolation.SEALED else ""
    if closed and words[1] == "left":
        fault = fault or "the source ended the process within a step"
    return Campaigned(code, int(words[2]) if done and words[2].isdigit() else 0, fault, printed, level)


def _ended(
    command: list[str],
    cwd: Path,
    question: Question,
    channel: judge.Channel,
    variables: Mapping[str, str],
    given: int,
) -> tuple[int | None, bool, str, str]:
    """Run a build with sanitizers to its end, and end all processes that it leaves; `given` is a descriptor that it
    reads. Returns its exit code (None: its time was up), whether it left processes, the channel's text, and the end of
    its error output."""
    with tempfile.TemporaryFile() as errors:
        started = subprocess.Popen(
            command,
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env={**_OPTIONS, "PATH": os.environ.get("PATH", os.defpath), **variables, "LC_ALL": "C.UTF-8"},
            start_new_session=True,
            pass_fds=(channel.theirs, given),
        )
        process.watch(started.pid)
        code: int | None = None
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = started.wait(question.seconds * WALL)
        process.kill_tree(started.pid)
        started.wait()
        process.unwatch(started.pid)
        left = process.end_orphans()
        errors.seek(max(0, errors.seek(0, os.SEEK_END) - LOG_KEPT))
        printed = errors.read().decode("utf-8", "replace")
    answer = channel.close()
    return code, left, answer.decode("utf-8", "replace"), printed


def answered(asked: Runs, question: Question) -> Answered:
    """The runs, each on a node of its own; and once more in reverse order, by another process, with a build in which
    uninitialised memory holds other bytes: an answer that depends on chance, the clock, such bytes, or earlier runs is
    not accepted."""
    spent = process.Stopwatch()
    first, faults, program = _all(asked.program, asked.runs, asked.crashes, question, spent)
    silent = bool(program.silent)
    unsteady = None
    if asked.twin and not faults:
        order = [k for k in reversed(range(len(first))) if not first[k].crash]
        runs = [asked.runs[k] for k in order]
        again, faults, twin = _all(asked.twin, runs, asked.crashes, question, spent)
        silent = bool(twin.silent)
        for k, other in zip(order, again, strict=False):
            if other != first[k]:
                unsteady = k
    observed = program.observed()
    return Answered(tuple(first), faults, silent, unsteady, observed, program.isolation)


def _all(
    path: str, runs: Sequence[tuple[str, ...]], most: int, question: Question, spent: process.Stopwatch
) -> tuple[list[Run], str, _Program]:
    program = _Program(Path(path), SUBJECT_PATIENCE, Path(question.root))
    found: list[Run] = []
    crashes = 0
    fault = ""
    try:
        for run in runs:
            if spent() > question.seconds:
                break
            replies = program.ask_all([{"command": command} for command in run])
            failed = next((r for r in replies if isinstance(r, SubjectFailed)), None)
            crash = program.crashed() if failed is not None else ""
            if failed is not None and (program.fault or not crash):
                fault = str(failed)
                break
            found.append(Run(tuple(r for r in replies if not isinstance(r, SubjectFailed)), crash))
            crashes += bool(crash)
            if crashes >= most:
                break
    finally:
        fault = program.close() or fault
    return found, fault, program


def shown(asked: Show, question: Question) -> Shown:
    level = available()
    program = Path(asked.program)
    channel = judge.Channel()
    with tempfile.TemporaryFile() as lines:
        for k, line in enumerate(asked.commands):
            lines.write(f"{k}|{line}\n".encode())
        lines.flush()
        lines.seek(0)
        command = [str(program), str(lines.fileno()), str(channel.theirs)]
        if level is Isolation.SEALED:
            command = sealed(command)
        code, _, answer, printed = _ended(command, Path(question.root), question, channel, {}, lines.fileno())
    replies: list[Any] = []
    for line in answer.splitlines():
        try:
            message = from_text(Message, line)
        except Unreadable:
            break
        if message.turn == str(len(replies)) and message.replies:
            replies.append(message.replies[0]["value"])
    return Shown(tuple(replies), code, printed)


def _answer(question: Question) -> Campaigned | Answered | Shown:
    match question.ask:
        case Campaign() as asked:
            return campaign(asked, question)
        case Runs() as asked:
            return answered(asked, question)
        case Show() as asked:
            return shown(asked, question)
        case _:
            assert_never(question.ask)


def main() -> None:
    channel = int(sys.argv[1])
    os.set_inheritable(channel, False)
    process.adopt_orphans()
    question = from_text(Question, Path(sys.argv[2]).read_bytes())
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    judge.say(channel, _answer(question))


if __name__ == "__main__":
    main()
