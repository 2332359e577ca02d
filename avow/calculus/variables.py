"""One set of variables for a whole system: linking equations are solved by giving both ends of an edge one name.

The output `at` of `navigation` is ``navigation.at`` wherever it flows; ``navigation.at@before`` is its value one step
earlier (what a delayed edge delivers); an input that no node provides is ``in.wayP``, one for all nodes that read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from avow.language.contract import Node
from avow.language.sorts import Sort
from avow.language.terms import Role, Term, Variable
from avow.logic.formula import substitute
from avow.system.formulas import Assumed, environment_assumptions, initial_condition
from avow.system.graph import Graph, dataflow
from avow.system.plan import Endpoint, System

SUFFIXES = ("", "@before", "@before@before")
"""Now, one step earlier, two steps earlier."""


@dataclass(slots=True)
class Frame:
    """A system with its graph, and its formulas in system-level variables (each translated once)."""

    system: System
    graph: Graph
    assumed: tuple[Assumed, ...]
    own_inputs: frozenset[str]
    """Inputs of one node (``agent.wayP``) that the plan sets apart from the inputs of that name that others read."""
    constants: frozenset[str]
    """Environment inputs (``in.wayP``, ``agent.wayP``) that keep their value."""

    _nodes: dict[str, Node] = field(default_factory=dict)
    _mappings: dict[tuple[str, int], Mapping[Variable, Term]] = field(default_factory=dict)
    _terms: dict[tuple[str, str, int], Term] = field(default_factory=dict)

    def node(self, name: str) -> Node:
        return self._nodes[name]

    def clause(self, node: str, clause: str, earlier: int = 0) -> Term:
        """A clause of a node, `earlier` steps ago."""
        key = (node, clause, earlier)
        if key not in self._terms:
            formula = self.node(node).clause(clause).formula
            self._terms[key] = substitute(formula, self.mapping(node, earlier))
        return self._terms[key]

    def mapping(self, node: str, earlier: int = 0) -> Mapping[Variable, Term]:
        """A node's ports in system-level variables."""
        key = (node, earlier)
        if key not in self._mappings:
            contract = self.node(node)
            found: dict[Variable, Term] = {p.variable: self.output(node, p.name, earlier) for p in contract.outputs}
            found |= {p.variable: self.input(node, p.name, earlier) for p in contract.inputs}
            self._mappings[key] = found
        return self._mappings[key]

    def output(self, node: str, port: str, earlier: int = 0) -> Variable:
        """The variable of an output."""
        return system_variable(f"{node}.{port}", self.node(node).output(port).sort, earlier)

    def input(self, node: str, port: str, earlier: int = 0) -> Variable:
        """The variable that an input reads: its provider's, now or one step earlier, or the environment's."""
        edge = self.graph.by_target.get(Endpoint(node, port))
        if edge is None:
            sort = self.node(node).input(port).sort
            own = f"{node}.{port}" in self.own_inputs
            if (f"{node}.{port}" if own else f"in.{port}") in self.constants:
                earlier = 0
            if own:
                return system_variable(f"{node}.in.{port}", sort, earlier)

            return Variable(Role.INPUT, port + SUFFIXES[earlier], sort)

        return self.output(edge.source.node, edge.source.port, earlier + (1 if edge.delayed else 0))

    def environment(self, earlier: int = 0) -> dict[str, Term]:
        """What the plan assumes of the environment, labelled ``environment in.wayP``."""
        return {
            f"environment {assumed.port}" + (" one step before" if earlier else ""): substitute(
                assumed.formula, self.mapping(assumed.node, earlier)
            )
            for assumed in self.assumed
        }

    def initials(self, nodes: frozenset[str]) -> dict[str, Term]:
        """What holds before the first step of the outputs of `nodes` that feed delayed edges."""
        found: dict[str, Term] = {}
        for edge in self.graph.edges:
            if edge.delayed and edge.source.node in nodes:
                condition = initial_condition(self.system, edge)
                if condition is not None:
                    source = self.node(edge.source.node).output(edge.source.port).variable
                    before = self.output(edge.source.node, edge.source.port, 1)
                    found[f"initial {edge.source}"] = substitute(
                        condition, {**self.mapping(edge.source.node), source: before}
                    )

        return found


def frame(system: System) -> Frame:
    """Raises Rejected where the plan's formulas are wrong."""
    graph = dataflow(system)
    own = frozenset(entry.port for entry in system.plan.environment if not entry.port.startswith("in."))
    nodes = {node.name: node for node in system.contract.nodes}
    constants = frozenset(entry.port for entry in system.plan.environment if entry.constant)
    return Frame(system, graph, environment_assumptions(system, graph), own, constants, nodes)


def system_variable(name: str, sort: Sort, earlier: int = 0) -> Variable:
    """A variable of the whole system; its name holds a dot, so that no bound variable can bear it."""
    return Variable(Role.BOUND, name + SUFFIXES[earlier], sort)
