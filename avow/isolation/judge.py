"""A judge in a process of its own, whose word comes through a pipe that only it and we hold.

No file carries a verdict: a subject, or something that it left running, could write one. The judge's answer counts if
it ended well and the pipe held its one line and nothing else.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from avow.base import process
from avow.base.module_path import absolute_only
from avow.base.process import Completed


def ask(
    script: str, arguments: Sequence[str], *, cwd: Path, seconds: float, megabytes: int, env: Mapping[str, str]
) -> tuple[Completed, dict[str, Any] | None]:
    """Run ``python script FD arguments…``; the judge writes its answer with `say`. Raises ToolMissing."""
    ours, theirs = os.pipe()
    parts: list[bytes] = []

    def read() -> None:
        while part := os.read(ours, 1 << 16):
            parts.append(part)

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        done = process.run(
            [sys.executable, "-P", script, str(theirs), *arguments],
            cwd=cwd,
            seconds=seconds,
            megabytes=megabytes,
            env={"PYTHONPATH": absolute_only(), **env},
            pass_fds=(theirs,),
        )
    finally:
        process.end_orphans()
        os.close(theirs)
        reader.join(5.0)
        if not reader.is_alive():
            os.close(ours)
    answer = _answer(b"".join(parts)) if done.code == 0 and not reader.is_alive() else None
    if answer is not None and answer.pop(_ENDED, False):
        process.ended_with(-signal.SIGKILL)
    return done, answer


_ENDED = "ended by others"
"""In a judge's word: its subject was ended by somebody else."""


def _answer(data: bytes) -> dict[str, Any] | None:
    if data.count(b"\n") != 1 or not data.endswith(b"\n"):
        return None
    try:
        answer = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return answer if isinstance(answer, dict) else None


def say(channel: int, answer: Mapping[str, Any]) -> None:
    """The judge's one word to whoever started it."""
    data = json.dumps({**answer, _ENDED: process.ended_by_others()}).encode() + b"\n"
    while data:
        data = data[os.write(channel, data) :]
    os.close(channel)
