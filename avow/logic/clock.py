"""Time limits that a busy machine does not change.

A limit is counted in processor time of the thread that asks, so that the same question gets the same effort, and
mostly the same answer, whatever else runs; wall-clock time is bounded by a multiple of it.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

WALL = 20
"""Wall-clock time allowed, as a multiple of the limit in processor time."""


def now() -> float:
    """Seconds of processor time of this thread: for deadlines."""
    return time.thread_time()


def _clock() -> Callable[[], float]:
    """Processor time of this thread, to be read by another one; wall-clock time where the system cannot tell it."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return time.monotonic
    clock = time.pthread_getcpuclockid(threading.get_ident())
    return lambda: time.clock_gettime(clock)


@contextlib.contextmanager
def watchdog(milliseconds: int, interrupt: Callable[[], None]) -> Iterator[threading.Event]:
    """Call `interrupt`, again and again, while the block goes on beyond its limit; what is yielded is set once it was.

    Z3's own limit is in wall-clock time, and sometimes it misses it altogether (seen: 84 s for 16 ms).
    """
    done = threading.Event()
    interrupted = threading.Event()
    used = _clock()
    limit = milliseconds / 1000
    cpu_end = used() + limit
    wall_end = time.monotonic() + limit * WALL + 1

    def bark() -> None:
        wait = limit
        while not done.wait(wait):
            left = min(cpu_end - used(), wall_end - time.monotonic())
            if left <= 0:
                interrupted.set()
                interrupt()
            wait = max(left, 0.02)

    dog = threading.Thread(target=bark, daemon=True)
    dog.start()
    try:
        yield interrupted
    finally:
        done.set()
        dog.join()
