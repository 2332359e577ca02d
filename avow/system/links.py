"""A plan with what it leaves to the contract: the guarantees of its methods, and what the names under a requirement's
`supported_by` say there, which a confirmation covers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from avow.base.files import sha256
from avow.language.contract import Contract, Node
from avow.language.printer import show_sort, show_term
from avow.system.folding import leaves
from avow.system.plan import Method, NodePlan, Plan, System


def completed(plan: Plan, contract: Contract) -> System:
    """The system of a plan and its contract: each method that names no guarantee takes on all of its node's, and each
    requirement knows what its links say: sentences, formulas (constants by their values) and the types of the ports
    that they may speak of. White space, comments and the order of clauses say nothing."""
    known = {node.name: node for node in contract.nodes}
    inside = leaves(plan)
    derived = {goal.name: goal.select for goal in plan.compose}

    def said(name: str) -> Iterator[str]:
        owner, dot, clause = name.partition(".")
        if dot and owner in known:
            yield from _said(known[owner], clause)
            return
        for part in derived.get(name, (name,)):
            for node in inside.get(part, (part,)):
                if node in known:
                    yield from _said(known[node])

    requirements = tuple(
        replace(r, linked=sha256(repr(sorted({text for name in r.supported_by for text in said(name)}))))
        for r in plan.requirements
    )

    def taken_on(entry: NodePlan, method: Method) -> Method:
        own = known[entry.node].guarantees if entry.node in known else ()
        return (
            method if method.guarantees else replace(method, guarantees=tuple(c.name for c in own if not c.unwritten))
        )

    nodes = tuple(replace(e, methods=tuple(taken_on(e, method) for method in e.methods)) for e in plan.nodes)
    return System(replace(plan, nodes=nodes, requirements=requirements), contract)


def _said(node: Node, name: str | None = None) -> Iterator[str]:
    clauses = [g for g in node.guarantees if name in (None, g.name)]
    for clause in clauses:
        yield repr((node.name, clause.name, " ".join((clause.sentence or "").split()), show_term(clause.formula)))
    for port in (*node.inputs, *node.outputs) if clauses else ():
        yield repr((node.name, port.role.name, port.name, show_sort(port.sort)))
