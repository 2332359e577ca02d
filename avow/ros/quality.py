"""Quality of service (QoS): what a publisher offers and a subscriber requests, and whether DDS connects the two.

The rules are those of DDS 1.4, 2.2.3, as rmw applies them (rmw_dds_common, `qos_profile_check_compatible`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Span
from avow.base.files import read_text
from avow.base.records import dataclass
from avow.ros.bags import NoBag, is_bag

LEVELS = {
    "reliability": ("best_effort", "reliable"),
    "durability": ("volatile", "transient_local"),
    "liveliness": ("automatic", "manual_by_node", "manual_by_topic"),
}
"""The kinds of each policy, the weakest first: what is offered has to be at least as strong as what is requested."""
UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}
BAG_FILE = "metadata.yaml"
"""In the folder of each ROS 2 bag."""
SYSTEM = ("system_default", "best_available", "unknown")
"""Kinds that the middleware replaces by others."""


@dataclass(frozen=True, slots=True)
class Quality:
    """The quality of service of one end of a topic; None: not known. Times in seconds are infinite if there is none."""

    reliability: str | None = None
    durability: str | None = None
    deadline: float | None = None
    liveliness: str | None = None
    lease: float | None = None
    depth: int | None = None

    def __str__(self) -> str:
        said = {f.name: getattr(self, f.name) for f in fields(self)}
        return ", ".join(f"{name} {said[name]}" for name in said if said[name] not in (None, math.inf))


def quality(given: Mapping[str, Any]) -> Quality:
    """A profile by its policies, as rclpy, rclcpp, bags and plans name them; a kind of `SYSTEM` is not known."""
    named = {"lease" if name == "liveliness_lease_duration" else name: value for name, value in given.items()}
    known = {f.name: named[f.name] for f in fields(Quality) if f.name in named}
    return Quality(**{name: value for name, value in known.items() if value not in SYSTEM})


_NO_TIME = {"deadline": math.inf, "lease": math.inf}
_DEFAULT = {"reliability": "reliable", "durability": "volatile", "depth": 10, **_NO_TIME}
PROFILES: Mapping[str, Mapping[str, Any]] = {
    "default": _DEFAULT,
    "sensor_data": {**_DEFAULT, "reliability": "best_effort", "depth": 5},
    "services_default": _DEFAULT,
    "parameters": {**_DEFAULT, "depth": 1000},
    "parameter_events": {**_DEFAULT, "depth": 1000},
    "clock": {**_DEFAULT, "reliability": "best_effort", "depth": 1},
    "rosout": {**_DEFAULT, "durability": "transient_local", "depth": 1000},
    "system_default": _NO_TIME,
    "best_available": {},
}
"""rmw's profiles by name (rmw/qos_profiles.h)."""


def seconds(text: str) -> float | None:
    """``100 ms`` or ``100ms`` in seconds; infinite for no time; None for any other text."""
    found = re.fullmatch(rf"\s*(\d+(?:\.\d+)?)\s*({'|'.join(UNITS)})\s*", text)
    return float(found[1]) * UNITS[found[2]] or math.inf if found is not None else None


def unmet(offered: Quality, requested: Quality) -> Iterator[tuple[str, str]]:
    """What is offered and requested, for each policy because of which DDS does not connect the two, as far as known."""
    for policy, levels in LEVELS.items():
        one, other = getattr(offered, policy), getattr(requested, policy)
        if one in levels and other in levels and levels.index(one) < levels.index(other):
            yield one, other
    for policy, words in (("deadline", "a deadline"), ("lease", "a liveliness lease")):
        one, other = getattr(offered, policy), getattr(requested, policy)
        if one is not None and other is not None and one > other:
            yield f"no {words[2:]}" if one == math.inf else f"{words} of {one:g} s", f"{words} of {other:g} s"


# -- recorded --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Recorded:
    """An end that a record has. `node`: its whole name, empty if the record does not say."""

    node: str
    topic: str
    publishes: bool
    quality: Quality
    span: Span


def recorded(path: Path) -> tuple[Recorded, ...]:
    """The ends in a ROS 2 bag, or in the output of ``ros2 topic info --verbose``. Raises NoBag, OSError, ValueError."""
    return tuple(_of_bag(path) if is_bag(path) else printed(read_text(path, "utf-8"), str(path)))


def _of_bag(path: Path) -> Iterator[Recorded]:
    from rosbags.rosbag2 import Reader, ReaderError

    try:
        with Reader(path) as reader:
            connections = list(reader.connections)
    except (ReaderError, OSError, ValueError, KeyError) as error:
        raise NoBag(f"{path} cannot be read as a ROS 2 bag: {error}") from None
    for connection in connections:
        for profile in getattr(connection.ext, "offered_qos_profiles", ()):
            said = {name: getattr(profile, name).name.lower() for name in LEVELS}
            times = {"deadline": profile.deadline, "lease": profile.liveliness_lease_duration}
            said |= {name: _seconds(time.sec * 10**9 + time.nsec) for name, time in times.items()}
            found = quality({**said, "depth": profile.depth or None})
            yield Recorded("", connection.topic, True, found, Span(str(path), 1, 1, 1, 2))


def _seconds(nanoseconds: int) -> float:
    """None is 0, the greatest of 64 bits, or more."""
    return math.inf if nanoseconds == 0 or nanoseconds >= 2147483647 * 10**9 else nanoseconds / 10**9


_LINE = re.compile(r"\s*(?:QoS profile:)?\s*([A-Z][A-Za-z ]*?)(?: \(Depth\))?:\s*(.*?)\s*\Z")


def printed(text: str, source: str = "") -> Iterator[Recorded]:
    """The ends in the output of ``ros2 topic info --verbose``. The topic of each answer is in the command that asks,
    ``ros2 topic info --verbose /scan``: a line with it, or the name alone, comes first. Raises ValueError."""
    lines = text.splitlines()
    if not any(line.startswith("Endpoint type:") for line in lines):
        raise ValueError("it is neither a bag nor the output of `ros2 topic info --verbose`")
    said: dict[str, str] = {}
    topic, begin = "", 0
    for number, line in enumerate([*lines, "Node name: "], 1):
        name = re.search(r"(?:\A|\s)(/[\w/]+)\s*\Z", line)
        if line.startswith("Node name:"):
            if "Endpoint type" in said:
                node = f"{said.get('Node namespace', '/').rstrip('/')}/{said['Node name']}"
                publishes = said["Endpoint type"] == "PUBLISHER"
                yield Recorded(node, said["topic"], publishes, _told(said), Span(source, begin, 1, begin, 2))
            said, begin = {"topic": topic}, number
        if (found := _LINE.match(line)) is not None:
            said[found[1]] = found[2]
        elif name is not None:
            topic = name[1]


def _told(said: Mapping[str, str]) -> Quality:
    depth = re.search(r"\((\d+)\)", said.get("History", ""))
    given: dict[str, Any] = {name: said.get(name.title(), "unknown").lower() for name in LEVELS}
    for name, words in (("deadline", "Deadline"), ("lease", "Liveliness lease duration")):
        digits = re.match(r"\d+", said.get(words, ""))
        given[name] = _seconds(int(digits[0])) if digits else math.inf if said.get(words) == "Infinite" else None
    return quality({**given, "depth": int(depth[1]) if depth else None})
