"""The derived system-level contract: a contract like any other; a composed system can be a node of a larger one.

Its inputs are what the selected nodes read from outside (and, for delayed edges, the values of the step before); its
outputs are all that they put out; it assumes what the derivation assumes (and what it shows of the step before), and
guarantees what its nodes guarantee.
"""

from __future__ import annotations

import re
from dataclasses import replace

from avow.calculus.composition import Composition
from avow.calculus.derivation import Goal
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.terms import Role, Term, Variable
from avow.logic.formula import free_variables, substitute
from avow.system.plan import Endpoint


def derived_contract(composition: Composition, goal: Goal) -> Contract:
    """The contract of the selected nodes taken together, as one node with the goal's name."""
    frame = composition.frame
    names = _Names()
    outputs: dict[str, Port] = {}
    for node in goal.nodes:
        for port in frame.node(node).outputs:
            variable = frame.output(node, port.name)
            fresh = names.give(variable, Role.OUTPUT, node, port.name)
            outputs[fresh.name] = Port(Role.OUTPUT, fresh.name, port.sort, port.type_name)
    inputs: dict[str, Port] = {}
    for node in goal.nodes:
        for port in frame.node(node).inputs:
            variable = frame.input(node, port.name)
            if variable not in names.given:
                edge = frame.graph.by_target.get(Endpoint(node, port.name))
                known = edge is not None and edge.delayed
                label = f"{edge.source.port}_before" if edge is not None and known else port.name
                fresh = names.give(variable, Role.INPUT, node, label)
                inputs[fresh.name] = Port(Role.INPUT, fresh.name, port.sort, port.type_name)
    assumptions: list[Clause] = []
    # What speaks of the step before was shown by induction over the system's own steps; a larger system that feeds the
    # values back has to show it again.
    carried = [condition.about for condition in goal.conditions if condition.delayed]
    for clause in (*goal.root.assumed, *carried):
        original = frame.node(clause.node).clause(clause.clause)
        term = frame.clause(clause.node, clause.clause)
        label = f"{clause.node}_{clause.clause}"
        assumptions.append(_clause(names, ClauseKind.ASSUMPTION, label, original, term, len(assumptions)))
    used = {port for condition in goal.conditions for port in condition.environment}
    for assumed in frame.assumed:
        if assumed.port in used:
            term = substitute(assumed.formula, frame.mapping(assumed.node))
            label = re.sub(r"\W", "_", f"environment_{assumed.port}")
            blank = Clause(ClauseKind.ASSUMPTION, label, 0, term, assumed.because or None)
            assumptions.append(_clause(names, ClauseKind.ASSUMPTION, label, blank, term, len(assumptions)))
    guarantees = [
        _clause(names, ClauseKind.GUARANTEE, f"{node}_{clause.name}", clause, frame.clause(node, clause.name), k)
        for k, (node, clause) in enumerate((n, c) for n in goal.nodes for c in frame.node(n).guarantees)
    ]
    label = re.sub(r"\W", "_", goal.name if goal is not composition.whole else frame.system.name)
    whole = Node(label, tuple(inputs.values()), tuple(outputs.values()), (), tuple(assumptions), tuple(guarantees))
    return replace(frame.system.contract, files=(), nodes=(whole,))


class _Names:
    """System-level variables as ports of one node; a name that two nodes use is prefixed by its node."""

    def __init__(self) -> None:
        self.given: dict[Variable, Variable] = {}
        self.taken: set[str] = set()

    def give(self, variable: Variable, role: Role, node: str, port: str) -> Variable:
        name = port if port not in self.taken else f"{node}_{port}"
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        self.given[variable] = Variable(role, name, variable.sort)
        return self.given[variable]

    def rename(self, term: Term) -> Term:
        found = {v: self.given[v] for v in free_variables(term) if v in self.given}
        return substitute(term, found)


def _clause(names: _Names, kind: ClauseKind, label: str, original: Clause, term: Term, position: int) -> Clause:
    return Clause(kind, label, position + 1, names.rename(term), original.sentence)
