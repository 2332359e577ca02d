"""The content of a launch file in any format: elements with attributes, as in ROS's XML."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import field

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean, nearest

HINT = "say what it does under `ros: {nodes: …}`, or give the value as `args` of the launch file in the plan"
_QUIET = "param rosparam env set_env unset_env set_use_sim_time machine test master log description append_env"
SILENT = frozenset(re.split(" ", _QUIET))
"""Elements that start nothing and rename nothing."""
NODES = ("node", "lifecycle_node", "node_container", "composable_node", "composable_node_container")
_OTHERS = ("group", "timer", "load_composable_node", "push_ros_namespace", "remap", "include", "set_parameter")


@dataclass(frozen=True, slots=True)
class Unread:
    """A value that cannot be known without running the file, and why."""

    why: str


Text = str | Unread
"""A text with substitutions (``$(var x)``), or why it is unknown."""


@dataclass(frozen=True, slots=True)
class Element:
    """``<node name="a">``: its tag with ``_`` for ``-``, its attributes, its children, and its place."""

    tag: str
    attributes: Mapping[str, Text]
    children: tuple[Element, ...]
    span: Span

    def get(self, *names: str) -> Text | None:
        """The first attribute that is present."""
        return next((self.attributes[name] for name in names if name in self.attributes), None)

    def hint(self, *wanted: str) -> str:
        """What to do about an unknown element, or about one that lacks an attribute: another may be its misspelling."""
        for key in wanted:
            if key not in self.attributes and (near := nearest(key, self.attributes, alike=0.75)):
                return f"did you mean `{key}` for `{near[0]}`?"
        return (None if wanted else did_you_mean(self.tag, [*NODES, *_OTHERS, *SILENT])) or HINT

    def within(self) -> Iterator[Element]:
        """It, and all elements in it."""
        yield self
        for child in self.children:
            yield from child.within()


@dataclass(slots=True)
class Parsed:
    """A file's elements, and its parts that cannot be read as elements."""

    elements: tuple[Element, ...] = ()
    unread: list[Diagnostic] = field(default_factory=list)

    @property
    def arguments(self) -> Iterator[str]:
        """All that are declared, under whichever condition."""
        names = (each.get("name") for one in self.elements for each in one.within() if each.tag == "arg")
        return (name for name in names if isinstance(name, str))

    @property
    def is_ros2(self) -> bool:
        """Whether it is ROS 2's XML: roslaunch has neither `exec` nor these elements."""
        return any(
            {"exec", "namespace"} & e.attributes.keys()
            or e.tag in ("let", "push_ros_namespace", "set_remap", "node_container", "load_composable_node")
            or any(
                isinstance(text, str) and ("$(var " in text or "$(find-pkg" in text) for text in e.attributes.values()
            )
            for one in self.elements
            for e in one.within()
        )


def place(file: str, line: int, column: int = 1) -> Span:
    return Span(file, line, column, line, column + 1)


def unread(span: Span, message: str, hint: str = HINT) -> Diagnostic:
    """A diagnostic for a part that is not read, with its place."""
    return Diagnostic("ROS121", message, span, Severity.WARNING, hint)


def literal(text: str) -> Text:
    """A text in which nothing is a substitution."""
    return Unread(f"{text[:60]!r} would be taken for a substitution") if "$(" in text else text


def joined(parts: list[Text]) -> Text:
    """Concatenated texts; unread if one of them is."""
    whole = ""
    for part in parts:
        if isinstance(part, Unread):
            return part
        whole += part
    return whole


VARIABLE = re.compile(r"[A-Za-z_][\w.-]*\Z", re.ASCII)
"""A name that may be used in ``$(var …)``."""
