"""A process that answers one question after another: to start Python and a solver costs more than most questions.

``python -P -m MODULE PARENT`` reads questions as lines of JSON, and writes for each a line: the answer, and the digest
of what it is the answer to, so that no answer is taken for another's (`serve`). One that crashes or does not keep its
time is ended, and the next question gets another.
"""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from avow.base import process
from avow.base.codec import Unreadable, from_json, from_text, line
from avow.base.files import sha256
from avow.base.tuning.sizes import ANSWERED_BY_ONE

T = TypeVar("T")
Q = TypeVar("Q")


@dataclass(frozen=True, slots=True)
class _Answer:
    said: Any
    of: str
    """The digest of the question's line."""


class NoAnswer(Exception):  # noqa: N818 - it says what it is
    """The process ended without a word, or said what is no answer to what was asked."""


@dataclass(slots=True)
class Answering:
    """Started at the first question, and anew in a fork of this process. Safe to use from several threads."""

    module: str
    _owner: int = 0
    _asked: int = 0
    _process: subprocess.Popen[bytes] | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def ask(self, question: object, kind: type[T], seconds: float) -> T:
        """Its answer, of that type. Raises NoAnswer, and TimeoutError."""
        if self._owner != os.getpid():  # of the process that this one is a fork of, and so is the lock
            self._process, self._lock, self._owner = None, threading.Lock(), os.getpid()
        asked = line(question)
        with self._lock:
            try:
                found = from_text(_Answer, self._answer(asked, time.monotonic() + seconds))
                if found.of != sha256(asked):
                    raise Unreadable("it is the answer to another question")
                return from_json(kind, found.said)
            except (OSError, ValueError) as error:
                self._end()
                if isinstance(error, TimeoutError):
                    raise
                raise NoAnswer(str(error)) from error

    def close(self) -> None:
        with self._lock:
            if self._owner == os.getpid():
                self._end()

    def _answer(self, asked: bytes, end: float) -> bytes:
        if self._process is None or self._asked >= ANSWERED_BY_ONE or self._process.poll() is not None:
            self._end()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", self.module, str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
            process.watch(self._process.pid)
            self._asked = 0
        self._asked += 1
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(asked)
        self._process.stdin.flush()
        said = b""
        while not said.endswith(b"\n"):
            left = end - time.monotonic()
            if left <= 0 or not select.select([self._process.stdout], [], [], left)[0]:
                raise TimeoutError
            part = os.read(self._process.stdout.fileno(), 1 << 16)
            if not part:
                raise ValueError("it ended")
            said += part
        return said

    def _end(self) -> None:
        if self._process is None:
            return
        process.kill_tree(self._process.pid)
        self._process.wait()
        process.unwatch(self._process.pid)
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):  # what it was to read can no longer be written
                stream.close() if stream is not None else None
        self._process = None


def serve(answer: Callable[[Q], object], kind: type[Q]) -> None:
    """The far end, until there are no more questions, or what comes is none."""
    process.die_with(int(sys.argv[1]))
    for asked in sys.stdin.buffer:
        try:
            question = from_text(kind, asked)
        except Unreadable as error:
            sys.exit(f"what came is no question: {error}")
        sys.stdout.buffer.write(line(_Answer(answer(question), sha256(asked))))
        sys.stdout.buffer.flush()
