"""A judge in a process of its own, whose word comes through a pipe that only it and we hold.

No file carries a verdict: a subject, or something that it left running, could write one. The judge's answer counts if
it ended well and the pipe held its one line and nothing else.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from avow.base import process
from avow.base.codec import Unreadable, from_json, from_text, line
from avow.base.module_path import absolute_only
from avow.base.process import Completed
from avow.base.records import dataclass
from avow.base.tuning.running import CHANNEL_PATIENCE
from avow.base.tuning.sizes import CHANNEL_KEPT

T = TypeVar("T")


class Channel:
    """A pipe that is read while its other end, `theirs`, is written to: who writes more than a pipe holds would wait
    for us, and we for its end."""

    def __init__(self) -> None:
        self._ours, self.theirs = os.pipe()
        self._parts: list[bytes] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        size = 0
        while part := os.read(self._ours, 1 << 16):
            size += len(part)
            if size <= CHANNEL_KEPT:
                self._parts.append(part)

    def close(self) -> bytes | None:
        """What came, once who wrote has ended and `theirs` is closed; what is beyond all measure is left out. None
        where somebody still holds the other end."""
        self._reader.join(CHANNEL_PATIENCE)
        if self._reader.is_alive():
            return None
        os.close(self._ours)
        return b"".join(self._parts)


def ask(
    kind: type[T],
    script: str,
    arguments: Sequence[str],
    *,
    cwd: Path,
    seconds: float,
    megabytes: int,
    env: Mapping[str, str],
) -> tuple[Completed, T | None]:
    """Run ``python script FD arguments…``; the judge writes its answer, a `kind`, with `say`. Raises ToolMissing."""
    channel = Channel()
    try:
        done = process.run(
            [sys.executable, "-P", script, str(channel.theirs), *arguments],
            cwd=cwd,
            seconds=seconds,
            megabytes=megabytes,
            env={**os.environ, "PYTHONPATH": absolute_only(), **env},
            pass_fds=(channel.theirs,),
        )
    finally:
        process.end_orphans()
        os.close(channel.theirs)
        said = channel.close()
    if done.code != 0 or said is None or said.count(b"\n") != 1 or not said.endswith(b"\n"):
        return done, None
    try:
        word = from_text(_Word, said)
        if word.ended:
            process.ended_with(-signal.SIGKILL)
        return done, from_json(kind, word.answer)
    except Unreadable:
        return done, None


@dataclass(frozen=True, slots=True)
class _Word:
    """A judge's. `ended`: its subject was, by somebody else."""

    answer: Any
    ended: bool


def say(channel: int, answer: object) -> None:
    """The judge's one word to whoever started it."""
    data = line(_Word(answer, process.ended_by_others()))
    while data:
        data = data[os.write(channel, data) :]
    os.close(channel)
