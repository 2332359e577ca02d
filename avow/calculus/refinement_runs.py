"""Refinement where clauses speak of other steps: of every run, by induction over steps.

The refining node stands alone in a system, of whose environment the refined node's assumptions are assumed. First its
assumptions are required, of whatever it puts out: its guarantees hold only where these do, and may not be used. Then
the refined node's guarantees are required of what it guarantees, where all assumptions of both hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from avow.base.verdict import Verdict
from avow.calculus.certificates import requirement_scope
from avow.calculus.composition import Composition, composed_over
from avow.calculus.discharge import Bounds
from avow.calculus.questions import Answer
from avow.calculus.requirements import formula_question
from avow.calculus.variables import framed
from avow.formulas.formula import substitute
from avow.kernel.certificate import Certificate, How
from avow.kernel.statements import Claimed
from avow.language.contract import Clause, Contract, Node
from avow.language.subterms import ports_of
from avow.language.terms import Role, Term, Variable
from avow.system.formulas import Assumed
from avow.system.graph import dataflow
from avow.system.plan import System
from avow.system.plan_file import bare_plan


def answered(concrete: Node, abstract: Node, bounds: Bounds) -> tuple[tuple[Answer, ...], tuple[Certificate, ...]]:
    """For each assumption of the first node, then each guarantee of the second, whether it follows; and what the kernel
    established it from. The types of both are the same."""
    alone = replace(concrete, inputs=abstract.inputs, topics=(), assumptions=())
    given = abstract.assumptions
    certificates: list[Certificate] = []
    first = [
        _of_inputs(clause, answer)
        for clause, answer in zip(
            concrete.assumptions,
            _required(replace(alone, guarantees=()), given, concrete.assumptions, bounds, certificates),
            strict=True,
        )
    ]
    then = _required(alone, (*given, *concrete.assumptions), abstract.guarantees, bounds, certificates)
    return (*first, *then), tuple(certificates)


def _required(
    node: Node, assumed: Sequence[Clause], wanted: Sequence[Clause], bounds: Bounds, certificates: list[Certificate]
) -> list[Answer]:
    """Whether the node has what is wanted where something is assumed."""
    if not wanted:
        return []
    system = System(bare_plan(node.name, ()), Contract((), (), (), (node,)))
    supposed = [Assumed(f"{k} {clause.name}", node.name, clause.formula, "", "") for k, clause in enumerate(assumed)]
    required = {clause.name: _placed(node.name, clause.formula) for clause in wanted}
    composition = composed_over(framed(system, dataflow(system), supposed, required))
    support = tuple(f"{node.name}.{clause.name}" for clause in node.guarantees)
    answers = []
    for clause in wanted:
        answer = formula_question(composition.frame, clause.name, support)(composition, bounds)
        answers.append(_alone(composition, answer))
        kept = composition.certificates.made.get(requirement_scope(clause.name))
        if answers[-1].verdict is Verdict.PROVED and kept is not None:
            certificates.append(kept)
    return answers


def _of_inputs(clause: Clause, answer: Answer) -> Answer:
    """An assumption of what the node itself has put out may hold of what it guarantees: no run without that refutes."""
    if answer.verdict is not Verdict.REFUTED or all(v.role is Role.INPUT for v in ports_of(clause.formula)):
        return answer
    return Answer(Verdict.UNKNOWN, "it speaks of what the node has put out, of which its guarantees were not used")


def _placed(node: str, formula: Term) -> Term:
    """A clause's formula over ``node.port``, as a requirement's is."""
    ports: Mapping[Variable, Variable] = {v: replace(v, name=f"{node}.{v.name}") for v in ports_of(formula)}
    return substitute(formula, ports)


def _alone(composition: Composition, answer: Answer) -> Answer:
    """A proof that rests on what the node guarantees and on what is assumed, and on nothing else."""
    if answer.verdict is not Verdict.PROVED:
        return answer
    assumed = {claim.digest for claim in composition.certificates.known.every if claim.kind is Claimed.ENVIRONMENT}
    hypotheses = answer.established.hypotheses if answer.established is not None else ()
    others = [need for need in hypotheses if need.kind is not How.GUARANTEE and need.digest not in assumed]
    if answer.established is not None and not others:
        return answer
    return replace(answer, verdict=Verdict.UNKNOWN, summary="the proof rests on more than the contracts say")
