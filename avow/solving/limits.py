"""Time limits that a busy machine does not change.

A limit is counted in processor time of the thread that asks, so that the same question gets the same effort, and
mostly the same answer, whatever else runs; wall-clock time is bounded by a multiple of it.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from avow.tuning.effort import WALL_CLOCK


def now() -> float:
    """Seconds of processor time of this thread: for deadlines."""
    return time.thread_time()


class _Budget(threading.local):
    """When the time of all questions of this thread together is up, by `now`."""

    end: float = math.inf


_budget = _Budget()


@contextlib.contextmanager
def budget(milliseconds: float) -> Iterator[None]:
    """All questions asked within the block share this much processor time, however long each may take by itself; a
    block within a block cannot extend it."""
    before = _budget.end
    _budget.end = min(before, now() + milliseconds / 1000)
    try:
        yield
    finally:
        _budget.end = before


def allowed(milliseconds: int) -> int:
    """What is left of a question's limit within the budget; 0 if nothing is."""
    if math.isinf(_budget.end):
        return milliseconds
    return max(0, min(milliseconds, int((_budget.end - now()) * 1000)))


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
    limit = milliseconds / 1000
    used = _clock()
    watched = _Watched(used, used() + limit, time.monotonic() + limit * WALL_CLOCK + 1, interrupt)
    _kennel.dog.watch(watched, limit)
    try:
        yield watched.interrupted
    finally:
        with watched.lock:  # from here on nothing is interrupted: it would be what is asked next
            watched.done = True
            watched.interrupt = _nothing  # the list of blocks must not keep alive what it holds


def _nothing() -> None:
    pass


@dataclass(slots=True, eq=False)
class _Watched:
    """A block that is being watched."""

    used: Callable[[], float]
    cpu_end: float
    wall_end: float
    interrupt: Callable[[], None]
    interrupted: threading.Event = field(default_factory=threading.Event)
    lock: threading.Lock = field(default_factory=threading.Lock)
    done: bool = False

    def look(self) -> float | None:
        """Interrupt it if it is beyond its limit. How many seconds it has at least, or None where it is done."""
        with self.lock:
            if self.done:
                return None
            left = min(self.cpu_end - self.used(), self.wall_end - time.monotonic())
            if left <= 0:
                self.interrupted.set()
                self.interrupt()
            return max(left, 0.02)


class _Dog:
    """One thread for all blocks: most are done long before their limit, and a thread for each would cost more than they
    do. It sleeps until the first limit that it knows of may be reached, and looks again."""

    def __init__(self) -> None:
        self.condition = threading.Condition()
        self.watched: list[_Watched] = []
        self.wakes = math.inf
        self.thread: threading.Thread | None = None

    def watch(self, block: _Watched, limit: float) -> None:
        with self.condition:
            self.watched.append(block)
            if self.thread is None or not self.thread.is_alive():
                self.thread = threading.Thread(target=self.run, daemon=True, name="watchdog")
                self.thread.start()
            elif time.monotonic() + limit < self.wakes:
                self.condition.notify()

    def run(self) -> None:
        with self.condition:
            while True:
                known = [(block, block.look()) for block in self.watched]
                self.watched = [block for block, left in known if left is not None]
                wait = min((left for _, left in known if left is not None), default=None)
                self.wakes = math.inf if wait is None else time.monotonic() + wait
                self.condition.wait(wait)


class _Kennel:
    """Holds the dog. A process that was forked has none of its parent's threads, and gets its own."""

    def __init__(self) -> None:
        self.renew()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self.renew)

    def renew(self) -> None:
        self.dog = _Dog()


_kennel = _Kennel()
