"""The derived system-level contract: a contract like any other; a composed system can be a node of a larger one.

Its inputs are what the selected nodes read from outside (and, for delayed edges, the values of the step before); its
outputs are all that they put out; it assumes what the derivation assumes (and what it shows of the step before), and
guarantees what its nodes guarantee. What it says is `Derived` in proofs/instances.dfy: what stays open is assumed.
"""

from __future__ import annotations

import re
from dataclasses import replace

from avow.base.diagnostics import Diagnostic, Rejected
from avow.calculus.composition import Composition
from avow.calculus.derivation import Goal, Phase, SideCondition
from avow.calculus.subsystem_contracts import carried, innermost
from avow.formulas.formula import free_variables, substitute
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.sorts import FunctionSort
from avow.language.subterms import histories
from avow.language.terms import Quantified, Quantifier, Role, Term, Variable
from avow.system.plan import Endpoint


def derived_contract(composition: Composition, goal: Goal) -> Contract:
    """The contract of the selected nodes taken together, as one node with the goal's name; of subsystems among them,
    the nodes inside count. Raises Rejected for a clause that speaks of other steps."""
    frame = composition.frame
    nodes = composition.leaves(goal, goal.nodes)
    for owner in nodes:
        for clause in frame.system.contract.node(owner).clauses:
            for record in histories(clause.formula)[:1]:
                what = f"{owner}.{clause.name} speaks of other steps (`{record.operator}`)"
                raise Rejected(Diagnostic("PLAN135", f"{what}, and no contract is derived of it", clause.span))
    names = _Names()
    outputs: dict[str, Port] = {}
    for node in nodes:
        for port in frame.node(node).outputs:
            variable = frame.output(node, port.name)
            fresh = names.give(variable, Role.OUTPUT, node, port.name)
            outputs[fresh.name] = Port(Role.OUTPUT, fresh.name, port.sort, port.type_name)
    inputs: dict[str, Port] = {}
    for node in nodes:
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
    parts = goal.inner_first()
    delayed = [(part, condition.about) for part in parts for condition in part.conditions if condition.delayed]
    # What was shown with the help of the step before is not shown of values that merely come in as such.
    apart_from_before = {
        (part, condition.about)
        for part in parts
        for condition in part.conditions
        if not condition.delayed and _by_the_step_before(composition, part, condition)
    }
    delayed += sorted(apart_from_before, key=lambda each: (each[0].name, str(each[1])))
    for part, name in dict.fromkeys([*((goal, name) for name in goal.root.assumed), *delayed]):
        level = composition.frame_of(part)
        original = level.node(name.node).clause(name.clause)
        apart = name in part.root.assumed and goal.name in composition.around.values()
        apart = apart or (part, name) in apart_from_before
        term = carried(level, part, name) if apart else level.clause(name.node, name.clause)
        label = re.sub(r"\W", "_", innermost(str(name)))
        if apart:
            term = _whatever(term, {v for v in names.given if names.given[v].role is Role.OUTPUT})
        assumptions.append(_clause(names, ClauseKind.ASSUMPTION, label, original, term, len(assumptions)))
    used = {port for part in parts for condition in part.conditions for port in condition.environment}
    for assumed in frame.assumed:
        if assumed.port in used:
            term = substitute(assumed.formula, frame.mapping(assumed.node))
            label = re.sub(r"\W", "_", f"environment_{assumed.port}")
            blank = Clause(ClauseKind.ASSUMPTION, label, 0, term, assumed.because or None)
            assumptions.append(_clause(names, ClauseKind.ASSUMPTION, label, blank, term, len(assumptions)))
    guarantees = [
        _clause(names, ClauseKind.GUARANTEE, f"{node}_{clause.name}", clause, frame.clause(node, clause.name), k)
        for k, (node, clause) in enumerate((n, c) for n in nodes for c in frame.node(n).guarantees)
    ]
    label = re.sub(r"\W", "_", goal.name if goal is not composition.whole else frame.system.name)
    whole = Node(label, tuple(inputs.values()), tuple(outputs.values()), (), tuple(assumptions), tuple(guarantees))
    return replace(frame.system.contract, files=(), nodes=(whole,))


def _by_the_step_before(composition: Composition, part: Goal, condition: SideCondition) -> bool:
    """Whether a proof of a side condition may have used it: not where one question about one step was enough."""
    answer = composition.known(part).get(condition)
    graph = composition.frame_of(part).graph
    delays = any(e.delayed and {e.source.node, e.target.node} <= set(part.nodes) for e in graph.edges)
    return delays if answer is None else any(case.phase is not Phase.SAME_STEP for case in answer.cases)


def _whatever(term: Term, outputs: set[Variable]) -> Term:
    """What a subsystem assumes of values from inside as well is to hold whatever these are. One cannot say so of
    relations; then the assumption speaks of outputs, and is hard to show."""
    spoken = tuple(v for v in sorted(free_variables(term), key=lambda v: v.name) if v in outputs)
    if not spoken or any(isinstance(v.sort, FunctionSort) for v in spoken):
        return term
    bound = {v: Variable(Role.BOUND, "any_" + re.sub(r"\W", "_", v.name), v.sort) for v in spoken}
    return Quantified(Quantifier.FORALL, tuple(bound.values()), substitute(term, bound))


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
