"""Subsystems: nodes of a plan combined into one node, to any depth; and the dataflow graph with them as nodes.

A subsystem does not change how values flow. From outside, its inputs are the values that its nodes read from elsewhere
(one port for each value, however many nodes read it) and, over a delayed edge, its own values of the previous step; its
outputs are all outputs of its nodes. A loop that only closes outside it is therefore a loop of the graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from avow.base.diagnostics import Diagnostic, Severity
from avow.base.graphs import components
from avow.base.plain import circle
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.language.contract import Node, Port
from avow.language.sorts import Sort
from avow.language.terms import Role
from avow.system.graph import Graph, wired
from avow.system.plan import Edge, Endpoint, EnvironmentInput, Plan, System
from avow.system.topics import ends


@dataclass(frozen=True, slots=True)
class Face:
    """A subsystem as a node without clauses. `ports`: each of its ports → the node's port that it represents; `outlets`
    and `inlets`: each port of the nodes inside that is visible from outside → the subsystem's port."""

    node: Node
    inside: frozenset[str]
    ports: Mapping[Endpoint, Endpoint]
    outlets: Mapping[Endpoint, Endpoint]
    inlets: Mapping[Endpoint, Endpoint]


@dataclass(frozen=True, slots=True)
class Folded:
    """The graph with some subsystems as single nodes."""

    graph: Graph
    faces: Mapping[str, Face]


def inner_first(plan: Plan) -> tuple[str, ...]:
    """The subsystems of a plan (whose names are valid), each after those inside it."""
    names = [subsystem.name for subsystem in plan.subsystems]
    known = set(names)
    arcs = [(member, s.name) for s in plan.subsystems for member in s.members if member in known]
    return tuple(name for group in components(reversed(names), arcs) for name in group)


def leaves(plan: Plan) -> dict[str, tuple[str, ...]]:
    """For each subsystem the nodes inside it, at any depth."""
    members = {subsystem.name: subsystem.members for subsystem in plan.subsystems}
    found: dict[str, tuple[str, ...]] = {}
    for name in inner_first(plan):
        found[name] = tuple(node for member in members[name] for node in found.get(member, (member,)))
    return found


def parents(plan: Plan) -> dict[str, str]:
    """For each node or subsystem that is in one: the subsystem that it is directly in."""
    return {member: subsystem.name for subsystem in plan.subsystems for member in subsystem.members}


def outermost(system: System) -> tuple[str, ...]:
    """The nodes of the system as a whole: subsystems that are in no other, and nodes that are in none."""
    inside = parents(system.plan)
    found: dict[str, None] = {}
    for node in system.contract.nodes:
        name = node.name
        while name in inside:
            name = inside[name]
        found[name] = None
    return tuple(found)


def apart(plan: Plan, nodes: Iterable[Node]) -> dict[str, str]:
    """Inputs (``camera.raw``) that the plan separates from inputs of the same name elsewhere, and their owner: the node
    (``camera.raw``), or a subsystem (``perception.raw``, one for all nodes inside)."""
    inside, joined = leaves(plan), _joined(plan)
    known = {node.name: node for node in nodes}
    found: dict[str, str] = {}
    for entry in sorted(plan.environment, key=lambda e: -len(inside.get(e.port.partition(".")[0], ()))):
        owner, _, port = entry.port.partition(".")
        if owner == "in" or (entry.taken_in and entry.port in joined):
            continue
        for leaf in inside.get(owner, (owner,)):
            if leaf in known and any(p.name == port for p in known[leaf].inputs):
                found[f"{leaf}.{port}"] = entry.port  # the innermost entry wins
    return found


@by_identity(16)
def own_inputs(system: System, graph: Graph) -> Mapping[str, str]:
    """The same; in addition, inputs from the environment with one name but different types or topics are different
    inputs: the first node's keeps the name, another is named after the first node that reads it."""
    found = apart(system.plan, system.contract.nodes)
    heard = ends(system.contract.nodes, system.plan.ros.names).inputs
    first: dict[str, tuple[Sort, frozenset[str]]] = {}
    others: dict[tuple[str, Sort, frozenset[str]], str] = {}
    for at in graph.environment:
        name, sort = found.get(str(at), f"in.{at.port}"), system.contract.node(at.node).input(at.port).sort
        topics = frozenset(carrier.topic for carrier in heard.get(at, ()))
        known, carried = first.get(name, (sort, topics))
        first[name] = known, carried or topics
        # an end without a topic is linked by its name
        if sort != known or (topics and carried and topics != carried):
            found[str(at)] = others.setdefault((name, sort, topics), str(at))
    return found


def holders(system: System, graph: Graph, entry: EnvironmentInput) -> tuple[Endpoint, ...]:
    """The inputs that an entry of the plan's environment is about: those of its name that no other entry separates."""
    owner, _, port = entry.port.partition(".")
    inside = leaves(system.plan).get(owner, (owner,))
    nodes = [node for node in system.contract.nodes if owner == "in" or node.name in inside]
    at = [Endpoint(node.name, port) for node in nodes if any(p.name == port for p in node.inputs)]
    names = {entry.port}
    if entry.taken_in and entry.port in _joined(system.plan):
        names |= {f"{name}.{port}" for name in ("in", *_around(parents(system.plan), owner))}
    alone = own_inputs(system, graph)
    return tuple(e for e in at if alone.get(str(e), f"in.{port}") in names)


def _joined(plan: Plan) -> frozenset[str]:
    """Inputs of included folders (``left.raw``) that the plan declares to be the shared input (``in.raw``). An input
    that a folder's own plan separates for a node (``left_reader.raw``) stays separate."""
    folders = [subsystem.name for subsystem in plan.subsystems if subsystem.folder is not None]
    shared = [entry.port.partition(".")[2] for entry in plan.environment if entry.port.startswith("in.")]
    return frozenset(f"{name}.{port}" for name in folders for port in shared)


def _around(parents_of: Mapping[str, str], name: str) -> tuple[str, ...]:
    """The subsystems around a node or subsystem, innermost first."""
    found: list[str] = []
    while name in parents_of:
        name = parents_of[name]
        found.append(name)
    return tuple(found)


def face(system: System, graph: Graph, name: str, inside: Iterable[str]) -> Face:
    """A subsystem from outside."""
    nodes = [system.contract.node(leaf) for leaf in dict.fromkeys(inside)]
    held = frozenset(node.name for node in nodes)
    alone = own_inputs(system, graph)
    taken: set[str] = set()
    ports: dict[Endpoint, Endpoint] = {}

    def give(owner: str, label: str, port: Port, role: Role) -> Port:
        called = label if label not in taken else f"{owner}.{label}"
        while called in taken:
            called += "_"
        taken.add(called)
        ports[Endpoint(name, called)] = Endpoint(owner, port.name)
        return Port(role, called, port.sort, port.type_name, port.span)

    outputs: list[Port] = []
    outlets: dict[Endpoint, Endpoint] = {}
    for node in nodes:
        for port in node.outputs:
            outputs.append(give(node.name, port.name, port, Role.OUTPUT))
            outlets[Endpoint(node.name, port.name)] = Endpoint(name, outputs[-1].name)
    inputs: list[Port] = []
    inlets: dict[Endpoint, Endpoint] = {}
    known: dict[object, Endpoint] = {}
    for node in nodes:
        for port in node.inputs:
            at = Endpoint(node.name, port.name)
            edge = graph.by_target.get(at)
            if edge is not None and edge.source.node in held and not edge.delayed:
                continue
            value: object = (edge.source, edge.delayed) if edge else alone.get(str(at), f"in.{port.name}")
            if value not in known:
                label = f"{edge.source.port}_before" if edge is not None and edge.delayed else port.name
                inputs.append(give(node.name, label, port, Role.INPUT))
                known[value] = Endpoint(name, inputs[-1].name)
            inlets[at] = known[value]
    span = next((s.span for s in system.plan.subsystems if s.name == name), None)
    return Face(Node(name, tuple(inputs), tuple(outputs), (), (), (), span), held, ports, outlets, inlets)


def fold(system: System, graph: Graph, faces: Iterable[Face]) -> Folded:
    """The graph in which each of the faces (none inside another) represents the nodes inside it."""
    chosen = tuple(faces)
    home = {leaf: part for part in chosen for leaf in part.inside}
    outlets = {at: port for part in chosen for at, port in part.outlets.items()}
    inlets = {at: port for part in chosen for at, port in part.inlets.items()}
    nodes: dict[str, Node] = {}
    for node in system.contract.nodes:
        whole = home[node.name].node if node.name in home else node
        nodes[whole.name] = whole
    edges: dict[Endpoint, Edge] = {}
    for edge in graph.edges:
        part = home.get(edge.target.node)
        if part is not None and edge.target not in inlets:
            continue  # it stays inside
        target = inlets.get(edge.target, edge.target)
        edges.setdefault(target, replace(edge, source=outlets.get(edge.source, edge.source), target=target))
    folded = wired(tuple(nodes.values()), edges.values(), (), None)
    grouped = {part.node.name for part in chosen}
    meant = {port: at for part in chosen for port, at in part.ports.items()}
    dangling = tuple(e for e in folded.dangling if meant.get(e, e) in graph.dangling)  # not if it feeds a node inside
    deadlocks = tuple(cycle for cycle in folded.deadlocks if len(cycle) > 1 or cycle[0] not in grouped)
    findings = tuple(_waiting(cycle, folded) for cycle in deadlocks if grouped & set(cycle))
    return Folded(
        replace(folded, findings=findings, dangling=dangling, deadlocks=deadlocks),
        {part.node.name: part for part in chosen},
    )


def seen(system: System, graph: Graph) -> tuple[tuple[str, Graph], ...]:
    """The graph as it is drawn: the whole with its outermost subsystems as nodes (its name is empty), then the inside
    of each subsystem with its members as nodes, outer ones first."""
    plan, inside = system.plan, leaves(system.plan)
    if not plan.subsystems:
        return (("", graph),)
    faces = {name: face(system, graph, name, found) for name, found in inside.items()}
    found = [("", fold(system, graph, (faces[n] for n in outermost(system) if n in faces)).graph)]
    for name in reversed(inner_first(plan)):
        members = next(s.members for s in plan.subsystems if s.name == name)
        found.append((name, restricted(fold(system, graph, (faces[m] for m in members if m in faces)).graph, members)))
    return tuple(found)


def restricted(graph: Graph, names: Iterable[str]) -> Graph:
    """Some nodes with the edges between them. An input from elsewhere counts as one from outside, an output that leads
    elsewhere as not dangling."""
    kept = set(names)
    inside = [e for e in graph.edges if e.target.node in kept and e.source.node in kept]
    entering = {e.target: None for e in graph.edges if e.target.node in kept and e.source.node not in kept}
    outside = tuple(dict.fromkeys([*(e for e in graph.environment if e.node in kept), *entering]))
    return replace(
        graph,
        nodes=tuple(name for name in graph.nodes if name in kept),
        edges=tuple(inside),
        environment=outside,
        dangling=tuple(e for e in graph.dangling if e.node in kept),
        deadlocks=tuple(cycle for cycle in graph.deadlocks if set(cycle) <= kept),
        by_target={e.target: e for e in inside},
        by_consumer={n: tuple(e for e in inside if e.target.node == n) for n in kept},
        by_provider={n: tuple(e for e in inside if e.source.node == n) for n in kept},
    )


def _waiting(cycle: tuple[str, ...], graph: Graph) -> Diagnostic:
    shown = circle(cycle)
    span = next((edge.span for edge in graph.edges if edge.target.node == cycle[0] and edge.span), None)
    message = f"taken as single nodes, {shown} wait for one another at one step, and nothing comes first"
    return Diagnostic("PLAN123", message, span, Severity.WARNING, "group them otherwise, or delay an edge between them")
