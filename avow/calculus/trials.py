"""The guarantees from whose failure rates that of a requirement may be composed, if they are sampled.

Trials at 1 m/s do not test a requirement that demands something from 5 m/s on, even if they test a guarantee for all
speeds. So a guarantee is *beyond* a requirement unless each of its trials, as far as its node's ports show, also meets
the requirement's condition (or none can).
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
    return False


def _seen(condition: Term, own: set[Variable]) -> Term:
    """The part of a condition over the ports of a node and the cells of requirements."""

    def shown(term: Term) -> bool:
        return all(v in own or v.name.startswith(OBSERVED) for v in free_variables(term))

    body = condition.body if isinstance(condition, Quantified) and not shown(condition) else condition
    return conjunction(filter(shown, body.items if isinstance(body, And) else (body,)))
