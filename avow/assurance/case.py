"""Building THE case object: a pure function of obligations, ledger records and the plan.

The pipeline calls, once a system:

    ledger = Ledger(workspace.ledger(system.name))
    facts = facts_of_system(
        system,
        obligations,                       # every Obligation of the system, of every kind
        ledger.records(),                  # every Entry, oldest first; current, stale and superseded alike. The
                                           # case keeps some of them: `avow.assurance.history`
        keys={(obligation.id, method_id): key},   # one item for each attempt that the plan asks for NOW; `key` as
                                           # computed now. No item: no method is planned (missing, or withdrawn).
        today=date,                        # passed in: nothing here reads a clock
        run=RunInfo(...),
        derivations=(Derivation(...), …),  # what the calculus derived (view dataclass in avow.assurance.model)
        methods=(MethodInfo(...), …),      # the backends known: for suggestions and for "what green means"
        tools=(ToolInfo(...), …),
        discrepancies=audit(ledger, root, system=…, obligations={o.id: o.digest …}, keys=keys),
                                           # avow.evidence.audit; None: not audited (then never CERTIFIED)
        digests={"contracts/x/plan.yaml": sha256, …},
        ledger_head=ledger.head,
        graph_svg="<svg…>",
        sources={"contracts/x/system.rcl": "the text…"},  # the texts behind `digests`
    )
    case = conclude(facts)
    render_all(case, workspace.report(system.name))
    exit code: case.exit_code

Raises `Rejected` for a policy that cannot be used (call `avow.assurance.policy.read_policy(plan.policy)` when the plan
is loaded, so that this is raised early).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date

from avow.assurance.answers import EARLIER, Changes
from avow.assurance.assumptions import Statements, assumptions
from avow.assurance.certification import Grade, ProofView, proof_views, standing, trusted_base
from avow.assurance.changes import changes
from avow.assurance.closure import Closure
from avow.assurance.deficits import deficits
from avow.assurance.facts import Facts, facts_of_case
from avow.assurance.findings import handle
from avow.assurance.first_screen import answers, felled, weakest_of, with_signature
from avow.assurance.gap import counted, independent, missing_tools
from avow.assurance.gates import exit_code, gates, grants, suggestion_for
from avow.assurance.mitigated import hazard_views
from avow.assurance.model import (
    Case,
    Currency,
    Derivation,
    DerivationView,
    EvidenceView,
    ObligationView,
    OpenItem,
    RunInfo,
)
from avow.assurance.naming import derivation_claim, sanity_property, short
from avow.assurance.relied import relied_upon
from avow.assurance.remarks import remarks
from avow.assurance.requirement_views import failing_of, held, requirement_view
from avow.assurance.risk_gates import standard_gate
from avow.assurance.standards import standard_view
from avow.assurance.summary import open_items
from avow.assurance.support import (
    Names,
    assumption_claims,
    criticality,
    derivation_claims,
    obligation_claim,
    open_conditions,
    requirement_claim_of,
)
from avow.assurance.trust import trust_lines
from avow.base.plain import count
from avow.base.verdict import Link, Verdict
from avow.evidence.claims import Claim, Standing, judge
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Kind, Obligation
from avow.evidence.record import AGAINST, OUTPUT_FOR_EVERY_INPUT, Evidence
from avow.evidence.status import Status, behind, best_link, effective, roll_up, weigh


def conclude_again(case: Case) -> Case:
    """The case that follows from a case's facts: equal to it, unless its conclusions were edited."""
    return conclude(facts_of_case(case))


def as_of_earlier(case: Case) -> Case:
    """A case whose system cannot be read now: the same facts, and a gate that fails for this reason."""
    return conclude(replace(facts_of_case(case), earlier=True))


def as_of(case: Case, today: date) -> Case:
    """The same facts on another day: assumptions, reviews and accepted risks expire."""
    return case if case.today == today.isoformat() else conclude(replace(facts_of_case(case), today=today))


def conclude(facts: Facts) -> Case:
    """Everything that follows from the facts. Pure: same facts, same case."""
    evidence, orphans = _evidence(facts)
    counting = {name: tuple(v.entry for v in views if v.counts) for name, views in evidence.items()}
    statuses = {o.id: _status(counting[o.id], outdated=bool(evidence[o.id])) for o in facts.obligations}
    statuses |= {o.id: Status.UNWRITTEN for o in facts.obligations if o.unwritten}
    by_program = shown_by_programs(facts.obligations, statuses, counting)
    statuses |= {name: status for name, (status, _) in by_program.items()}
    findings = (
        *handle("expected", facts.expected or (), facts.obligations, statuses, counting, facts.today),
        *handle("accepted", facts.accepted, facts.obligations, statuses, counting, facts.today),
    )
    names = Names(facts, {name for name, entries in counting.items() if _is_certified(entries)})
    resting = {o.id: behind(e.evidence for e in counting[o.id]) for o in facts.obligations}
    claims = [
        obligation_claim(o, statuses[o.id], *resting[o.id], _link(counting[o.id]), names) for o in facts.obligations
    ]
    claims += assumption_claims((h for o in facts.obligations for h in resting[o.id][0]), findings)
    claims += [requirement_claim_of(r, names, statuses) for r in facts.requirements]
    claims += derivation_claims(facts, names)
    standings = judge(claims)
    granted = _granted(claims, standings, facts)
    rests = {claim.id: claim.rests_on for claim in claims}
    handled = {name: f.how for f in findings if not f.expired for name in f.obligations}
    views = tuple(
        _obligation(o, facts, evidence[o.id], statuses[o.id], standings[o.id], claim, handled.get(o.id, ""))
        for o, claim in zip(facts.obligations, claims, strict=False)  # the first claims are theirs
    )
    said = Statements(facts.statements, facts.today)
    programs = [v for v in views if v.obligation.kind is Kind.PROGRAM]
    relied = {v.id: r for v in views if (r := relied_upon(v, said.judge, programs))}
    closure = Closure(views, facts.nodes, rests, standings, relied)
    closed = {r.id: closure.of_requirement(r.id) for r in facts.requirements}
    leaves = [v.id for v in views if v.obligation.kind in (Kind.GUARANTEE, Kind.PROGRAM)]
    whole = closure.of([*leaves, *(v.id for v in views if v.status is Status.JUSTIFIED)])
    supposed = assumptions(facts, views, relied, closed, whole, said)
    by_id, titles = {view.id: view for view in views}, {node.name: node.title for node in facts.nodes}
    requirements = tuple(
        held(requirement_view(r, names, standings, statuses), closed[r.id], by_id, relied, supposed, titles)
        for r in facts.requirements
    )
    levels = {name: r.level for r in requirements for name in r.obligations}
    views = tuple(replace(view, level=levels[view.id]) if view.id in levels else view for view in views)
    derived = tuple(_derivation(d, standings, rests, names) for d in facts.derivations)
    fresh, freshness = _fresh(facts, views)
    proofs = proof_views(views, facts.kernel, facts.run.id)
    grade, reason = _grade(facts, proofs)
    hazards = hazard_views(facts.hazards, requirements, by_id, relied, closure, supposed, facts.nodes, said.judge)
    found = gates(facts, views, requirements, derived, hazards, findings, proofs, relied, fresh, granted)
    standard = None
    if facts.policy.standard:
        standard = standard_view(
            facts.policy.standard, facts.policy.level, found, requirements, views, hazards, supposed
        )
        found = (*found, standard_gate(standard))
    listed = (
        *open_items(facts, views, requirements, derived, findings),
        *(OpenItem("program", name, text, advice=True) for name, (_, text) in by_program.items()),
        *remarks(facts.sources, views),
    )
    single = _single(views, facts)
    weakened = deficits(views, requirements, supposed, listed, findings, relied, single, hazards, missing_tools(facts))
    basis = {n for c in closed.values() for n in c.claims} if closed else set(whole.claims)
    basis |= {n for h in hazards for n in h.closure}
    lost = sorted({n for c in closed.values() for n in c.failing} | {n for h in hazards for n in h.failing})
    wrong = [view.id for view in felled(views)][:1]
    weakest = failing_of(wrong, wrong or lost, by_id, titles) or weakest_of(basis, by_id, relied, titles)
    following = weakest_of(basis - {weakest.claim}, by_id, relied, titles) if weakest else None
    if weakest is not None:
        needing = tuple(r.id for r in requirements if weakest.claim in r.closure)
        dangers = tuple(h.hazard.id for h in hazards if weakest.claim in h.closure)
        weakest = replace(weakest, needed_by=(*needing, *dangers))
    code = exit_code(found)
    told = answers(
        requirements,
        facts.nodes,
        views,
        relied,
        supposed,
        weakened,
        found,
        weakest,
        following,
        sum(view.obligation.kind is Kind.GUARANTEE and view.id not in basis for view in views),
        trust_lines(proofs, facts.kernel, supposed, views, facts.run.id, len(single)),
        strict=facts.expected is not None,
        passed=code == 0,
    )
    case = Case(
        system=facts.system,
        title=f"{EARLIER}: {facts.title}" if facts.earlier else facts.title,
        today=facts.today.isoformat(),
        run=facts.run,
        grade=grade,
        grade_reason=reason,
        fresh=fresh,
        freshness=freshness,
        kernel=facts.kernel,
        proofs=proofs,
        trusted=trusted_base(proofs, facts.kernel),
        policy=facts.policy,
        exit_code=code,
        ledger_head=facts.ledger_head,
        digests=facts.digests,
        answers=told,
        requirements=requirements,
        assumptions=supposed,
        deficits=weakened,
        changes=Changes(""),
        open_items=listed,
        nodes=facts.nodes,
        obligations=views,
        derivations=derived,
        environment=facts.environment,
        findings=findings,
        gates=found,
        tools=facts.tools,
        methods=facts.methods,
        discrepancies=facts.discrepancies or (),
        audited=facts.discrepancies is not None,
        strict=facts.expected is not None,
        orphans=orphans,
        hazards=hazards,
        standard=standard,
        graph_svg=facts.graph_svg,
        statements=facts.statements,
        baseline=facts.baseline,
        sources=facts.sources,
        earlier=facts.earlier,
        left_out=facts.left_out,
    )
    case = replace(case, changes=changes(case))
    return replace(case, answers=with_signature(case))


def _status(entries: Sequence[Entry], *, outdated: bool) -> Status:
    """A proof from other claims, and data against what follows: no tool is wrong, but one of these claims is."""
    status = roll_up((e.evidence for e in entries), outdated=outdated)
    refuting = [e.evidence for e in entries if weigh(e.evidence).refuted]
    return Status.REFUTED if refuting and all(AGAINST in record.details for record in refuting) else status


def _granted(claims: Sequence[Claim], standings: Mapping[str, Standing], facts: Facts) -> Mapping[str, Standing]:
    """The standings if the assumptions that the policy accepts were shown: conditions of the composition with a
    person's reason, and what a person took as a risk."""
    if not grants(facts.policy):
        return standings
    conditions = {o.id for o in facts.obligations if o.kind is Kind.COMPOSITION}
    return judge(
        replace(claim, own=Status.PROVED)
        if claim.own is Status.JUSTIFIED and (claim.id in conditions or claim.id.startswith("assumption:"))
        else claim
        for claim in claims
    )


def _evidence(facts: Facts) -> tuple[dict[str, tuple[EvidenceView, ...]], tuple[Entry, ...]]:
    """Each obligation's records with their currency, and the records that belong to no obligation, in an order that
    does not depend on which method answered first."""
    grouped: dict[str, list[Entry]] = {o.id: [] for o in facts.obligations}
    orphans = []
    for entry in facts.entries:
        if entry.evidence.obligation in grouped:
            grouped[entry.evidence.obligation].append(entry)
        else:
            orphans.append(entry)
    digests = {o.id: o.digest for o in facts.obligations}
    result = {
        name: _in_order(_views(entries, digests[name], dict(facts.planned.get(name, ())), facts.run, facts.today))
        for name, entries in grouped.items()
    }
    return result, tuple(sorted(orphans, key=lambda e: (e.evidence.obligation, e.evidence.method)))


def _in_order(views: list[EvidenceView]) -> tuple[EvidenceView, ...]:
    """Sorted by run, and within a run by method: which of several methods answered first is chance."""
    if len(views) == 1:  # nearly always
        return tuple(views)
    runs = {run: at for at, run in enumerate(dict.fromkeys(v.entry.evidence.run for v in views))}
    return tuple(sorted(views, key=lambda v: (runs[v.entry.evidence.run], v.entry.evidence.method)))


def _views(
    entries: list[Entry], digest: str, planned: Mapping[str, str], run: RunInfo, today: date
) -> list[EvidenceView]:
    """The currency of each record. All answers to today's question count, so that none hides a refutation; but of
    several with the same result only the newest counts, and a failed attempt does not count if the same method also
    answered: leaving these out cannot change the status. A method's support does not count if its newest mutation score
    shows that it is non-discriminating."""

    def currency(entry: Entry) -> Currency:
        record = entry.evidence
        if record.method not in planned:
            return Currency.WITHDRAWN
        if planned[record.method] != record.key or record.obligation_digest != digest:
            return Currency.STALE
        if _has_expired(record, today):
            return Currency.EXPIRED
        if run.fresh and record.run != run.id and not weigh(record).refuted and not _is_hollow(record):
            return Currency.SET_ASIDE
        return Currency.CURRENT

    standing = [currency(entry) for entry in entries]
    if len(entries) == 1:  # no other record to compare with: nearly always
        return [_view(entries[0], standing[0])]
    scored = {
        e.evidence.method: e.evidence
        for e, c in zip(entries, standing, strict=True)
        if c is Currency.CURRENT and "mutation" in e.evidence.details
    }
    hollow = {method for method, record in scored.items() if _is_hollow(record)}
    for at, entry in enumerate(entries):
        record = entry.evidence
        speaks = _is_hollow(record) or weigh(record).support is not None
        if standing[at] is Currency.CURRENT and speaks and _is_hollow(record) != (record.method in hollow):
            standing[at] = Currency.SUPERSEDED
    answered = {
        e.evidence.method for e, c in zip(entries, standing, strict=True) if c is Currency.CURRENT and not _failed(e)
    }
    said: set[tuple[str, Verdict, bool]] = set()
    for at in range(len(entries) - 1, -1, -1):
        record = entries[at].evidence
        words = (record.method, effective(record), record.vacuous)
        if standing[at] is Currency.CURRENT:
            if words in said or (_failed(entries[at]) and record.method in answered):
                standing[at] = Currency.SUPERSEDED
            said.add(words)
    return [_view(entry, found) for entry, found in zip(entries, standing, strict=True)]


def _view(entry: Entry, found: Currency) -> EvidenceView:
    return EvidenceView(entry, found, found is Currency.CURRENT)


def _failed(entry: Entry) -> bool:
    return entry.evidence.verdict in (Verdict.ERROR, Verdict.NOT_RUN, Verdict.UNKNOWN)


def _has_expired(record: Evidence, today: date) -> bool:
    """Whether support was given until a day that has passed, or that cannot be read. A refutation does not expire."""
    until = record.details.get("valid_until")
    if until is None or weigh(record).support is None:
        return False
    try:
        return date.fromisoformat(str(until)) < today
    except ValueError:
        return True


def _is_hollow(record: Evidence) -> bool:
    """Whether it is a mutation score of a non-discriminating method, which kills no mutant."""
    return record.vacuous and "mutation" in record.details and record.verdict.supports


def _link(entries: tuple[Entry, ...]) -> Link | None:
    """The most mechanical link among the records that give the status."""
    weights = [(weigh(e.evidence).support, e.evidence.link) for e in entries]
    best = max((s for s, _ in weights if s is not None), key=lambda s: s.rank, default=None)
    return best_link(link for support, link in weights if support is best and best is not None)


def _obligation(
    obligation: Obligation,
    facts: Facts,
    evidence: tuple[EvidenceView, ...],
    status: Status,
    standing: Standing,
    claim: Claim,
    handled: str,
) -> ObligationView:
    view = ObligationView(
        obligation=obligation,
        criticality=criticality(obligation, facts),
        status=status,
        standing=standing.status,
        evidence=evidence,
        planned=facts.planned.get(obligation.id, ()),
        rests_on=claim.rests_on,
        below=standing.below,
        hypotheses=standing.hypotheses,
        link=claim.link,
        handled=handled,
    )
    suggested = suggestion_for(view, facts, facts.today)
    return replace(view, suggestion=suggested) if suggested else view


def _derivation(
    derivation: Derivation, standings: Mapping[str, Standing], rests: Mapping[str, tuple[str, ...]], names: Names
) -> DerivationView:
    claim = derivation_claim(derivation.name)
    standing = standings[claim]
    return DerivationView(
        derivation, standing.status, *standing.weakest, standing.below, rests[claim], open_conditions(derivation, names)
    )


def _single(views: Sequence[ObligationView], facts: Facts) -> tuple[str, ...]:
    """The guarantees without a second independent method, as the policy counts methods: a test of too few cases is
    none."""

    def methods(view: ObligationView) -> int:
        kept, _ = counted(view, facts.policy.demand(view.criticality), facts.policy, facts.today)
        return independent(record for record in kept if weigh(record).support)

    return tuple(v.id for v in views if v.obligation.kind is Kind.GUARANTEE and v.status.supports and methods(v) < 2)


def _grade(facts: Facts, proofs: Sequence[ProofView]) -> tuple[Grade, str]:
    """CERTIFIED: no proof of the calculus or of a requirement is merely claimed, and every digest was verified."""
    if facts.discrepancies is None:
        return Grade.CHECKED, "digests were not verified in this run"
    if any(d.serious for d in facts.discrepancies):
        return Grade.CHECKED, "the audit found that the ledger or what it refers to was changed"
    good, reason = standing(proofs, facts.kernel, facts.run.id)
    return (Grade.CERTIFIED if good else Grade.CHECKED), reason


def _fresh(facts: Facts, views: Sequence[ObligationView]) -> tuple[bool, str]:
    """Whether this run computed everything that was used, and every digest was verified."""
    if facts.discrepancies is None:
        return False, "digests were not verified in this run"
    serious = sum(d.serious for d in facts.discrepancies)
    if serious:
        return False, f"the audit found {count(serious, 'discrepancy', 'discrepancies')}"
    if not facts.run.fresh:
        cached = sum(1 for view in views for r in view.records if r.run != facts.run.id)
        if not cached:
            return False, "every answer is of this run, though earlier ones were allowed"
        return False, f"{count(cached, 'answer')} from earlier runs, of the same inputs as now"
    unanswered = sum(
        1
        for view in views
        for method, _ in view.planned
        if not any(
            v.counts and v.entry.evidence.method == method and v.entry.evidence.run == facts.run.id
            for v in view.evidence
        )
    )
    if unanswered:
        return False, f"{count(unanswered, 'planned attempt')} not made in this run"
    return True, "every answer was computed in this run, and every digest verified"


def shown_by_programs(
    obligations: Sequence[Obligation], statuses: Mapping[str, Status], counting: Mapping[str, Sequence[Entry]]
) -> dict[str, tuple[Status, str]]:
    """Obligation → its status and, in words, the method whose proofs give it.

    A program that is proved to meet every guarantee for all allowed inputs, and to have an output for each, is itself
    the witness that its node's contract is realizable, and so consistent. It counts if the analysis of the contract
    alone gave no answer, and only while its records are current; if the analysis gave the opposite answer, one of the
    tools is wrong.
    """
    proofs: dict[str, list[set[str]]] = {}
    for o in obligations:
        if o.kind is Kind.GUARANTEE:
            said = {e.evidence.method for e in counting[o.id] if _is_proof(e.evidence)}
            proofs.setdefault(o.node, []).append(said)
    methods = {node: method for node, of in proofs.items() if (method := _method(of)) is not None}
    sanity = [o for o in obligations if o.kind is Kind.SANITY and o.node in methods]
    allowed = {o.node for o in sanity if sanity_property(o) == "assumptions-satisfiable" and statuses[o.id].supports}
    found: dict[str, tuple[Status, str]] = {}
    for o in sanity:
        about, method = sanity_property(o), methods[o.node]
        if about != "realizable" and not (about == "consistent" and o.node in allowed):
            continue
        program = f"the program that {method} proves to meet every guarantee of {o.node} for all allowed inputs"
        if statuses[o.id] is Status.UNKNOWN:
            text = f"{short(o.id)} is shown by {program}; the analysis of the contract alone: {statuses[o.id]}"
            found[o.id] = (Status.PROVED, text)
        elif statuses[o.id] is Status.REFUTED:
            text = f"{short(o.id)} is refuted by the analysis of the contract, and shown by {program}"
            found[o.id] = (Status.CONTRADICTORY, text)
    return found


def _method(proofs: Sequence[set[str]]) -> str | None:
    """A method whose current records prove every guarantee of a node, unconditionally, of a program that always has
    an output; `proofs` are the methods that prove each."""
    return min(set[str].intersection(*proofs), default=None)


def _is_certified(entries: Sequence[Entry]) -> bool:
    """Whether every record that supports a claim has a certificate."""
    records = [e.evidence for e in entries if weigh(e.evidence).support is not None]
    return bool(records) and all("certificate" in record.details for record in records)


def _is_proof(record: Evidence) -> bool:
    total = record.details.get(OUTPUT_FOR_EVERY_INPUT) is True
    return total and effective(record) is Verdict.PROVED and not record.hypotheses and not record.rests_on
