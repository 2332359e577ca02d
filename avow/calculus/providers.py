"""Can what a node assumes of its inputs ever come from the nodes that they are connected to?

A side condition of the calculus asks whether the providers' guarantees *imply* an assumption. Here is the question
before that one: do they leave room for it? If they contradict it, then no implementation of the providers makes the
consumer's contract apply, and verifying against that contract is in vain. It is a sanity claim of the consumer that
only the whole system can settle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from avow.base.diagnostics import Severity
from avow.base.files import digest as sha256
from avow.base.verdict import Outcome, Verdict
from avow.calculus.variables import Frame, frame
from avow.formulas.formula import digest
from avow.language.contract import Clause, Node
from avow.language.printer import show_term
from avow.language.terms import TRUE, Term
from avow.sanity.analysis import Bounds, SanityResult, as_outcome, listing
from avow.sanity.claims import Claim, Property
from avow.solving.questions import solve
from avow.system.formulas import ports_of
from avow.system.plan import Endpoint, System


@dataclass(frozen=True, slots=True)
class ProviderClaim:
    """That the providers of an assumption's inputs leave room for it."""

    claim: Claim
    digest: str
    """SHA-256 of the assumption, the providers' contracts and what the plan assumes of the environment."""
    clause: str
    """The assumption's name."""
    formulas: Mapping[str, Term]
    """The assumption and all that is promised of its inputs, by ``node.clause``."""
    providers: tuple[str, ...]


def provider_claims(system: System, node: Node) -> tuple[ProviderClaim, ...]:
    """A claim for each assumption of a node that says something of a connected input. Raises Rejected where the plan's
    formulas are wrong."""
    if not node.assumptions:
        return ()
    whole = frame(system)
    found = (_claim(whole, node, clause) for clause in node.assumptions if clause.formula != TRUE)
    return tuple(claim for claim in found if claim is not None)


def settle(claims: Sequence[ProviderClaim], node: Node, bounds: Bounds) -> tuple[SanityResult, ...]:
    """Ask whether the assumptions can be met."""
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
    formulas = {about: whole.clause(node.name, clause.name)}
    for edge in edges:
        provider, earlier = edge.source.node, 1 if edge.delayed else 0
        for given in whole.node(provider).clauses:
            formulas.setdefault(_label(provider, given, earlier), whole.clause(provider, given.name, earlier))
    formulas |= whole.environment()
    providers = tuple(dict.fromkeys(edge.source.node for edge in edges))
    names = " and ".join(providers)
    verb = "guarantees" if len(providers) == 1 else "guarantee"
    claim = Claim(
        Property.UNMEETABLE,
        clause.name,
        f"What {names} {verb} can meet assumption {clause.name} of {node.name}.",
        show_term(clause.formula),
        (about, *(f"{p}.{g.name}" for p in providers for g in whole.node(p).guarantees)),
        Severity.ERROR,
        clause.span,
    )
    meaning = sha256("\n".join(["providers", *sorted(f"{label} {digest(f)}" for label, f in formulas.items())]))
    return ProviderClaim(claim, meaning, clause.name, formulas, providers)


def _label(provider: str, clause: Clause, earlier: int) -> str:
    return f"{provider}.{clause.name}" + (" one step before" if earlier else "")


def _settle(asked: ProviderClaim, node: Node, bounds: Bounds) -> SanityResult:
    claim = asked.claim
    about = f"{node.name}.{asked.clause}"
    answer = solve(asked.formulas, timeout_ms=bounds.milliseconds, seed=bounds.seed, shown=False)
    because = None
    match answer.status:
        case "sat":
            verdict, text = Verdict.PROVED, ""
        case "unsat" if about in answer.core:
            others = [label for label in answer.core if label != about]
            verdict, text = Verdict.REFUTED, f"no provider can meet it: {listing(others)} {_exclude(others)} it"
        case "unsat":
            # The providers' own contracts leave no room for anything: a finding of theirs.
            verdict, text = Verdict.REFUTED, f"{listing(answer.core)} cannot hold together: no value comes from there"
            because = f"{_owner(answer.core)}/consistent"
        case _:
            verdict, text = Verdict.UNKNOWN, answer.reason
    return SanityResult(
        node.name,
        claim.about,
        claim.subject,
        claim.name,
        claim.sentence,
        verdict,
        claim.severity,
        answer.core if verdict is Verdict.REFUTED else (),
        None,
        text,
        because=because,
        engine=answer.engine,
        seconds=answer.seconds,
        span=claim.span,
    )


def _exclude(labels: Sequence[str]) -> str:
    return "excludes" if len(labels) == 1 else "exclude"


def _owner(labels: Iterable[str]) -> str:
    return next(iter(labels)).partition(".")[0]
