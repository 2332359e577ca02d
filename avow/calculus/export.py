"""The derived system-level contract: a contract like any other, so that a composed system can be a node of a larger
one.

Its inputs are what the selected nodes read from outside (and, for delayed edges, the values of the step before); its
outputs are all outputs of these nodes. It assumes what the derivation assumes (and what the derivation shows about the
step before), and guarantees what its nodes guarantee. It is an instance of `Derived` in proofs/instances.dfy:
assumptions that stay open are assumed.
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
    """The contract of the selected nodes together, as one node with the goal's name; subsystems among them are replaced
    by the nodes inside. Raises Rejected if a clause mentions other steps."""
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
    # Assumptions about the step before were shown by induction over the system's own steps; a larger system that feeds
    # the values back has to show them again.
    parts = goal.inner_first()
    delayed = [(part, condition.about) for part in parts for condition in part.conditions if condition.delayed]
    # Assumptions shown with facts about the step before are not shown for values that come in as plain inputs.
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

    def promised(node: str, clause: Clause, position: int) -> Clause:
        term, mapping = frame.clause(node, clause.name), frame.mapping(node)
        made = _clause(names, ClauseKind.GUARANTEE, f"{node}_{clause.name}", clause, term, position)
        over = lambda formula: names.rename(substitute(formula, mapping))  # noqa: E731
        return replace(made, chance=clause.chance and clause.chance.mapped(over))

    guarantees = [promised(n, c, k) for k, (n, c) in enumerate((n, c) for n in nodes for c in frame.node(n).guarantees)]
    label = re.sub(r"\W", "_", goal.name if goal is not composition.whole else frame.system.name)
    whole = Node(label, tuple(inputs.values()), tuple(outputs.values()), (), tuple(assumptions), tuple(guarantees))
    return replace(frame.system.contract, files=(), nodes=(whole,))


def _by_the_step_before(composition: Composition, part: Goal, condition: SideCondition) -> bool:
    """Whether a proof of a side condition may have used the step before; not if one query about one step was enough."""
    answer = composition.known(part).get(condition)
    graph = composition.frame_of(part).graph
    delays = any(e.delayed and {e.source.node, e.target.node} <= set(part.nodes) for e in graph.edges)
    return delays if answer is None else any(case.phase is not Phase.SAME_STEP for case in answer.cases)


def _whatever(term: Term, outputs: set[Variable]) -> Term:
    """An assumption that also mentions values from inside has to hold for all of these. This cannot be expressed for
    relations; then the assumption mentions outputs, and is hard to show."""
    spoken = tuple(v for v in sorted(free_variables(term), key=lambda v: v.name) if v in outputs)
    if not spoken or any(isinstance(v.sort, FunctionSort) for v in spoken):
        return term
    bound = {v: Variable(Role.BOUND, "any_" + re.sub(r"\W", "_", v.name), v.sort) for v in spoken}
    return Quantified(Quantifier.FORALL, tuple(bound.values()), substitute(term, bound))


class _Names:
    """System-level variables as ports of one node; a name that two nodes use is prefixed with its node's name."""

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
