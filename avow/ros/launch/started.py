"""What launch files start: nodes, their names, remappings and parameters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, replace
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Span
from avow.base.records import dataclass


@dataclass(frozen=True, slots=True)
class Started:
    """A node that a launch file starts. `unread`: the parts of its names that are unknown without running the file."""

    name: str
    """``/robot1/sensor``; empty if it is not known."""
    kind: str
    """``package/executable``, as far as it is given."""
    remaps: tuple[tuple[str, str], ...] = ()
    unread: tuple[str, ...] = ()
    span: Span | None = field(default=None, compare=False, repr=False)
    parameters: tuple[Setting, ...] = ()
    """In their order, as far as they can be read."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter's name and value as text; a file's path, if the name is empty. The value is empty if it is not
    known."""

    name: str
    value: str
    span: Span = field(compare=False, repr=False)
    shared: bool = False
    """Whether it is set for all nodes of a scope, which need not have such a parameter."""
    unnamed: bool = False
    """ROS 2: whether it is given without the node's name, as a wildcard is (`avow.ros.parameters.settled`)."""
    within: str = ""
    """ROS 1: the namespace in which the file's mapping is loaded; empty: the node's own."""


@dataclass(frozen=True, slots=True)
class Launched:
    """The nodes that some launch files start. `unread`: the places that cannot be read statically; `files`: all files
    that were read; `arguments`: those that they declare or refer to."""

    nodes: tuple[Started, ...] = ()
    unread: tuple[Diagnostic, ...] = ()
    files: tuple[Path, ...] = ()
    arguments: tuple[str, ...] = ()

    @property
    def is_broken(self) -> bool:
        """Whether a file is missing or no launch file, so that nothing follows from what the others start."""
        return any(found.is_error for found in self.unread)


def with_server(node: Started, place: int, server: Iterable[tuple[int, Setting]]) -> Started:
    """ROS 1: a node, before which `place` nodes come, with the parameters that elements outside of nodes set for it,
    each with the number of nodes that come before it. The last one of a name holds."""
    prefix = f"{node.name}/"
    own = []
    for k, setting in server if node.name else ():
        within = f"{setting.within.rstrip('/')}/"
        if setting.within and (within.startswith(prefix) or prefix.startswith(within)):
            own.append((k, setting))
        elif setting.name.startswith(prefix):
            own.append((k, replace(setting, name=setting.name[len(prefix) :])))
    before, after = ([s for k, s in own if (k > place) is late] for late in (False, True))
    return replace(node, parameters=(*before, *node.parameters, *after)) if own else node
