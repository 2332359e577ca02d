"""Callbacks that sleep, in virtual time: each runs in a thread of its own, and only one thread runs at a time."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from typing import Any

FREE = "no group"
"""In the place of a callback group: tasks of the executor, which belong to none."""


SLEEPS = re.compile(r"\bsleep|\btimeout|\bServiceProxy|\bSimpleAction")
"""What in a file's text may let a callback wait."""
ORDERS = ("", "the last first", "others before each publication")
"""The orders in which callbacks of one instant run, if the executor has several threads; the first: as they came."""


class Turn(threading.Thread):
    """A call of a callback."""

    def __init__(self, act: Callable[[], Any], lock: tuple[Any, ...] | None, number: int) -> None:
        super().__init__(daemon=True)
        self.act, self.lock, self.number = act, lock, number
        self.mine, self.others = threading.Semaphore(0), threading.Semaphore(0)
        self.error: BaseException | None = None
        self.over = self.cut = False

    def run(self) -> None:
        self.mine.acquire()
        try:
            self.act()
        except BaseException as error:
            self.error = error
        self.over = True
        self.others.release()

    def go(self) -> None:
        """Until it ends or sleeps."""
        self.mine.release()
        self.others.acquire()
        if self.over:
            self.join()

    def sleep(self) -> None:
        self.others.release()
        self.mine.acquire()
        if self.cut:
            raise SystemExit


class Turns:
    """Which callbacks run, sleep and wait. An executor of one thread runs one callback at a time. One of several runs
    those of other groups while a callback sleeps, and those of one instant in one of `ORDERS`."""

    def __init__(self) -> None:
        self.sleeps = self.parallel = False
        """Whether callbacks may sleep, and whether the executor has several threads."""
        self.order = self.number = 0
        self.taken: dict[int, None] = {}
        """Messages by their numbers, as their callbacks began; at the latest when time moves on."""
        self.running: Turn | None = None
        self.asleep: tuple[Turn, ...] = ()
        self.ready: tuple[Turn, ...] = ()

    def turn(self, group: Any, act: Callable[..., Any]) -> Callable[..., None]:
        """A callback that waits while another of its group sleeps."""

        def run(*given: Any) -> None:
            own = None if group is FREE or getattr(group, "reentrant", False) else (group,)
            self.join(Turn(lambda: act(*given), own if self.parallel else (), self.number))

        return run if self.sleeps or self.parallel else act

    def join(self, turn: Turn) -> None:
        self.ready = (*self.ready, turn)
        if not self.order:
            self.go_on()

    def next(self) -> Turn | None:
        """The one to run next, of those that wait for no other. Within a group they begin in their order."""
        held = [each.lock for each in (*self.asleep, *self.ready) if each.ident and each.lock is not None]
        free = [each for each in self.ready if each.ident or each.lock not in held]
        if not free or self.order != 1:
            return free[0] if free else None
        last = free[-1]
        return last if last.ident or last.lock is None else next(t for t in free if not t.ident and t.lock == last.lock)

    def go_on(self) -> None:
        while (turn := self.next()) is not None:
            self.ready = tuple(each for each in self.ready if each is not turn)
            self.take(turn)
            if not turn.ident:
                turn.start()
            self.running = turn
            turn.go()
            self.running = None
            if turn.error is not None:
                raise turn.error
            if not turn.over:
                self.asleep = (*self.asleep, turn)

    def take(self, *turns: Turn) -> None:
        self.taken.update((each.number, None) for each in turns if each.number)

    def wake(self, turn: Turn) -> None:
        self.asleep = tuple(each for each in self.asleep if each is not turn)
        self.join(turn)

    def cut(self) -> None:
        """End those that still sleep at the end of a run."""
        for turn in (each for each in (*self.asleep, *self.ready) if each.ident):
            turn.cut = True
            turn.go()
        self.asleep = self.ready = ()
