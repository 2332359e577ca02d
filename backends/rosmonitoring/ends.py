"""The two ends of a link: an input is read as the outputs that it hears."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from avow.base.diagnostics import Rejected
from avow.language.contract import Node
from avow.system.graph import dataflow
from avow.system.plan import Endpoint, Located, System

from .observing import Wrong

NAME = "rosmonitoring"


def method_of(system: System, node: str) -> Located | None:
    """The options of a node's (first) monitors."""
    return next((m.options for m in system.plan.node(node).methods if m.backend == NAME), None)


def said(options: Located | None) -> Mapping[str, Any]:
    """What a method's options say; nothing of a method that is not there."""
    return options.data if options is not None and isinstance(options.data, Mapping) else {}


def mapping_of(options: Located | None) -> Mapping[str, Any]:
    found = said(options).get("mapping")
    return found if isinstance(found, Mapping) else {}


def sources(system: System, node: Node, port: str) -> list[Endpoint]:
    """The outputs that an input hears: of a topic with several publishers, one of each."""
    try:
        graph = dataflow(system)
    except Rejected:
        return []
    heard = [e for e in graph.feeding(node.name) if e.target.port == port]
    each = (graph.feeding(e.source.node) if e.source.node in graph.relays else (e,) for e in heard)
    return [edge.source for edges in each for edge in edges]


def published(system: System, node: Node, port: str) -> Any:
    """What the plan says of the outputs that an input hears, without first values. Raises Wrong, where these are read
    in different ways."""
    found: dict[str, tuple[Endpoint, Any]] = {}
    for source in sources(system, node, port):
        entry = mapping_of(method_of(system, source.node)).get(f"out.{source.port}")
        entry = {k: v for k, v in entry.items() if k != "initial"} if isinstance(entry, Mapping) else entry
        if entry is not None:
            found.setdefault(json.dumps(written_out(entry), sort_keys=True, default=str), (source, entry))
    if len(found) > 1:
        (one, first), (other, second), *_ = found.values()
        raise Wrong(f"it hears {one}, read as {show_entry(first)}, and {other}, read as {show_entry(second)}")
    return next((entry for _, entry in found.values()), None)


def show_entry(entry: Any) -> str:
    return entry if isinstance(entry, str) else json.dumps(entry, default=str)


def written_out(entry: Any) -> Mapping[str, Any]:
    if isinstance(entry, str):
        return {"field": entry}
    if isinstance(entry, list):
        return {"fields": entry}
    found: Mapping[str, Any] = entry or {}
    return found
