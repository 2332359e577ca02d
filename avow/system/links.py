"""A plan completed from the contract: the guarantees of its methods, and the meaning there of the names in a
requirement, which a validation covers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from avow.base.files import sha256
from avow.language.contract import Contract, Node
from avow.language.printer import show_sort, show_term, show_type
from avow.language.sorts import DataSort, EnumSort, components
from avow.system.folding import leaves
from avow.system.plan import Method, NodePlan, Plan, Requirement, System

_WORD = re.compile(r"\w+")


def completed(plan: Plan, contract: Contract) -> System:
    """The system of a plan and its contract: each method that names no guarantee is given all of its node's, and each
    requirement gets a digest of what its words depend on.

    For each node under `supported_by` these are its guarantees (or the one named) and assumptions, for each node that
    the formula names its ports; for both the connections to the node and the types of ports; and the constants,
    definitions and types that the formula names. White space, comments and the order of clauses make no difference.
    """
    known = {node.name: node for node in contract.nodes}
    inside = leaves(plan)
    derived = {goal.name: goal.select for goal in plan.compose}

    def supporting(name: str) -> Iterator[str]:
        owner, dot, clause = name.partition(".")
        if dot and owner in known:
            yield from _promised(known[owner], clause)
            yield from _placed(known[owner], plan)
            return
        for part in derived.get(name, (name,)):
            for node in inside.get(part, (part,)):
                if node in known:
                    yield from _promised(known[node])
                    yield from _placed(known[node], plan)

    def meant(requirement: Requirement) -> Iterator[str]:
        for name in requirement.supported_by:
            yield from supporting(name)
        words = set(_WORD.findall(f"{requirement.formula or ''} {requirement.temporal or ''}"))
        for node in words & known.keys():
            yield from _placed(known[node], plan)
        yield from (repr((name, show_term(value))) for name, value in contract.constants if name in words)
        yield from (repr((name, show_type(sort))) for name, sort in contract.types if name in words)
        yield from (repr((d.name, show_term(d.body))) for d in contract.definitions if d.name in words)

    requirements = tuple(replace(r, linked=sha256(repr(sorted({*meant(r)})))) for r in plan.requirements)

    def taken_on(entry: NodePlan, method: Method) -> Method:
        own = known[entry.node].guarantees if entry.node in known else ()
        return (
            method if method.guarantees else replace(method, guarantees=tuple(c.name for c in own if not c.unwritten))
        )

    nodes = tuple(replace(e, methods=tuple(taken_on(e, method) for method in e.methods)) for e in plan.nodes)
    return System(replace(plan, nodes=nodes, requirements=requirements), contract)


def _promised(node: Node, name: str | None = None) -> Iterator[str]:
    """The guarantees of a node, all of them or one clause, and its assumptions."""
    guarantees = [g for g in node.guarantees if name in (None, g.name)]
    for clause in (*guarantees, *(node.assumptions if guarantees else ())):
        likely = clause.chance and (str(clause.chance.least), clause.chance.per_run)
        said = (" ".join((clause.sentence or "").split()), show_term(clause.spoken), *(likely or ()))
        yield repr((node.name, clause.name, *said))


def _placed(node: Node, plan: Plan) -> Iterator[str]:
    """A node's ports with their units and frames, and what is connected to its inputs."""
    for port in (*node.inputs, *node.outputs):
        listed = (show_type(part) for part in components(port.sort) if isinstance(part, EnumSort | DataSort))
        more = (*((port.unit,) if port.unit else ()), *sorted(listed))
        yield repr(
            (node.name, port.role.name, port.name + " (parameter)" * port.parameter, show_sort(port.sort), *more)
        )
    for topic in node.topics:
        frame = (topic.frame,) if topic.frame else ()
        yield repr((node.name, topic.name, topic.port.variable.qualified if topic.port else "", *frame))
    for edge in plan.connections:
        if edge.target.node == node.name:
            yield repr((str(edge), edge.initial))
