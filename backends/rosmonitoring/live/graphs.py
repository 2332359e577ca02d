"""The interface of a running graph to the code that judges it: `ros1` and `dds` implement it."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol

from avow.ros.bags import Event

from ..tuning import QUEUED_MESSAGES

OK, WARN, ERROR, STALE = range(4)
"""Levels of a `diagnostic_msgs/DiagnosticStatus`."""


@dataclass(frozen=True, slots=True)
class Heard:
    """One message, the time at which it came, and its reader (which raises ValueError); or (`read` None) the trouble
    with its publisher."""

    topic: str
    time: float
    read: Callable[[], Event] | None
    trouble: str = ""
    forward: Callable[[], None] | None = None
    """For a filtered topic: passes the message on."""


class Inbox:
    """The messages that wait to be judged, in the order of arrival, whichever thread receives them."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Heard] = queue.Queue(QUEUED_MESSAGES)
        self._lock = threading.Lock()
        self.dropped = 0

    def message(self, topic: str, read: Callable[[float], Event], forward: Callable[[], None] | None = None) -> None:
        """A message has come just now; it is read, as an event of that time, when it is judged."""
        with self._lock:
            now = time.time()
            self._put(Heard(topic, now, lambda: read(now), forward=forward))

    def trouble(self, topic: str, text: str) -> None:
        with self._lock:
            self._put(Heard(topic, time.time(), None, text))

    def _put(self, heard: Heard) -> None:
        try:
            self._queue.put_nowait(heard)
        except queue.Full:
            self.dropped += 1

    def get(self, seconds: float) -> Heard | None:
        """The next one, or None if none comes within `seconds`."""
        try:
            return self._queue.get(timeout=seconds)
        except queue.Empty:
            return None


@dataclass(frozen=True, slots=True)
class Status:
    """One clause's status, as in ROS's diagnostics."""

    name: str
    level: int
    text: str
    values: tuple[tuple[str, str], ...] = ()

    def message(self, system: str) -> dict[str, object]:
        """The fields of a `diagnostic_msgs/DiagnosticStatus`."""
        values = [{"key": key, "value": value} for key, value in self.values]
        return {"level": self.level, "name": self.name, "message": self.text, "hardware_id": system, "values": values}


class Graph(Protocol):
    """Use it as a context: it listens until that is left."""

    inbox: Inbox

    def __enter__(self) -> Graph: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...

    def diagnostics(self, topic: str, system: str) -> Callable[[Sequence[Status]], None]:
        """A function that publishes verdicts on a topic, as `diagnostic_msgs/DiagnosticArray`."""
        ...
