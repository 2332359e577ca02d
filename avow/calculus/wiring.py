"""A system as the kernel is told of it: its contracts, the wires of its dataflow graph, and the plan's formulas."""

from __future__ import annotations

from avow.calculus.variables import Frame
from avow.kernel.statements import Wire, Wiring
from avow.language.terms import Term
from avow.system.formulas import initial_condition
from avow.system.temporal import parse_state


def wiring(frame: Frame) -> Wiring:
    """Of the frame of every node by itself. Raises Rejected for a formula that is wrong."""
    system, graph = frame.system, frame.graph
    initials: dict[tuple[str, str], Term] = {}
    for edge in graph.edges:
        if edge.delayed and (edge.source.node, edge.source.port) not in initials:
            condition = initial_condition(system, edge)
            if condition is not None:
                initials[edge.source.node, edge.source.port] = condition
    return Wiring(
        nodes=system.contract.nodes,
        wires={
            (target.node, target.port): Wire(edge.source.node, edge.source.port, edge.delayed)
            for target, edge in graph.by_target.items()
        },
        outside={(at.node, at.port): frame.entry(at.node, at.port) for at in graph.environment},
        rigid=frame.constants,
        environment=tuple((a.port, a.node, a.formula) for a in frame.assumed),
        initials=tuple((node, port, term) for (node, port), term in initials.items()),
        requirements=tuple(
            (r.id, parse_state(r.formula, system.contract, r.formula_span))
            for r in system.plan.requirements
            if r.formula is not None
        ),
    )
