"""Bounded runs of outside tools: own session, whole process group killed, output to files, never a hang.

A tool is given wall-clock time and memory; what it leaves behind (a solver that outlives its driver) is killed with it,
also when Avow itself is interrupted.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from avow.base.tuning.running import FORK_LOOK, PROCESSOR_LOOK, WALL
from avow.base.tuning.sizes import OUTPUT_KEPT

_FROM_OUTSIDE = frozenset({-signal.SIGHUP, -signal.SIGINT, -signal.SIGKILL, -signal.SIGTERM, -signal.SIGXFSZ})
"""Signals of a tool that was ended from outside: by a person, or by a system out of memory or disk space. A crash of
its own gives others."""


HOME_PREFIX = "avow-home-"
"""Prefix of the empty temporary folders that tools get as their homes."""


@dataclass(slots=True)
class _Process:
    """What this process started, received and may do: state of the process, not of a run, like its imports."""

    running: set[int] = field(default_factory=set)
    lock: threading.Lock = field(default_factory=threading.Lock)
    ended_by_others: bool = False
    adopted_since: frozenset[int] | None = None
    """The children that it had when it began to adopt orphans; None before."""
    trusts_plugins: bool = False
    """It may import what a plan names under ``plugins``."""


here = _Process()


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
    """The program is missing on this machine."""


def run(
    command: Sequence[str],
    *,
    cwd: Path | None = None,
    seconds: float = 60.0,
    megabytes: int | None = None,
    env: Mapping[str, str] | None = None,
    stdin: str | None = None,
    pass_fds: Sequence[int] = (),
    stopped: Callable[[], bool] | None = None,
    tied: bool = True,
) -> Completed:
    """Run a program without a shell. Raises ToolMissing; a failure or a time-out is a result, not an exception. It ends
    soon after `stopped` says so, as if its time were up.

    It gets the variables `bare` and `env`, and no others, so that no answer depends on a person's environment or home.
    If `tied`, it dies with this process; an untied one, for tools that end at once, starts at a tenth of the cost, as
    it needs no fork."""
    assert tied or megabytes is None
    start = time.monotonic()
    with (
        tempfile.TemporaryFile() as out,
        tempfile.TemporaryFile() as err,
        _stdin(stdin) as source,
        tempfile.TemporaryDirectory(prefix=HOME_PREFIX, ignore_cleanup_errors=True) as home,
    ):
        try:
            process = subprocess.Popen(
                list(command),
                cwd=cwd,
                stdin=source,
                stdout=out,
                stderr=err,
                env={**bare(home), **(env or {})},
                start_new_session=True,
                preexec_fn=_before_exec(megabytes) if tied else None,
                pass_fds=pass_fds,
            )
        except (FileNotFoundError, PermissionError, NotADirectoryError) as error:
            raise ToolMissing(f"{command[0]}: {error.strerror or error}") from error
        watch(process.pid)
        code: int | None
        try:
            code = _wait(process, start + seconds, stopped)
        finally:
            if process.returncode is None:
                kill_tree(process.pid)
                process.wait()
            else:
                _kill_group(process.pid)  # only its group can be attributed to it
            unwatch(process.pid)
        ended_with(code)
        return Completed(tuple(command), code, _read(out), _read(err), time.monotonic() - start)


def _wait(process: subprocess.Popen[bytes], end: float, stopped: Callable[[], bool] | None) -> int | None:
    """Its exit code; None after a time-out or if it was cancelled."""
    while True:
        left = end - time.monotonic()
        try:
            return process.wait(timeout=max(0.0, left if stopped is None else min(left, FORK_LOOK)))
        except subprocess.TimeoutExpired:
            if left <= 0 or (stopped is not None and stopped()):
                return None


def bare(home: str) -> dict[str, str]:
    """The variables that an outside program gets: PATH, an empty folder as HOME, one language."""
    fixed = {"HOME": home, "TMPDIR": home, "LANG": "C.UTF-8", "LC_ALL": "C.UTF-8", "TZ": "UTC"}
    return {"PATH": os.environ.get("PATH", os.defpath), **fixed}


def ended_with(code: int | None) -> None:
    """Note how a program that this process ran ended; if it was killed from outside, `ended_by_others` is true. A
    program that runs another one reports that one's signal by a code above 128."""
    if code is not None and (128 - code if code > 128 else code) in _FROM_OUTSIDE:
        here.ended_by_others = True


def ended_by_others() -> bool:
    """Whether a tool that this process ran was killed from outside: its failure then says nothing about its input."""
    return here.ended_by_others


def watch(pid: int) -> None:
    """`kill_all` is to kill this process too, with its descendants."""
    with here.lock:
        here.running.add(pid)


def unwatch(pid: int) -> None:
    """It has ended and was waited for: its process id may be reused now."""
    with here.lock:
        here.running.discard(pid)


def kill_all() -> None:
    """Kill every running tool: called when Avow is interrupted."""
    with here.lock:
        pids = tuple(here.running)
    for pid in pids:
        kill_tree(pid)


def kill_tree(pid: int) -> None:
    """Kill a process, its group, and descendants that moved to a group of their own (a tool that a worker runs)."""
    family = [pid, *_descendants(pid)]
    _kill_group(pid)
    for member in family:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(member, signal.SIGKILL)


def _kill_group(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def _descendants(pid: int, known: Mapping[int, Sequence[bytes]] | None = None) -> list[int]:
    children = _parents(_processes() if known is None else known)
    found: list[int] = []
    todo = [pid]
    while todo:
        for child in children.get(todo.pop(), ()):
            found.append(child)
            todo.append(child)
    return found


def _parents(known: Mapping[int, Sequence[bytes]]) -> dict[int, list[int]]:
    """Process → its children."""
    children: dict[int, list[int]] = {}
    for pid, fields in known.items():
        children.setdefault(int(fields[1]), []).append(pid)
    return children


def _processes() -> dict[int, list[bytes]]:
    """Process → the fields of its `stat` behind its name. Read from /proc; empty where there is none."""
    found: dict[int, list[bytes]] = {}
    with contextlib.suppress(OSError), os.scandir("/proc") as processes:
        for name in [entry.name for entry in processes if entry.name.isdigit()]:
            with contextlib.suppress(OSError), open(f"/proc/{name}/stat", "rb", 0) as stat:  # noqa: PTH123 - there are many
                # the name in parentheses may contain spaces and parentheses
                if len(fields := stat.read(4096).rpartition(b")")[2].split()) > 14:
                    found[int(name)] = fields
    return found


class Stopwatch:
    """The processor seconds that this process and all that it started have used since, so that a limit does not depend
    on the machine's load; or the `WALL`-th part of the time on the clock if that is more, as for a program that
    sleeps."""

    def __init__(self) -> None:
        self._wall, self._looked, self._last = time.monotonic(), 0.0, 0.0
        self._begun = _processor_seconds()

    def __call__(self) -> float:
        now = time.monotonic()
        if now - self._looked > PROCESSOR_LOOK:
            self._looked = now
            self._last = max(self._last, _processor_seconds() - self._begun, (now - self._wall) / WALL)
        return self._last


def _processor_seconds() -> float:
    """Of this process and of its descendants, those that have ended included."""
    known = _processes()
    ticks = sum(int(field) for pid in _descendants(os.getpid(), known) for field in known[pid][11:15])
    return sum(os.times()[:4]) + ticks / os.sysconf("SC_CLK_TCK")


_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4
_PR_SET_CHILD_SUBREAPER = 36
_LIBC = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None


def die_with(parent: int) -> None:
    """Called by a new process: it must not outlive `parent`, which started it, however that dies."""
    if _LIBC is not None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before the call
            os._exit(1)


def adopt_orphans() -> None:
    """From now on, a process that a descendant leaves running becomes our child, in any session or group; and our
    memory and descriptors are hidden from our own user if the system can do so. Only on Linux."""
    if _LIBC is None or here.adopted_since is not None:
        return
    _LIBC.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    _LIBC.prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0)
    here.adopted_since = frozenset(children(os.getpid()))


def forget_orphans() -> None:
    """In a fork: forget what the parent adopts, runs and received."""
    here.adopted_since, here.ended_by_others = None, False
    here.running.clear()


def end_orphans() -> bool:
    """Kill all adopted children until none is left; whether there was any. See `adopt_orphans`."""
    if here.adopted_since is None:
        return False
    found = False
    for _ in range(1000):  # a killed process may leave children, which become ours
        with here.lock:
            expected = here.adopted_since | here.running
        orphans = [pid for pid in children(os.getpid()) if pid not in expected]
        if not orphans:
            return found
        found = True
        for pid in orphans:
            kill_tree(pid)
        for pid in orphans:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, 0)
    return found


def guard(*, tied: bool) -> None:
    """Returns in a fork, which goes on; this process only watches it from now on, and ends with the same code. It ends
    whatever the fork leaves running, and, if `tied`, all of it when the process that started this one ends. Only on
    Linux: elsewhere nothing is watched."""
    if _LIBC is None:
        return
    adopt_orphans()
    signals = {signal.SIGCHLD, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    if tied:  # until here it was to die at once, with nothing running
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    watching, pid = os.getpid(), os.fork()
    if pid == 0:
        forget_orphans()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
        os.setsid()
        if tied:
            die_with(watching)
        return
    code = 1
    try:
        os.closerange(3, os.sysconf("SC_OPEN_MAX"))  # the other ends of these connections must see them close
        ended, status = 0, 0
        while not ended and signal.sigwait(signals) == signal.SIGCHLD:
            ended, status = os.waitpid(pid, os.WNOHANG)
        end_orphans()
        code = os.waitstatus_to_exitcode(status) if ended else -signal.SIGTERM
    finally:
        os._exit(128 - code if code < 0 else code)


def children(pid: int) -> list[int]:
    """The processes that a process has started or adopted."""
    return _parents(_processes()).get(pid, [])


def _before_exec(megabytes: int | None) -> Callable[[], None]:
    size = megabytes * 1024 * 1024 if megabytes else None
    here = os.getpid()

    def apply() -> None:
        die_with(here)
        if size is not None:
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
    data: bytes = file.read(OUTPUT_KEPT)  # type: ignore[attr-defined]
    return data.decode("utf-8", errors="replace")
