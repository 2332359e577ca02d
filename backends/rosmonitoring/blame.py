"""Whose fault was it? A breach is followed along the graph, across delays, to the first clause that broke.

A node whose assumption fails on what another node says is not to blame, and nor is the environment: the other node is,
where one of its guarantees about that output was broken; else it was broken in turn by what came before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from avow.language.contract import Node
from avow.language.terms import Role
from avow.system.formulas import ports_of
from avow.system.graph import Edge, dataflow
from avow.system.plan import System

from .coverage import Tally
from .engine import Monitor
from .watched import Fault, Violation


@dataclass(frozen=True, slots=True)
class _Broken:
    """A guarantee that failed: where it all began, and how often it had held until then."""

    origin: str
    held: int


@dataclass(slots=True)
class Blame:
    """Follows breaches; `told` takes the violations of one event, of all nodes together."""

    system: System
    _feeding: dict[str, dict[str, Edge]] = field(default_factory=dict)
    _broken: dict[tuple[str, str], _Broken] = field(default_factory=dict)
    _assumed: dict[str, str] = field(default_factory=dict)
    """Node → where its latest broken assumption began."""

    def __post_init__(self) -> None:
        for edge in dataflow(self.system).edges:
            self._feeding.setdefault(edge.target.node, {})[edge.target.port] = edge

    def told(self, violations: Sequence[Violation], monitors: Mapping[str, Monitor]) -> Iterator[Violation]:
        """The same, with who is to blame: guarantees first, since an assumption may fail by them at the same event."""
        for violation in violations:
            if violation.fault is Fault.GUARANTEE:
                origin = f"{violation.node}.{violation.clause} at event {violation.index}"
                self._note(violation, origin, monitors)
        for violation in violations:
            match violation.fault:
                case Fault.ASSUMPTION:
                    yield self._assumption(violation, monitors)
                case Fault.EXCUSED:
                    self._note(violation, self._assumed.get(violation.node, ""), monitors)
                    yield violation
                case _:  # the node itself, or a message
                    yield violation

    def _note(self, violation: Violation, origin: str, monitors: Mapping[str, Monitor]) -> None:
        if origin:
            tally = monitors[violation.node].tallies[violation.clause]
            self._broken[violation.node, violation.clause] = _Broken(origin, _held(tally))

    def _assumption(self, violation: Violation, monitors: Mapping[str, Monitor]) -> Violation:
        node = self.system.contract.node(violation.node)
        edges = [edge for port in _inputs(node, violation.clause) for edge in self._edges(node.name, port)]
        if not edges:
            self._assumed[node.name] = f"{node.name}.{violation.clause} at event {violation.index} (environment)"
            return violation
        here = f"{node.name}.{violation.clause} at event {violation.index}"
        causes = [cause for edge in edges if (cause := self._cause(edge, monitors))]
        self._assumed[node.name] = causes[0] if causes else here
        providers = ", ".join(dict.fromkeys(str(edge.source) for edge in edges))
        if causes:
            why = f"{causes[0]} caused {here}"
        else:
            why = f"it came from {providers}, of which no guarantee was seen broken"
        return replace(violation, fault=Fault.PROVIDER, explanation=f"{violation.explanation}; {why}")

    def _edges(self, node: str, port: str) -> list[Edge]:
        """What feeds an input; of a topic of several publishers, all of them."""
        edge = self._feeding.get(node, {}).get(port)
        if edge is None:
            return []
        if self.system.contract.node(edge.source.node).relay:
            return list(self._feeding.get(edge.source.node, {}).values())
        return [edge]

    def _cause(self, edge: Edge, monitors: Mapping[str, Monitor]) -> str:
        """Where a breach of the source began that the edge still delivers; empty where there is none."""
        source = self.system.contract.node(edge.source.node)
        monitor = monitors.get(source.name)
        if monitor is None:
            return ""
        for clause in source.guarantees:
            broken = self._broken.get((source.name, clause.name))
            speaks = any(v.role is Role.OUTPUT and v.name == edge.source.port for v in ports_of(clause.formula))
            # a delayed edge still delivers what was said before the latest answer
            if broken and speaks and _held(monitor.tallies[clause.name]) <= broken.held + edge.delayed:
                return broken.origin
        return ""


def _held(tally: Tally) -> int:
    return tally.decided - tally.broken


def _inputs(node: Node, clause: str) -> list[str]:
    return [v.name for v in ports_of(node.clause(clause).formula) if v.role is Role.INPUT]
