"""Names of topics as ROS resolves them: absolute, relative to the node's namespace, private to the node, remapped.

Source: http://wiki.ros.org/Names and https://design.ros2.org/articles/topic_and_service_names.html.
"""

from __future__ import annotations

import re
from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass

_NAME = re.compile(r"(?:/|~/?)?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*\Z", re.ASCII)


@dataclass(frozen=True, slots=True)
class Placed:
    """A running node: its whole name, and the remappings with which it was started."""

    name: str
    """``/robot1/sensor``."""
    remaps: tuple[tuple[str, str], ...] = ()
    """(from, to), as written: either may be absolute, relative or private."""
    span: Span | None = field(default=None, compare=False, repr=False)
    named: bool = field(default=False, compare=False, repr=False)
    """Whether its name is given explicitly; otherwise it is assumed."""
    launched: bool = field(default=False, compare=False, repr=False)
    """Whether a launch file gives it."""

    @property
    def namespace(self) -> str:
        """``/robot1``; empty for a node at the root."""
        return self.name.rpartition("/")[0]

    def expanded(self, name: str) -> str:
        """The whole name of what the node refers to by this name, before any remapping."""
        if name.startswith("/"):
            return name
        if name.startswith("~"):
            return f"{self.name}/{name.lstrip('~/')}"
        return f"{self.namespace}/{name}"

    def resolved(self, name: str) -> str:
        """The whole name of the topic that the node refers to."""
        whole = self.expanded(name)
        for old, new in self.remaps:
            if self.expanded(old) == whole:
                return self.expanded(new)
        return whole


def is_name(text: str) -> bool:
    """Whether ROS would accept it as the name of a topic or a node."""
    return len(text) <= 255 and _NAME.match(text) is not None


@dataclass(frozen=True, slots=True)
class Resolver:
    """Where each node of a system runs; a node without an entry runs at the root under its own name."""

    nodes: tuple[tuple[str, Placed], ...] = ()

    def placed(self, node: str) -> Placed:
        for name, placed in self.nodes:
            if name == node:
                return placed
        return Placed(f"/{node}")

    def topic(self, node: str, name: str) -> str:
        """The whole name of a topic that a node calls `name`."""
        return self.placed(node).resolved(name)
