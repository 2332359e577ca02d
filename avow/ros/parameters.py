"""ROS 2 parameter files: the parameters that they set for a node.

Entries are named by nodes, in full (``/ns/node``), without the first slash, or within their namespaces. ``*`` matches
one part of a name, ``**`` any number of them. Source: https://docs.ros.org/en/rolling/p/rcl_yaml_param_parser and
rclcpp's ``parameter_map_from``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

SECTION = "ros__parameters"
SLIP = SECTION.replace("__", "_")


class WrongParameters(Exception):  # noqa: N818 - it is what was found wrong
    """A file whose parameters for a node cannot be determined."""


def is_sectioned(data: object) -> bool:
    """Whether it is a parameter file of ROS 2, not a plain mapping."""
    keys = data.items() if isinstance(data, Mapping) else ()
    return any(key in (SECTION, SLIP) or str(key)[:1] == "/" or is_sectioned(value) for key, value in keys)


def of_node(data: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The parameters that a file sets for the node of a whole name, by their dotted names; a later entry takes
    precedence over an earlier one. Raises WrongParameters."""
    found: dict[str, Any] = {}
    own: dict[str, str] = {}
    entries = list(_entries(data, ""))
    for entry, section in entries:
        if not _matches(entry, name):
            continue
        for key, value in flat(section):
            if "*" in entry and key in own and found[key] != value:
                raise WrongParameters(
                    f"{entry} sets {key} to {value!r} after {own[key]} has set it to {found[key]!r}, and client "
                    "libraries do not agree which of them counts: put the wildcard first"
                )
            if "*" not in entry:
                own[key] = entry
            found[key] = value
    if not any(_matches(entry, name) for entry, _ in entries):
        raise WrongParameters(f"it sets nothing for {name}, but for {', '.join(entry for entry, _ in entries)}")
    return found


def flat(section: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Parameters by their dotted names."""
    for key, value in section.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def nested(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters by their dotted names, as mappings within mappings. Raises WrongParameters."""
    whole: dict[str, Any] = {}
    for name, value in settings.items():
        *path, last = name.split(".")
        at = whole
        for part in path:
            at = at.setdefault(part, {})
            if not isinstance(at, dict):
                raise WrongParameters(f"{part} is a value, and {name} lies within it")
        at[last] = value
    return whole


def _entries(data: Mapping[str, Any], before: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for key, value in data.items():
        name = f"{before}/{str(key).strip('/')}"
        if key == SLIP:
            raise WrongParameters(f"{before or '/'} has `{SLIP}`: write `{SECTION}`, with two underscores")
        if not isinstance(value, Mapping):
            raise WrongParameters(
                f"{name} is neither a node with `{SECTION}` nor a namespace: write `ros__parameters:` above it"
            )
        if SECTION not in value:
            yield from _entries(value, name)
        elif len(value) > 1:
            raise WrongParameters(f"{name} has other keys beside `{SECTION}`")
        elif not isinstance(value[SECTION], Mapping | None):
            raise WrongParameters(f"`{SECTION}` of {name} is no mapping")
        else:
            yield name, value[SECTION] or {}


def _matches(entry: str, name: str) -> bool:
    parts = (r"(/\w+)*" if p == "**" else r"/\w+" if p == "*" else f"/{re.escape(p)}" for p in entry.split("/")[1:])
    return re.fullmatch("".join(parts), name) is not None
