"""The processes of a run's jobs: forks of a server that has imported everything, or else a new Python for each.

Starting Python, importing Avow and Z3, and building the grammar's tables cost more than most jobs. A run has imported
most of that before its first job. It imports the rest, which its own work needs too, and forks a server while it has
one thread. The server forks a supervisor for each job. The supervisor forks the job's process, ends it as soon as the
run stops waiting, and ends whatever it left running. Where this process cannot be forked (several threads, systems
other than Linux), each job gets a new Python.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import multiprocessing
import os
import select
import signal
import socket
import sys
import tempfile
import threading
import time
import traceback
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from avow.base import process
from avow.base.files import read_text
from avow.base.module_path import absolute_only, is_led_here
from avow.base.tuning.running import COLLECTED_IN_WORKS, FORK_LOOK, FORK_STOP, WORKER_GRACE
from avow.base.tuning.sizes import OUTPUT_KEPT
from avow.pipeline.requests import Request, Response, read_response, request_bytes, request_digest

WORKER = "avow.pipeline.worker"
PLAIN = "AVOW_PLAIN_WORKERS"
"""Environment: when set, every job gets a new Python."""

_PRELOADED = (
    WORKER,
    "z3",
    "avow.calculus.obligations",
    "avow.language.load",
    "avow.sanity.claims",
    "avow.sanity.analysis",
    "avow.solving.questions",
    "avow.system.formulas",
)
"""What nearly every job needs. Backends are left out: importing one may start threads, which a fork does not inherit.
"""


class Processes:
    """The processes of one run. They end with it, at the latest with this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._control: socket.socket | None = None
        self._server: multiprocessing.process.BaseProcess | None = None
        self._owner = 0
        """This process' id, once it has forked: a fork of it must not use these connections."""

    def prepare(self, cwd: Path) -> None:
        """Fork the server. Without effect if this process cannot be forked or has a server."""
        if self._owner == os.getpid() or not _may_fork():
            return
        for name in _PRELOADED:
            importlib.import_module(name)
        self._owner = os.getpid()
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._server = _fork(theirs.fileno(), cwd, lambda: _serve(theirs))
        theirs.close()
        weakref.finalize(self, self._control.close)

    def close(self) -> None:
        """End the server once it is idle, so that its processor time counts as this process'."""
        if self._control is None or self._server is None:
            return
        self._control.close()
        self._server.join(FORK_STOP)
        if self._server.pid is not None and not self._server.is_alive():
            process.unwatch(self._server.pid)

    def run(self, request: Request, cwd: Path, stopped: Callable[[], bool] | None = None) -> Response:
        """Execute the job in a process of its own, which ends soon after `stopped` is true. Raises OSError if its files
        cannot be written."""
        data = request_bytes(request)
        digest, seconds = request_digest(data), request.seconds + WORKER_GRACE
        with tempfile.TemporaryDirectory(prefix="avow-request-") as name:
            place = Path(name)
            (place / "request").write_bytes(data)
            code, log = self._executed(place, cwd, seconds, stopped)
            log = log[:OUTPUT_KEPT]
            if code is None:
                return Response(digest, failure=f"no answer within {seconds:.0f} s", timed_out=True, log=log)
            if code != 0 or not (place / "response").is_file():
                last = log.strip().splitlines()[-1:] or [f"the worker ended with code {code}"]
                return Response(digest, failure=f"the engine crashed: {last[0][:300]}", log=log)
            response = read_response((place / "response").read_bytes(), digest)
        return replace(response, log=log)

    def _executed(
        self, place: Path, cwd: Path, seconds: float, stopped: Callable[[], bool] | None
    ) -> tuple[int | None, str]:
        """The process' exit code (None: time-out) and its standard error."""
        self.prepare(cwd)
        mine, theirs = socket.socketpair()
        with mine:
            with theirs:
                served = self._sent(place, theirs)
            if served:
                code = _exit_code(mine, time.monotonic() + seconds, stopped)
                log = place / "log"
                return code, read_text(log, errors="replace") if log.is_file() else ""
        command = [sys.executable, "-P", "-m", WORKER, str(place)]
        env = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": absolute_only()}
        done = process.run(command, cwd=cwd, seconds=seconds, env=env, stopped=stopped)
        # the guarding process reports a signal by a code above 128
        return 128 - done.code if done.code is not None and done.code > 128 else done.code, done.stderr

    def _sent(self, place: Path, theirs: socket.socket) -> bool:
        """Whether a server accepted the job."""
        if self._control is None or self._owner != os.getpid():
            return False
        try:
            with self._lock:
                socket.send_fds(self._control, [os.fsencode(place)], [theirs.fileno()])
        except OSError:  # it was killed
            return False
        return True


def _may_fork() -> bool:
    """Whether a fork of this process can replace a new Python."""
    if os.environ.get(PLAIN) or sys.platform != "linux" or is_led_here():
        return False
    try:
        os.close(os.pidfd_open(os.getpid()))  # some sandboxes forbid it
        return len(list(Path("/proc/self/task").iterdir())) == 1
    except OSError:
        return False


def _fork(kept: int, cwd: Path, serve: Callable[[], None]) -> multiprocessing.process.BaseProcess:
    """Run `serve` in a fork, which ends when its connection closes. Only the descriptor `kept` stays open there."""

    def alone() -> None:
        os.setsid()
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nothing, stream)
        sys.stdin, sys.stdout, sys.stderr = sys.__stdin__, sys.__stdout__, sys.__stderr__
        os.closerange(3, kept)
        os.closerange(kept + 1, os.sysconf("SC_OPEN_MAX"))
        os.chdir(cwd)
        os.environ.update({"PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": absolute_only()})
        atexit._clear()
        process.forget_orphans()
        gc.freeze()  # the collector writes to the objects that it visits, which would copy pages shared with the run
        gc.set_threshold(COLLECTED_IN_WORKS)
        multiprocessing.current_process().daemon = False  # a backend may start processes
        serve()

    fork = multiprocessing.get_context("fork").Process(target=alone, daemon=True)
    fork.start()
    assert fork.pid is not None
    process.watch(fork.pid)
    return fork


def _serve(control: socket.socket) -> None:
    """In the server: a supervisor for each message, which names a job's folder, until the run closes the connection."""
    while True:
        message, descriptors, _, _ = socket.recv_fds(control, 4096, 1)
        if not message:
            break
        if os.fork() == 0:
            control.close()
            _supervise(Path(os.fsdecode(message)), socket.socket(fileno=descriptors[0]))
        os.close(descriptors[0])
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
    with contextlib.suppress(ChildProcessError):
        while True:
            os.wait()


def _supervise(place: Path, user: socket.socket) -> NoReturn:
    """In a supervisor: runs the job's process until it ends or the client closes the connection, and sends the exit
    code."""
    try:
        os.setsid()
        process.adopt_orphans()
        supervisor, pid = os.getpid(), os.fork()
        if pid == 0:
            user.close()
            _execute(place, supervisor)
        select.select([os.pidfd_open(pid), user.fileno()], [], [])
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        _, status = os.waitpid(pid, 0)
        process.end_orphans()
        with contextlib.suppress(OSError):
            user.send(str(os.waitstatus_to_exitcode(status)).encode())
    finally:
        os._exit(0)


def _execute(place: Path, supervisor: int) -> NoReturn:
    """In the job's process."""
    code = 1
    try:
        os.setsid()
        process.forget_orphans()
        process.die_with(supervisor)
        os.dup2(os.open(place / "log", os.O_CREAT | os.O_WRONLY), 2)
        sys.argv = [WORKER, str(place)]
        code = importlib.import_module(WORKER).entry(place)
        atexit._run_exitfuncs()
    except Exception:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stderr.flush()
        os._exit(code)


def _exit_code(connection: socket.socket, end: float, stopped: Callable[[], bool] | None) -> int | None:
    """The job's exit code, once it and everything that it started have ended; None after a time-out."""
    while True:
        left = end - time.monotonic()
        if select.select([connection], [], [], max(0.0, left if stopped is None else min(left, FORK_LOOK)))[0]:
            said = connection.recv(32)
            return int(said) if said else -signal.SIGKILL  # no message: the supervisor was killed
        if left <= 0 or (stopped is not None and stopped()):
            connection.shutdown(socket.SHUT_WR)  # the supervisor ends the job, and then answers
            select.select([connection], [], [], FORK_STOP)
            return None
