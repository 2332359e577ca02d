"""What ROSMonitoring's validator or generator would stumble over in a configuration, by its documentation."""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from typing import Any

import yaml


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
    filtered: set[str] = set()
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
        found += [
            f"the topic {topic['name']} is filtered by several monitors"
            for topic in _filtered(monitor)
            if _taken(str(topic["name"]).lstrip("/"), filtered)
        ]
        if not isinstance(monitor.get("log"), str):
            found.append("`log` must be a path")
        found += _interface_problems(monitor.get("topics"), "topic", "msg")
        found += _interface_problems(monitor.get("services", []), "service", "srv")
        if not monitor.get("topics") and not monitor.get("services"):
            found.append("a monitor has at least one topic or service")
    return found


def _filtered(monitor: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    topics = monitor.get("topics")
    listed = [topic for topic in topics if isinstance(topic, dict)] if isinstance(topics, list) else []
    return [topic for topic in listed if topic.get("action") == "filter"]


def _taken(name: str, taken: set[str]) -> bool:
    found = name in taken
    taken.add(name)
    return found


def _interface_problems(listed: Any, kind: str, module: str) -> list[str]:
    if not isinstance(listed, list):
        return [f"`{kind}s` must be a list"]
    found, names = [], set()
    for topic in listed:
        if not isinstance(topic, dict) or not {"name", "type", "action"} <= topic.keys():
            found.append(f"a {kind} has a name, a type and an action")
            continue
        name = str(topic["name"]).lstrip("/")
        if name in names:
            found.append(f"the {kind} {name} occurs twice")
        names.add(name)
        parts = str(topic["type"]).split(".")
        if len(parts) != 3 or parts[1] != module or not all(p.isidentifier() for p in parts):
            found.append(f"the type {topic['type']!r} is not of the form package.{module}.Type")
        if topic["action"] not in ("log", "filter"):
            found.append(f"the action {topic['action']!r} is neither log nor filter")
    return found
