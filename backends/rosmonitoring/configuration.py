"""ROSMonitoring's configuration (3.0) of one node or all: the topics that the monitors listen to, filter and order, and
the services whose calls they forward."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Rejected
from avow.language.terms import Role
from avow.ros.calls import is_part, named

from .options import Setup, same_topic
from .pace import duration

_ENDS = ("/_request", "/_response")
_ESCAPE = re.compile(r"[^A-Za-z0-9_]|_(?=x[0-9a-f]+_)")


def identifier(prefix: str, name: str) -> str:
    """A Python identifier for a contract's name; different names get different identifiers."""
    found = prefix + _ESCAPE.sub(lambda m: f"_x{ord(m.group()):x}_", name)
    return found + "_" if keyword.iskeyword(found) else found


def dotted_type(ros_type: str) -> str:
    """``package/Type``, ``package/msg/Type`` or a built-in as ``package.msg.Type``, which the generator imports."""
    parts = ros_type.split("/")
    if len(parts) == 1:
        builtin = parts[0]
        return f"std_msgs.msg.{builtin.capitalize().replace('Uint', 'UInt')}"
    return f"{parts[0]}.msg.{parts[-1]}"


def _topic_types(setup: Setup) -> dict[str, str]:
    """Topic → dotted type, each once: the contract's topics, then those that only the plan names."""
    return {name: dotted_type(kind) for name, kind in _listed(setup) if not is_part(name)}


def _services(setup: Setup) -> dict[str, str]:
    """Service → dotted type. ROSMonitoring has no monitors of actions, nor of the services that implement them."""
    found = {}
    for name, kind in _listed(setup):
        if name.endswith(_ENDS) and "/_action/" not in name:
            package, _, part = kind.rpartition("/")
            part = part.removesuffix("_Request").removesuffix("_Response")
            found[named(name)] = f"{package.partition('/')[0]}.srv.{part}"
    return found


def _listed(setup: Setup) -> Iterator[tuple[str, str]]:
    """The topics and the parts of calls, each once, with their types: first those of the contract."""
    seen: set[str] = set()
    for name, kind in [*setup.named, *((rule.topic, rule.kind) for rule in setup.carried.values() if rule.kind)]:
        if same_topic(name) not in seen:
            seen.add(same_topic(name))
            yield name, kind


def configuration(setup: Setup, options: Mapping[str, Any]) -> str:
    """The file of one node."""
    return _file([_monitor(setup, options)], _nodes(setup, options), options.get("ros_version"))


def of_system(parts: Sequence[tuple[Setup, Mapping[str, Any]]]) -> str:
    """One file for all nodes: the generator makes one package of each file, always with the same name. Nodes without
    observable topics are left out. Only one monitor can forward a service's calls: that of the node that serves it, if
    there is one. Raises Rejected if the methods do not agree."""
    versions = {str(options["ros_version"]) for _, options in parts if "ros_version" in options}
    if len(versions) > 1:
        text = f"the methods say {' and '.join(sorted(versions))} as `ros_version`, and one file is for one"
        raise Rejected(Diagnostic("MON101", text))
    forwards: dict[str, str] = {}
    for serving in (True, False):
        for setup, _ in parts:
            for service in map(same_topic, _services(setup)):
                if not serving or service in _serves(setup):
                    forwards.setdefault(service, setup.node.name)
    monitors = [
        monitor
        for setup, options in parts
        if (monitor := _monitor(setup, options, forwards))["topics"] or monitor.get("services")
    ]
    nodes = [node for setup, options in parts for node in _nodes(setup, options)]
    if wrong := [*_problems(monitors)]:
        raise Rejected(
            *(Diagnostic("MON101", f"ROSMonitoring would not take the configuration: {one}") for one in wrong)
        )
    return _file(monitors, nodes, next(iter(versions), None))


def _nodes(setup: Setup, options: Mapping[str, Any]) -> list[dict[str, Any]]:
    if not {"package", "path"} <= options.keys():
        return []
    return [{"node": {"name": setup.node.name, "package": str(options["package"]), "path": str(options["path"])}}]


def _file(monitors: list[dict[str, Any]], nodes: list[dict[str, Any]], version: object) -> str:
    whole: dict[str, Any] = {"ros_version": str(version)} if version is not None else {}
    if nodes:
        whole["nodes"] = nodes
    whole["monitors"] = [{"monitor": monitor} for monitor in monitors]
    return yaml.safe_dump(whole, sort_keys=False, allow_unicode=False, width=1000)


def _serves(setup: Setup) -> set[str]:
    """The services whose responses are outputs."""
    rules = [rule for rule in setup.carried.values() if rule.variable.role is Role.OUTPUT]
    return {same_topic(named(rule.topic)) for rule in rules if rule.topic.endswith("/_response")}


def _monitor(setup: Setup, options: Mapping[str, Any], forwards: Mapping[str, str] | None = None) -> dict[str, Any]:
    """`forwards`: the node in whose monitor each service is, if not in that of every node that takes part."""
    monitor: dict[str, Any] = {
        "id": identifier("monitor_", setup.node.name),
        "log": f"./{identifier('', setup.node.name)}_log.txt",
        "silent": bool(options.get("silent", False)),
        "warning": int(options.get("warning", 1)),
    }
    oracle = options.get("oracle")
    if isinstance(oracle, Mapping):
        monitor["oracle"] = {
            "url": str(oracle.get("url", "127.0.0.1")),
            "port": int(oracle["port"]),
            "action": str(oracle.get("action", "nothing")),
            "timeout": float(oracle.get("timeout", 2.0)),
        }
    filtered = setup.filtered if "oracle" in monitor else frozenset[str]()  # only an oracle decides what is broken
    monitor["topics"] = []
    for name, kind in _topic_types(setup).items():
        topic: dict[str, Any] = {"name": name, "type": kind, "action": "log"}
        if same_topic(name) in filtered:
            topic |= {"action": "filter", "publishers": [setup.node.name]}
        monitor["topics"].append(topic)
    own = setup.node.name
    services = {n: kind for n, kind in _services(setup).items() if (forwards or {}).get(same_topic(n), own) == own}
    if services:
        monitor["services"] = [{"name": name, "type": kind, "action": "log"} for name, kind in services.items()]
    for interface in (*monitor["topics"], *monitor.get("services", ())) if "ordered" in options else ():
        interface["ordering"] = {"enabled": True, "max_delay_ms": int(1000 * duration(str(options["ordered"])))}
    return monitor


def _problems(monitors: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """The errors of ROSMonitoring's validator or generator that contract and plan can cause (the tests check the rest:
    `tests/oracle/rosmonitoring.py`)."""
    if not monitors:
        yield "`monitors` must be a list of monitors"
    filtered: set[str] = set()
    for topic in (topic for monitor in monitors for topic in (*monitor["topics"], *monitor.get("services", ()))):
        name, parts = same_topic(topic["name"]), topic["type"].split(".")
        if topic["action"] == "filter":
            if name in filtered:
                yield f"the topic {topic['name']} is filtered by several monitors"
            filtered.add(name)
        if len(parts) != 3 or not all(part.isidentifier() for part in parts):
            yield f"the type {topic['type']!r} is not of the form package.msg.Type or package.srv.Type"
