"""What a refinement says, established by the kernel: `Refined` in proofs/instances.dfy.

The refining node stands alone: all inputs are the environment's, of which the refined node's assumptions are assumed;
the refined node's guarantees are what has to be shown.
"""

from __future__ import annotations

from collections.abc import Iterable

from avow.calculus.finder import Finder, Hint
from avow.kernel.certificate import Certificate, How
from avow.kernel.check import Established, Kernel, Refused
from avow.kernel.statements import Claimed, Place, Statement, Wiring, statements
from avow.language.contract import Clause, Node
from avow.language.terms import Role, Term


def established(concrete: Node, abstract: Node) -> tuple[Certificate, dict[tuple[Claimed, str], Established]]:
    """The certificate that was found, and by kind and name what the kernel establishes of the assumptions of the first
    node, and (as requirements) of the guarantees of the second. Types have to be the same in both."""
    at = concrete.name
    known = statements(
        Wiring(
            (concrete,),
            {(Role.OUTPUT, at, p.name): Place(f"{at}.{p.name}", at, 0, p.sort) for p in concrete.outputs}
            | {(Role.INPUT, at, p.name): Place(f"in.{p.name}", None, 0, p.sort) for p in abstract.inputs},
            (
                *_said(Claimed.ENVIRONMENT, at, abstract.assumptions),
                *_said(Claimed.REQUIREMENT, at, abstract.guarantees),
            ),
        )
    )
    given = tuple((f"environment {a.name}", 0) for a in abstract.assumptions)
    hints = {f"{at}.{a.name}": Hint(given) for a in concrete.assumptions}
    goals = tuple(claim for claim in known.every if claim.kind is Claimed.REQUIREMENT)
    finder = Finder(known, "refinement", (at,), lambda _: frozenset(), False, frozenset(), hints, goals=goals)
    certificate = finder.find()
    kernel = Kernel(known, certificate, finder.solvers)
    wanted = [claim for claim in known.every if claim.kind in (Claimed.ASSUMPTION, Claimed.REQUIREMENT)]
    assumed = {claim.digest for claim in known.every if claim.kind is Claimed.ENVIRONMENT}
    found = {(claim.kind, claim.name): _shown(kernel, claim, assumed) for claim in wanted}
    return certificate, {name: one for name, one in found.items() if one is not None}


def _said(kind: Claimed, node: str, clauses: Iterable[Clause]) -> list[tuple[Claimed, str, str, Term]]:
    return [(kind, node, clause.name, clause.formula) for clause in clauses]


def _shown(kernel: Kernel, claim: Statement, assumed: set[str]) -> Established | None:
    """Up to the node's own evidence, and what the refined node assumes."""
    for i, entry in enumerate(kernel.certificate.entries):
        if (entry.how, entry.node, entry.digest) == (How.SHOWN, claim.node, claim.digest):
            try:
                found = kernel.establish(i)
            except Refused:
                continue
            if all(need.kind is How.GUARANTEE or need.digest in assumed for need in found.hypotheses):
                return found
    return None
