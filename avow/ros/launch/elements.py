"""The content of a launch file in any format: elements with attributes, as in ROS's XML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.records import dataclass
from avow.base.suggestions import nearest


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


@dataclass(slots=True)
class Parsed:
    """A file's elements, and its parts that cannot be read as elements."""

    elements: tuple[Element, ...] = ()
    unread: list[Diagnostic] = field(default_factory=list)


class WrongLaunch(Exception):  # noqa: N818 - it is what was found wrong
    """A text that is not a launch file; `line` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


HINT = "say what it does under `ros: {nodes: …}`, or give the value as `args` of the launch file in the plan"


def place(file: str, line: int, column: int = 1) -> Span:
    return Span(file, line, column, line, column + 1)


def unread(span: Span, message: str, hint: str = HINT) -> Diagnostic:
    """A diagnostic for a part that is not read, with its place."""
    return Diagnostic("ROS121", message, span, Severity.WARNING, hint)


def nameless(element: Element) -> str:
    """The hint for a node without a name: another attribute may be a misspelt `name`."""
    near = nearest("name", element.attributes, alike=0.75)
    return f"did you mean `name` for `{near[0]}`?" if near else HINT


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
