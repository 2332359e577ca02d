"""ROS 2 parameter files: the parameters that they set for a node.

Entries are named by nodes, in full (``/ns/node``), without the first slash, or within their namespaces. ``*`` matches
one part of a name, ``**`` any number of them. Source: https://docs.ros.org/en/rolling/p/rcl_yaml_param_parser and
rclcpp's ``parameter_map_from``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

OF_EVERY_NODE = ("use_sim_time", "qos_overrides", "start_type_description_service")
"""First parts of the names of parameters that every node of ROS 2 has."""
SECTION = "ros__parameters"
SLIP = SECTION.replace("__", "_")

Path = tuple[str, ...]
"""Keys of mappings within mappings."""


class WrongParameters(Exception):  # noqa: N818 - it is what was found wrong
    """A file whose parameters for a node cannot be determined; `path`: the keys that lead to the fault."""

    def __init__(self, text: str, path: Path = ()) -> None:
        super().__init__(text)
        self.path = path


def is_sectioned(data: object) -> bool:
    """Whether it is a parameter file of ROS 2, not a plain mapping."""
    keys = data.items() if isinstance(data, Mapping) else ()
    return any(key in (SECTION, SLIP) or str(key)[:1] == "/" or is_sectioned(value) for key, value in keys)


def of_node(data: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The parameters that a file sets for the node of a whole name, by their dotted names; a later entry takes
    precedence over an earlier one. Raises WrongParameters."""
    return {key: value for key, (value, _) in placed(data, name).items()}


def placed(data: Mapping[str, Any], name: str) -> dict[str, tuple[Any, Path]]:
    """The same with the keys that lead to each value; of a plain mapping, all of it."""
    if not is_sectioned(data):
        return {".".join(map(str, path)): (value, path) for path, value in _leaves(data, ())}
    found: dict[str, tuple[Any, Path]] = {}
    own: dict[str, str] = {}
    entries = list(_entries(data, "", ()))
    for entry, section, above in entries:
        if not _matches(entry, name):
            continue
        for path, value in _leaves(section, above):
            key = ".".join(map(str, path[len(above) :]))
            if "*" in entry and key in own and found[key][0] != value:
                raise WrongParameters(
                    f"{entry} sets {key} to {value!r} after {own[key]} has set it to {found[key][0]!r}, and client "
                    "libraries do not agree which of them counts: put the wildcard first",
                    path,
                )
            if "*" not in entry:
                own[key] = entry
            found[key] = value, path
    if not any(_matches(entry, name) for entry, _, _ in entries):
        others = ", ".join(entry for entry, _, _ in entries)
        raise WrongParameters(f"it sets nothing for {name}, but for {others}", entries[0][2][:-1] if entries else ())
    return found


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
