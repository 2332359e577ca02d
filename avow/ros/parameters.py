"""ROS 2 parameter files: the parameters that they set for a node.

Entries are named by nodes, in full (``/ns/node``), without the first slash, or within their namespaces. ``*`` matches
one part of a name, ``**`` any number of them. Source: https://docs.ros.org/en/rolling/p/rcl_yaml_param_parser and
rclcpp's ``parameter_map_from``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

OF_EVERY_NODE = ("use_sim_time", "qos_overrides", "start_type_description_service")
"""First parts of the names of parameters that every node of ROS 2 has."""
SECTION = "ros__parameters"
SLIP = SECTION.replace("__", "_")

Path = tuple[str, ...]
"""Keys of mappings within mappings."""
At = TypeVar("At")
EVERY = "/**"
"""The entry of parameters that are set without a node's name, as `-p` does."""


class WrongParameters(Exception):  # noqa: N818 - it is what was found wrong
    """A file whose parameters for a node cannot be determined; `path`: the keys that lead to the fault."""

    def __init__(self, text: str, path: Path = ()) -> None:
        super().__init__(text)
        self.path = path


def is_sectioned(data: object) -> bool:
    """Whether it is a parameter file of ROS 2, not a plain mapping."""
    keys = data.items() if isinstance(data, Mapping) else ()
    return any(key in (SECTION, SLIP) or str(key)[:1] == "/" or is_sectioned(value) for key, value in keys)


def placed(data: Mapping[str, Any], name: str) -> dict[str, tuple[Any, Path]]:
    """The parameters that a file sets for the node of a whole name, by their dotted names, with the keys that lead to
    each value; of a plain mapping, all of it. Raises WrongParameters."""
    if not is_sectioned(data):
        return {".".join(map(str, path)): (value, path) for path, value in _leaves(data, ())}
    found, doubts = settled(entries(data, name))
    for key, why in doubts.items():
        raise WrongParameters(why, found[key][1])
    return found


def entries(data: Mapping[str, Any], name: str) -> Iterator[tuple[str, str, Any, Path]]:
    """What a file sets for a node: the entry's name, the parameter's dotted name, its value, and the keys that lead to
    it. Raises WrongParameters."""
    every = list(_entries(data, "", ()))
    for entry, section, above in every:
        for path, value in _leaves(section, above) if _matches(entry, name) else ():
            yield entry, ".".join(map(str, path[len(above) :])), value, path
    if not any(_matches(entry, name) for entry, _, _ in every):
        others = ", ".join(entry for entry, _, _ in every)
        raise WrongParameters(f"it sets nothing for {name}, but for {others}", every[0][2][:-1] if every else ())


def settled(given: Iterable[tuple[str, str, Any, At]]) -> tuple[dict[str, tuple[Any, At]], dict[str, str]]:
    """Parameters by their names, each with its value and a place; and why some values are not clear. All that is given
    under one entry is one section (rcl), the sections count in the order in which they first appear (rclcpp and
    rclpy), except that in older versions of rclpy a wildcard never replaces what is given for the node itself."""
    sections: dict[str, dict[str, tuple[Any, At]]] = {}
    for entry, key, value, at in given:
        sections.setdefault(entry, {})[key] = value, at
    found: dict[str, tuple[Any, At]] = {}
    own: dict[str, str] = {}
    doubts: dict[str, str] = {}
    for entry, section in sections.items():
        for key, (value, at) in section.items():
            if "*" in entry and key in own and found[key][0] != value:
                doubts[key] = (
                    f"{entry} sets {key} to {value!r} after {own[key]} has set it to {found[key][0]!r}, and client "
                    "libraries do not agree which of them counts: put the wildcard first"
                )
            if "*" not in entry:
                own[key] = entry
                doubts.pop(key, None)
            found[key] = value, at
    return found, doubts


def flat(section: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Parameters by their dotted names."""
    return ((".".join(map(str, path)), value) for path, value in _leaves(section, ()))


def _leaves(section: Mapping[str, Any], above: Path) -> Iterator[tuple[Path, Any]]:
    for key, value in section.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, (*above, key))
        else:
            yield (*above, key), value


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


def _entries(data: Mapping[str, Any], before: str, above: Path) -> Iterator[tuple[str, Mapping[str, Any], Path]]:
    for key, value in data.items():
        name, path = f"{before}/{str(key).strip('/')}", (*above, key)
        if key == SLIP:
            raise WrongParameters(f"{before or '/'} has `{SLIP}`: write `{SECTION}`, with two underscores", path)
        if not isinstance(value, Mapping):
            raise WrongParameters(
                f"{name} is neither a node with `{SECTION}` nor a namespace: write `ros__parameters:` above it", path
            )
        if SECTION not in value:
            yield from _entries(value, name, path)
        elif len(value) > 1:
            other = next(each for each in value if each != SECTION)
            raise WrongParameters(f"{name} has other keys beside `{SECTION}`", (*path, other))
        elif not isinstance(value[SECTION], Mapping | None):
            raise WrongParameters(f"`{SECTION}` of {name} is no mapping", (*path, SECTION))
        else:
            yield name, value[SECTION] or {}, (*path, SECTION)


def _matches(entry: str, name: str) -> bool:
    parts = (r"(/\w+)*" if p == "**" else r"/\w+" if p == "*" else f"/{re.escape(p)}" for p in entry.split("/")[1:])
    return re.fullmatch("".join(parts), name) is not None
