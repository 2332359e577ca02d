"""Topics are the wiring: messages published under a name reach every listener to it, whatever the ports are called.

Names are resolved by ROS's rules (`avow.ros.names`) with the plan's `ros` entries for the nodes. If both ends of a link
have a topic, the resolved name alone links them. Several publishers of one topic are treated as in ROS: the listener
receives from any of them, at any step. This is modelled by a node of its own, whose only guarantee says so; the
listener's assumptions then have to follow from each publisher's contract.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean, distance, nearest, suggest
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port, Topic
from avow.language.sorts import BOOL, FunctionSort
from avow.language.terms import Apply, Compare, Iff, Or, Quantified, Quantifier, Role, Term, Variable
from avow.ros.calls import CALL_PARTS, part_topic
from avow.ros.definitions import HEADER, Array, Definitions, Nested, canonical, definition_file
from avow.ros.names import Resolver
from avow.ros.sources import definitions
from avow.system.plan import Driving, Edge, Endpoint, Plan


@dataclass(frozen=True, slots=True)
class Carrier:
    """The topic that carries a port: its whole name, its messages' type, and their frame, if the contract names it."""

    topic: str
    kind: str
    span: Span | None = None
    frame: str = ""

    @property
    def shown(self) -> str:
        """``geometry_msgs/PoseStamped in map``."""
        return f"{self.kind} in {self.frame}" if self.frame else self.kind


@dataclass(frozen=True, slots=True)
class Ends:
    """The publishers and listeners, by topic. `outputs` and `inputs`: each port's topics, if it has any."""

    outputs: Mapping[Endpoint, tuple[Carrier, ...]]
    inputs: Mapping[Endpoint, tuple[Carrier, ...]]
    published: Mapping[str, tuple[tuple[Endpoint, Port], ...]]

    def reaching(self, target: Endpoint) -> tuple[tuple[Endpoint, Port], ...]:
        """Every output on a topic that an input listens to, each once."""
        found = {at: port for c in self.inputs.get(target, ()) for at, port in self.published.get(c.topic, ())}
        return tuple(found.items())

    def beside(self, source: Endpoint) -> tuple[Endpoint, ...]:
        """The outputs of other nodes on the topics of an output."""
        carriers = self.outputs.get(source, ())
        found = (at for c in carriers for at, _ in self.published[c.topic] if at.node != source.node)
        return tuple(dict.fromkeys(found))


def whole_name(names: Resolver, node: Node, topic: Topic) -> str:
    """The topic's name at run time; a part of a call has one of its own."""
    return part_topic(names.topic(node.name, topic.name), topic.ros_type)


def ends(nodes: Sequence[Node], names: Resolver) -> Ends:
    """The topics of the nodes' ports."""
    outputs: dict[Endpoint, tuple[Carrier, ...]] = {}
    inputs: dict[Endpoint, tuple[Carrier, ...]] = {}
    published: dict[str, list[tuple[Endpoint, Port]]] = defaultdict(list)
    for node in nodes:
        for topic in node.topics:
            if topic.port is None:
                continue
            at = Endpoint(node.name, topic.port.name)
            carrier = Carrier(whole_name(names, node, topic), canonical(topic.ros_type), topic.span, topic.frame)
            if topic.port.role is Role.INPUT:
                inputs[at] = (*inputs.get(at, ()), carrier)
            else:
                outputs[at] = (*outputs.get(at, ()), carrier)
                published[carrier.topic].append((at, topic.port))
    return Ends(outputs, inputs, {name: tuple(found) for name, found in published.items()})


def wrong_types(found: Ends) -> Iterator[Diagnostic]:
    """Topics whose ends have different message types, which ROS does not connect, or frames. The most frequent is taken
    as meant."""
    first: dict[str, tuple[Endpoint, Carrier]] = {}
    every = [(at, one) for at, some in (*found.outputs.items(), *found.inputs.items()) for one in some]
    often = Counter((carrier.topic, carrier.shown) for _, carrier in every)
    for at, carrier in sorted(every, key=lambda each: -often[each[1].topic, each[1].shown]):
        known = first.setdefault(carrier.topic, (at, carrier))
        if known[1].shown != carrier.shown:
            message = f"{carrier.topic} is {carrier.shown} at {at}, and {known[1].shown} at {known[0]}"
            near = did_you_mean(carrier.kind, [known[1].kind])
            hint = near or "correct one, or remap one end under `ros: {nodes: …}`"
            notes = ((f"{known[0]} is here", known[1].span),)
            yield Diagnostic("ROS111", message, carrier.span, hint=hint, notes=notes)


def unknown_types(plan: Plan, contract: Contract) -> Iterator[Diagnostic]:
    """Topics whose messages' type is not defined, though the plan says where types are defined: a typing error in the
    name, or a service or an action without the part of a call that is meant. Faults in the definitions, too. An error
    for a node whose class is driven by its callbacks: it cannot run without its types."""
    driven = {entry.node for entry in plan.nodes if entry.source and entry.source.kind != Driving.STEP}
    needed = {canonical(topic.ros_type) for node in contract.nodes if node.name in driven for topic in node.topics}
    needed = {kind for kind in needed if kind != HEADER and not kind.startswith("builtin_interfaces/")}
    if plan.ros.distro is None and not plan.messages and not needed:
        return
    known, wrong = definitions(plan.messages, plan.ros.distro)
    yield from wrong
    packages = {name.partition("/")[0] for name in known.messages}
    missing: set[str] = set()
    asked = [(canonical(topic.ros_type), topic.span, topic.name) for node in contract.nodes for topic in node.topics]
    for kind, span, name in () if wrong else (*asked, *_parts_of(known, {kind for kind, _, _ in asked})):
        if kind in known.messages or (plan.ros.distro is None and not plan.messages and kind not in needed):
            continue
        parts = [part for part in (f"{kind}_{end}" for end in CALL_PARTS) if part in known.messages]
        if parts:
            message = f"{kind} is a service or an action: which part of a call {name} carries is not said"
            yield Diagnostic("ROS104", message, span, Severity.WARNING, f"write {' or '.join(parts)}")
            continue
        package, _, word = kind.partition("/")
        own = sorted(other.partition("/")[2] for other in known.messages if other.startswith(f"{package}/"))
        near = [f"{package}/{other}" for other in nearest(word, own)]
        near += (other for other in sorted(known.messages) if other.endswith(f"/{word}"))
        text = f"nothing defines {kind}"
        if package not in packages:
            near[:0] = (f"{other}/{word}" for other in nearest(package, packages, alike=0.75))
            text = f"neither `messages` nor the distribution has the package {package}, of {kind}"
        file, _ = definition_file(kind)
        # a package is named once, and the parts of a call are in one file
        if file not in missing and (
            package in packages or ((plan.messages or kind in needed) and package not in missing)
        ):
            hint = f"add its definition (`{file}`) under `messages`"
            others = suggest(word, own)
            hint = f"did you mean `{near[0]}`? If not, {hint}" if near else f"{hint}; {others}" if others else hint
            if kind in needed:
                yield Diagnostic("DRIVE101", f"{text}: its class cannot be driven", span, hint=hint)
            else:
                yield Diagnostic("ROS104", text, span, Severity.WARNING, hint)
        missing |= ({package} - packages) | ({file} if "_" in word else set())


def _parts_of(known: Definitions, kinds: Collection[str]) -> Iterator[tuple[str, Span, str]]:
    """The types of the fields of some types that the plan's files define, at their lines; and the fields' names."""
    named = [known.messages[kind] for kind in kinds if kind in known.messages]
    names = {message.name for message in named} | {name for message in named for name in known.within(message)}
    for message in (known.messages[name] for name in sorted(names & known.messages.keys())):
        for each in message.fields if message.source.endswith(".msg") else ():
            if isinstance(wire := each.wire.item if isinstance(each.wire, Array) else each.wire, Nested):
                yield wire.name, Span(message.source, each.line, 1, each.line, 2), each.name


_DIGITS = re.compile(r"\d")
"""Two cameras differ in these alone."""


def turned(plan: Plan, contract: Contract) -> Iterator[Diagnostic]:
    """Remappings of a topic that the node does not have: to one that it has, probably written the wrong way round; in a
    launch file, of what is one letter from a topic that it has, or to what is like one."""
    for node in contract.nodes:
        placed = plan.ros.names.placed(node.name)
        own = {placed.expanded(topic.name): topic.name for topic in node.topics}
        taken = [placed.expanded(old) for old, _ in placed.remaps]
        for old, new in placed.remaps:
            meant = own.get(placed.expanded(new))
            if placed.launched:  # a contract drafted from a running system has the names that topics have then
                bare, *others = (_DIGITS.sub("", name) for name in (placed.expanded(old), *own))
                slips = [t for t, b in zip(own, others, strict=True) if distance(bare, b, 1) == 1 and t not in taken]
                near = slips or (nearest(placed.expanded(new), own) if meant is None else [])
                if near and placed.expanded(old) not in own:
                    lacks = f"no topic {placed.expanded(old)}" if slips else "no topic of either name"
                    message = f"{node.name} is started with {old} remapped to {new}, and has {lacks}"
                    hint = f"did you mean `{near[0]}`?"
                    yield Diagnostic("ROS116", message, placed.span, Severity.WARNING, hint)
                continue
            if meant is not None and placed.expanded(old) not in own:
                message = f"{node.name} is started with {old}:={new}, and has no topic {old}, but {meant}"
                hint = f"a remapping says the node's own name first: {{{meant}: {old}}}"
                yield Diagnostic("ROS116", message, placed.span, Severity.WARNING, hint)


def several(plan: Plan, contract: Contract) -> Iterator[Diagnostic]:
    """A note for each topic that several nodes publish, which may be a slip."""
    found = ends(contract.nodes, plan.ros.names)
    for topic, _ in plan.ros.shared:
        who = {at.node: c.span for at, _ in found.published[topic] for c in found.outputs[at] if c.topic == topic}
        notes = tuple((f"{name} publishes it here", span) for name, span in who.items())
        message = f"{topic} has several publishers, and an input on it takes what any says: {', '.join(who)}"
        hint = "if one is not meant, correct its topic, or remap it"
        yield Diagnostic("ROS117", message, notes[-1][1], Severity.NOTE, hint, notes)


def contradicted(connections: Sequence[Edge], found: Ends, relays: Collection[str]) -> Iterator[Diagnostic]:
    """Connections whose ends have topics of different names, and those to an input that also receives on its topic."""
    for connection in connections:
        source, target = connection.source, connection.target
        if source.node in relays:
            continue
        ones, others = found.outputs.get(source, ()), found.inputs.get(target, ())
        apart = not {c.topic for c in ones} & {c.topic for c in others}
        if ones and others and apart:
            one, other = ones[0], others[0]
            message = f"the connection contradicts the topics: {source} is on {one.topic}, {target} on {other.topic}"
            yield Diagnostic("ROS112", message, connection.span, hint=_remap_hint(target.node, other, one))
        elif others and apart and (publishers := found.reaching(target)):
            topic = next(c for c in others if found.published.get(c.topic)).topic
            who = publishers[0][0]
            message = f"{source} has no topic: the connection would silence {who}, to which {target} listens on {topic}"
            hint = f"give {source} its topic in the contract, or remap {topic} for {target.node} under `ros`"
            yield Diagnostic("ROS112", message, connection.span, hint=hint)


def unheard(source: Endpoint, target: Endpoint, found: Ends, span: Span | None) -> Iterator[Diagnostic]:
    """A link to an input whose topic is not given, from an output whose topic others publish too."""
    if source.node == target.node:
        return  # its own memory, declared by a connection
    if source in found.outputs and target not in found.inputs and (others := found.beside(source)):
        topic = next(c for c in found.outputs[source] if any(at == others[0] for at, _ in found.published[c.topic]))
        message = f"{target} has several providers: {source}, and {others[0]} on the same topic {topic.topic}"
        hint = f"give {target} its topic in the contract: it hears both, or listens to another"
        yield Diagnostic("PLAN122", message, span, hint=hint)


def _remap_hint(node: str, carrier: Carrier, meant: Carrier) -> str:
    """The entry that the plan may have so that a node listens to the intended topic."""
    remap = f"ros: {{nodes: {{{node}: {{remap: {{{carrier.topic}: {meant.topic}}}}}}}}}"
    near = did_you_mean(carrier.topic, [meant.topic])
    return f"{f'{near} ' if near else ''}if they are one topic when the robot runs:  {remap}"


def unlinked(
    target: Endpoint,
    carrier: Carrier,
    source: Endpoint,
    other: Carrier,
    span: Span | None,
    names: Resolver,
) -> Diagnostic:
    """Ports of one name on different topics."""
    message = (
        f"{source} does not feed {target}: it is published on {other.topic}, and {target.node} listens to "
        f"{carrier.topic}; the input is left to the environment"
    )
    hint, notes = _remap_hint(target.node, carrier, other), []
    for name, placed in ((name, names.placed(name)) for name in (source.node, target.node)):
        if placed.launched and placed.remaps:
            hint = "correct the launch file, or the topic in the contract"
            remaps = ", ".join(f"{old} to {new}" for old, new in placed.remaps)
            notes.append((f"{name} is started with {remaps} remapped here", placed.span))
    return Diagnostic("ROS113", message, span, Severity.WARNING, hint, tuple(notes))


# -- several publishers ------------------------------------------------------------------------------------------------


def heard(plan: Plan, contract: Contract) -> tuple[Plan, Contract, tuple[Diagnostic, ...]]:
    """The system with a node for each input whose topic several nodes publish; and publishers of a topic for which the
    plan does not say what the input receives. No publisher is left out: its messages would still be received."""
    found = ends(contract.nodes, plan.ros.names)
    published = ((topic, sorted({at.node for at, _ in outputs})) for topic, outputs in sorted(found.published.items()))
    called = plan.ros.names.placed
    several = tuple((topic, tuple(called(n).name for n in who)) for topic, who in published if len(who) > 1)
    plan = replace(plan, ros=replace(plan.ros, shared=several))
    connections = list(plan.connections)
    nodes: list[Node] = []
    taken = {node.name for node in contract.nodes}
    faults: list[Diagnostic] = []
    relays = {node.name for node in contract.nodes if node.relay}
    for node in contract.nodes:
        for port in node.inputs:
            target = Endpoint(node.name, port.name)
            if target not in found.inputs:
                continue
            carrier = found.inputs[target][0]
            sources, unclear = _sources(target, port, found, connections)
            outside = [c for c in found.inputs[target] if c.topic not in found.published] if sources else []
            if len(sources) + len(unclear) + len(outside) < 2:
                continue
            for publisher, topic in unclear:
                message = (
                    f"{publisher} publishes {topic} too, and which of its outputs {target} hears is not said, "
                    f"or none is of the type {port.type_name}"
                )
                hint = f"connections: {{from: {publisher}.…, to: {target}}}, or remap one of them"
                faults.append(Diagnostic("ROS115", message, carrier.span, hint=hint))
            if unclear:
                continue
            name = _free(f"topic_{carrier.topic.strip('/').replace('/', '_')}", taken)
            relay = _relay(name, node.name, port, carrier, sources, outside)
            nodes.append(relay)
            mine = [c for c in connections if c.target == target]
            known = {source for source, _ in sources}
            connections = [
                c for c in connections if c.target != target or not (c.source in known or c.source.node in relays)
            ]  # another source contradicts the topics, which `contradicted` reports
            for (source, _), inner in zip(sources, relay.inputs, strict=False):
                given = next((c for c in mine if c.source == source), Edge(source, target, span=carrier.span))
                connections.append(replace(given, target=Endpoint(name, inner.name)))
            connections.append(Edge(Endpoint(name, port.name), target, span=carrier.span))
    if not nodes:
        return plan, contract, tuple(faults)
    whole = replace(contract, nodes=(*contract.nodes, *nodes))
    return replace(plan, connections=tuple(connections)), whole, tuple(faults)


def _sources(
    target: Endpoint, port: Port, found: Ends, connections: Sequence[Edge]
) -> tuple[tuple[tuple[Endpoint, Port], ...], tuple[tuple[str, str], ...]]:
    """Every output that reaches an input by one of its topics: for each node on each topic the one that carries the
    input's value; and the nodes, with the topic, for which that cannot be determined."""
    by_node: dict[tuple[str, str], list[tuple[Endpoint, Port]]] = defaultdict(list)
    for topic in dict.fromkeys(carrier.topic for carrier in found.inputs[target]):
        for at, output in found.published.get(topic, ()):
            by_node[at.node, topic].append((at, output))
    named = {c.source for c in connections if c.target == target}
    chosen: dict[Endpoint, Port] = {}
    unclear: list[tuple[str, str]] = []
    for publisher, several in by_node.items():
        fitting = [(at, output) for at, output in several if at in named]
        fitting = fitting or [(at, o) for at, o in several if o.name == port.name and o.sort == port.sort]
        fitting = fitting or [(at, o) for at, o in several if o.sort == port.sort]
        if len(fitting) == 1:
            chosen.update(fitting)
        else:
            unclear.append(publisher)
    return tuple(chosen.items()), tuple(unclear)


def _free(name: str, taken: set[str]) -> str:
    found, count = name, 1
    while found in taken:
        count += 1
        found = f"{name}_{count}"
    taken.add(found)
    return found


def _relay(
    name: str,
    listener: str,
    port: Port,
    carrier: Carrier,
    sources: Sequence[tuple[Endpoint, Port]],
    outside: Sequence[Carrier],
) -> Node:
    """`outside`: the listener's topics without a publisher in the system. Their messages come from the environment."""
    inputs = [
        Port(Role.INPUT, f"{at.node}_{output.name}", output.sort, output.type_name, carrier.span, unit=port.unit)
        for at, output in sources
    ]
    topics = []
    for each in outside:
        called = f"outside{each.topic.replace('/', '_')}"
        inputs.append(Port(Role.INPUT, called, port.sort, port.type_name, each.span))
        topics.append(Topic(each.kind, each.topic, inputs[-1], each.span, each.frame))
    output = Port(Role.OUTPUT, port.name, port.sort, port.type_name, carrier.span)
    said = " or ".join([*(str(at) for at, _ in sources), *(f"the environment on {c.topic}" for c in outside)])
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
    return Node(name, tuple(inputs), (output,), tuple(topics), (), (clause,), carrier.span, relay=True)


def _same(one: Variable, other: Variable) -> Term:
    """The claim that two variables of one sort have one value; for functions, everywhere."""
    if not isinstance(one.sort, FunctionSort):
        return Compare("==", one, other)
    names = [f"a{k}" for k in range(1, len(one.sort.parameters) + 1)]
    bound = tuple(Variable(Role.BOUND, n, s) for n, s in zip(names, one.sort.parameters, strict=True))
    left, right = (Apply(f, bound, one.sort.result) for f in (one, other))
    body: Term = Iff(left, right) if one.sort.result == BOOL else Compare("==", left, right)
    return Quantified(Quantifier.FORALL, bound, body)
