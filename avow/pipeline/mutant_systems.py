"""A system with a near miss in place of one guarantee."""

from __future__ import annotations

from dataclasses import replace

from avow.base.records import dataclass
from avow.language.contract import Clause, Node
from avow.sanity.mutants import Mutant, telling
from avow.system.plan import System


@dataclass(frozen=True, slots=True)
class Altered:
    """Which mutant of which guarantee stands in for the guarantee (see `avow.pipeline.mutation`)."""

    clause: str
    number: int
    limit: int


def alter(system: System, node: Node, altered: Altered) -> System:
    """The system with a mutant in place of a guarantee. Raises KeyError and IndexError for one that there is not."""
    clause = node.clause(altered.clause)
    mutant = chosen(node, clause, altered.limit)[altered.number]
    guarantees = tuple(replace(c, formula=mutant.formula) if c.name == clause.name else c for c in node.guarantees)
    changed = replace(node, guarantees=guarantees)
    nodes = tuple(changed if n.name == node.name else n for n in system.contract.nodes)
    return replace(system, contract=replace(system.contract, nodes=nodes))


def chosen(node: Node, clause: Clause, limit: int) -> tuple[Mutant, ...]:
    """The mutants that are tried: the same ones, in the same order, in every process."""
    others = tuple(g.formula for g in node.guarantees if g.name != clause.name)
    return telling(clause.formula, tuple(a.formula for a in node.assumptions), limit, others=others)
