"""Methods' files are generated beside the run, in one fork of it.

What a backend needs to write them (Z3, its own writers) is imported there and not here, and the run goes on meanwhile.
It is the same function of the same data in the same program: where there is no such fork, or it gives no answer, the
run generates the files itself.
"""

from __future__ import annotations

import os
import socket
import threading
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path

from avow.base import process
from avow.base.codec import Unreadable, from_text, line
from avow.base.records import dataclass
from avow.pipeline.forks import OwnFork, may_fork

Files = Mapping[str, str]
"""Name → text."""


@dataclass(frozen=True, slots=True)
class _Made:
    """What was made of a name; nothing: the run finds why, and says it."""

    name: str
    files: Files | None


class Beside:
    """The fork, from its run's side. It ends with the run, or at the latest with this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._near: socket.socket | None = None
        self._owner = 0

    def prepare(self, cwd: Path, make: Callable[[str], Files]) -> None:
        """From now on it is asked what `make` says of a name. Without effect where this process cannot be forked."""
        if self._near is not None or not may_fork():
            return
        near, far = socket.socketpair()
        try:
            with far:
                fork = OwnFork(far, cwd, lambda connection: _serve(connection, make))
        except OSError:
            near.close()
            return
        process.watch(fork.pid)
        self._near, self._owner = near, os.getpid()
        weakref.finalize(self, _close, near, fork).atexit = False

    def ask(self, name: str) -> Files | None:
        """What `make` says of it there; None where it says nothing."""
        if self._near is None or self._owner != os.getpid():
            return None
        with self._lock, self._near.makefile("rb") as answers:
            try:
                self._near.sendall(line(name))
                made = from_text(_Made, answers.readline())
            except (OSError, Unreadable):
                return None
        return made.files if made.name == name else None


def _close(near: socket.socket, fork: OwnFork) -> None:
    near.close()
    threading.Thread(target=_wait, args=(fork,), daemon=True).start()


def _wait(fork: OwnFork) -> None:
    fork.wait()
    process.unwatch(fork.pid)  # not before: until then its number cannot be another's


def _serve(connection: socket.socket, make: Callable[[str], Files]) -> int:
    with connection.makefile("rwb") as stream:
        for asked in stream:
            name = from_text(str, asked)
            try:
                said = line(_Made(name, dict(make(name))))
            except Exception:
                said = line(_Made(name, None))
            stream.write(said)
            stream.flush()
    return 0
