"""Can the nodes that feed an input ever satisfy what the consumer assumes about it?

A side condition of the calculus asks whether the providers' guarantees *imply* an assumption. This module asks an
earlier question: are they consistent with it? If they contradict it, no implementation of the providers makes the
consumer's contract apply, and verifying against that contract is pointless. This is a sanity claim of the consumer that
only the whole system can decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from itertools import chain
from typing import assert_never

from avow.base.diagnostics import Severity
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.verdict import Outcome, Verdict
from avow.calculus.variables import Frame, bearing, indexed
from avow.formulas.formula import digest, free_variables
from avow.formulas.temporal.cell import CELL
from avow.language.contract import Clause, Node
from avow.language.printer import show_term
from avow.language.subterms import ports_of
from avow.language.terms import TRUE, Term
from avow.sanity.claims import Claim, Property
from avow.sanity.results import Bounds, Finding, SanityResult, as_outcome, listing
from avow.solving.questions import solve
from avow.solving.second import CONTRADICTED, doubted
from avow.solving.sizes import in_every_size
from avow.system.plan import Endpoint


@dataclass(frozen=True, slots=True)
class ProviderClaim:
    """The claim that an assumption is consistent with the providers of its inputs."""

    claim: Claim
    digest: str
    """SHA-256 of the assumption, the providers' contracts and the plan's environment assumptions."""
    assumed: Mapping[str, Term]
    """The assumption, and the plan's environment assumptions that bear on it, by label."""
    promised: tuple[Mapping[str, Term], ...]
    """The contracts of the providers of its inputs, each by ``node.clause``."""
    first: Mapping[str, Term] = field(default_factory=dict)
    """The initial values of all cells that these formulas mention."""

    @property
    def clause(self) -> str:
        """The assumption's name."""
        return self.claim.subject or ""

    @property
    def is_whole(self) -> bool:
        """Whether the digest is that of the formulas."""
        return self.digest == _meaning({**self.assumed, **self.first}, (indexed(part).digest for part in self.promised))

    @property
    def formulas(self) -> dict[str, Term]:
        """All formulas that have to hold together."""
        return dict(chain.from_iterable(part.items() for part in (self.assumed, *self.promised)))


def provider_claims(whole: Frame, node: Node) -> tuple[ProviderClaim, ...]:
    """A claim for each assumption of a node about a connected input."""
    found = (_claim(whole, node, clause) for clause in node.assumptions if clause.formula != TRUE)
    return tuple(claim for claim in found if claim is not None)


def settle(claims: Sequence[ProviderClaim], node: Node, bounds: Bounds) -> tuple[SanityResult, ...]:
    """Check whether the assumptions can be met."""
    return tuple(_settle(claim, node, bounds) for claim in claims)


def outcomes(node: Node, obligations: Mapping[str, ProviderClaim], bounds: Bounds) -> tuple[Outcome, ...]:
    """For the pipeline: one outcome for each obligation id."""
    return tuple(
        as_outcome(identity, node.name, asked.claim.name, _settle(asked, node, bounds))
        for identity, asked in obligations.items()
    )


def _claim(whole: Frame, node: Node, clause: Clause) -> ProviderClaim | None:
    edges = [
        edge
        for port in ports_of(clause.formula)
        if (edge := whole.graph.by_target.get(Endpoint(node.name, port.name))) is not None
    ]
    if not edges:
        return None
    about = f"{node.name}.{clause.name}"
    given = {(e.source.node, int(e.delayed)): whole.promised(e.source.node, int(e.delayed)) for e in edges}
    goal = whole.clause(node.name, clause.name)
    spoken = free_variables(goal)
    if whole.environment() or whole.blank():  # otherwise not needed, and slow with many consumers
        spoken = spoken.union(*(p.speaking for p in given.values()))
    # facts without a connection to these variables cannot exclude anything here
    assumed = {about: goal} | bearing(whole.environment(), spoken)
    providers = tuple(dict.fromkeys(provider for provider, _ in given))
    names = " and ".join(providers)
    verb = "guarantees" if len(providers) == 1 else "guarantee"
    claim = Claim(
        Property.MEETABLE,
        clause.name,
        f"What {names} {verb} can meet assumption {clause.name} of {node.name}.",
        show_term(clause.formula),
        sum((_guarantees(whole.node(p)) for p in providers), (about,)),
        Severity.ERROR,
        clause.span,
    )
    first = {label: fact for label, fact in whole.blank().items() if not spoken.isdisjoint(free_variables(fact))}
    meaning = _meaning({**assumed, **first}, (p.digest for p in given.values()))
    return ProviderClaim(claim, meaning, assumed, tuple(p.terms for p in given.values()), first)


@by_identity(20_000)
def _guarantees(node: Node) -> tuple[str, ...]:
    """The names of a node's guarantees; cached, as many consumers may read them."""
    return tuple(f"{node.name}.{clause.name}" for clause in node.guarantees)


def _meaning(assumed: Mapping[str, Term], promised: Iterable[str]) -> str:
    """`promised`: the providers' digests (`avow.calculus.variables.Facts.digest`)."""
    meanings = sorted(f"{label} {digest(fact)}" for label, fact in assumed.items())
    return sha256("\n".join(["providers", *meanings, *sorted(promised)]))


def _settle(asked: ProviderClaim, node: Node, bounds: Bounds) -> SanityResult:
    claim = asked.claim
    about = f"{node.name}.{asked.clause}"
    answer = solve(asked.formulas, effort=bounds.effort, seed=bounds.seed, values="unused")
    because = None
    match answer.status:
        case "sat" if any(CELL in v.name for f in asked.formulas.values() for v in free_variables(f)):
            begun = solve({**asked.formulas, **asked.first}, effort=bounds.effort, seed=bounds.seed, values="unused")
            verdict, text = Verdict.PROVED, "at the first step of a run"
            if begun.status != "sat":
                verdict, text = Verdict.UNKNOWN, "not at the first step of a run; whether at a later one is not asked"
        case "sat":
            what = f"{about} and what its providers guarantee"
            verdict, text = in_every_size({}, asked.formulas, what=what, effort=bounds.effort, seed=bounds.seed)
        case "unsat" if doubted(answer, asked.formulas):
            verdict, text = Verdict.ERROR, CONTRADICTED
        case "unsat" if about in answer.core:
            others = [label for label in answer.core if label != about]
            verb = "excludes" if len(others) == 1 else "exclude"
            verdict, text = Verdict.REFUTED, f"no provider can meet it: {listing(others)} {verb} it"
        case "unsat":
            # The providers' own contracts are inconsistent: a finding about them.
            verdict, text = Verdict.REFUTED, f"{listing(answer.core)} cannot hold together: no value comes from there"
            because = f"{answer.core[0].partition('.')[0]}/consistent"
        case "unknown":
            verdict, text = Verdict.UNKNOWN, answer.reason
        case _:
            assert_never(answer.status)
    core = answer.core if verdict is Verdict.REFUTED else ()
    found = Finding(verdict, text, core, because=because, engine=answer.engine)
    return SanityResult.of(node.name, claim, found, answer.seconds)
