"""Topics are the wiring: what is published under a name reaches whoever listens to it, however the ports are called.

Names are resolved by ROS's rules (`avow.ros.names`) with what the plan's `ros` says of the nodes. Where both ends of a
link have a topic, the resolved name alone links them. Several publishers of one topic are what ROS makes of them: the
listener hears any of them, at any step. That is a node of its own here, whose only guarantee says so; what the listener
assumes has then to follow from each publisher's contract.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.sorts import BOOL, FunctionSort
from avow.language.terms import Apply, Compare, Iff, Or, Quantified, Quantifier, Role, Term, Variable
from avow.ros.definitions import canonical
from avow.ros.names import Resolver
from avow.system.plan import Connection, Endpoint, Plan


@dataclass(frozen=True, slots=True)
class Carrier:
    """The topic that carries a port: its whole name, and its messages' type."""

    topic: str
    kind: str
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class Ends:
    """Who publishes and who listens, by topic. `outputs` and `inputs`: each port's topic, where it has one."""

    outputs: Mapping[Endpoint, Carrier]
    inputs: Mapping[Endpoint, Carrier]
    published: Mapping[str, tuple[tuple[Endpoint, Port], ...]]


def ends(nodes: Sequence[Node], names: Resolver) -> Ends:
    """The topics of the nodes' ports; of a port with several, the first listed."""
    outputs: dict[Endpoint, Carrier] = {}
    inputs: dict[Endpoint, Carrier] = {}
    published: dict[str, list[tuple[Endpoint, Port]]] = defaultdict(list)
    for node in nodes:
        for topic in node.topics:
            if topic.port is None:
                continue
            at = Endpoint(node.name, topic.port.name)
            carrier = Carrier(names.topic(node.name, topic.name), canonical(topic.ros_type), topic.span)
            if topic.port.role is Role.INPUT:
                inputs.setdefault(at, carrier)
            elif at not in outputs:
                outputs[at] = carrier
                published[carrier.topic].append((at, topic.port))
    return Ends(outputs, inputs, {name: tuple(found) for name, found in published.items()})


def wrong_types(found: Ends) -> Iterator[Diagnostic]:
    """Topics whose ends are of different message types: in ROS they never meet."""
    first: dict[str, tuple[Endpoint, Carrier]] = {}
    for at, carrier in (*found.outputs.items(), *found.inputs.items()):
        known = first.setdefault(carrier.topic, (at, carrier))
        if known[1].kind != carrier.kind:
            message = f"{carrier.topic} is {carrier.kind} at {at}, and {known[1].kind} at {known[0]}"
            notes = ((f"{known[0]} is here", known[1].span),)
            hint = "a topic has one type: correct one of them, or remap one end under `ros: {nodes: …}`"
            yield Diagnostic("ROS111", message, carrier.span, hint=hint, notes=notes)


def contradicted(connections: Sequence[Connection], found: Ends) -> Iterator[Diagnostic]:
    """Connections whose ends have topics of different names."""
    for connection in connections:
        one, other = found.outputs.get(connection.source), found.inputs.get(connection.target)
        if one is not None and other is not None and one.topic != other.topic:
            message = (
                f"{connection.source} is published on {one.topic}, and {connection.target} listens to {other.topic}: "
                "the connection contradicts the topics"
            )
            yield Diagnostic("ROS112", message, connection.span, hint=remap_hint(connection.target.node, other, one))


def remap_hint(node: str, carrier: Carrier, meant: Carrier) -> str:
    """What the plan may write so that a node listens to the topic that is meant."""
    remap = f"ros: {{nodes: {{{node}: {{remap: {{{carrier.topic}: {meant.topic}}}}}}}}}"
    return f"if they are one topic when the robot runs:  {remap}"


def unlinked(target: Endpoint, carrier: Carrier, source: Endpoint, other: Carrier, span: Span | None) -> Diagnostic:
    """Ports of one name on different topics."""
    message = (
        f"{source} does not feed {target}: it is published on {other.topic}, and {target.node} listens to "
        f"{carrier.topic}; the input is left to the environment"
    )
    return Diagnostic("ROS113", message, span, Severity.WARNING, remap_hint(target.node, carrier, other))


# -- several publishers ------------------------------------------------------------------------------------------------


def heard(plan: Plan, contract: Contract) -> tuple[Plan, Contract, tuple[Diagnostic, ...]]:
    """The system with a node for each input whose topic several nodes publish; and who else publishes a topic without
    its being said what the input hears of it. None is left out: what it says would be heard all the same."""
    found = ends(contract.nodes, plan.ros.names)
    connections = list(plan.connections)
    nodes: list[Node] = []
    taken = {node.name for node in contract.nodes}
    faults: list[Diagnostic] = []
    for node in contract.nodes:
        for port in node.inputs:
            target = Endpoint(node.name, port.name)
            carrier = found.inputs.get(target)
            if carrier is None:
                continue
            sources, unclear = _sources(target, port, found, connections)
            if len(sources) + len(unclear) < 2:
                continue
            for publisher in unclear:
                message = (
                    f"{publisher} publishes {carrier.topic} too, and which of its outputs {target} hears is not said, "
                    f"or none is of the type {port.type_name}"
                )
                hint = f"connections: {{from: {publisher}.…, to: {target}}}, or remap one of them"
                faults.append(Diagnostic("ROS115", message, carrier.span, hint=hint))
            if unclear:
                continue
            name = _free(f"topic_{carrier.topic.strip('/').replace('/', '_')}", taken)
            relay = _relay(name, node.name, port, carrier, sources)
            nodes.append(relay)
            mine = [c for c in connections if c.target == target]
            connections = [c for c in connections if c.target != target]
            for (source, _), inner in zip(sources, relay.inputs, strict=True):
                given = next((c for c in mine if c.source == source), Connection(source, target, span=carrier.span))
                connections.append(replace(given, target=Endpoint(name, inner.name)))
            connections.append(Connection(Endpoint(name, port.name), target, span=carrier.span))
    if not nodes:
        return plan, contract, tuple(faults)
    whole = replace(contract, nodes=(*contract.nodes, *nodes))
    return replace(plan, connections=tuple(connections)), whole, tuple(faults)


def _sources(
    target: Endpoint, port: Port, found: Ends, connections: Sequence[Connection]
) -> tuple[tuple[tuple[Endpoint, Port], ...], tuple[str, ...]]:
    """Every output that reaches an input by its topic: of each node the one that carries the input's value; and the
    nodes of which that cannot be told."""
    by_node: dict[str, list[tuple[Endpoint, Port]]] = defaultdict(list)
    for at, output in found.published.get(found.inputs[target].topic, ()):
        by_node[at.node].append((at, output))
    named = {c.source for c in connections if c.target == target}
    chosen: list[tuple[Endpoint, Port]] = []
    unclear: list[str] = []
    for publisher, several in by_node.items():
        fitting = [(at, output) for at, output in several if at in named]
        fitting = fitting or [(at, o) for at, o in several if o.name == port.name and o.sort == port.sort]
        fitting = fitting or [(at, o) for at, o in several if o.sort == port.sort]
        if len(fitting) == 1:
            chosen += fitting
        else:
            unclear.append(publisher)
    return tuple(chosen), tuple(unclear)


def _free(name: str, taken: set[str]) -> str:
    found, count = name, 1
    while found in taken:
        count += 1
        found = f"{name}_{count}"
    taken.add(found)
    return found


def _relay(name: str, listener: str, port: Port, carrier: Carrier, sources: Sequence[tuple[Endpoint, Port]]) -> Node:
    inputs = tuple(
        Port(Role.INPUT, f"{at.node}_{output.name}", output.sort, output.type_name, carrier.span)
        for at, output in sources
    )
    output = Port(Role.OUTPUT, port.name, port.sort, port.type_name, carrier.span)
    said = " or ".join(str(at) for at, _ in sources)
    formula = Or(tuple(_same(output.variable, wire.variable) for wire in inputs))
    text = " or ".join(f"out.{port.name} == in.{wire.name}" for wire in inputs)
    clause = Clause(
        ClauseKind.GUARANTEE,
        "heard",
        1,
        formula,
        f"What {listener} hears on {carrier.topic} is what {said} says",
        text,
        carrier.span,
    )
    return Node(name, inputs, (output,), (), (), (clause,), carrier.span)


def _same(one: Variable, other: Variable) -> Term:
    """That two variables of one sort have one value: of functions, everywhere."""
    if not isinstance(one.sort, FunctionSort):
        return Compare("==", one, other)
    names = [f"a{k}" for k in range(1, len(one.sort.parameters) + 1)]
    bound = tuple(Variable(Role.BOUND, n, s) for n, s in zip(names, one.sort.parameters, strict=True))
    left, right = (Apply(f, bound, one.sort.result) for f in (one, other))
    body: Term = Iff(left, right) if one.sort.result == BOOL else Compare("==", left, right)
    return Quantified(Quantifier.FORALL, bound, body)
