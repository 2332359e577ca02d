"""What a running graph is to those that judge it: `ros1` and `rosbridge` are two."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol

from .bags import Event

OK, WARN, ERROR, STALE = range(4)
"""Levels of a `diagnostic_msgs/DiagnosticStatus`."""


@dataclass(frozen=True, slots=True)
class Heard:
    """One message, or (`event` None) what is wrong with who said it."""

    topic: str
    event: Event | None
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class Status:
    """One clause's standing, as ROS's diagnostics have it."""

    name: str
    level: int
    text: str
    values: tuple[tuple[str, str], ...] = ()


class Graph(Protocol):
    """Used as a context: it listens until that is left."""

    heard: queue.Queue[Heard]
    dropped: int

    def __enter__(self) -> Graph: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...

    def diagnostics(self, topic: str, system: str) -> Callable[[Sequence[Status]], None]:
        """What says verdicts on a topic, as `diagnostic_msgs/DiagnosticArray`."""
        ...
