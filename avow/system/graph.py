"""The dataflow graph: which output feeds which input, by topics, by names and types, and by the plan where those do not
suffice.

Where both ends have a topic, the topic links them (`avow.system.topics`). Otherwise an output feeds the inputs of
*other* nodes that have its name and type. A connection of the plan renames, chooses among several providers, delays, or
lets a node feed itself; an input named by a connection takes that source and no other.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import field, replace

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.graphs import components, cycles_in, reached
from avow.base.plain import circle
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.suggestions import nearest
from avow.language.contract import Node, Port
from avow.language.sorts import INTEGER, NATURAL, Sort
from avow.language.units import unit
from avow.ros.names import Resolver
from avow.system.plan import Edge, Endpoint, System
from avow.system.topics import Carrier, Ends, contradicted, ends, unheard, unlinked, wrong_types


@dataclass(frozen=True, slots=True)
class Graph:
    """`environment`: inputs that no node provides; `dangling`: outputs that feed nothing; `deadlocks`: cycles, each as
    the nodes on it, that no delayed edge with an initial value breaks."""

    nodes: tuple[str, ...]
    edges: tuple[Edge, ...]
    environment: tuple[Endpoint, ...]
    dangling: tuple[Endpoint, ...]
    deadlocks: tuple[tuple[str, ...], ...]
    findings: tuple[Diagnostic, ...]
    relays: frozenset[str]
    """Nodes that represent a topic of several publishers."""
    by_target: Mapping[Endpoint, Edge] = field(compare=False, repr=False)
    by_consumer: Mapping[str, tuple[Edge, ...]] = field(compare=False, repr=False)
    by_provider: Mapping[str, tuple[Edge, ...]] = field(compare=False, repr=False)

    def feeding(self, node: str) -> tuple[Edge, ...]:
        """The edges into a node."""
        return self.by_consumer.get(node, ())

    def fed_by(self, node: str) -> tuple[Edge, ...]:
        """The edges out of a node."""
        return self.by_provider.get(node, ())

    def upstream(self, node: str) -> frozenset[str]:
        """The nodes from which data reaches a node, at once or with delay; the node itself only if it is on a cycle."""
        return frozenset(reached(self.providers(node), self.providers))

    def ancestors(self, node: str, among: Collection[str]) -> tuple[str, ...]:
        """The other nodes among these from which values flow to a node within one step."""
        return self._within_a_step(node, among, self.providers)

    def heirs(self, node: str, among: Collection[str]) -> tuple[str, ...]:
        """The other nodes among these to which values flow from a node within one step."""
        return self._within_a_step(node, among, self.consumers)

    def _within_a_step(
        self, node: str, among: Collection[str], next_to: Callable[..., tuple[str, ...]]
    ) -> tuple[str, ...]:
        def neighbours(name: str) -> list[str]:
            return [n for n in reversed(next_to(name, delayed=False)) if n in among and n != node]

        return tuple(reached(neighbours(node), neighbours))

    def providers(self, node: str, *, delayed: bool | None = None) -> tuple[str, ...]:
        """The nodes that feed a node (including itself only if the edges do), each once."""
        found = (e.source.node for e in self.feeding(node) if delayed is None or e.delayed is delayed)
        return tuple(dict.fromkeys(found))

    def consumers(self, node: str, *, delayed: bool | None = None) -> tuple[str, ...]:
        """The nodes that a node feeds, each once."""
        found = (e.target.node for e in self.fed_by(node) if delayed is None or e.delayed is delayed)
        return tuple(dict.fromkeys(found))


@by_identity(8)
def dataflow(system: System) -> Graph:
    """The graph of a system. Never raises: its faults are in `findings`."""
    nodes = system.contract.nodes
    found = ends(nodes, system.plan.ros.names)
    relays = {node.name for node in nodes if node.relay}
    faults: list[Diagnostic] = [*wrong_types(found), *contradicted(system.plan.connections, found, relays)]
    edges = _declared(system, faults)
    taken = {edge.target: edge for edge in edges}
    edges += _by_topics(nodes, taken, found, faults)
    taken = {edge.target: edge for edge in edges}
    edges += _by_names(nodes, taken, found, faults, system.plan.ros.names)
    for edge in edges:
        if edge.target.node not in relays:
            faults += unheard(edge.source, edge.target, found, edge.span)
    edges = [replace(e, topic=_topic(e, found)) for e in edges]
    faults += [fault for edge in edges if (fault := _units(system, edge)) is not None]
    return wired(nodes, edges, faults, {node.name: node.span for node in nodes})


def wired(
    nodes: Sequence[Node], edges: Iterable[Edge], faults: Iterable[Diagnostic], spans: Mapping[str, Span | None] | None
) -> Graph:
    """The graph of some nodes and edges. `spans`: where to report start-up deadlocks; None: they are not reported."""
    order = {node.name: k for k, node in enumerate(nodes)}
    edges = sorted(edges, key=lambda e: (order[e.target.node], order[e.source.node], e.target.port, e.source.port))
    fed = {edge.target for edge in edges}
    feeding = {edge.source for edge in edges}
    environment = tuple(
        Endpoint(n.name, p.name) for n in nodes for p in n.inputs if Endpoint(n.name, p.name) not in fed
    )
    dangling = tuple(
        Endpoint(n.name, p.name) for n in nodes for p in n.outputs if Endpoint(n.name, p.name) not in feeding
    )
    names = tuple(node.name for node in nodes)
    started = [(e.source.node, e.target.node) for e in edges if not (e.delayed and e.initial is not None)]
    selves = {source for source, target in started if source == target}
    loops = [c for c in components(names, started) if len(c) > 1 or c[0] in selves]
    deadlocks = tuple(cycle for component in loops for cycle in cycles_in(component, started))
    relays = frozenset(node.name for node in nodes if node.relay)
    own = {cycle: tuple(name for name in cycle if name not in relays) for cycle in deadlocks if spans is not None}
    told = [_deadlock(shown, to_delay(cycle, edges, relays), spans or {}) for cycle, shown in own.items()]
    by_consumer: dict[str, list[Edge]] = defaultdict(list)
    by_provider: dict[str, list[Edge]] = defaultdict(list)
    for edge in edges:
        by_consumer[edge.target.node].append(edge)
        by_provider[edge.source.node].append(edge)
    return Graph(
        names,
        tuple(edges),
        environment,
        dangling,
        deadlocks,
        (*faults, *told),
        relays,
        {edge.target: edge for edge in edges},
        {name: tuple(found) for name, found in by_consumer.items()},
        {name: tuple(found) for name, found in by_provider.items()},
    )


def fits(output: Sort, wanted: Sort) -> bool:
    """Whether every value of an output's sort is one of the input's sort. INTEGER does not fit NATURAL."""
    return output == wanted or (output == NATURAL and wanted == INTEGER)


def _declared(system: System, faults: list[Diagnostic]) -> list[Edge]:
    edges: dict[Endpoint, Edge] = {}
    for connection in system.plan.connections:
        source, target = connection.source, connection.target
        ports = _ports(system, connection)
        if ports is None:
            continue
        output, wanted = ports
        if not fits(output.sort, wanted.sort):
            message = f"{source} has type {output.type_name}, {target} wants {wanted.type_name}"
            faults.append(Diagnostic("PLAN121", message, connection.span))
            continue
        if target in edges:
            message = f"{target} is fed twice: by {edges[target].source} and by {source}"
            notes = (("first connected here", edges[target].span),)
            faults.append(Diagnostic("PLAN122", message, connection.span, notes=notes))
            continue
        edges[target] = connection
    return list(edges.values())


def _ports(system: System, connection: Edge) -> tuple[Port, Port] | None:
    try:
        source = system.contract.node(connection.source.node).output(connection.source.port)
        return source, system.contract.node(connection.target.node).input(connection.target.port)
    except KeyError:
        return None  # reported, with its place, by avow.system.names


def _units(system: System, edge: Edge) -> Diagnostic | None:
    """The fault if both ends have a unit, and not the same."""
    source, target = (system.contract.node(at.node) for at in (edge.source, edge.target))
    given, wanted = source.output(edge.source.port).unit, target.input(edge.target.port).unit
    if not given or not wanted or unit(given) == unit(wanted):
        return None
    message = f"{edge.source} is in {given}, and {edge.target}, which it feeds, in {wanted}"
    return Diagnostic("PLAN140", message, edge.span, hint="convert the value, or correct a unit")


def _topic(edge: Edge, found: Ends) -> str:
    heard = {carrier.topic for carrier in found.inputs.get(edge.target, ())}
    carriers = found.outputs.get(edge.source, ())
    return next((c.topic for c in carriers if c.topic in heard), carriers[0].topic if carriers and heard else "")


def _by_topics(nodes: Sequence[Node], taken: Collection[Endpoint], found: Ends, faults: list[Diagnostic]) -> list[Edge]:
    """The edge that one topic makes from a publishing node to a listening one. If a topic carries several variables,
    those of one name belong together; otherwise there has to be one at either end."""
    listening: dict[tuple[str, str], int] = defaultdict(int)
    for at, carriers in found.inputs.items():
        for topic in {carrier.topic for carrier in carriers}:
            listening[at.node, topic] += 1
    edges: list[Edge] = []
    for node in nodes:
        for port in node.inputs:
            target = Endpoint(node.name, port.name)
            if target in taken or target not in found.inputs:
                continue
            sources = found.reaching(target)
            carriers = found.inputs[target]
            carrier = next((c for c in carriers if found.published.get(c.topic)), carriers[0])
            others = [(at, output) for at, output in sources if at.node != node.name]
            if sources and not others:
                faults.append(_own_topic(target, sources[0][0], carrier))
                continue
            named = [(at, output) for at, output in others if output.name == port.name]
            single = len(others) == 1 and listening[node.name, carrier.topic] == 1
            chosen = named or (others if single else [])
            if len(chosen) == 1:
                at, output = chosen[0]
                if fits(output.sort, port.sort):
                    edges.append(Edge(at, target, implied=True, span=port.span))
                else:
                    meant = Endpoint(at.node, port.name)
                    apart = "" if named else ", ".join(c.topic for c in found.outputs.get(meant, ()))
                    faults.append(
                        _other_type(at, output, target, port, carrier, f"{meant} is on {apart}" * bool(apart))
                    )
            elif chosen:
                faults.append(_several(target, [at.node for at, _ in chosen], port))
            elif others:
                faults.append(_which(target, others, carrier, found))
    return edges


def _own_topic(target: Endpoint, source: Endpoint, carrier: Carrier) -> Diagnostic:
    message = f"{target.node} hears on {carrier.topic} what it publishes itself as {source.port}"
    hint = f"connections: {{from: {source}, to: {target}, delayed: true, initial: …}}"
    return Diagnostic("ROS114", message, carrier.span, hint=hint)


def _other_type(at: Endpoint, output: Port, target: Endpoint, port: Port, carrier: Carrier, apart: str) -> Diagnostic:
    """`apart`: where the output of the input's name is instead."""
    message = f"{carrier.topic} links {at} ({output.type_name}) and {target} ({port.type_name}): other types"
    hint = f"{apart}: correct its topic, or remap it" if apart else "give both ports one type, or remap one of them"
    return Diagnostic("PLAN121", message, carrier.span, hint=hint)


def _which(target: Endpoint, others: Sequence[tuple[Endpoint, Port]], carrier: Carrier, found: Ends) -> Diagnostic:
    """Outputs of other names on an input's topic; the one of its name may be on a topic with a similar name."""
    known = ", ".join(str(at) for at, _ in others)
    message = f"{carrier.topic} carries {known}, and which of them is {target} is not said"
    hint = f"connections: {{from: {others[0][0]}, to: {target}}}"
    alike = {c.topic: at for at, carriers in found.outputs.items() if at.port == target.port for c in carriers}
    for near in nearest(carrier.topic, alike):
        hint = f"{alike[near]} is published on `{near}`: did you mean `{carrier.topic}`?"
    return Diagnostic("ROS115", message, carrier.span, hint=hint)


def _by_names(
    nodes: Sequence[Node], taken: Mapping[Endpoint, Edge], found: Ends, faults: list[Diagnostic], names: Resolver
) -> list[Edge]:
    outputs: dict[str, list[tuple[str, Port]]] = defaultdict(list)
    blamed: set[tuple[str, ...]] = set()
    relays = {node.name for node in nodes if node.relay}
    for node in nodes:
        for port in () if node.relay else node.outputs:
            outputs[port.name].append((node.name, port))
    edges: list[Edge] = []
    for node in nodes:
        for port in node.inputs:
            target = Endpoint(node.name, port.name)
            if port.name not in outputs or node.relay or port.parameter:
                continue
            others = [(name, output) for name, output in outputs[port.name] if name != node.name]
            if target in taken:
                edge = taken[target]
                if edge.implied or edge.source.node in relays:  # received on a topic: no connection chose it
                    also = [Endpoint(name, o.name) for name, o in others if fits(o.sort, port.sort)]
                    faults += [_beside(edge, at, port) for at in also if at not in found.outputs]
                continue
            carrier = found.inputs.get(target, (None,))[0]
            if carrier is not None:  # an output with a topic is linked by it, or not at all
                apart = [Endpoint(name, o.name) for name, o in others if Endpoint(name, o.name) in found.outputs]
                others = [(name, o) for name, o in others if Endpoint(name, o.name) not in found.outputs]
                if apart and not others:
                    other = found.outputs[apart[0]][0]
                    pair = (apart[0].node, other.topic, target.node, carrier.topic)
                    if apart[0] not in dict(found.reaching(target)) and pair not in blamed:
                        blamed.add(pair)  # one fault, however many ports the topics carry
                        faults.append(unlinked(target, carrier, apart[0], other, port.span, names))
                    continue
            fitting = [(name, output) for name, output in others if fits(output.sort, port.sort)]
            if len(fitting) == 1:
                name, output = fitting[0]
                edges.append(Edge(Endpoint(name, output.name), target, implied=True, span=port.span))
            elif fitting:
                faults.append(_several(target, [name for name, _ in fitting], port))
            elif others:
                name, output = others[0]
                message = (
                    f"{name}.{output.name} ({output.type_name}) does not feed {target} ({port.type_name}): same name, "
                    "other type; the input is left to the environment"
                )
                faults.append(Diagnostic("PLAN121", message, port.span, Severity.WARNING))
            elif carrier is None or Endpoint(node.name, port.name) not in found.outputs:
                message = f"{node.name} has an input and an output {port.name!r}; only a connection links them"
                hint = f"connections: {{from: {target}, to: {target}, delayed: true, initial: …}}"
                faults.append(Diagnostic("PLAN124", message, port.span, Severity.WARNING, hint))
    return edges


def _beside(edge: Edge, other: Endpoint, port: Port) -> Diagnostic:
    message = f"{edge.target} has several providers: {edge.source} by its topic, and {other}, without a topic, by name"
    return Diagnostic("PLAN122", message, port.span, hint=f"give {other} its topic in the contract, or another name")


def _several(target: Endpoint, names: list[str], port: Port) -> Diagnostic:
    message = f"{target} has several providers: {', '.join(f'{name}.{port.name}' for name in names)}"
    hint = f"say which is meant: connections: {{from: {names[0]}.{port.name}, to: {target}}}"
    return Diagnostic("PLAN122", message, port.span, hint=hint)


def to_delay(cycle: tuple[str, ...], edges: Sequence[Edge], relays: Collection[str]) -> str:
    """What to write in the plan so that something comes first in a loop: the fewest connections that need it. One to a
    relay is written to the input that the relay feeds."""
    heard = {e.source.node: e.target for e in edges if e.source.node in relays}
    arcs = zip(cycle, (*cycle[1:], cycle[0]), strict=True)
    open_ = [e for e in edges if not (e.delayed and e.initial is not None)]
    ways = [[e for e in open_ if (e.source.node, e.target.node) == arc] for arc in arcs if arc[0] not in relays]
    way = min(reversed(ways), key=lambda way: sum(1 if e.delayed else 2 for e in way))
    ends = ((e.source, heard.get(e.target.node, e.target)) for e in way)
    told = (f"{{from: {source}, to: {target}, delayed: true, initial: …}}" for source, target in ends)
    return f"say what was there before the first step, for example  connections: [{', '.join(told)}]"


def _deadlock(cycle: tuple[str, ...], advice: str, spans: Mapping[str, Span | None]) -> Diagnostic:
    message = f"start-up deadlock: {circle(cycle)} wait for one another and nothing comes first"
    return Diagnostic("PLAN123", message, spans.get(cycle[0]), Severity.WARNING, advice)
