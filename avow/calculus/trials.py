"""What the failure rate of a requirement may be composed of, where guarantees beneath it are sampled.

A requirement that demands something from 5 m/s on is not tried by trials at 1 m/s, whatever a guarantee for all speeds
says of them. So a guarantee is *beyond* a requirement unless each of its trials, as far as its node's ports show it,
meets the requirement's condition too (or none can).
"""

from __future__ import annotations

from avow.base.tuning.effort import CONSISTENT_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.entailment import implied
from avow.calculus.variables import OBSERVED, Frame
from avow.formulas.formula import conjunction, free_variables, negation
from avow.kernel.certificate import How
from avow.kernel.check import Established
from avow.language.contract import Node
from avow.language.terms import TRUE, And, Quantified, Term, Variable
from avow.sanity.claims import triggers


def composes(frame: Frame, goal: Term, found: Established) -> dict[str, object]:
    """`at_once`: the requirement fails at a step only where a guarantee does at this step. `beyond`: as above."""
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
        return implied({**given, "": condition}, claim, effort=CONSISTENT_EFFORT).verdict is Verdict.PROVED

    for seen in [part for condition in asked if (part := _seen(condition, own)) != TRUE]:
        tried = any(meets(condition, seen) for condition in met)
        if not tried and not all(meets(condition, negation(seen)) for condition in met):
            return True
    return False


def _seen(condition: Term, own: set[Variable]) -> Term:
    """What of a condition the ports of a node show, with all that is remembered for the requirement only."""

    def shown(term: Term) -> bool:
        return all(v in own or v.name.startswith(OBSERVED) for v in free_variables(term))

    body = condition.body if isinstance(condition, Quantified) and not shown(condition) else condition
    return conjunction(filter(shown, body.items if isinstance(body, And) else (body,)))
