"""Publishers and listeners: from ``rosnode info`` or ``ros2 node info``, from JSON (from a ROS 1 master:
`avow.ros.master`)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field, fields
from typing import Any

from avow.base.codec import LATER, Unreadable, called, from_text
from avow.base.records import dataclass
from avow.ros.definitions import canonical
from avow.ros.names import is_name


class NoListing(Exception):  # noqa: N818 - it is what was found wrong
    """A text that is no listing of a ROS graph, or a master that does not answer; the text says how."""


@dataclass(frozen=True, slots=True)
class Listed:
    """A running node, by its whole name, and its topics, services and actions, by theirs."""

    name: str
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    does: tuple[str, ...] = ()
    """The actions that it serves."""
    orders: tuple[str, ...] = ()
    """The actions that it is a client of."""


@dataclass(frozen=True, slots=True)
class Listing:
    """A ROS graph. `types`: topic or service → type (``package/Type``), as far as it is given. `qos`: the endpoints
    as ``ros2 topic info --verbose`` prints them, each below its topic; empty if the source does not say."""

    nodes: tuple[Listed, ...]
    types: Mapping[str, str] = field(default_factory=dict)
    qos: str = ""

    def text(self) -> str:
        """In the format of ``rosnode info``."""
        lines: list[str] = []
        for node in self.nodes:
            lines.append(f"Node [{node.name}]")
            for title, names in (
                ("Publications", node.publishes),
                ("Subscriptions", node.subscribes),
                ("Services", node.serves),
            ):
                lines.append(f"{title}:")
                lines += [f" * {name} [{self.types.get(name, 'unknown type')}]" for name in names]
            lines.append("")
        return "\n".join(lines)


HEADER = re.compile(r"(?:Node\s+\[(?P<ros1>/[^\]\s]*)\]|(?P<ros2>/[^\s:]*))\s*\Z")
_SECTION = re.compile(r"\s*([A-Z][A-Za-z ]*):(?:\s|\Z)")
_ENTRY = re.compile(r"\s+(?:\*\s+)?(?P<name>/[^\s:\[]+):?\s*\[?(?P<type>[^\]\s]*/[^\]\s]+)?")
_SIDES = {
    "publications": "publishes",
    "publishers": "publishes",
    "subscriptions": "subscribes",
    "subscribers": "subscribes",
    "services": "serves",
    "service servers": "serves",
    "service clients": "calls",
    "action servers": "does",
    "action clients": "orders",
}
EVERY_SIDE = tuple(dict.fromkeys(_SIDES.values()))


def is_info(text: str) -> bool:
    """Whether a text is the output of ``rosnode info`` or ``ros2 node info``."""
    return any(HEADER.match(line) for line in text.splitlines())


def parse_listing(text: str) -> Listing:
    """Raises NoListing."""
    if text.lstrip().startswith("{"):
        return _of_json(text)
    if not is_info(text):
        raise NoListing("it is no JSON object, and no output of `ros2 node info NODE` (or `rosnode info`) of each node")
    return parse_info(text)


def parse_info(text: str) -> Listing:
    """The sections for each node in ``rosnode info`` or ``ros2 node info``, in order."""
    found: dict[str, dict[str, dict[str, None]]] = {}
    types: dict[str, str] = {}
    sides: dict[str, dict[str, None]] = {}
    into: dict[str, None] | None = None
    for line in text.splitlines():
        if header := HEADER.match(line):
            sides = found.setdefault(header["ros1"] or header["ros2"], {})
            into = None
        elif (entry := _ENTRY.match(line)) and into is not None:
            into[entry["name"]] = None
            if entry["type"]:
                types[entry["name"]] = canonical(entry["type"])
        elif section := _SECTION.match(line):
            side = _SIDES.get(section[1].strip().lower())
            into = sides.setdefault(side, {}) if side is not None else None
    return Listing(tuple(listed(name, {k: tuple(v) for k, v in s.items()}) for name, s in found.items()), types)


def listed(name: str, sides: Mapping[str, Iterable[str]]) -> Listed:
    """A node by its name, and for each side the topics that it has there."""
    return Listed(name, **{side: tuple(sides.get(side, ())) for side in EVERY_SIDE})


_Names = Mapping[str, str | None] | tuple[str, ...]


def _side(word: str) -> Any:
    return field(default=(), metadata={**called(word), **LATER})


@dataclass(frozen=True, slots=True)
class _Sides:
    """The topics of a node; each by name only, or with their types."""

    publishes: _Names = _side("publishers")
    subscribes: _Names = _side("subscribers")
    serves: _Names = _side("services")
    calls: _Names = _side("clients")
    does: _Names = _side("action servers")
    orders: _Names = _side("action clients")


def _of_json(text: str) -> Listing:
    """``{"/a": {"publishers": {"/t": "std_msgs/Float64"}, "subscribers": {…}, "services": {…}, "clients": {…},
    "action servers": {…}, "action clients": {…}}}``."""
    try:
        told = from_text(dict[str, _Sides], text)
    except Unreadable as error:
        raise NoListing(f"it is no JSON of nodes and their topics: {error}") from None
    sides = {name: {f.name: getattr(said, f.name) for f in fields(_Sides)} for name, said in told.items()}
    nodes = [listed(name, said) for name, said in sides.items()]
    typed = (names.items() for said in sides.values() for names in said.values() if isinstance(names, Mapping))
    types = {name: canonical(kind) for names in typed for name, kind in names if kind}
    wrong = [n for node in nodes for n in (node.name, *node.publishes, *node.subscribes) if not is_name(n)]
    if wrong:
        raise NoListing(f"{wrong[0][:60]!r} is no name that ROS takes")
    return Listing(tuple(nodes), types)
