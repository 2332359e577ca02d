"""The guarantees from whose failure rates that of a requirement may be composed, if they are sampled.

Trials at 1 m/s do not test a requirement that demands something from 5 m/s on, even if they test a guarantee for all
speeds. So a guarantee is *beyond* a requirement unless each of its trials, as far as its node's ports show, also meets
the requirement's condition (or none can), and unless that condition can arise with each input of a trial: if it is
about a sensor, the sensor's contract may narrow what reaches a node behind it.
"""

from __future__ import annotations

from avow.base.tuning.effort import CONSISTENT_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.entailment import implied
from avow.calculus.variables import OBSERVED, Frame
from avow.formulas.formula import conjunction, free_variables, negation, substitute
from avow.kernel.certificate import How
from avow.kernel.check import Established
from avow.language.contract import Node
from avow.language.sorts import FunctionSort
from avow.language.terms import FALSE, TRUE, And, Quantified, Quantifier, Role, Term, Variable
from avow.sanity.claims import triggers


def composes(frame: Frame, goal: Term, found: Established) -> dict[str, object]:
    """`at_once`: the requirement fails at a step only if a guarantee fails at this step. `beyond`: as above."""
    nodes, asked = frame.system.contract.nodes, triggers(goal)
    remembering = [need.node for need in found.hypotheses if need.kind is How.GUARANTEE]
    return {
        "at_once": found.at_once and not frame.remembering(remembering),
        "beyond": [f"{n.name}.{g.name}" for n in nodes for g in n.guarantees if _beyond(frame, n, g.name, asked)],
    }


def _beyond(frame: Frame, node: Node, clause: str, asked: tuple[Term, ...]) -> bool:
    own = {v for value in frame.mapping(node.name).values() for v in free_variables(value)}
    met = triggers(frame.clause(node.name, clause)) or (TRUE,)
    given = {a.name: frame.clause(node.name, a.name) for a in node.assumptions}

    def meets(condition: Term, claim: Term) -> bool:
        found = implied({**given, "": condition}, claim, effort=CONSISTENT_EFFORT, whether=True)
        return found.verdict is Verdict.PROVED

    for seen in [part for condition in asked if (part := _seen(condition, own)) != TRUE]:
        tried = any(meets(condition, seen) for condition in met)
        if not tried and not all(meets(condition, negation(seen)) for condition in met):
            return True
    apart = (some for condition in asked if (some := _upstream(frame, node, condition, own)) is not None)
    return not all(meets(condition, some) for some in apart for condition in met)


def _upstream(frame: Frame, node: Node, condition: Term, own: set[Variable]) -> Term | None:
    """That a condition about nodes before this one can arise with its inputs, by their contracts; None if it is about
    no such node."""
    before = [frame.node(name) for name in frame.graph.ancestors(node.name, frame.graph.nodes)]
    theirs = {v for n in before for value in frame.mapping(n.name).values() for v in free_variables(value)}
    if free_variables(condition) <= own or theirs.isdisjoint(free_variables(condition)):
        return None
    parts = conjunction((condition, *(frame.clause(n.name, clause.name) for n in before for clause in n.clauses)))
    others = sorted(free_variables(parts) - own, key=str)
    if any(isinstance(v.sort, FunctionSort) for v in others):
        return FALSE  # no quantifier ranges over functions: the trials do not count
    bound = {v: Variable(Role.BOUND, f"some{k}", v.sort) for k, v in enumerate(others)}
    return Quantified(Quantifier.EXISTS, tuple(bound.values()), substitute(parts, bound)) if bound else parts


def _seen(condition: Term, own: set[Variable]) -> Term:
    """The part of a condition over the ports of a node and the cells of requirements."""

    def shown(term: Term) -> bool:
        return all(v in own or v.name.startswith(OBSERVED) for v in free_variables(term))

    body = condition.body if isinstance(condition, Quantified) and not shown(condition) else condition
    return conjunction(filter(shown, body.items if isinstance(body, And) else (body,)))
