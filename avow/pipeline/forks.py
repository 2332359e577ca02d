"""Where a work's process comes from: a fork of one that has imported everything, or else a new Python.

To start Python, import Avow and Z3 and build the grammar's tables costs more than many an obligation does. So a run
starts one server (``python -m avow.pipeline.fork_server``) that does this once, and forks itself for each work. A fork
is a process of its own in a session of its own: it is bounded, crashes and is killed with its descendants like a new
Python. The server runs nothing but imports, has one thread, and ends with the process that started it.

A run of the pipeline has most of that imported itself by the time it knows that there is work. It makes the server as
a fork of its own (`Forks.prepare`), while it has one thread; whoever did not gets a new Python as server.

It is of one process, folder and environment: where any of them is another, another server is started. Systems other
than Linux, and machines on which the server does not start, use a new Python for each work.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from avow.base import process
from avow.base.codec import Unreadable, from_text, line
from avow.base.module_path import absolute_only, is_led_here
from avow.base.process import Completed
from avow.base.tuning.running import COLLECTED_IN_WORKS, FORK_LOOK, FORK_START, FORK_STOP
from avow.base.tuning.sizes import OUTPUT_KEPT

WORKER = "avow.pipeline.worker"
PLAIN = "AVOW_PLAIN_WORKERS"
"""Environment: when set, every work gets a new Python."""


def _python() -> dict[str, str]:
    """Environment of a Python that works for us. It keeps its byte code: a run may start dozens, and each would compile
    the same modules again."""
    return {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": absolute_only()}


def may_fork() -> bool:
    """Whether a fork of this process would be as good as a new Python."""
    return _has_forks() and not is_led_here() and len(list(Path("/proc/self/task").glob("*"))) == 1


def _has_forks() -> bool:
    return not os.environ.get(PLAIN) and sys.platform == "linux" and hasattr(os, "pidfd_open")


_Place = tuple[int, str, tuple[tuple[str, str], ...]]


class Forks:
    """The processes of a run's works. Its server ends with it, or at the latest with this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._server: _Server | None = None
        self._refused: set[_Place] = set()
        """Where a server did not start: waited for once, not for each work."""

    def prepare(self, cwd: Path) -> None:
        """Let the server be a fork of this process: what both need is imported once. Without effect where a fork would
        not be as good as a new Python: with several threads, or modules found in the current folder."""
        if may_fork():
            self._at(cwd, own=True)

    def run(
        self, arguments: Sequence[str], *, cwd: Path, seconds: float, stopped: Callable[[], bool] | None = None
    ) -> Completed:
        """Run the worker on these arguments, in a process of its own; what it prints on standard output is not kept. It
        ends soon after `stopped` says so, as if its time were up."""
        server = self._at(cwd)
        done = server.run(arguments, seconds, stopped) if server else None
        if done is not None:
            return done
        command = [sys.executable, "-P", "-m", WORKER, *arguments]
        return process.run(command, cwd=cwd, seconds=seconds, env={**os.environ, **_python()}, stopped=stopped)

    def _at(self, cwd: Path, own: bool = False) -> _Server | None:
        """The server for this folder and environment; None where there can be none."""
        if not _has_forks():
            return None
        place = (os.getpid(), str(cwd.resolve()), tuple(sorted(os.environ.items())))
        with self._lock:
            if self._server is not None and (self._server.place != place or not self._server.alive):
                self._server.close()
                self._server = None
            if self._server is None and place not in self._refused:
                self._server = _started(place, cwd, own)
                if self._server is None:
                    self._refused.add(place)
                else:
                    weakref.finalize(self, self._server.close).atexit = False
            return self._server


def _started(place: _Place, cwd: Path, own: bool) -> _Server | None:
    try:
        server = _Server(place, cwd, own)
    except OSError:
        return None
    if server.ready():
        return server
    server.close()
    return None


class _Server:
    """The near end. One message on `control` starts a fork, and hands over a socket of that fork's own: on it comes
    the exit code, and closing it kills the fork."""

    def __init__(self, place: _Place, cwd: Path, own: bool) -> None:
        """`own`: a fork of this process. Raises OSError."""
        self.place = place
        self._sending = threading.Lock()
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            # Not bound to our life by a signal, as that is bound to the starting *thread*: it ends as `control` closes.
            self._process = OwnFork(theirs, cwd, _forks) if own else _new_python(theirs, cwd)
        process.watch(self._process.pid)

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def ready(self) -> bool:
        """Wait until it has imported everything."""
        try:
            self._control.settimeout(FORK_START)
            ready = self._control.recv(16) == b"ready"
            self._control.settimeout(None)
        except OSError:
            return False
        return ready

    def run(
        self, arguments: Sequence[str], seconds: float, stopped: Callable[[], bool] | None = None
    ) -> Completed | None:
        """None where the server did not take it on."""
        start = time.monotonic()
        mine, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with tempfile.TemporaryFile() as errors, mine:
            with theirs, self._sending:
                try:
                    socket.send_fds(self._control, [line(list(arguments))], [theirs.fileno(), errors.fileno()])
                except OSError:
                    return None
            code: int | None = None
            ended, fault = False, ""
            try:
                code = _code(mine, start + seconds, stopped)
                ended = True
            except TimeoutError:
                pass
            except Unreadable as error:
                code, fault = 1, f"\nhow the work's process ended cannot be read: {error}"
            finally:
                if not ended:
                    _end(mine)
            errors.seek(0)
            text = errors.read(OUTPUT_KEPT).decode("utf-8", errors="replace") + fault
            return Completed((WORKER, *arguments), code, "", text, time.monotonic() - start)

    def close(self) -> None:
        """Let it end, once nothing that it forked is running. Does not wait for that."""
        if self._control.fileno() >= 0:
            self._control.close()
            threading.Thread(target=self._wait, daemon=True).start()

    def _wait(self) -> None:
        self._process.wait()
        process.unwatch(self._process.pid)  # not before: until then its number cannot be another's


def _new_python(theirs: socket.socket, cwd: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "avow.pipeline.fork_server", str(theirs.fileno())],
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **_python()},
        start_new_session=True,
        pass_fds=[theirs.fileno()],
    )


class OwnFork:
    """A fork of this process that serves, asked after as a `subprocess.Popen` is."""

    def __init__(self, theirs: socket.socket, cwd: Path, serve: Callable[[socket.socket], int]) -> None:
        """`serve` is all that it does, with its end of the connection; its exit code. Raises OSError."""
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _alone(theirs, cwd, serve)
        self._handle = os.pidfd_open(self.pid)
        self._lock = threading.Lock()
        self._ended = False
        atexit.register(self._leave)

    def poll(self) -> int | None:
        """0 once it has ended."""
        with self._lock:
            if not self._ended and self._over(0):
                os.waitpid(self.pid, 0)
                os.close(self._handle)
                self._ended = True
                atexit.unregister(self._leave)
            return 0 if self._ended else None

    def wait(self) -> int:
        """Until it has ended."""
        while self.poll() is None:
            self._over(None)
        return 0

    def _over(self, seconds: float | None) -> bool:
        try:
            return bool(select.select([self._handle], [], [], seconds)[0])
        except (OSError, ValueError):  # another thread saw its end
            return True

    def _leave(self) -> None:
        """At the end of this process, as that is waited for with all that it spent."""
        if self.poll() is None:
            process.kill_tree(self.pid)
            self._over(FORK_STOP)
            self.poll()


def _forks(control: socket.socket) -> int:
    from avow.pipeline import fork_server

    process.guard(tied=False)  # it ends as `control` closes
    return fork_server.serve(control)


def _alone(control: socket.socket, cwd: Path, serve: Callable[[socket.socket], int]) -> NoReturn:
    """In the fork, from here to its end: nothing of the process that it comes from stays open."""
    code = 1
    try:
        os.setsid()
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nothing, stream)
        for name in os.listdir("/proc/self/fd"):  # noqa: PTH208 - a folder's own descriptor is gone once it is listed
            if int(name) > 2 and int(name) != control.fileno():
                with contextlib.suppress(OSError):
                    os.close(int(name))
        os.chdir(cwd)
        os.environ.update(_python())
        atexit._clear()
        process.forget_orphans()
        gc.freeze()  # what it comes with is never looked through, here or in its forks
        gc.set_threshold(COLLECTED_IN_WORKS)
        code = serve(control)
    finally:
        os._exit(code)


def _code(connection: socket.socket, end: float, stopped: Callable[[], bool] | None) -> int:
    """The fork's exit code. Raises TimeoutError, and Unreadable."""
    said = b""
    while True:
        left = end - time.monotonic()
        connection.settimeout(max(0.001, left if stopped is None else min(left, FORK_LOOK)))
        try:
            said = connection.recv(32)
        except TimeoutError:
            if left <= 0 or (stopped is not None and stopped()):
                raise
            continue
        except ConnectionError:
            pass
        break
    # without a word: the server, and with it the fork, was killed from outside
    return from_text(int, said) if said else -signal.SIGKILL


def _end(connection: socket.socket) -> None:
    """Have the fork killed, and wait until it is."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_WR)
        connection.settimeout(FORK_STOP)
        connection.recv(32)
