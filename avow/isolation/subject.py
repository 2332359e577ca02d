"""A program under test in a process of its own, from the judge's side: requests and answers are lines of JSON over
pipes, with time limits. Its standard output is not read."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from avow.base import process
from avow.base.codec import LATER, Unreadable, from_text
from avow.base.module_path import absolute_only
from avow.base.records import dataclass
from avow.base.verdict import Isolation
from avow.isolation.level import available, sealed
from avow.isolation.observed import Observed, Seen, as_here, interpreter, recorded


class SubjectFailed(Exception):  # noqa: N818 - it names what happened
    """The program raised, ended, hung, or returned no value of the output's type."""


@dataclass(frozen=True, slots=True)
class Message:
    """A line from the program's process (`host`, or a compiled program), which writes it without the codec."""

    seen: tuple[tuple[str, str], ...] = field(default=(), metadata=LATER)
    """(event, path) pairs observed since the previous message."""
    ready: bool = field(default=False, metadata=LATER)
    error: str = field(default="", metadata=LATER)
    """Why it is not ready."""
    replies: tuple[Any, ...] | None = field(default=None, metadata=LATER)
    """One for each case: ``{"value": …}`` or ``{"error": "…"}``."""
    turn: str = field(default="", metadata=LATER)
    """For a compiled program: the request that it answers."""
    end: bool = field(default=False, metadata=LATER)
    """For a compiled program: it ends as requested."""


class SubjectProcess:
    """The process with a function of a Python file. Started at the first request.

    `root` is the system's folder. `fault` is set once no answer counts any more: the program left processes behind.
    Raises `level.Unavailable` if it must be sealed and cannot be.
    """

    def __init__(self, path: Path, function: str, patience: float, root: Path | None = None) -> None:
        self.path, self.function, self.patience = path.resolve(), function, patience
        self.root = (root or path.parent).resolve()
        self.isolation: Isolation = available()
        self.fault = ""
        self.silent = ""
        """A reason for a missing answer that is no fault of the program: wall-clock time, or a kill from outside."""
        self.code: int | None = None
        """How its process ended, if it ended by itself."""
        self.process: subprocess.Popen[bytes] | None = None
        self._events: dict[tuple[str, str], None] = {}
        self._to = self._from = -1
        self._buffer = b""
        self._scratch: tempfile.TemporaryDirectory[str] | None = None

    def ask(self, inputs: Mapping[str, Any]) -> Any:
        """The program's return value, as the host's data. Raises SubjectFailed."""
        reply = self.ask_all([inputs])[0]
        if isinstance(reply, SubjectFailed):
            raise reply
        return reply

    def ask_all(self, cases: Sequence[Mapping[str, Any]]) -> list[Any]:
        """For each case the program's return value or its SubjectFailed; if the process itself fails, later cases have
        no answer. Many cases in one request cost less: each request wakes another process."""
        try:
            replies = self._exchange(cases)
        except SubjectFailed as failure:
            if len(cases) == 1 or self.fault:
                return [failure]
            return self._one_by_one(cases)
        return [self._reply(reply) for reply in replies]

    def observed(self) -> tuple[Observed, ...]:
        """Its inputs so far, the interpreter first."""
        return (interpreter(), as_here(Seen.MODULES), *recorded(self._events))

    def close(self) -> str:
        """End it with all that it started. Returns why no answer counts, or why its end is no fault of the program
        (`silent`)."""
        self._stop()
        return self.fault or self.silent

    # -- inside ------------------------------------------------------------------------------------------

    def _one_by_one(self, cases: Sequence[Mapping[str, Any]]) -> list[Any]:
        """The answers up to the first case without one, which is the case that ended the process."""
        replies: list[Any] = []
        for inputs in cases:
            replies.append(self.ask_all([inputs])[0])
            if isinstance(replies[-1], SubjectFailed):
                break
        return replies

    def _reply(self, reply: Any) -> Any:
        if not isinstance(reply, dict) or not ({"error", "value"} & reply.keys()):
            return SubjectFailed("the subject's answer is no data")
        return SubjectFailed(f"the subject raised {reply['error']}") if "error" in reply else reply["value"]

    def _exchange(self, cases: Sequence[Mapping[str, Any]]) -> list[Any]:
        if self.fault:
            raise SubjectFailed(self.fault)
        if self.process is None:
            self._start()
        self._send(self._written(cases))
        message = self._message()
        if message.replies is None or len(message.replies) != len(cases) or not self._in_turn(message):
            raise self._end("the subject's answer is no data")
        return list(message.replies)

    def _send(self, request: bytes) -> None:
        end = time.monotonic() + self.patience
        while request:
            try:
                request = request[os.write(self._to, request) :]
            except BlockingIOError:
                self._wait((), (self._to,), end)
            except OSError as error:
                raise self._end("the subject's process has ended") from error

    def _wait(self, reading: Sequence[int], writing: Sequence[int], end: float) -> None:
        if not any(select.select(reading, writing, [], max(0.0, end - time.monotonic()))):
            self.silent = f"the subject does not answer within {self.patience:g} s{self._place()}"
            raise self._end(self.silent)

    def _place(self) -> str:
        """The line of the program's own files that is executed, as its process writes it (`host.main`)."""
        text = b""
        if self.isolation is Isolation.SEALED or self.process is None:
            return ""
        with contextlib.suppress(OSError):
            os.kill(self.process.pid, signal.SIGUSR1)
            while not text.endswith(b"in <module>\n") and select.select([self._from], [], [], 0.5)[0]:
                part = os.read(self._from, 1 << 16)
                text += part
                if not part or len(text) > 1 << 16:
                    break
        places = re.findall(r'File "(.+)", line (\d+) in (\w+)', text.decode("utf-8", "replace"))
        own = [place for place in places if Path(place[0]).is_relative_to(self.root)]
        return f": it is in {own[0][2]} ({Path(own[0][0]).name}, line {own[0][1]})" if own else ""

    def _written(self, cases: Sequence[Mapping[str, Any]]) -> bytes:
        """The cases as the process reads them: one line."""
        return json.dumps(list(cases)).encode() + b"\n"

    def _in_turn(self, message: Message) -> bool:
        """Whether a message answers the last request."""
        return True

    def _command(self, there: int, back: int) -> list[str]:
        """The command. It reads from descriptor `there` and writes to `back`."""
        host = Path(__file__).with_name("host.py").resolve()
        command = [sys.executable, "-P", "-B", str(host), str(self.path), self.function, str(self.root)]
        return [*command, str(there), str(back)]

    def _around(self, command: list[str]) -> list[str]:
        """The command that is started instead."""
        return command

    def _end(self, why: str) -> SubjectFailed:
        """Stop it; returns the fault that was found, or else `why`."""
        self._stop()
        if process.ended_by_others():
            self.silent = "the subject's process was killed from outside"
        return SubjectFailed(self.fault or why)

    def _stop(self) -> None:
        if self.process is not None:
            os.close(self._to)
            if not self.silent:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.process.wait(2.0)  # it ends by itself once nothing more is asked
            os.close(self._from)
            self._to = self._from = -1
            self.code = self.process.poll()
            process.ended_with(self.code)
            process.kill_tree(self.process.pid)
            self.process.wait()
            process.unwatch(self.process.pid)
            left = process.end_orphans()
            if left and self.isolation is not Isolation.SEALED:
                self.fault = self.fault or "the subject left processes behind"
            self.process, self._buffer = None, b""
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    def _start(self) -> None:
        there, self._to = os.pipe()
        self._from, back = os.pipe()
        command = self._command(there, back)
        self._scratch = tempfile.TemporaryDirectory(prefix="avow-subject-", ignore_cleanup_errors=True)
        place = os.path.realpath(self._scratch.name)
        if self.isolation is Isolation.SEALED:
            command = sealed(command, Path(place))
        environment = {
            "PATH": os.environ.get("PATH", os.defpath),
            "PYTHONPATH": absolute_only(),
            "PYTHONHASHSEED": "0",
            "LANG": "C.UTF-8",
            "TZ": "UTC",
            "TMPDIR": place,
            "HOME": place,
        }
        os.set_blocking(self._to, False)
        self.process = subprocess.Popen(
            self._around(command),
            cwd=self.root,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
            pass_fds=(there, back),
        )
        process.watch(self.process.pid)
        os.close(there)
        os.close(back)
        ready = self._message()
        if not ready.ready:
            raise self._end(f"the subject cannot be loaded: {ready.error or 'no reason given'}")

    def _message(self) -> Message:
        """The next message of its process. Raises SubjectFailed."""
        try:
            message = from_text(Message, self._line())
        except Unreadable:
            raise self._end("the subject's answer is no data") from None
        self._events.update((looked, None) for looked in message.seen)
        return message

    def _line(self) -> bytes:
        end = time.monotonic() + self.patience
        while b"\n" not in self._buffer:
            self._wait((self._from,), (), end)
            part = os.read(self._from, 1 << 16)
            if not part:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    assert self.process is not None
                    self.process.wait(self.patience)  # its exit code shows who ended it
                raise self._end("the subject's process has ended")
            self._buffer += part
            if len(self._buffer) > 16_000_000:
                raise self._end("the subject's answer has no end")
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line
