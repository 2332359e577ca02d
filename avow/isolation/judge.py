"""A judge in a process of its own, which answers through a descriptor that no program under test has.

The answer counts if the judge exited with 0 and wrote exactly one line.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from avow.base import process
from avow.base.codec import Unreadable, from_json, from_text, line
from avow.base.module_path import absolute_only
from avow.base.process import Completed
from avow.base.records import dataclass
from avow.base.tuning.sizes import CHANNEL_KEPT

T = TypeVar("T")


class Channel:
    """An unnamed file for one answer. Its descriptor `theirs` is what a process inherits to write it."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - `close` closes it
        self.theirs = self._file.fileno()

    def close(self) -> bytes:
        """The written bytes, up to a limit, once the writer has ended."""
        with self._file:
            self._file.seek(0)
            return self._file.read(CHANNEL_KEPT)


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
        output = channel.close()
    if done.code != 0 or output.count(b"\n") != 1 or not output.endswith(b"\n"):
        return done, None
    try:
        word = from_text(_Word, output)
        if word.ended:
            process.ended_with(-signal.SIGKILL)
        return done, from_json(kind, word.answer)
    except Unreadable:
        return done, None


@dataclass(frozen=True, slots=True)
class _Word:
    """A judge's answer. `ended`: its program under test was killed from outside."""

    answer: Any
    ended: bool


def say(channel: int, answer: object) -> None:
    """Write the judge's only answer."""
    data = line(_Word(answer, process.ended_by_others()))
    while data:
        data = data[os.write(channel, data) :]
    os.close(channel)
