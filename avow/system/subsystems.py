"""The plan's subsystems, checked against its nodes; and ports of subsystems, as connections may name them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from avow.base.diagnostics import Diagnostic, Span
from avow.base.graphs import components, cycle_in
from avow.base.plain import circle
from avow.base.suggestions import suggest
from avow.language.contract import Contract
from avow.system.folding import leaves, parents
from avow.system.plan import Edge, Endpoint, Plan, Subsystem


def check_subsystems(plan: Plan, contract: Contract) -> tuple[Diagnostic, ...]:
    """Unknown members, clashes of names, parts that overlap, subsystems that contain one another. Each located."""
    nodes = [node.name for node in contract.nodes]
    groups = {subsystem.name: subsystem for subsystem in plan.subsystems}
    goals: dict[str, Span | None] = {goal.name: goal.span for goal in plan.compose}
    faults: list[Diagnostic] = []
    home: dict[str, tuple[str, Span | None]] = {}
    for subsystem in plan.subsystems:
        name = subsystem.name
        if name in nodes:
            message = f"subsystems: {name!r} is also a node of the contract"
            faults.append(Diagnostic("PLAN110", message, subsystem.span, hint="give the subsystem a name of its own"))
        if name in goals:
            message = f"subsystems: {name!r} is also a derivation of compose"
            notes = (("there", goals[name]),)
            faults.append(Diagnostic("PLAN110", message, subsystem.span, hint="give it another name", notes=notes))
        for number, member in enumerate(subsystem.members):
            span = subsystem.options.at("nodes", number)
            if member not in nodes and member not in groups:
                message = f"subsystems.{name}.nodes: {member!r}: there is no such node or subsystem"
                faults.append(Diagnostic("PLAN106", message, span, hint=suggest(member, [*nodes, *groups])))
            elif member in home:
                where, first = home[member]
                message = f"subsystems.{name}.nodes: {member!r} is in {where!r} already; subsystems do not overlap"
                faults.append(Diagnostic("PLAN110", message, span, notes=(("first here", first),)))
            else:
                home[member] = (name, span)
    for what, names in (
        ("compose", goals),
        ("requirements", {requirement.id: requirement.span for requirement in plan.requirements}),
    ):
        for name, place in names.items():
            if name in nodes:
                message = f"{what}: {name!r} is also a node of the contract: `supported_by` could mean either"
                faults.append(Diagnostic("PLAN110", message, place, hint="give it a name of its own"))
    faults += _circles(groups)
    return (*faults, *(() if faults else _selections(plan)))


def _selections(plan: Plan) -> Iterator[Diagnostic]:
    """A derivation over a subsystem and over a part of it."""
    around = parents(plan)
    for goal in plan.compose:
        for number, name in enumerate(goal.select):
            outer = around.get(name)
            while outer is not None and outer not in goal.select:
                outer = around.get(outer)
            if outer is not None:
                message = f"compose.{goal.name}.select: {name!r} is inside {outer!r}, which is selected too"
                yield Diagnostic("PLAN110", message, goal.options.at("select", number))


def _circles(groups: dict[str, Subsystem]) -> Iterator[Diagnostic]:
    arcs = [(name, member) for name, group in groups.items() for member in group.members if member in groups]
    for component in components(groups, arcs):
        cycle = cycle_in(component, arcs)
        if cycle:
            shown = circle(cycle)
            yield Diagnostic("PLAN110", f"subsystems contain one another: {shown}", groups[cycle[0]].span)


def resolved(plan: Plan, contract: Contract) -> tuple[Plan, tuple[Diagnostic, ...]]:
    """The plan with connections between ports of nodes in place of those that name ports of subsystems.

    A subsystem's output is that of the one node inside that has it; its input is that of every node inside that has it
    and gets it from no other node inside.
    """
    inside = leaves(plan)
    faults: list[Diagnostic] = []
    found: list[Edge] = []
    taken = {connection.target for connection in [*(c for c in plan.connections if c.target.node not in inside)]}
    for connection in plan.connections:
        sources = _sources(connection, inside, contract, faults)
        targets = _targets(connection, inside, contract, taken, faults)
        found += [replace(connection, source=s, target=t) for s in sources for t in targets]
    for entry in plan.environment:
        owner, _, port = entry.port.partition(".")
        if owner in inside and not _having(inside[owner], port, contract, "inputs"):
            message = f"environment: {entry.port}: no node of {owner!r} has an input {port!r}"
            known = [f"{owner}.{p.name}" for name in inside[owner] for p in contract.node(name).inputs]
            faults.append(Diagnostic("PLAN106", message, entry.span, hint=suggest(entry.port, dict.fromkeys(known))))
    return replace(plan, connections=tuple(found)), tuple(faults)


def _having(names: tuple[str, ...], port: str, contract: Contract, side: str) -> list[Endpoint]:
    return [Endpoint(name, port) for name in names if port in [p.name for p in getattr(contract.node(name), side)]]


def _sources(
    connection: Edge, inside: dict[str, tuple[str, ...]], contract: Contract, faults: list[Diagnostic]
) -> list[Endpoint]:
    owner, port = connection.source.node, connection.source.port
    if owner not in inside:
        return [connection.source]
    found = _having(inside[owner], port, contract, "outputs")
    if len(found) == 1:
        return found
    if found:
        message = f"connections: {connection.source}: {', '.join(map(str, found))} are all outputs of that name"
        faults.append(Diagnostic("PLAN122", message, connection.span, hint="name the node inside"))
        return []
    message = f"connections: {connection.source}: no node of {owner!r} has an output {port!r}"
    known = [f"{owner}.{p.name}" for name in inside[owner] for p in contract.node(name).outputs]
    faults.append(Diagnostic("PLAN106", message, connection.span, hint=suggest(str(connection.source), known)))
    return []


def _targets(
    connection: Edge,
    inside: dict[str, tuple[str, ...]],
    contract: Contract,
    taken: set[Endpoint],
    faults: list[Diagnostic],
) -> list[Endpoint]:
    owner, port = connection.target.node, connection.target.port
    if owner not in inside:
        return [connection.target]
    own = {e.node for e in _having(inside[owner], port, contract, "outputs")}
    found = [
        e
        for e in _having(inside[owner], port, contract, "inputs")
        if e not in taken and not own - {e.node}  # not an input that another node inside provides
    ]
    if not found:
        message = f"connections: {connection.target}: no node of {owner!r} reads {port!r} from outside"
        known = [f"{owner}.{p.name}" for name in inside[owner] for p in contract.node(name).inputs]
        hint = suggest(str(connection.target), dict.fromkeys(known))
        faults.append(Diagnostic("PLAN106", message, connection.span, hint=hint))
    return found
