"""A system as the kernel receives it: its contracts, the wires of its dataflow graph, and the plan's formulas.

Cells (the state variables of clauses) are outputs of their own (`SoundWithMemory` in proofs/kernel.dfy: a cell's value
after a step is a definition). Several publishers of a topic are a node whose output is that of one of them.

Two claims are existential: a loop has first values, and the situation that a guarantee in a cycle is about can arise.
Nothing is derived from them: the kernel asks for values that satisfy them, and does not accept a proof that there are
none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from avow.base.graphs import components
from avow.calculus.chance import over_system
from avow.calculus.variables import Frame
from avow.formulas.formula import conjunction, negation
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.temporal.cell import CELL
from avow.formulas.temporal.clock import GOES_ON, is_arrival
from avow.kernel.statements import Claimed, Place, Wiring
from avow.language.sorts import BOOL, Sort
from avow.language.terms import Role, Term, Variable
from avow.sanity.claims import triggers
from avow.system.formulas import initial_condition
from avow.system.plan import Edge


def wiring(frame: Frame) -> Wiring:
    """The wiring of the frame in which every node is a node of its own. Raises Rejected if a formula is wrong."""
    system, graph = frame.system, frame.graph
    plan: list[tuple[Claimed, str, str, Term]] = []
    initials: dict[tuple[str, str], Term] = {}
    for edge in graph.edges:
        if edge.delayed and (edge.source.node, edge.source.port) not in initials:
            condition = initial_condition(system, edge)
            if condition is not None:
                initials[edge.source.node, edge.source.port] = condition
    plan += [(Claimed.ENVIRONMENT, a.node, a.port, a.formula) for a in frame.assumed]
    plan += [(Claimed.INITIAL, node, port, term) for (node, port), term in initials.items()]
    every = dict.fromkeys(each for of in ("", *frame.observed) for each in frame.own_cells(of))
    for name, _, cell in every:
        own = Variable(Role.OUTPUT, cell.name, cell.sort)
        plan.append((Claimed.DEFINITION, name, cell.name, cell.leaves(own)))
        if cell.initial is not None:
            plan.append((Claimed.INITIAL, name, cell.name, cell.begins(own)))
    plan += [(Claimed.DEFINITION, name, CLOCK.name, GOES_ON) for name in frame.timed[:1]]
    for name, term in frame.required.items():
        known = frame.observed.get(name)
        plan.append((Claimed.REQUIREMENT, "", name, term if known is None else known.formula))
    plan += [(Claimed.START, "", start_name(group), _beginning(frame, group)) for group in loops(frame)]
    for group in circles(frame):
        for node, clause in ((name, g.name) for name in group for g in frame.node(name).guarantees):
            plan += _situations(frame, group, node, clause)
    return Wiring(tuple(frame.node(n.name) for n in system.contract.nodes), _ports(frame), tuple(plan))


# Existential claims, shown by an example: a loop has first values; a situation that a guarantee is about can arise.
# Nothing is derived from them. Each is a formula over ``node.port`` that some values have to satisfy: the kernel asks
# for values, and does not accept a proof that there are none.


def loops(frame: Frame) -> Iterator[tuple[str, ...]]:
    """Nodes that feed one another in a cycle, with or without delay."""
    arcs = [(e.source.node, e.target.node) for e in frame.graph.edges]
    selves = {source for source, target in arcs if source == target}
    yield from (g for g in components(frame.graph.nodes, arcs) if len(g) > 1 or g[0] in selves)


def circles(frame: Frame) -> Iterator[tuple[str, ...]]:
    """Nodes that feed one another in a cycle within one step."""
    arcs = [(e.source.node, e.target.node) for e in frame.graph.edges if not e.delayed]
    yield from (group for group in components(frame.graph.nodes, arcs) if len(group) > 1)


def start_name(group: Sequence[str]) -> str:
    """The obligation that the nodes of a loop have first values."""
    return f"start.{joined(group)}"


def joined(names: Sequence[str]) -> str:
    return "-".join(names) if len(names) <= 6 else f"{names[0]}-and-{len(names) - 1}-more"


def _beginning(frame: Frame, group: Iterable[str]) -> Term:
    """The plan's conditions on the outputs of a loop before the first step, over ``node.port``."""
    members = frozenset(group)
    first: dict[str, Edge] = {str(e.source): e for e in frame.graph.edges if e.delayed and e.source.node in members}
    found = [(e.source.node, initial_condition(frame.system, e)) for e in first.values()]
    return conjunction([over_system(condition, node) for node, condition in found if condition is not None])


def _situations(frame: Frame, group: Sequence[str], node: str, clause: str) -> Iterator[tuple[Claimed, str, str, Term]]:
    """Two claims for each situation that a guarantee of a node in a cycle is about: that it arises while all nodes of
    the cycle keep their contracts, and that its node's own contract excludes it, which composition does not change."""
    contracts = {name: [over_system(each.formula, name) for each in frame.node(name).clauses] for name in group}
    everything = [term for terms in contracts.values() for term in terms]
    everything += [over_system(assumed.formula, assumed.node) for assumed in frame.assumed]
    for k, situation in enumerate(triggers(frame.node(node).clause(clause).formula)):
        name, there = f"joint.{node}.{clause}.{k}", over_system(situation, node)
        yield Claimed.POSSIBLE, "", name, conjunction([*everything, there])
        yield Claimed.IMPOSSIBLE, "", name, negation(conjunction([*contracts[node], there]))


def _ports(frame: Frame) -> dict[tuple[Role, str, str], Place]:
    """The value that each port has: that of an output, now or (over a delayed edge) one step before, or of the
    environment."""
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
    clock = Place(f"in.{CLOCK.name}", None, 0, CLOCK.sort)
    found |= {(Role.INPUT, *at): clock for node in frame.timed for at in ((node, CLOCK.name), (CLOCK.name, ""))}
    for node in frame.cells:
        for event in (port.name for port in frame.node(node).inputs if is_arrival(port.variable)):
            found[Role.INPUT, node, event] = Place(f"in.{node}.{event}", None, 0, BOOL)

    def keep(at: tuple[str, str], called: str, owner: str, sort: Sort) -> None:
        for role, back in ((Role.OUTPUT, 0), (Role.INPUT, 1)):
            other, _, kept = frame.shared.get(called, "").partition(".")
            found[role, *at] = found[role, other, kept] if other else Place(called, owner, back, sort)

    for node, cells in frame.cells.items():
        for cell in cells:
            read = (found[v.role, node, v.name] for v, _ in frame.behind(node, cell.now))
            keep((node, cell.name), f"{node}.{cell.name}", node if any(place.node for place in read) else "", cell.sort)
    for observed in frame.observed.values():
        for node, event in observed.arrivals:
            found[Role.INPUT, node, event] = Place(f"in.{node}.{event}", None, 0, BOOL)
        for cell in observed.cells:
            # the cell counts steps of the node that it mentions; if it mentions several, of all nodes
            nodes = {v.name.partition(".")[0] for v in observed.spoken if CELL not in v.name}
            owner, _, name = cell.name.partition(".")
            keep((owner, name), cell.name, nodes.pop() if len(nodes) == 1 else owner, cell.sort)
    return found
