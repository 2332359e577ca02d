"""The subject's process, from the judge's side: questions and answers as lines of JSON, with bounded patience."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .convention import sent
from .generate import Inputs

PATIENCE = 10.0
"""Seconds that a subject may take for one answer."""


class SubjectFailed(Exception):  # noqa: N818 - it names what happened
    """The subject raised, ended, hung, or returned what is no value of the output's type."""


class Subject:
    """The process that holds the subject. Started at the first question."""

    def __init__(self, path: Path, function: str, patience: float) -> None:
        self.path, self.function, self.patience = path, function, patience
        self.process: subprocess.Popen[bytes] | None = None
        self._to = self._from = -1
        self._buffer = b""

    def ask(self, inputs: Inputs) -> Any:
        """What the subject returned, as the host's data. Raises SubjectFailed."""
        reply = self.ask_all([inputs])[0]
        if isinstance(reply, SubjectFailed):
            raise reply
        return reply

    def ask_all(self, cases: Sequence[Inputs]) -> list[Any]:
        """For each case what the subject returned, or the SubjectFailed that it ended in; where the process itself
        fails, nothing for the cases after. Many at a time cost less: each question wakes another process."""
        try:
            replies = self._exchange(cases)
        except SubjectFailed as failure:
            if len(cases) == 1:
                return [failure]
            return self._one_by_one(cases)
        return [self._reply(reply) for reply in replies]

    def _one_by_one(self, cases: Sequence[Inputs]) -> list[Any]:
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

    def _exchange(self, cases: Sequence[Inputs]) -> list[Any]:
        if self.process is None:
            self._start()
        if self._buffer:
            raise SubjectFailed("the subject's process answers out of turn")
        data = [{name: sent(value) for name, value in inputs.items()} for inputs in cases]
        request = json.dumps(data).encode() + b"\n"
        try:
            while request:
                request = request[os.write(self._to, request) :]
        except OSError as error:
            self.close()
            raise SubjectFailed("the subject's process has ended") from error
        replies = self._line()
        if not isinstance(replies, list) or len(replies) != len(cases):
            self.close()
            raise SubjectFailed("the subject's answer is no data")
        return replies

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            os.close(self._to)
            os.close(self._from)
            self.process, self._buffer = None, b""

    def _start(self) -> None:
        there, self._to = os.pipe()
        self._from, back = os.pipe()
        host = Path(__file__).with_name("host.py")
        self.process = subprocess.Popen(
            [sys.executable, "-P", str(host), str(self.path), self.function, str(there), str(back)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # nothing is to appear beside the subject
            pass_fds=(there, back),
        )
        os.close(there)
        os.close(back)
        ready = self._line()
        if not isinstance(ready, dict) or not ready.get("ready"):
            self.close()
            why = ready.get("error", "no reason given") if isinstance(ready, dict) else "no reason given"
            raise SubjectFailed(f"the subject cannot be loaded: {why}")

    def _line(self) -> Any:
        end = time.monotonic() + self.patience
        while b"\n" not in self._buffer:
            left = end - time.monotonic()
            if left <= 0 or not select.select([self._from], [], [], left)[0]:
                self.close()
                raise SubjectFailed(f"the subject does not answer within {self.patience:g} s")
            part = os.read(self._from, 1 << 16)
            if not part or len(self._buffer) > 4_000_000:
                self.close()
                raise SubjectFailed(
                    "the subject's process has ended" if not part else "the subject's answer has no end"
                )
            self._buffer += part
        line, _, self._buffer = self._buffer.partition(b"\n")
        try:
            return json.loads(line)
        except (ValueError, RecursionError) as error:
            self.close()
            raise SubjectFailed("the subject's answer is no data") from error
