"""A running graph under the monitors: what is heard is judged and recorded, and verdicts are said as ROS diagnostics.

Evidence is the record, judged again by `avow verify`: a live verdict stays what it is, a message to whoever looks.
"""

from __future__ import annotations

import json
import queue
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected

from .coverage import coverage
from .ros1 import Ros1, Spoken
from .session import Session
from .tuning import LIVE_PAUSE, VERDICTS_EVERY
from .watched import Violation

DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
"""Levels of a `diagnostic_msgs/DiagnosticStatus`."""


def follow(
    running: Session, graph: Ros1, seconds: float | None, record: Path | None, verdicts: str | None,
    warn: Callable[[str], None],
) -> Iterator[Violation]:  # fmt: skip
    """Judge what a graph says, for some time (None: until interrupted). Deadlines pass by this machine's clock. Raises
    Rejected where the record cannot be written."""
    with ExitStack() as stack:
        try:
            file = stack.enter_context(record.open("w", encoding="utf-8")) if record is not None else None
        except OSError as error:
            text = f"{record} cannot be written: {error.strerror}"
            raise Rejected(Diagnostic("MON304", text)) from None
        stack.enter_context(graph)
        board = Board(running, graph, verdicts) if verdicts is not None else None
        end = None if seconds is None else time.monotonic() + seconds
        while end is None or time.monotonic() < end:
            try:
                heard = graph.heard.get(timeout=LIVE_PAUSE)
            except queue.Empty:
                if running.events:  # the run begins with its first message
                    yield from running.tick({"time": time.time()})
            else:
                if heard.event is None:
                    warn(heard.trouble)
                    continue
                if file is not None:
                    file.write(json.dumps(heard.event) + "\n")
                found = list(running.step(heard.event))
                if board is not None and found:
                    board.broken(found)
                yield from found
            if board is not None:
                board.refresh()
        yield from running.finish()
        if graph.dropped:
            warn(f"{graph.dropped} messages came faster than they were judged, and are lost")


class Board:
    """The verdicts on a topic: each clause a status, at once when one is broken, else once a second."""

    def __init__(self, running: Session, graph: Ros1, topic: str) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.running = running
        self._store = get_typestore(Stores.ROS1_NOETIC)
        definition, digest = self._store.generate_msgdef("diagnostic_msgs/msg/DiagnosticArray", ros_version=1)
        self._said: Spoken = graph.speak(topic, DIAGNOSTICS, definition, digest)
        self._next = 0.0
        self._number = 0
        self._latest: dict[str, Violation] = {}

    def broken(self, found: list[Violation]) -> None:
        self._latest |= {f"{v.node}.{v.clause}": v for v in found}
        self._next = 0.0

    def refresh(self) -> None:
        """Say how it stands, if it is time to."""
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + VERDICTS_EVERY
        types = self._store.types
        statuses = []
        for name, level, text, values in self.standing():
            pairs = [types["diagnostic_msgs/msg/KeyValue"](key=key, value=value) for key, value in values]
            made = types["diagnostic_msgs/msg/DiagnosticStatus"](
                level=level, name=name, message=text, hardware_id=self.running.system.name, values=pairs
            )
            statuses.append(made)
        now = time.time_ns()
        stamp = types["builtin_interfaces/msg/Time"](sec=now // 10**9, nanosec=now % 10**9)
        header = types["std_msgs/msg/Header"](seq=self._number, stamp=stamp, frame_id="")
        self._number += 1
        whole = types["diagnostic_msgs/msg/DiagnosticArray"](header=header, status=statuses)
        self._said.say(bytes(self._store.serialize_ros1(whole, "diagnostic_msgs/msg/DiagnosticArray")))

    def standing(self) -> Iterator[tuple[str, int, str, list[tuple[str, str]]]]:
        """Each clause: its name, level, words, and counts; and each other thing that was told."""
        told = dict(self._latest)
        for monitor, clause, _, tally in self.running.clauses():
            name = f"{monitor.setup.node.name}.{clause}"
            latest = told.pop(name, None)
            counts = [("published", str(tally.published)), ("broken", str(tally.broken))]
            if latest is not None and tally.broken:
                yield name, ERROR, latest.text(), counts
            elif not tally.judged:
                yield name, STALE, tally.reason or "not judged yet", counts
            elif tally.undecided or tally.order:
                yield name, WARN, coverage(tally), counts
            else:
                yield name, OK, coverage(tally), counts
        for name, violation in told.items():
            yield name, ERROR, violation.text(), []
