"""The far end of `avow.pipeline.forks`: imports everything once, then forks for each work that it is told of.

One loop, one thread: it waits for the next message, for a fork to end, and for its user to hang up. What is imported
here is Avow's core only. A backend may do as it likes at import (start a thread, ask the environment), so each fork
imports its own.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import os
import selectors
import socket
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from avow.base import process
from avow.base.codec import from_text, line
from avow.base.tuning.running import FORK_MESSAGE
from avow.pipeline import worker

PRELOADED = (
    "avow.calculus.obligations",
    "avow.language.load",
    "avow.sanity.claims",
    "avow.sanity.analysis",
    "avow.solving.questions",
    "avow.system.formulas",
)
"""What nearly every work needs, directly or not."""


@dataclass(frozen=True, slots=True)
class _Fork:
    pid: int
    handle: int
    """A descriptor that becomes readable as the process ends."""
    user: socket.socket


def serve(control: socket.socket) -> int:
    """Until `control` is closed and every fork has ended; the exit code. Raises OSError where it cannot serve."""
    for name in PRELOADED:
        importlib.import_module(name)
    if len(list(Path("/proc/self/task").iterdir())) != 1:
        return 1  # a lock that another thread holds would stay locked in every fork
    os.close(os.pidfd_open(os.getpid()))  # where that is forbidden, better now than with a fork under way
    gc.collect()
    gc.freeze()  # what is shared with the forks stays shared: the collector does not write to it
    process.adopt_orphans()
    control.send(b"ready")
    forks: set[_Fork] = set()
    with selectors.DefaultSelector() as events:
        events.register(control, selectors.EVENT_READ)
        listening = True
        while listening or forks:
            for event, _ in events.select():
                fork: _Fork | None = event.data
                if fork is None:
                    begun = _next(control, events)
                    if begun is None:
                        events.unregister(control)
                        listening = False
                    else:
                        forks.add(begun)
                        events.register(begun.handle, selectors.EVENT_READ, begun)
                        events.register(begun.user, selectors.EVENT_READ, begun)
                elif fork in forks:  # it ended, or its user hung up; both may come at once
                    forks.remove(fork)
                    events.unregister(fork.handle)
                    events.unregister(fork.user)
                    _end(fork)
    return 0


def _next(control: socket.socket, events: selectors.BaseSelector) -> _Fork | None:
    """Start what the next message asks for; None at the end of all messages."""
    try:
        message, descriptors, _, _ = socket.recv_fds(control, FORK_MESSAGE, 2)
    except OSError:
        message, descriptors = b"", []
    if not message:
        return None
    user, errors = descriptors
    server = os.getpid()
    pid = os.fork()
    if pid == 0:
        open_here = [control.fileno(), user, *_descriptors(events)]
        _work(message, server, errors, open_here)
    process.watch(pid)
    os.close(errors)
    return _Fork(pid, os.pidfd_open(pid), socket.socket(fileno=user))


def _descriptors(events: selectors.BaseSelector) -> list[int]:
    own = [events.fileno()] if isinstance(events, selectors.EpollSelector) else []
    return [*own, *(key.fd for key in events.get_map().values())]


def _work(message: bytes, server: int, errors: int, open_here: Sequence[int]) -> NoReturn:
    """In the fork, from here to its end."""
    code = 1
    try:
        os.setsid()
        process.forget_orphans()
        process.die_with(server)
        os.dup2(errors, 2)
        for descriptor in {*open_here, errors}:
            with contextlib.suppress(OSError):
                os.close(descriptor)  # a connection that stays open here would never close for its user
        arguments = from_text(tuple[str, ...], message)
        sys.argv = [worker.__file__, *arguments]
        code = worker.entry(arguments)
        atexit._run_exitfuncs()
    except Exception:
        traceback.print_exc()  # into the work's own log
    finally:
        with contextlib.suppress(Exception):
            sys.stderr.flush()
        os._exit(code)


def _end(fork: _Fork) -> None:
    process.kill_tree(fork.pid)  # before it is waited for: until then, its number cannot be another's
    _, status = os.waitpid(fork.pid, 0)
    process.unwatch(fork.pid)
    process.end_orphans()  # what it left, if it was killed itself
    os.close(fork.handle)
    with fork.user, contextlib.suppress(OSError):
        fork.user.send(line(os.waitstatus_to_exitcode(status)))


if __name__ == "__main__":
    process.guard(tied=False)
    sys.exit(serve(socket.socket(fileno=int(sys.argv[1]))))
