"""Bounded runs of outside tools: own session, whole process group killed, output to files, never a hang.

A tool is given wall-clock time and memory; what it leaves behind (a solver that outlives its driver) is killed with it,
also when Avow itself is interrupted.
"""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

_KEEP = 4_000_000
"""Characters of output kept: a tool that prints without end must not fill the memory."""

_running: set[int] = set()
_lock = threading.Lock()


@dataclass(frozen=True, slots=True)
class Completed:
    """How a tool ended. `code` is None after a time-out."""

    command: tuple[str, ...]
    code: int | None
    stdout: str
    stderr: str
    seconds: float

    @property
    def timed_out(self) -> bool:
        return self.code is None


class ToolMissing(Exception):  # noqa: N818 - it names a state, not a fault
    """The program is not on this machine."""


def run(
    command: Sequence[str],
    *,
    cwd: Path | None = None,
    seconds: float = 60.0,
    megabytes: int | None = None,
    env: Mapping[str, str] | None = None,
    stdin: str | None = None,
) -> Completed:
    """Run a program without a shell. Raises ToolMissing; a failure or a time-out is a result, not an exception."""
    start = time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, _stdin(stdin) as source:
        try:
            process = subprocess.Popen(
                list(command),
                cwd=cwd,
                stdin=source,
                stdout=out,
                stderr=err,
                env={**os.environ, **env} if env else None,
                start_new_session=True,
                preexec_fn=_limit(megabytes) if megabytes else None,
            )
        except (FileNotFoundError, PermissionError, NotADirectoryError) as error:
            raise ToolMissing(f"{command[0]}: {error.strerror or error}") from error
        with _lock:
            _running.add(process.pid)
        code: int | None
        try:
            code = process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            _kill_group(process.pid)
            process.wait()
            with _lock:
                _running.discard(process.pid)
        return Completed(tuple(command), code, _read(out), _read(err), time.monotonic() - start)


def kill_all() -> None:
    """Kill every tool under way: called when Avow is interrupted."""
    with _lock:
        pids = tuple(_running)
    for pid in pids:
        _kill_group(pid)


def _kill_group(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def _limit(megabytes: int) -> Callable[[], None]:
    size = megabytes * 1024 * 1024

    def apply() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (size, size))

    return apply


@contextlib.contextmanager
def _stdin(text: str | None) -> Iterator[int]:
    if text is None:
        yield subprocess.DEVNULL
        return
    with tempfile.TemporaryFile() as file:
        file.write(text.encode())
        file.seek(0)
        yield file.fileno()


def _read(file: object) -> str:
    file.seek(0)  # type: ignore[attr-defined]
    data: bytes = file.read(_KEEP)  # type: ignore[attr-defined]
    return data.decode("utf-8", errors="replace")
