"""A subject's process, from the judge's side: questions and answers as lines of JSON, with bounded patience."""

from __future__ import annotations

import contextlib
import json
import os
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
from avow.base.records import dataclass
from avow.base.tuning.sizes import SCRATCH_BYTES
from avow.base.verdict import Isolation
from avow.isolation.level import available, sealed
from avow.isolation.observed import Observed, Seen, as_here, interpreter, recorded, untold, variables
from avow.isolation.printed import Names, Printed
from avow.isolation.tracing import Trace, traces

_SCRATCH = "/tmp/avow-scratch"
"""Where a sealed subject may write."""


class SubjectFailed(Exception):  # noqa: N818 - it names what happened
    """The subject raised, ended, hung, did what no subject may do, or returned what is no value of the output's
    type."""


@dataclass(frozen=True, slots=True)
class Message:
    """A line from a subject's process, which may be of the subject's making: one that does not read as this is its
    fault. (`host` and a compiled program write it without the codec: what they import, the subject can change.)"""

    seen: tuple[tuple[str, str], ...] = field(default=(), metadata=LATER)
    """(event, path) of what it has looked at since the message before."""
    faults: tuple[str, ...] = field(default=(), metadata=LATER)
    ready: bool = field(default=False, metadata=LATER)
    error: str = field(default="", metadata=LATER)
    """Why it is not ready."""
    replies: tuple[Any, ...] | None = field(default=None, metadata=LATER)
    """One a case: ``{"value": …}`` or ``{"error": "…"}``."""
    turn: str = field(default="", metadata=LATER)
    """Of a compiled program: the question that it answers."""
    end: bool = field(default=False, metadata=LATER)


class SubjectProcess:
    """The process that holds a function of a Python file. Started at the first question.

    `root` is the system's folder, `names` what has a verdict (`Names.of`). Once `fault` says something, no answer
    of this subject counts: it started processes, wrote files, looked at other processes or printed what reads as a
    result; what it left running is found where the judge has said `process.adopt_orphans`. Raises `level.Unavailable`
    where it must be sealed and cannot be.
    """

    def __init__(
        self, path: Path, function: str, patience: float, root: Path | None = None, names: Sequence[str] = ()
    ) -> None:
        self.names = names
        self.path, self.function, self.patience = path.resolve(), function, patience
        self.root = (root or path.parent).resolve()
        self.isolation: Isolation = available()
        self.fault = ""
        self.silent = ""
        """Why there is no answer that says nothing of the subject: time on the wall, or a kill from outside."""
        self.code: int | None = None
        """How its process ended, where it ended by itself."""
        self.process: subprocess.Popen[bytes] | None = None
        self._events: dict[tuple[str, str], None] = {}
        self._trace: Trace | None = None
        self._printed: Printed | None = None
        self._untraced = False
        """Whether something ran that no trace tells of."""
        self._to = self._from = -1
        self._buffer = b""
        self._scratch: tempfile.TemporaryDirectory[str] | None = None

    def ask(self, inputs: Mapping[str, Any]) -> Any:
        """What the subject returned, as the host's data. Raises SubjectFailed."""
        reply = self.ask_all([inputs])[0]
        if isinstance(reply, SubjectFailed):
            raise reply
        return reply

    def ask_all(self, cases: Sequence[Mapping[str, Any]]) -> list[Any]:
        """For each case what the subject returned, or the SubjectFailed that it ended in; where the process itself
        fails, nothing for the cases after. Many at a time cost less: each question wakes another process."""
        try:
            replies = self._exchange(cases)
        except SubjectFailed as failure:
            if len(cases) == 1 or self.fault:
                return [failure]
            return self._one_by_one(cases)
        return [self._reply(reply) for reply in replies]

    def observed(self) -> tuple[Observed, ...]:
        """What it has looked at so far, the interpreter first, who watched it and kept it last. A program that it
        started is told by what the trace tells of it, where there is one of all that ran."""
        programs = [what for event, what in self._events if event == "program"]
        untraced = map(untold, dict.fromkeys(programs)) if self._untraced else ()
        return (
            interpreter(),
            as_here(Seen.MODULES),
            *recorded(e for e in self._events if e[0] != "program"),
            *untraced,
            as_here(Seen.TRACER),
            as_here(Seen.SANDBOX),
        )

    def close(self) -> str:
        """End it, with all that it started; in words what it did that no subject may do, or why its end says nothing
        of it (`silent`): no answer counts then."""
        if self.process is not None:
            os.close(self._to)
            self._to = -1
            try:
                if not self._message().end:  # its last: what it looked at, and whether something is left
                    self.fault = self.fault or "the subject does not end as it is asked"
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.process.wait(2.0)
            except SubjectFailed as failure:
                if not self.silent:
                    self.fault = self.fault or f"the subject does not end as it is asked: {failure}"
        self._stop()
        return self.fault or self.silent

    # -- inside ------------------------------------------------------------------------------------------

    def _one_by_one(self, cases: Sequence[Mapping[str, Any]]) -> list[Any]:
        """The answers up to the first case that has none: which of many it was that ended the process."""
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
        if self._buffer:
            raise SubjectFailed("the subject's process answers out of turn")
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
        assert self._printed is not None
        if not self._printed.wait(reading, writing, end - time.monotonic()):
            self.silent = f"the subject does not answer within {self.patience:g} s"
            raise self._end(self.silent)

    def _written(self, cases: Sequence[Mapping[str, Any]]) -> bytes:
        """The cases as the process reads them: one line."""
        return json.dumps(list(cases)).encode() + b"\n"

    def _in_turn(self, message: Message) -> bool:
        """Whether a message is the answer to what was asked last."""
        return True

    def _command(self, there: int, back: int, mark: str) -> tuple[list[str], tuple[Path, ...]]:
        """What is run, and the folders that it has to see. It reads from descriptor `there`, writes to `back`, and
        looks at ``<mark>-begin`` and ``<mark>-end``."""
        host = Path(__file__).with_name("host.py").resolve()
        command = [sys.executable, "-P", "-B", str(host), str(self.path), self.function, str(self.root)]
        command += [self.isolation.value, str(there), str(back), mark]
        return command, (host.parent, host.parent.parent / "drive", Path(sys.prefix), Path(sys.base_prefix))

    def _end(self, why: str) -> SubjectFailed:
        """Stop it, and say why: what it did before that no subject may do, or else `why`."""
        self._stop()
        if process.ended_by_others():
            self.silent = "the subject's process was killed from outside"
        return SubjectFailed(self.fault or why)

    def _stop(self) -> None:
        if self.process is not None:
            self.code = self.process.poll()
            # of a subject that does not answer the process is strace's child, and becomes ours as both are ended
            own = process.children(self.process.pid) if self._trace is not None and self.silent else ()
            process.ended_with(self.code)
            process.kill_tree(self.process.pid)
            self.process.wait()
            process.unwatch(self.process.pid)
            for channel in {self._to, self._from} - {-1}:
                os.close(channel)
            left = process.end_orphans(own)
            if self._printed is not None:
                self._printed.end()
                self._judge_printed()
                self._printed = None
            if left and self.isolation is not Isolation.SEALED and not self.fault:
                self.fault = "the subject left processes behind"
            self.process, self._buffer = None, b""
            self._read_trace()
        if self._scratch is not None:
            if _more_than(SCRATCH_BYTES, self._scratch.name) and not self.fault:
                self.fault = f"the subject fills its scratch folder: more than {SCRATCH_BYTES // 1_000_000} MB"
            self._scratch.cleanup()
            self._scratch = None

    def _judge_printed(self) -> None:
        if self._printed is not None and self._printed.result and not self.fault:
            self.fault = f"the subject {self._printed.told()}"

    def _read_trace(self) -> None:
        traced = self._trace.read(self.root, self._writes) if self._trace is not None else None
        if traced is None:
            self._untraced = True
        else:
            self._events.update((event, None) for event in traced.events)
            if traced.faults and not self.fault:
                self.fault = f"the subject {traced.faults[0]}"
        self._trace = None

    def _start(self) -> None:
        there, self._to = os.pipe()
        self._from, back = os.pipe()
        self._trace = Trace() if traces() else None
        command, shown = self._command(there, back, self._trace.mark if self._trace is not None else "")
        environment = {
            **variables(),
            "PYTHONHASHSEED": "0",
            "LANG": "C.UTF-8",
            "TZ": "UTC",
        }
        if self.isolation is Isolation.SEALED:
            environment["TMPDIR"] = _SCRATCH
            command = sealed(command, (self.root, *shown), _SCRATCH)
        else:
            self._scratch = tempfile.TemporaryDirectory(prefix="avow-subject-")
            environment["TMPDIR"] = os.path.realpath(self._scratch.name)
        environment["HOME"] = self._writes = environment["TMPDIR"]
        if self._trace is not None:
            command = self._trace.around(command)
        os.set_blocking(self._to, False)
        self._printed = Printed(Names.of(self.names))
        self.process = subprocess.Popen(
            command,
            cwd=self.root,
            stdin=subprocess.DEVNULL,
            stdout=self._printed.theirs[0],
            stderr=self._printed.theirs[1],
            env=environment,
            start_new_session=True,
            pass_fds=(there, back),
        )
        process.watch(self.process.pid)
        self._printed.begun()
        os.close(there)
        os.close(back)
        ready = self._message()
        if not ready.ready:
            raise self._end(f"the subject cannot be loaded: {ready.error or 'no reason given'}")

    def _message(self) -> Message:
        """What its process says next, of which is kept what the subject looked at. Raises SubjectFailed."""
        try:
            message = from_text(Message, self._line())
        except Unreadable:
            raise self._end("the subject's answer is no data") from None
        self._events.update((looked, None) for looked in message.seen)
        if message.faults:
            self.fault = f"the subject {message.faults[0]}"
        elif self._printed is not None:
            self._printed.read()
            self._judge_printed()
        if self.fault:
            raise self._end(self.fault)
        return message

    def _line(self) -> bytes:
        end = time.monotonic() + self.patience
        while b"\n" not in self._buffer:
            self._wait((self._from,), (), end)
            part = os.read(self._from, 1 << 16)
            if not part:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    assert self.process is not None
                    self.process.wait(self.patience)  # what it ended with says by whom
                raise self._end("the subject's process has ended")
            self._buffer += part
            if len(self._buffer) > 16_000_000:
                raise self._end("the subject's answer has no end")
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line


def _more_than(limit: int, folder: str) -> bool:
    """Whether what lies in a folder takes more bytes of the disk."""
    taken = 0
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            with contextlib.suppress(OSError):
                taken += os.lstat(os.path.join(place, name)).st_blocks * 512  # noqa: PTH118
        if taken > limit:
            return True
    return False
