"""A system as the kernel is told of it: its contracts, the wires of its dataflow graph, and the plan's formulas."""

from __future__ import annotations

from avow.calculus.existence import beginning, circles, loops, situations, start_name
from avow.calculus.variables import Frame
from avow.kernel.statements import Kind, Wire, Wiring
from avow.language.terms import Term
from avow.system.formulas import initial_condition
from avow.system.temporal import parse_state


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
    for r in system.plan.requirements:
        if r.formula is not None:
            plan.append((Kind.REQUIREMENT, "", r.id, parse_state(r.formula, system.contract, r.formula_span)))
    plan += [(Kind.POSSIBLE, "", start_name(group), beginning(frame, group)) for group in loops(frame)]
    for group in circles(frame):
        for node, clause in ((name, g.name) for name in group for g in frame.node(name).guarantees):
            for found in situations(frame, group, node, clause):
                plan.append((Kind.POSSIBLE, "", found.name, found.possible))
                plan.append((Kind.IMPOSSIBLE, "", found.name, found.excluded))
    return Wiring(
        nodes=system.contract.nodes,
        wires={
            (target.node, target.port): Wire(edge.source.node, edge.source.port, edge.delayed)
            for target, edge in graph.by_target.items()
        },
        outside={(at.node, at.port): frame.entry(at.node, at.port) for at in graph.environment},
        rigid=frame.constants,
        formulas=tuple(plan),
    )
