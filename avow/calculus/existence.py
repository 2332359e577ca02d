"""What an example shows: that a loop has first values, that a situation that a guarantee is about can arise.

Nothing is derived from these claims. Each is a formula over ``node.port``, which some values have to meet: the kernel
asks for values, and takes no proof that there are none for an answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from avow.base.graphs import components
from avow.base.records import dataclass
from avow.calculus.variables import Frame
from avow.formulas.formula import conjunction, negation, substitute
from avow.language.subterms import ports_of
from avow.language.terms import Role, Term, Variable
from avow.sanity.claims import triggers
from avow.system.formulas import initial_condition
from avow.system.plan import Edge


@dataclass(frozen=True, slots=True)
class Situation:
    """What a guarantee is about. `possible`: it arises while all nodes of a circle keep their contracts; `excluded`:
    its node's own contract leaves it no room, which composing does not change."""

    name: str
    possible: Term
    excluded: Term


def loops(frame: Frame) -> Iterator[tuple[str, ...]]:
    """Nodes that feed one another in a circle, at once or delayed."""
    arcs = [(e.source.node, e.target.node) for e in frame.graph.edges]
    selves = {source for source, target in arcs if source == target}
    yield from (g for g in components(frame.graph.nodes, arcs) if len(g) > 1 or g[0] in selves)


def circles(frame: Frame) -> Iterator[tuple[str, ...]]:
    """Nodes that feed one another in a circle within one step."""
    arcs = [(e.source.node, e.target.node) for e in frame.graph.edges if not e.delayed]
    yield from (group for group in components(frame.graph.nodes, arcs) if len(group) > 1)


def start_name(group: Sequence[str]) -> str:
    """The obligation that the nodes of a loop have first values."""
    return f"start.{joined(group)}"


def joined(names: Sequence[str]) -> str:
    return "-".join(names) if len(names) <= 6 else f"{names[0]}-and-{len(names) - 1}-more"


def beginning(frame: Frame, group: Iterable[str]) -> Term:
    """What the plan says of the outputs of a loop before the first step, over ``node.port``."""
    members = frozenset(group)
    first: dict[str, Edge] = {str(e.source): e for e in frame.graph.edges if e.delayed and e.source.node in members}
    found = [(e.source.node, initial_condition(frame.system, e)) for e in first.values()]
    return conjunction([_qualified(condition, node) for node, condition in found if condition is not None])


def situations(frame: Frame, group: Sequence[str], node: str, clause: str) -> tuple[Situation, ...]:
    """The situations that a guarantee of a node in a circle is about."""
    contracts = {name: [_qualified(each.formula, name) for each in frame.node(name).clauses] for name in group}
    everything = [term for terms in contracts.values() for term in terms]
    everything += [_qualified(assumed.formula, assumed.node) for assumed in frame.assumed]
    found = triggers(frame.node(node).clause(clause).formula)
    return tuple(
        Situation(
            f"joint.{node}.{clause}.{k}",
            conjunction([*everything, _qualified(situation, node)]),
            negation(conjunction([*contracts[node], _qualified(situation, node)])),
        )
        for k, situation in enumerate(found)
    )


def _qualified(term: Term, node: str) -> Term:
    """A formula of a node over ``node.port``."""
    return substitute(
        term, {v: Variable(v.role, f"{node}.{v.name}", v.sort) for v in ports_of(term) if v.role is not Role.BOUND}
    )
