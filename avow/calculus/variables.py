"""One set of variables for a whole system: linking equations are solved by giving both ends of an edge one name.

The output `at` of `navigation` is ``navigation.at`` wherever it flows; ``navigation.at@before`` is its value one step
earlier (what a delayed edge delivers); an input that no node provides is ``in.map``, one for all nodes that read it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from avow.formulas.formula import free_variables, substitute
from avow.language.contract import Node
from avow.language.sorts import Sort
from avow.language.terms import Role, Term, Variable
from avow.system.folding import own_inputs
from avow.system.formulas import Assumed, environment_assumptions, initial_condition
from avow.system.graph import Edge, Graph, dataflow
from avow.system.plan import Endpoint, System

SUFFIXES = ("", "@before", "@before@before")
"""Now, one step earlier, two steps earlier."""


@dataclass(slots=True)
class Frame:
    """A system with its graph, and its formulas in system-level variables (each translated once)."""

    system: System
    graph: Graph
    assumed: tuple[Assumed, ...]
    own_inputs: Mapping[str, str]
    """Inputs (``planner.map``) that the plan sets apart from the inputs of that name that others read → as whose."""
    constants: frozenset[str]
    """Environment inputs (``in.map``, ``planner.map``) that keep their value."""

    _nodes: dict[str, Node] = field(default_factory=dict)
    _mappings: dict[tuple[str, int], Mapping[Variable, Term]] = field(default_factory=dict)
    _terms: dict[tuple[str, str, int], Term] = field(default_factory=dict)
    _environment: dict[int, dict[str, Term]] = field(default_factory=dict)
    _initials: dict[str, tuple[tuple[str, Term], ...]] | None = None

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
            entry = self.entry(node, port)
            if entry in self.constants:
                earlier = 0
            owner = entry.partition(".")[0]
            if owner != "in":
                return system_variable(f"{owner}.in.{port}", sort, earlier)

            return Variable(Role.INPUT, port + SUFFIXES[earlier], sort)

        return self.output(edge.source.node, edge.source.port, earlier + (1 if edge.delayed else 0))

    def entry(self, node: str, port: str) -> str:
        """What the plan calls an input from the environment: ``in.map``, or ``planner.map`` where it is set apart."""
        return self.own_inputs.get(f"{node}.{port}", f"in.{port}")

    def environment(self, earlier: int = 0) -> dict[str, Term]:
        """What the plan assumes of the environment, labelled ``environment in.map``."""
        if earlier not in self._environment:
            suffix = " one step before" if earlier else ""
            self._environment[earlier] = {
                f"environment {assumed.port}{suffix}": substitute(assumed.formula, self.mapping(assumed.node, earlier))
                for assumed in self.assumed
            }
        return dict(self._environment[earlier])

    def initials(self, nodes: Iterable[str]) -> dict[str, Term]:
        """What holds before the first step of the outputs of `nodes` that feed delayed edges."""
        if self._initials is None:
            found: dict[str, dict[str, Term]] = {}
            for edge in self.graph.edges:
                label = f"initial {edge.source}"
                if edge.delayed and label not in found.get(edge.source.node, {}):
                    condition = self._initially(edge)
                    if condition is not None:
                        found.setdefault(edge.source.node, {})[label] = condition
            self._initials = {node: tuple(conditions.items()) for node, conditions in found.items()}
        return dict(item for node in nodes for item in self._initials.get(node, ()))

    def _initially(self, edge: Edge) -> Term | None:
        condition = initial_condition(self.system, edge)
        if condition is None:
            return None
        node, port = edge.source.node, edge.source.port
        source = self.node(node).output(port).variable
        return substitute(condition, {**self.mapping(node), source: self.output(node, port, 1)})


def frame(system: System) -> Frame:
    """Raises Rejected where the plan's formulas are wrong."""
    graph = dataflow(system)
    own = own_inputs(system, graph)
    nodes = {node.name: node for node in system.contract.nodes}
    constants = frozenset(entry.port for entry in system.plan.environment if entry.constant)
    return Frame(system, graph, environment_assumptions(system, graph), own, constants, nodes)


def system_variable(name: str, sort: Sort, earlier: int = 0) -> Variable:
    """A variable of the whole system; its name holds a dot, so that no bound variable can bear it."""
    return Variable(Role.BOUND, name + SUFFIXES[earlier], sort)


def system_term(frame: Frame, formula: Term, earlier: int = 0) -> Term:
    """A formula over ``node.port`` in system-level variables."""
    mapping: dict[Variable, Term] = {}
    for variable in free_variables(formula):
        node, _, port = variable.name.partition(".")
        find = frame.input if variable.role is Role.INPUT else frame.output
        mapping[variable] = find(node, port, earlier)
    return substitute(formula, mapping)
