"""The ROSMonitoring configuration (3.0) of one node: which topics its monitor listens to."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from typing import Any

import yaml

from avow.ros.calls import is_part

from .options import Setup, same_topic
from .rules import Choice, Fields

_ESCAPE = re.compile(r"[^A-Za-z0-9_]|_(?=x[0-9a-f]+_)")


def identifier(prefix: str, name: str) -> str:
    """A Python identifier for a contract's name; different names get different identifiers."""
    found = prefix + _ESCAPE.sub(lambda m: f"_x{ord(m.group()):x}_", name)
    return found + "_" if keyword.iskeyword(found) else found


def dotted_type(ros_type: str) -> str:
    """``package/Type``, ``package/msg/Type`` or a built-in as ``package.msg.Type``. The generator imports that."""
    parts = ros_type.split("/")
    if len(parts) == 1:
        builtin = parts[0]
        short = builtin.capitalize().replace("Uint", "UInt")
        return f"std_msgs.msg.{short}"
    return f"{parts[0]}.msg.{parts[-1]}"


def topic_types(setup: Setup) -> dict[str, str]:
    """Topic → dotted type, each once: the contract's topics, then those that only the plan names."""
    found: dict[str, str] = {}
    seen: set[str] = set()
    rules = (rule for rule in setup.rules.values() if isinstance(rule, Fields | Choice) and rule.kind)
    for name, kind in [*setup.named, *((rule.topic, rule.kind) for rule in rules)]:
        if same_topic(name) not in seen and not is_part(name):  # ROSMonitoring listens to topics
            seen.add(same_topic(name))
            found[name] = dotted_type(kind)
    return found


def configuration(setup: Setup, options: Mapping[str, Any]) -> str:
    """The file's text."""
    monitor_id = identifier("monitor_", setup.node.name)
    monitor: dict[str, Any] = {
        "id": monitor_id,
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
    types = topic_types(setup)
    monitor["topics"] = [{"name": name, "type": kind, "action": "log"} for name, kind in types.items()]
    whole: dict[str, Any] = {}
    if "ros_version" in options:
        whole["ros_version"] = str(options["ros_version"])
    if "package" in options and "path" in options:
        node = {"name": setup.node.name, "package": str(options["package"]), "path": str(options["path"])}
        whole["nodes"] = [{"node": node}]
    whole["monitors"] = [{"monitor": monitor}]
    return yaml.safe_dump(whole, sort_keys=False, allow_unicode=False, width=1000)


def problems(text: str) -> list[str]:
    """What ROSMonitoring's validator or generator would stumble over in a configuration."""
    found: list[str] = []
    try:
        whole = yaml.safe_load(text)
    except yaml.YAMLError as error:
        return [f"not YAML: {error}"]
    monitors = whole.get("monitors") if isinstance(whole, dict) else None
    if not isinstance(monitors, list) or not monitors:
        return ["`monitors` must be a list of monitors"]
    ids: set[str] = set()
    for entry in monitors:
        monitor = entry.get("monitor") if isinstance(entry, dict) else None
        if not isinstance(monitor, dict):
            found.append("each item of `monitors` holds one `monitor`")
            continue
        name = monitor.get("id")
        if not isinstance(name, str) or not name.isidentifier() or not name.isascii() or keyword.iskeyword(name):
            found.append(f"the id {name!r} is no Python identifier")
        elif name in ids:
            found.append(f"the id {name} occurs twice")
        else:
            ids.add(name)
        if not isinstance(monitor.get("log"), str):
            found.append("`log` must be a path")
        found += _topic_problems(monitor.get("topics"))
    return found


def _topic_problems(topics: Any) -> list[str]:
    if not isinstance(topics, list):
        return ["`topics` must be a list"]
    found, names = [], set()
    for topic in topics:
        if not isinstance(topic, dict) or not {"name", "type", "action"} <= topic.keys():
            found.append("a topic has a name, a type and an action")
            continue
        name = same_topic(str(topic["name"]))
        if name in names:
            found.append(f"the topic {name} occurs twice")
        names.add(name)
        parts = str(topic["type"]).split(".")
        if len(parts) != 3 or parts[1] != "msg" or not all(p.isidentifier() for p in parts):
            found.append(f"the type {topic['type']!r} is not of the form package.msg.Type")
        if topic["action"] not in ("log", "filter"):
            found.append(f"the action {topic['action']!r} is neither log nor filter")
    return found
