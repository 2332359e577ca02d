"""The dependencies between claims: the claims of a case as `Claim`s, from names in the plan and premises of the
calculus."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set

from avow.assurance.facts import Facts
from avow.assurance.findings import accepts, text_mark
from avow.assurance.model import Derivation, Handled, NodeView
from avow.assurance.naming import derivation_claim, is_advice, is_foundation, requirement_claim, sanity_property
from avow.base.remembered import by_identity
from avow.base.verdict import Hypothesis, HypothesisKind, Link, in_words
from avow.evidence.claims import Claim
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.evidence.status import Status, weakest
from avow.system.plan import Requirement


class Names:
    """The claims that the names in a plan or a backend denote."""

    def __init__(self, facts: Facts, certified: Set[str]) -> None:
        """`certified`: obligations whose proofs have a certificate, which names everything that they rest on."""
        self.certified = certified
        self.obligations = {o.id: o for o in facts.obligations}
        self.local = {o.local_id: o.id for o in facts.obligations}
        self.guarantees: dict[str, list[str]] = {node.name: [] for node in facts.nodes}
        self.foundation: dict[str, list[str]] = {node.name: [] for node in facts.nodes}
        self.vacuity: dict[str, list[str]] = {}
        self.clause: dict[str, str] = {}
        self.own: dict[str, list[str]] = {}
        for o in facts.obligations:
            if o.kind is Kind.GUARANTEE:
                self.guarantees.setdefault(o.node, []).append(o.id)
                self.clause[f"{o.node}.{o.name}"] = o.id
            elif is_foundation(o):
                self.foundation.setdefault(o.node, []).append(o.id)
            elif (
                o.kind is Kind.SANITY and sanity_property(o) in ("not-vacuous", "not-tautological") and not is_advice(o)
            ):
                for clause in o.clauses:
                    self.vacuity.setdefault(clause, []).append(o.id)
        self.discharged = {node.name: node.discharged_by for node in facts.nodes}
        self.premises = {derivation.name: derivation.premises for derivation in facts.derivations}
        self.requirements = {r.id for r in facts.requirements}
        for o in facts.obligations:
            if o.kind is Kind.REQUIREMENT:
                for name in (r for r in self.requirements if _belongs(o.name, r)):
                    self.own.setdefault(name, []).append(o.id)
        self.derivations = {d.name for d in facts.derivations}
        self.saying: dict[tuple[str, ...], list[Obligation]] = {}
        for o in self.obligations.values():
            self.saying.setdefault((o.digest, *o.local_id.split("/")[:2]), []).append(o)

    def claims(self, name: str) -> tuple[str, ...] | None:
        """The claims that a name of the plan denotes; None if it denotes nothing."""
        if name in self.derivations:
            return (derivation_claim(name),)
        if name in self.requirements:
            return (requirement_claim(name),)
        if name in self.clause:
            return (self.clause[name],)
        if name in self.guarantees:
            return tuple(self.guarantees[name])
        known = self.obligations.get(name)
        if known is not None:
            return (known.id,)
        return (self.local[name],) if name in self.local else None

    def discharging(self, hypothesis: Hypothesis) -> str | None:
        """The claim that states what a hypothesis states; None if there is none. A claim of the same name with another
        meaning does not match; of several with the same meaning, the one of that name is chosen."""
        if hypothesis.kind is HypothesisKind.ASSUMPTION:
            return assumption_claim(hypothesis)
        saying = self.saying.get((hypothesis.digest, *hypothesis.name.split("/")[:2]), [])
        named = [o for o in saying if o.local_id == hypothesis.name]
        return next((o.id for o in (*named, *saying)), None)

    def behind(self, name: str) -> tuple[str, ...]:
        """The claims that discharge the assumptions of the nodes that a name of the plan denotes: a node keeps its
        guarantees only if these are met, by whatever derivation a requirement uses them."""
        owners, seen, found = [name], set[str](), dict[str, None]()
        while owners:
            owner = owners.pop()
            if owner in seen:
                continue
            seen.add(owner)
            owners += self.premises.get(owner, ())
            node = owner if owner in self.discharged else owner.partition(".")[0]
            if owner not in self.premises:
                found |= dict.fromkeys(self.local.get(at, at) for at in self.discharged.get(node, ()))
        return tuple(found)

    def every_guarantee(self) -> tuple[str, ...]:
        return tuple(name for names in self.guarantees.values() for name in names)


def _belongs(obligation: str, requirement: str) -> bool:
    rest = obligation.removeprefix(requirement)
    return obligation == requirement or (rest != obligation and not (rest[0].isalnum() or rest[0] == "_"))


def assumption_claim(hypothesis: Hypothesis) -> str:
    """One claim for each assumption, whatever rests on it."""
    return f"assumption:{hypothesis.name}:{text_mark(hypothesis)}"


def assumption_claims(hypotheses: Iterable[Hypothesis], accepted: Iterable[Handled]) -> Iterable[Claim]:
    """The assumptions that a person has to accept: justified if a person has (``accepted: {obligation:
    agent/assumption/…, verdict: missing, found: …}``) and still does, else missing."""
    taken = [f for f in accepted if f.how == "accepted" and f.verdict == Status.MISSING and not f.expired]
    found = {h: None for h in hypotheses if h.kind is HypothesisKind.ASSUMPTION}
    for hypothesis in found:
        given = any(accepts(f.pattern, f.found, hypothesis) for f in taken)
        status = Status.JUSTIFIED if given else Status.MISSING
        yield Claim(assumption_claim(hypothesis), status, link=Link.GUIDED if given else None)


def obligation_claim(
    obligation: Obligation,
    status: Status,
    rests_on: Sequence[Hypothesis],
    hypotheses: Sequence[str],
    link: Link | None,
    names: Names,
) -> Claim:
    """An obligation rests on its evidence; a guarantee also on the sanity of its node's contract; and both on what the
    evidence rests on. Within limits it is `checked` at most. A hypothesis that no claim of the case discharges is an
    error; a remark in words is a hypothesis too, even if its words are a claim's id."""
    rests: list[str] = []
    if obligation.kind is Kind.GUARANTEE:
        rests += names.foundation.get(obligation.node, [])
        rests += names.vacuity.get(f"{obligation.node}.{obligation.name}", [])
    elif obligation.kind is Kind.REQUIREMENT:
        rests += [names.clause[clause] for clause in obligation.clauses if clause in names.clause]
    if status.supports and any(h.kind is HypothesisKind.BOUND for h in rests_on):
        status = weakest((status, Status.CHECKED)) or status
    for hypothesis in rests_on:
        if hypothesis.kind is HypothesisKind.BOUND:
            continue
        found = names.discharging(hypothesis)
        if found is None:
            status = weakest((status, Status.ERROR)) or Status.ERROR
        else:
            rests.append(found)
    return Claim(obligation.id, status, tuple(dict.fromkeys(rests)), in_words(rests_on, hypotheses), link)


def requirement_support(requirement: Requirement, names: Names) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The claims that a requirement rests on, and the names under `supported_by` that denote nothing."""
    rests: list[str] = list(names.own.get(requirement.id, ()))
    unknown = []
    for name in requirement.supported_by:
        found = names.claims(name)
        if found is None:
            unknown.append(name)
        else:
            rests += found
            rests += names.behind(name)
    own = names.own.get(requirement.id, ())
    named = requirement.supported_by or any(names.obligations[o].clauses for o in own)
    certified = bool(own) and names.certified >= set(own)
    # a property of runs is about the composition of all nodes, whatever the plan names; and if nothing says which
    # guarantees a formula was discharged on, it rests on all
    if requirement.temporal or (requirement.formula and not named and not certified):
        rests += names.every_guarantee()
    return tuple(dict.fromkeys(rests)), tuple(unknown)


def requirement_claim_of(requirement: Requirement, names: Names, statuses: Mapping[str, Status]) -> Claim:
    """Its own obligations are the requirement itself (a refutation of one refutes it); the rest is what it rests on."""
    rests, unknown = requirement_support(requirement, names)
    formal = bool(requirement.formula or requirement.temporal)
    own = weakest(statuses[name] for name in names.own.get(requirement.id, ()))
    if (formal and own is None) or unknown or not rests or requirement.outdated:
        own = weakest((Status.MISSING, *([own] if own else ())))
    return Claim(requirement_claim(requirement.id), own, rests, prose=not formal)


def derivation_claims(facts: Facts, names: Names) -> Iterable[Claim]:
    """A derivation rests on its side conditions, and on the guarantees of the nodes (or derivations) it combines."""
    for derivation in facts.derivations:
        rests: list[str] = [condition.obligation for condition in derivation.side_conditions if condition.obligation]
        rests += [names.local[text] for text in derivation.conditional if text in names.local]
        lost = False
        for premise in derivation.premises:
            found = names.claims(premise)
            rests += found or ()
            lost = lost or found is None
        own = Status.MISSING if lost or not rests else None
        yield Claim(
            derivation_claim(derivation.name), own, tuple(dict.fromkeys(rests)), open_conditions(derivation, names)
        )


def open_conditions(derivation: Derivation, names: Names) -> tuple[str, ...]:
    """The conditions of a derivation that have no obligation to discharge them."""
    return tuple(text for text in derivation.conditional if text not in names.local)


def criticality(obligation: Obligation, facts: Facts) -> str:
    """The node's; a claim of no single node is as critical as the most critical node."""
    known, highest = _criticalities(facts.nodes)
    return known.get(obligation.node, highest if obligation.node == SYSTEM_LEVEL else "medium")


@by_identity(16)
def _criticalities(nodes: tuple[NodeView, ...]) -> tuple[Mapping[str, str], str]:
    """The criticality of each node, and the highest."""
    known = {node.name: node.criticality for node in nodes}
    present = set(known.values())
    return known, next((level for level in ("high", "medium", "low") if level in present), "medium")
