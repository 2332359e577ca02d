"""By which clock a monitor goes: that of the recording, of the simulation (`/clock`), or of the messages' headers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum
from fractions import Fraction
from typing import Any

from .reading import at
from .rules import FieldPath
from .tuning import EVENTS_WITHOUT_CLOCK
from .wires import MappingError, seconds

SIMULATED = "clock"
"""The topic of rosgraph_msgs/Clock, without its slash."""

Event = Mapping[str, Any]


class By(StrEnum):
    RECEIPT = "receipt"
    SIM = "sim"
    STAMP = "stamp"


class Clock:
    """Gives events the time of another clock. Those before its first reading wait for it."""

    def __init__(self, by: By) -> None:
        self._by = by
        self._now: Fraction | None = None
        self._waiting: list[tuple[int, Event, int]] = []
        self._dropped = False
        self._moved = False

    def ready(self, index: int, event: Event, place: int) -> Iterator[tuple[int, Event, int]]:
        """The events that can be judged now, each with its number and its place in the trace."""
        read = self._read(event)
        self._moved = self._moved or (read is not None and self._now is not None and read != self._now)
        self._now = self._now if read is None else read
        if self._now is None:
            self._dropped = len(self._waiting) == EVENTS_WITHOUT_CLOCK
            if not self._dropped:
                self._waiting.append((index, event, place))
            return
        for each in (*self._waiting, (index, event, place)):
            yield each[0], {**each[1], "time": self._now}, each[2]
        self._waiting.clear()

    def passed(self, event: Event) -> Event | None:
        """Time has passed by the recording's clock, which says nothing of this one."""
        return None if self._now is None else {**event, "time": self._now}

    def finish(self) -> str:
        """Why the run is no evidence: the clock was never read, or stood still."""
        if self._by is By.SIM and self._now is not None and not self._moved:
            return f"/clock stood still, by which the plan goes (`time: {self._by}`)"
        what = "no message of /clock came" if self._by is By.SIM else "no message had a `header.stamp`"
        if self._dropped and not self._waiting:
            what = f"more than {EVENTS_WITHOUT_CLOCK} events came before the first time"
        return f"{what}, by which the plan goes (`time: {self._by}`)" if self._waiting or self._dropped else ""

    def _read(self, event: Event) -> Fraction | None:
        way: FieldPath = ("clock",) if self._by is By.SIM else ("header", "stamp")
        if self._by is By.SIM and str(event.get("topic", "")).lstrip("/") != SIMULATED:
            return None
        try:
            read = seconds(at(event, way))
        except MappingError:
            return None
        return None if self._by is By.STAMP and not read else read  # ROS leaves 0 where nobody has set it
