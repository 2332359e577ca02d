"""What a callback class publishes, compared with a recording, topic by topic and in order."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from avow.backend_kit.programs.callbacks import SECOND, Event, Run
from avow.ros.bags import fields_of

Recorded = tuple[Event, Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Compared:
    """The publications on one topic."""

    topic: str
    said: int
    recorded: int
    different: tuple[tuple[int, Event, Mapping[str, Any]], ...]
    """Those that differ: the number (from 1), the publication, and the recorded event."""
    stamped: int
    """Those that differ only in `header.stamp`, where class and robot stamp by their clocks; times are not compared."""


def compared(recorded: Sequence[Recorded], run: Run) -> Iterator[Compared]:
    """For each topic that the class publishes."""
    copied = {stamp_of(event.data) for event, _ in recorded if event.topic not in run.spoken}
    for topic in sorted(run.spoken):
        published = [event for event in run.said if event.topic == topic]
        before = [(event, raw) for event, raw in recorded if event.topic == topic]
        wrong = [
            (number, event, there, raw)
            for number, (event, (there, raw)) in enumerate(zip(published, before, strict=False), start=1)
            if not _same(event.data, there.data, fields_of(raw))
        ]
        other = tuple((n, e, raw) for n, e, there, raw in wrong if not _by_clock(e, there, fields_of(raw), copied))
        yield Compared(topic, len(published), len(before), other, len(wrong) - len(other))


def _same(published: Any, recorded: Any, fields: Mapping[str, Any]) -> bool:
    """Whether they are equal in the recorded fields; a recording without fields matches no message that has some."""
    if not fields and published["d"]:
        return False
    return json.dumps(_plain_fields(published, fields)) == json.dumps(_plain_fields(recorded, fields))


def _plain_fields(data: Any, like: Any) -> Any:
    """A message's data, restricted to the fields of a recorded event."""
    if isinstance(like, dict) and isinstance(data, dict) and "d" in data:
        return [[name, _plain_fields(value, like[name])] for name, value in data["d"] if name in like]
    if isinstance(like, list) and isinstance(data, dict) and "l" in data and len(like) == len(data["l"]):
        return [_plain_fields(item, each) for item, each in zip(data["l"], like, strict=True)]
    return data


def _by_clock(published: Event, recorded: Event, fields: Mapping[str, Any], copied: set[int | None]) -> bool:
    """Whether they differ only in stamps that are each its clock's time: the class's is the time of its publication,
    the recorded one at most a second from its own, and neither is the stamp of a message that it received."""
    mine, old = stamp_of(published.data), stamp_of(recorded.data)
    if not mine or not old or copied & {mine, old}:  # none, or not stamped
        return False
    near = mine == published.at and abs(old - recorded.at) <= SECOND
    return near and _same(_unstamped(published.data), _unstamped(recorded.data), fields)


def stamp_of(data: Any) -> int | None:
    """The stamp in a message's header, in nanoseconds; None without one."""
    header = dict(data["d"]).get("header")
    stamp = dict(header["d"]).get("stamp") if isinstance(header, dict) and "d" in header else None
    return int(stamp["i"]) if isinstance(stamp, dict) and "i" in stamp else None


def _unstamped(data: Any) -> Any:
    """Called only with a stamp in its header."""

    def without(header: Any) -> Any:
        return {"d": [pair for pair in header["d"] if pair[0] != "stamp"]}

    return {"d": [[name, without(value) if name == "header" else value] for name, value in data["d"]]}
