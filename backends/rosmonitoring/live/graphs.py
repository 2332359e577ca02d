"""The interface of a running graph to the code that judges it: `ros1` and `dds` implement it."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol

from avow.ros.bags import LOST, Event

from ..tuning import QUEUED_MESSAGES

OK, WARN, ERROR, STALE = range(4)
"""Levels of a `diagnostic_msgs/DiagnosticStatus`."""


Forward = Callable[[Event], None]
"""Passes a message on, with other values of some fields."""


@dataclass(frozen=True, slots=True)
class Heard:
    """One message, the time at which it came, and its reader (which raises ValueError); or (`read` None) the trouble
    with its publisher."""

    topic: str
    time: float
    read: Callable[[], Event] | None
    trouble: str = ""
    mark: str = LOST
    forward: Forward | None = None
    """For a filtered topic."""


class Inbox:
    """The messages that wait to be judged, in the order of arrival, whichever thread receives them."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Heard] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._full: set[str] = set()
        """The topics of the messages that came since there was no room."""

    def message(self, topic: str, read: Callable[[float], Event], forward: Forward | None = None) -> None:
        """A message has come just now; it is read, as an event of that time, when it is judged."""
        with self._lock:
            now = time.time()
            if self._queue.qsize() < QUEUED_MESSAGES:
                self._full.discard(topic)
                self._queue.put(Heard(topic, now, lambda: read(now), forward=forward))
            elif topic not in self._full:
                self._full.add(topic)
                text = f"messages of {topic} came faster than they were judged, and are lost"
                self._queue.put(Heard(topic, now, None, text))

    def trouble(self, topic: str, text: str, mark: str = LOST) -> None:
        """Messages of a topic cannot be heard; `mark`: that of the event in the record."""
        with self._lock:
            self._queue.put(Heard(topic, time.time(), None, text, mark))

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
