"""The further claims of a system that recorded data of a node can contradict, beside those that a method shows.

A recording or a table is evidence against each claim that it breaks, under whatever method the plan names it: what the
plan assumes of the environment, a requirement whose formula is about one node and one step, another guarantee.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from avow.base.diagnostics import Rejected
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.suggestions import suggest
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.formulas.formula import substitute
from avow.language.contract import Clause, ClauseKind, Node
from avow.language.sorts import BOOL, FunctionSort
from avow.language.subterms import histories, ports_of
from avow.language.terms import History, Not, Past, Term
from avow.system.folding import holders, leaves
from avow.system.formulas import environment_assumptions
from avow.system.graph import dataflow
from avow.system.plan import Requirement, System
from avow.system.temporal import parse_state


@dataclass(frozen=True, slots=True)
class Further:
    """A claim about the ports of one node. As an assumption, `clause` is one of the plan about the environment."""

    node: str
    claim: str
    """Its obligation's id, without the system."""
    clause: Clause
    at_least: str = ""
    """Of a guarantee: the success rate that the plan claims, if a method claims one instead of the guarantee itself."""
    supports: tuple[str, ...] = ()
    """Of a requirement: the node's guarantees under its `supported_by`."""


@by_identity(64)
def of_plan(system: System) -> tuple[Further, ...]:
    """What the plan assumes of the environment, and its requirements that are about one node and one step."""
    try:
        return (*_environment(system), *_requirements(system))
    except Rejected:  # told elsewhere
        return ()


def guarantees(system: System, node: Node, names: Iterable[str] = ()) -> tuple[Further, ...]:
    """The node's guarantees, except those of these names."""
    rates = {
        name: str(method.options.data["at_least"])
        for method in system.plan.node(node.name).methods
        for name in method.guarantees
        if isinstance(method.options.data, Mapping) and "at_least" in method.options.data
    }
    rest = (clause for clause in node.guarantees if clause.name not in {*names} and not clause.unwritten)
    return tuple(Further(node.name, f"{node.name}/{Kind.GUARANTEE}/{c.name}", c, rates.get(c.name, "")) for c in rest)


def assumption(node: str, name: str) -> str:
    """The name of the claim that an assumption of a node holds in the system, whatever discharges it."""
    return f"{node}/{ClauseKind.ASSUMPTION}/{name}"


def unknown_outside(node: Node, names: Iterable[str]) -> Iterator[tuple[str, str, str | None]]:
    """Each name under `outside` that is no assumption and no input of the node, with what is wrong and a hint."""
    known = {clause.name for clause in node.assumptions} | {port.variable.qualified for port in node.inputs}
    for name in names:
        if name not in known:
            yield name, f"{node.name} has no assumption or input {name!r}", suggest(name, sorted(known))


def contradicted(claim: str, summary: str, shown: Counterexample) -> Outcome:
    return Outcome(claim, Verdict.REFUTED, summary, shown)


def _environment(system: System) -> Iterator[Further]:
    graph, contract = dataflow(system), system.contract
    assumed = {each.port: each for each in environment_assumptions(system, graph)}
    for entry in system.plan.environment:
        for at in (end for end in holders(system, graph, entry) if end in graph.environment):
            variable = contract.node(at.node).input(at.port).variable
            found = assumed.get(entry.port)
            if found is not None and (found.node == at.node or {*ports_of(found.formula)} == {variable}):
                yield _further(at.node, ClauseKind.ASSUMPTION, f"environment.{entry.port}", found.formula)
            if entry.constant and not isinstance(variable.sort, FunctionSort):
                same = Not(History(Past.CHANGED, (variable,), BOOL))
                yield _further(at.node, ClauseKind.ASSUMPTION, f"environment.{entry.constancy}", same)


def _requirements(system: System) -> Iterator[Further]:
    for requirement in system.plan.requirements:
        if requirement.formula is None or requirement.probability is not None:  # one row that breaks it refutes nothing
            continue
        formula = parse_state(requirement.formula, system.contract)
        nodes = {port.name.partition(".")[0] for port in ports_of(formula)}
        if len(nodes) == 1 and not histories(formula):
            own = {p: replace(p, name=p.name.partition(".")[2]) for p in ports_of(formula)}
            found = _further(min(nodes), ClauseKind.GUARANTEE, requirement.id, substitute(formula, own))
            yield replace(found, supports=tuple(_supports(system, requirement, system.contract.node(found.node))))


def _supports(system: System, requirement: Requirement, node: Node) -> Iterator[str]:
    derived, inside = {goal.name: goal.select for goal in system.plan.compose}, leaves(system.plan)
    named = [part for name in requirement.supported_by for part in derived.get(name, (name,))]
    whole = any(node.name in inside.get(part, (part,)) for part in named)
    return (c.name for c in node.guarantees if whole or f"{node.name}.{c.name}" in named)


def _further(node: str, kind: ClauseKind, name: str, formula: Term) -> Further:
    assumed = kind is ClauseKind.ASSUMPTION
    claim = f"{SYSTEM_LEVEL}/{Kind.COMPOSITION if assumed else Kind.REQUIREMENT}/{name}"
    return Further(node, claim, Clause(kind, name if assumed else f"requirement {name}", 0, formula))
