"""A system as the kernel is told of it: its contracts, the wires of its dataflow graph, and the plan's formulas.

Cells, in which clauses remember, are outputs of their own (`SoundWithMemory` in proofs/kernel.dfy: what a step leaves
there is a definition); several publishers of a topic are a node that puts out what one of them does.
"""

from __future__ import annotations

from dataclasses import replace

from avow.calculus.existence import beginning, circles, loops, situations, start_name
from avow.calculus.variables import Frame
from avow.kernel.statements import Kind, Place, Wiring
from avow.language.terms import Role, Term, Variable
from avow.system.formulas import initial_condition
from avow.system.temporal import parse_state
from avow.temporal.ages import CLOCK
from avow.temporal.clock import GOES_ON, is_arrival


def wiring(frame: Frame) -> Wiring:
    """Of the frame of every node by itself. Raises Rejected for a formula that is wrong."""
    system, graph = frame.system, frame.graph
    plan: list[tuple[Kind, str, str, Term]] = []
    initials: dict[tuple[str, str], Term] = {}
    for edge in graph.edges:
        if edge.delayed and (edge.source.node, edge.source.port) not in initials:
            condition = initial_condition(system, edge)
            if condition is not None:
                initials[edge.source.node, edge.source.port] = condition
    plan += [(Kind.ENVIRONMENT, a.node, a.port, a.formula) for a in frame.assumed]
    plan += [(Kind.INITIAL, node, port, term) for (node, port), term in initials.items()]
    for name, cell in frame.own_cells():
        own = Variable(Role.OUTPUT, cell.name, cell.sort)
        plan.append((Kind.DEFINITION, name, cell.name, cell.leaves(own)))
        if cell.initial is not None:
            plan.append((Kind.INITIAL, name, cell.name, cell.begins(own)))
    plan += [(Kind.DEFINITION, name, CLOCK.name, GOES_ON) for name in frame.timed[:1]]
    for r in system.plan.requirements:
        if r.formula is not None:
            plan.append((Kind.REQUIREMENT, "", r.id, parse_state(r.formula, system.contract, r.formula_span)))
    plan += [(Kind.START, "", start_name(group), beginning(frame, group)) for group in loops(frame)]
    for group in circles(frame):
        for node, clause in ((name, g.name) for name in group for g in frame.node(name).guarantees):
            for found in situations(frame, group, node, clause):
                plan.append((Kind.POSSIBLE, "", found.name, found.possible))
                plan.append((Kind.IMPOSSIBLE, "", found.name, found.excluded))
    return Wiring(tuple(frame.node(n.name) for n in system.contract.nodes), _ports(frame), tuple(plan))


def _ports(frame: Frame) -> dict[tuple[Role, str, str], Place]:
    """What each port is: the value of an output, now or (over a delayed edge) a step before, or of the environment."""
    outputs = {
        (node.name, port.name): Place(f"{node.name}.{port.name}", node.name, 0, port.sort)
        for node in frame.system.contract.nodes
        for port in node.outputs
    }
    found = {(Role.OUTPUT, *at): place for at, place in outputs.items()}
    for target, edge in frame.graph.by_target.items():
        source = outputs[edge.source.node, edge.source.port]
        found[Role.INPUT, target.node, target.port] = replace(source, back=int(edge.delayed))
    for at in frame.graph.environment:
        name, sort = frame.entry(at.node, at.port), frame.node(at.node).input(at.port).sort
        found[Role.INPUT, at.node, at.port] = Place(name, None, 0, sort, name in frame.constants)
    for node in frame.cells:
        for event in (port.variable for port in frame.node(node).inputs):
            if event == CLOCK or is_arrival(event):
                name = CLOCK.name if event == CLOCK else f"{node}.{event.name}"
                found[Role.INPUT, node, event.name] = Place(f"in.{name}", None, 0, event.sort)
    for node, cells in frame.cells.items():
        for cell in cells:
            if (keeper := frame.shared.get(f"{node}.{cell.name}")) is not None:
                other, _, kept = keeper.partition(".")
                for role in (Role.OUTPUT, Role.INPUT):
                    found[role, node, cell.name] = found[role, other, kept]
                continue
            read = (found[v.role, node, v.name] for v, _ in frame.behind(node, cell.now))
            owner = node if any(place.node for place in read) else ""
            found[Role.OUTPUT, node, cell.name] = Place(f"{node}.{cell.name}", owner, 0, cell.sort)
            found[Role.INPUT, node, cell.name] = Place(f"{node}.{cell.name}", owner, 1, cell.sort)
    return found
