"""Processes that talk to one another over this machine's loopback; nothing here goes by how fast it is."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

LONGEST = 150.0
"""Seconds after which something has gone wrong."""

RCL = """
node n {
  inputs( r : REAL )
  outputs( s : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 s matches(out.s) )
  guarantee low ( out.s <= 120 )
}
"""
MAPPING = {"in.r": "data", "out.s": "data"}
"""A node that is watched while it runs."""


def a_free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


def answers(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def running(command: Sequence[object], **more: Any) -> Iterator[subprocess.Popen[str]]:
    """A process that is over when this is left, and all that it started."""
    process = subprocess.Popen([str(word) for word in command], text=True, start_new_session=True, **more)

    def kill() -> None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)

    watchdog = threading.Timer(LONGEST, kill)
    watchdog.start()
    try:
        yield process
    finally:
        watchdog.cancel()
        if process.poll() is None:
            process.terminate()
        try:
            process.wait(timeout=30)
        finally:
            kill()
