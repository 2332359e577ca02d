"""Digests of what a composition claim is about: the clauses, the wiring, the plan's formulas; names of clauses, layout
and comments do not count."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

from avow.base.files import sha256
from avow.base.graphs import components
from avow.base.records import dataclass
from avow.calculus.variables import Frame
from avow.formulas.formula import digest, sort_digest


@dataclass(slots=True)
class Meanings:
    """Digests of nodes with all that flows into them, computed once for a system (as a Merkle tree over its loops)."""

    frame: Frame
    _nodes: dict[str, str] = field(default_factory=dict)
    _cones: dict[frozenset[str], dict[str, str]] = field(default_factory=dict)

    def node(self, name: str) -> str:
        """A node's ports and clauses."""
        if name not in self._nodes:
            node = self.frame.node(name)
            self._nodes[name] = sha256(
                "\n".join(
                    [
                        name,
                        *(f"{p.role} {p.name} {sort_digest(p.sort)}" for p in (*node.inputs, *node.outputs)),
                        *sorted(f"{clause.kind} {digest(clause.formula)}" for clause in node.clauses),
                    ]
                )
            )
        return self._nodes[name]

    def cone(self, name: str, selected: frozenset[str]) -> str:
        """A node and every selected node from which values flow to it, at whatever step."""
        if selected not in self._cones:
            self._cones[selected] = self._all_cones(selected)
        return self._cones[selected][name]

    def _all_cones(self, selected: frozenset[str]) -> dict[str, str]:
        graph = self.frame.graph
        inside = [edge for edge in graph.edges if edge.source.node in selected and edge.target.node in selected]
        into: dict[str, list[str]] = {}
        for edge in inside:
            text = (
                f"{edge.source} {edge.target} {edge.delayed} {self.initial(edge.source.node) if edge.delayed else ''}"
            )
            into.setdefault(edge.target.node, []).append(text)
        found: dict[str, str] = {}
        order = [name for name in graph.nodes if name in selected]
        for group in components(order, [(e.source.node, e.target.node) for e in inside]):
            members = set(group)
            parts = [self.node(name) for name in group]
            parts += sorted(text for name in group for text in into.get(name, ()))
            parts += sorted(
                {found[p] for name in group for p in graph.providers(name) if p in found and p not in members}
            )
            whole = sha256("\n".join(parts))
            found.update({name: sha256(f"{name} {whole}") for name in group})
        return found

    def initial(self, node: str) -> str:
        """What the plan says of a node's outputs before the first step."""
        return digest(*self.frame.initials(frozenset({node})).values())

    def environment(self, ports: Iterable[str] | None = None) -> str:
        """The plan's environment assumptions (on some ports)."""
        wanted = None if ports is None else set(ports)
        formulas = digest(*(a.formula for a in self.frame.assumed if wanted is None or a.port in wanted))
        own = (at if at == whose else f"{at} as {whose}" for at, whose in self.frame.own_inputs.items())
        return sha256("\n".join([formulas, *sorted(own), "constant", *sorted(self.frame.constants)]))

    def all(self, selected: frozenset[str]) -> str:
        """Everything that is selected."""
        return sha256("\n".join([*sorted(self.cone(n, selected) for n in selected), self.environment()]))
