"""How a system is wired, for people and for machines: the run-time name of each node, what each topic carries and
between which nodes, the inputs from the environment, and the links by name, made because an end has no topic.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.system.graph import Graph
from avow.system.plan import Edge, Endpoint, System
from avow.system.topics import ends, whole_name


@dataclass(frozen=True, slots=True)
class Ended:
    """An end of a topic: a port, the name that its node uses for the topic, and how it arrives late."""

    port: str
    called: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class TopicView:
    """`publishers`: if several, each is received, at any step. `environment`: whether a listener hears none of them."""

    name: str
    kind: str
    publishers: tuple[Ended, ...]
    listeners: tuple[Ended, ...]
    environment: bool


@dataclass(frozen=True, slots=True)
class Wiring:
    """`nodes`: (node, its whole name, remappings, where they are given). `topics` by name. `links`: those that no topic
    carries; `environment`: inputs without a topic that nothing provides."""

    nodes: tuple[tuple[str, str, tuple[tuple[str, str], ...], str], ...]
    topics: tuple[TopicView, ...]
    links: tuple[str, ...]
    environment: tuple[str, ...]
    deadlocks: tuple[tuple[str, ...], ...] = ()

    def json(self) -> dict[str, Any]:
        """As printed by ``avow graph --json``."""
        return {
            "nodes": [
                {"node": node, "name": name, "remap": dict(remaps), "said": said}
                for node, name, remaps, said in self.nodes
            ],
            "topics": [
                {
                    "topic": topic.name,
                    "type": topic.kind,
                    "publishers": [_json(end) for end in topic.publishers],
                    "listeners": [_json(end) for end in topic.listeners],
                    "environment": topic.environment,
                }
                for topic in self.topics
            ],
            "links": self.links,
            "environment": self.environment,
            "deadlocks": self.deadlocks,
        }

    def text(self) -> str:
        """For a terminal."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield "nodes"
        for node, name, remaps, said in self.nodes:
            told = [name, *(f"{old} → {new}" for old, new in remaps), *([f"({said})"] if said else [])]
            yield f"  {node}: {', '.join(told[:-1])} {told[-1]}" if said else f"  {node}: {', '.join(told)}"
        if self.topics:
            yield "topics"
        for topic in self.topics:
            yield f"  {topic.name}  {topic.kind}"
            several = ": any of the publishers, at any step" if len(_nodes(topic.publishers)) > 1 else ""
            yield from (f"    ← {line}" for line in _ends(topic.name, topic.publishers))
            if topic.environment:
                yield "    ← the environment"
            yield from (f"    → {line}{several}" for line in _ends(topic.name, topic.listeners))
            if not topic.listeners:
                yield "    → nobody"
        if self.links:
            yield "linked by name, since an end has no topic, or by a connection"
            yield from (f"  {link}" for link in self.links)
        if self.environment:
            yield "from the environment, without a topic"
            yield from (f"  {port}" for port in self.environment)
        for cycle in self.deadlocks:
            yield f"start-up deadlock: {' → '.join((*cycle, cycle[0]))}"


def wiring(system: System, graph: Graph) -> Wiring:
    """The wiring of a system that loads."""
    nodes = [node for node in system.contract.nodes if not node.relay]
    names = system.plan.ros.names
    found = ends(nodes, names)
    relayed = ends([node for node in system.contract.nodes if node.relay], names).inputs
    late = {edge.target: edge for edge in graph.edges}
    called = {(n.name, t.port.name, whole_name(names, n, t)): t.name for n in nodes for t in n.topics if t.port}
    whole: dict[str, str] = {}
    publishers: dict[str, list[Ended]] = {}
    listeners: dict[str, list[Ended]] = {}
    outside = {carrier.topic for at in graph.environment for carrier in relayed.get(at, ())}
    carried: set[Endpoint] = set()
    for into, side in ((publishers, found.outputs), (listeners, found.inputs)):
        for at, carriers in side.items():
            for carrier in carriers:
                whole.setdefault(carrier.topic, carrier.kind)
                note = ""
                if into is listeners:
                    note = _late_of(graph, late.get(at))
                    if at in graph.environment:
                        outside.add(carrier.topic)
                    if at in late and late[at].topic:
                        carried.add(at)
                word = called[at.node, at.port, carrier.topic]
                into.setdefault(carrier.topic, []).append(Ended(str(at), word, note))
    topics = tuple(
        TopicView(name, kind, tuple(publishers.get(name, ())), tuple(listeners.get(name, ())), name in outside)
        for name, kind in sorted(whole.items())
    )
    links = tuple(
        f"{edge.source} → {edge.target}{_late(edge)}"
        for edge in graph.edges
        if edge.target not in carried and edge.source.node not in graph.relays and edge.target.node not in graph.relays
    )
    open_ = tuple(str(at) for at in graph.environment if at not in found.inputs and at not in relayed)
    placed = dict(names.nodes)
    told = tuple(
        (node.name, names.placed(node.name).name, names.placed(node.name).remaps, _said(placed, node.name, system))
        for node in nodes
    )
    return Wiring(told, topics, links, open_, graph.deadlocks)


def _said(placed: Mapping[str, Any], node: str, system: System) -> str:
    span = placed[node].span if node in placed else None
    return f"{Path(span.file).name}:{span.line}" if span is not None and Path(span.file) != system.plan.path else ""


def _late_of(graph: Graph, edge: Edge | None) -> str:
    """As `_late`; for several publishers, those whose messages come late."""
    if edge is None or edge.source.node not in graph.relays:
        return _late(edge) if edge is not None else ""
    late = [str(e.source) for e in graph.feeding(edge.source.node) if e.delayed]
    return f", from {', '.join(late)} one step later" if late else ""


def _late(edge: Edge) -> str:
    if not edge.delayed:
        return ""
    return f", one step later, first {edge.initial}" if edge.initial else ", one step later"


def _ends(topic: str, ends: Sequence[Ended]) -> Iterator[str]:
    """A line for each node, with its ports."""
    lines: dict[tuple[str, str], list[str]] = {}
    for end in ends:
        node, _, port = end.port.partition(".")
        named = f" (there called {end.called})" if end.called.lstrip("/") != topic.lstrip("/") else ""
        lines.setdefault((node, f"{named}{end.note}"), []).append(port)
    for (node, note), ports in lines.items():
        yield f"{node}.{ports[0]}{note}" if len(ports) == 1 else f"{node}: {', '.join(ports)}{note}"


def _nodes(ends: Sequence[Ended]) -> set[str]:
    return {end.port.partition(".")[0] for end in ends}


def _json(end: Ended) -> dict[str, Any]:
    return {"port": end.port, "called": end.called, "delayed": bool(end.note)}
