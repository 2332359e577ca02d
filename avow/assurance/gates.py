"""The gates: the policy's demands, applied to the case. The exit code depends only on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import date

from avow.assurance.answers import EARLIER
from avow.assurance.certification import ProofView, certifiable, claimed
from avow.assurance.facts import Facts
from avow.assurance.findings import FINDINGS
from avow.assurance.gap import counted, shortfall, suggest
from avow.assurance.hazards import HazardView
from avow.assurance.model import DerivationView, Gate, Handled, ObligationView, RequirementView, Suggestion
from avow.assurance.naming import derivation_claim, requirement_claim, short
from avow.assurance.policy import Demand, Policy
from avow.assurance.relied import Relied, looked_at
from avow.assurance.risk_gates import hazards_gate, rates_gate, remedies, steps
from avow.base.plain import count, listed
from avow.base.verdict import Object
from avow.evidence.claims import Standing
from avow.evidence.obligation import Kind, ProgramClaim
from avow.evidence.status import Status, weigh

_TOOL = frozenset({Status.ERROR, Status.NOT_RUN})


def gates(
    facts: Facts,
    obligations: Sequence[ObligationView],
    requirements: Sequence[RequirementView],
    derivations: Sequence[DerivationView],
    hazards: Sequence[HazardView],
    findings: Sequence[Handled],
    proofs: Sequence[ProofView],
    relied: Mapping[str, Relied],
    fresh: bool,
    granted: Mapping[str, Standing],
) -> tuple[Gate, ...]:
    """Every gate, those that fail first, in the order in which a person should see to them: what is wrong, then what is
    lacking, the cheapest step first. `granted`: the standings of claims without the
    assumptions that the policy accepts."""
    views = {view.id: view for view in obligations}
    excused = {name for f in findings if not f.expired for name in f.obligations}
    unwritten = [view for view in obligations if view.status is Status.UNWRITTEN]
    behind = _behind(derivations, views, {view.id for view in unwritten} - excused)
    claims = [view for view in obligations if not view.advice and view.id not in behind]
    found = (
        *_earlier(facts),
        _integrity(facts),
        *_findings(facts, findings, obligations),
        _nothing_wrong(facts, obligations, excused),
        *([_gate("unwritten", "Every guarantee is written", unwritten, excused, _worded, "")] if unwritten else ()),
        *(
            _held_to(kind.value, title, [v for v in claims if v.obligation.kind is kind], good, excused)
            for kind, title, good in (
                (Kind.WELL_FORMED, "Contracts parse and are well-typed", (Status.PROVED,)),
                (Kind.SANITY, "Contracts are worth verifying", facts.policy.sanity),
                (Kind.COMPOSITION, "The composition holds", facts.policy.composition),
            )
        ),
        *_guarantees(facts, obligations, relied, excused),
        *_programs(facts, obligations, relied, excused),
        _derivations(facts, derivations, views, excused, {view.id for view in unwritten} | behind),
        _requirements(facts, requirements, derivations, views, excused, granted),
        *hazards_gate(hazards, views),
        *rates_gate(facts.policy, requirements, views),
        *_certified(facts, proofs, fresh),
    )
    known = [g if g.passed or g.suggestions else replace(g, suggestions=(_general(g.id),)) for g in found]
    return tuple(sorted(known, key=lambda gate: (gate.passed, 0 if gate.passed else gate.suggestions[0].cost)))


def _general(gate: str) -> Suggestion:
    """The next step of a gate if no claim has one of its own: what is wrong first, a better kind of proof last."""
    if gate not in _NEXT:
        return Suggestion(_EVIDENCE, cost=30)
    return Suggestion(_NEXT[gate], cost=70 if gate in ("proved", "certified") else -1)


_EVIDENCE = "give each claim that fails, and what it rests on, the evidence that is asked"
_NEXT = {
    "earlier": "repair what `avow check` reports, then verify again",
    "expected": "find out why the findings differ, then repair the system or correct `expected:` in the plan",
    "accepted": "repair the finding, or let a named person accept it again under `accepted:`, with a new date",
    "refuted": "repair what the findings show, or accept them under `accepted:`, with a name, a date and an expiry",
    "proved": "run `avow verify`: the kernel then checks the proofs; what it cannot check, prove in smaller steps",
    "certified": "run `avow verify --fresh`",
}


def _worded(view: ObligationView) -> str:
    return view.status.value


def _behind(
    derivations: Sequence[DerivationView], views: Mapping[str, ObligationView], unwritten: set[str]
) -> set[str]:
    """The open conditions of derivations that rest on an unwritten guarantee: no gate asks for them until it is
    written."""
    below = {name for d in derivations if not unwritten.isdisjoint(d.below) for name in d.below if name in views}
    views_below = [views[name] for name in below]
    return {v.id for v in views_below if v.obligation.kind is Kind.COMPOSITION and v.status is Status.UNKNOWN}


def exit_code(found: Iterable[Gate]) -> int:
    """0: all pass; 3: some fail, and each of them only because of a tool; 1: otherwise."""
    failed = [gate for gate in found if not gate.passed]
    if not failed:
        return 0
    return 3 if all(gate.tool_failure for gate in failed) else 1


def _earlier(facts: Facts) -> Iterable[Gate]:
    if facts.earlier:
        reason = f"{EARLIER}: the system cannot be read as it stands now, or is gone"
        yield Gate("earlier", "The report is of what stands here", False, reason)


def _integrity(facts: Facts) -> Gate:
    title = "The ledger says what was found"
    if facts.discrepancies is None:
        return Gate("integrity", title, True, "not audited in this run (`avow audit` does)", idle=True)
    serious = [d for d in facts.discrepancies if d.serious]
    if not serious:
        return Gate("integrity", title, True, "every digest was computed again and agrees")
    reason = f"{count(len(serious), 'discrepancy', 'discrepancies')}; first: {serious[0].text}"
    anew = Suggestion(
        "find out who changed it; what cannot be restored is computed again once "
        f"artifacts/ledger/{facts.system}.jsonl* is deleted (the loss is told from then on)",
        cost=-1,
    )
    return Gate("integrity", title, False, reason, tuple(d.subject for d in serious), (anew,))


def _findings(facts: Facts, findings: Sequence[Handled], obligations: Sequence[ObligationView]) -> Iterable[Gate]:
    if facts.expected is not None:
        absent = [f for f in findings if f.how == "expected" and not f.obligations]
        listed = {name for f in findings if not f.expired for name in f.obligations}
        extra = [v.id for v in obligations if v.status in FINDINGS and v.id not in listed and not v.advice]
        reasons = [
            f"expected but not there: {f.pattern} {f.verdict}{f' by {f.method}' if f.method else ''}" for f in absent
        ]
        reasons += [
            f"expected but not there: {name} {f.verdict}"
            for f in findings
            if f.how == "expected" and f.obligations
            for name in f.matched
            if f"{facts.system}/{name}" not in f.obligations
        ]
        reasons += [
            f"{f.pattern} was expected until {f.expires}" for f in findings if f.how == "expected" and f.expired
        ]
        reasons += [f"there but not expected: {short(name)}" for name in extra]
        good = f"exactly the {count(sum(f.how == 'expected' for f in findings), 'expected finding')}"
        yield Gate(
            "expected",
            "The findings are the expected ones, all of them and no others",
            not reasons,
            "; ".join(reasons) or good,
            (*(f.pattern for f in absent), *extra),
        )
    accepted = [f for f in findings if f.how == "accepted"]
    expired = [f for f in accepted if f.expired]
    if accepted:
        reason = "; ".join(f"{f.pattern} ({f.verdict}) was accepted by {f.who} until {f.expires}" for f in expired)
        title = "Accepted risks have not expired"
        names = tuple(name for f in expired for name in f.obligations)
        yield Gate("accepted", title, not expired, reason or count(len(accepted), "accepted risk"), names)


def _nothing_wrong(facts: Facts, obligations: Sequence[ObligationView], excused: set[str]) -> Gate:
    found = [view for view in obligations if view.status in FINDINGS]
    wrong = [view for view in found if not view.advice]
    but = ", but for remarks on how contracts are written" * (len(found) > len(wrong))
    good = f"{'nothing else' if excused else 'no claim'} is refuted, contradicted or vacuous{but}"
    return _gate("refuted", "No claim is refuted, contradictory or vacuous", wrong, excused, _worded, good)


def _held_to(name: str, title: str, views: Sequence[ObligationView], good: Sequence[Status], excused: set[str]) -> Gate:
    """A gate: each of some claims has a status that the policy accepts; if the policy names no status, it asks
    nothing."""
    found = _gate(
        name,
        title,
        [v for v in views if good and v.status not in good],
        excused,
        lambda view: _short_of(view.status, good),
        _holding([v.status.supports for v in views], asked=bool(good)) + _not_run(views, good),
        _in_words(good),
        idle=not good,
    )
    return replace(found, relaxed=not all(status.supports for status in good))


def _not_run(views: Sequence[ObligationView], good: Sequence[Status]) -> str:
    """A policy may accept that a claim stays open if its tool is missing: the gate gives the number of such claims."""
    many = sum(view.status is Status.NOT_RUN for view in views)
    return f"; {many} not run, which the policy accepts" if many and Status.NOT_RUN in good else ""


def _in_words(good: Sequence[Status]) -> str:
    return " or ".join(status.value for status in good)


def _short_of(status: Status, good: Sequence[Status]) -> str:
    """``justified, but proved or checked is asked``; the bare word for a status that supports nothing."""
    return f"{status.value}, but {_in_words(good)} is asked" if status.supports else status.value


def _guarantees(
    facts: Facts, obligations: Sequence[ObligationView], relied: Mapping[str, Relied], excused: set[str]
) -> Iterable[Gate]:
    for criticality, demand in facts.policy.guarantees:
        of_kind = [
            v
            for v in obligations
            if v.obligation.kind is Kind.GUARANTEE
            and v.status is not Status.UNWRITTEN
            and _criticality(v, facts) == criticality
        ]
        if not of_kind:
            continue
        lacking = {v.id: shortfall(v, demand, facts.policy, facts.today) for v in of_kind}
        failing = [v for v in of_kind if lacking[v.id]]
        yield _gate(
            f"guarantees-{criticality}",
            f"Guarantees of {criticality} criticality",
            failing,
            excused,
            lambda view, lacking=lacking: lacking[view.id] or "",  # type: ignore[misc]
            _holding([v.status.supports for v in of_kind], asked=bool(demand.one_of))
            + _kinds(of_kind, demand, facts)
            + _of_models(of_kind, relied),
            demand.text() if demand.one_of else "",
            idle=not demand.one_of,
        )


def _kinds(views: Sequence[ObligationView], demand: Demand, facts: Facts) -> str:
    """Which kinds of support count, if several methods are asked: ``: 2 proved and monitored, 1 proved and tested``."""
    if demand.methods < 2:
        return ""
    kept = [counted(view, demand, facts.policy, facts.today)[0] for view in views]
    found = [{status for r in records if (status := weigh(r).support)} for records in kept]
    kinds = Counter(" and ".join(s.value for s in Status if s in of) for of in found if of)
    return ": " + ", ".join(f"{many} {kind}" for kind, many in kinds.items())


def _of_models(views: Sequence[ObligationView], relied: Mapping[str, Relied]) -> str:
    """How many of them no evidence about a program or its recordings supports as well as that about a model."""
    many = sum(v.id in relied and looked_at(relied[v.id]) is Object.MODEL for v in views)
    return f"; {many} of a model only" if many else ""


def _programs(
    facts: Facts, obligations: Sequence[ObligationView], relied: Mapping[str, Relied], excused: set[str]
) -> Iterable[Gate]:
    """Agreement of a program with its model is asked for only if a guarantee of its node relies on a model."""
    own = [v for v in obligations if v.obligation.kind is Kind.PROGRAM]
    if not own:
        return
    guarantees = [v for v in obligations if v.obligation.kind is Kind.GUARANTEE and v.id in relied]
    of_models = {v.obligation.node for v in guarantees if looked_at(relied[v.id]) is Object.MODEL}
    asked = [v for v in own if v.obligation.name != ProgramClaim.LINKED or v.obligation.node in of_models]
    title = "Programs run without fault, and agree with their models"
    yield _held_to(Kind.PROGRAM.value, title, asked, facts.policy.programs, excused)


def _criticality(view: ObligationView, facts: Facts) -> str:
    known = dict(facts.policy.guarantees)
    return view.criticality if view.criticality in known else "high"


def _derivations(
    facts: Facts,
    derivations: Sequence[DerivationView],
    views: Mapping[str, ObligationView],
    excused: set[str],
    unwritten: set[str],
) -> Gate:
    """Derivations that wait only for unwritten guarantees are reported by the gate *unwritten*."""
    wanted = bool(facts.policy.composition)
    failing = [d for d in derivations if wanted and not d.status.supports]
    bad = [d for d in failing if not _all_excused(d.below, excused | unwritten)]
    names = tuple(derivation_claim(d.derivation.name) for d in bad)
    let_off = tuple(derivation_claim(d.derivation.name) for d in failing if _all_excused(d.below, excused))
    reason = "; ".join(f"{d.derivation.name} is {d.status.value}: {_because(d.below)}" for d in bad[:5])
    waiting = len(failing) - len(bad) - len(let_off)
    holding = _holding([d.status.supports for d in derivations], wanted, len(let_off))
    holding += f"; {waiting} once what is unwritten is written" if waiting else ""
    return Gate(
        "derivations",
        "Derivations rest on what is shown",
        not bad,
        reason or holding,
        names,
        steps(s for d in bad for s in remedies(d.below, views)),
        let_off,
        "",
        bool(bad) and all(_tool_only(d.below, views) for d in bad),
        idle=not wanted,
    )


def _requirements(
    facts: Facts,
    requirements: Sequence[RequirementView],
    derivations: Sequence[DerivationView],
    views: Mapping[str, ObligationView],
    excused: set[str],
    granted: Mapping[str, Standing],
) -> Gate:
    good = facts.policy.requirements
    status = {r.id: granted[requirement_claim(r.id)].status for r in requirements}
    failing = [
        r for r in requirements if good and (status[r.id] not in good or not (r.level.holds or r.awaits_validation))
    ]
    causes = {r.id: r.below or r.failing or _weak(r, derivations, views, facts.policy) for r in failing}
    # a finding below does not excuse a fault of the requirement itself
    own = {r.id for r in failing if r.outdated or r.unknown_names}
    bad = [r for r in failing if r.id in own or not _all_excused(causes[r.id], excused)]
    let_off = tuple(requirement_claim(r.id) for r in failing if r not in bad)
    reason = "; ".join(
        f"{r.id} is {_standing(r, status[r.id], good)}{f': {_because(causes[r.id])}' if causes[r.id] else ''}"
        for r in bad[:5]
    )
    found = [s for r in bad for s in remedies(causes[r.id], views)]
    if any(r.outdated for r in bad):
        found.append(Suggestion("read the sentence against the formula, then run `avow validate`", cost=5))
    if any(r.too_often for r in bad):
        found.append(
            Suggestion("repair what fails in the trials, make more trials, or ask for a lower probability", cost=30)
        )
    if any(not (r.formal or r.below or causes[r.id] or r.outdated) for r in bad):
        found.append(
            Suggestion("state the requirement as a `formula` or a `temporal` one: prose is argued by a person", cost=20)
        )
    return Gate(
        "requirements",
        "Every requirement is answered",
        not bad,
        reason or _holding([r.level.holds for r in requirements], bool(good), len(let_off)),
        tuple(requirement_claim(r.id) for r in bad),
        steps(found),
        let_off,
        _in_words(good) + (_GRANTED if grants(facts.policy) else ""),
        bool(bad) and all(_tool_only(r.below, views) for r in bad),
        idle=not good,
    )


_GRANTED = ", beside the assumptions that the composition's gate accepts"


def grants(policy: Policy) -> bool:
    """Whether a person's reason is accepted for a condition of the composition, but is no evidence of a requirement."""
    good, reason = policy.requirements, Status.JUSTIFIED
    return bool(good) and reason not in good and reason in policy.composition


def _standing(requirement: RequirementView, status: Status, good: Sequence[Status]) -> str:
    """The reason why it does not count; one that would hold by its own evidence may still rest on what has failed or
    expired."""
    if requirement.outdated:
        return "not validated (its sentence, formula or support changed since a person read them: run `avow validate`)"
    if status not in good:
        return _short_of(status, good)
    too_often = f"open: {requirement.too_often}" if requirement.too_often else "open: an assumption has expired"
    return "open" if requirement.failing else too_often


def _weak(
    requirement: RequirementView,
    derivations: Sequence[DerivationView],
    views: Mapping[str, ObligationView],
    policy: Policy,
) -> tuple[str, ...]:
    """The claims that make a requirement weaker than is asked: all below it that are themselves weaker than is asked.
    Empty if the requirement is only prose: no finding below it can excuse that."""
    good = policy.requirements
    if not (requirement.formula or requirement.temporal) and Status.ARGUED not in good:
        return ()
    rests = {derivation_claim(d.derivation.name): d.rests_on for d in derivations}
    found, seen, todo = list[str](), set[str](), list(requirement.rests_on)
    while todo:
        name = todo.pop(0)
        if name in seen:
            continue
        seen.add(name)
        view = views.get(name)
        todo += view.rests_on if view else rests.get(name, ())
        conditions = policy.composition if view and view.obligation.kind is Kind.COMPOSITION else ()
        if view is not None and view.status not in (*good, *conditions):
            found.append(name)
    return tuple(found)


def _certified(facts: Facts, proofs: Sequence[ProofView], fresh: bool) -> Iterable[Gate]:
    if facts.policy.proved:
        wanted = certifiable(proofs)
        lacking = claimed(wanted)
        reason = (
            f"by the calculus' word alone: {listed(list(map(short, lacking)), 5)}"
            if lacking
            else f"{count(len(wanted), 'proof')}, none by its word alone"
        )
        yield Gate(
            "proved", "What is proved of composition and requirements is certified", not lacking, reason, lacking
        )
    if facts.policy.certified:
        reason = "every answer is of this run, every digest verified" if fresh else "run `avow verify --fresh`"
        yield Gate("certified", "Every answer is fresh and every digest verified", fresh, reason)


def _gate(
    name: str,
    title: str,
    failing: Sequence[ObligationView],
    excused: set[str],
    why: Callable[[ObligationView], str],
    good: str,
    asks: str = "",
    idle: bool = False,
) -> Gate:
    bad = [view for view in failing if view.id not in excused]
    let_off = tuple(view.id for view in failing if view.id in excused)
    shown = "; ".join(f"{short(view.id)}: {why(view)}" for view in bad[:5])
    more = f"; and {len(bad) - 5} more" if len(bad) > 5 else ""
    pardoned = f"; {count(len(let_off), 'finding')} excused by the plan" if let_off else ""
    return Gate(
        name,
        title,
        not bad,
        shown + more if bad else good + pardoned,
        tuple(view.id for view in bad),
        steps(view.suggestion for view in bad if view.suggestion),
        let_off,
        asks,
        bool(bad) and all(view.status in _TOOL for view in bad),
        idle and not bad,
    )


def _holding(supported: Sequence[bool], asked: bool, excused: int = 0) -> str:
    """The text of a gate that passes: never more than holds."""
    if not supported:
        return "there are none"
    counts = f"{sum(supported)} of {len(supported)} {'is' if len(supported) == 1 else 'are'} supported"
    if not asked:
        return f"the policy asks nothing of them; {counts}"
    return f"{counts}; {excused} excused by the plan" if excused else counts


def suggestion_for(view: ObligationView, facts: Facts, today: date) -> Suggestion | None:
    """The cheapest step that would close an obligation's gap; None if there is no gap."""
    if view.obligation.kind is Kind.GUARANTEE:
        demand = facts.policy.demand(view.criticality)
        lacking = bool(shortfall(view, demand, facts.policy, today))
    else:
        demand = None
        good = _asked(view.obligation.kind, facts)
        lacking = not (view.advice or (view.status.supports and (not good or view.status in good)))
    return suggest(view, demand, facts) if lacking else None


def _asked(kind: Kind, facts: Facts) -> Sequence[Status]:
    """The statuses that the policy accepts for claims of a kind; empty if its gate names none."""
    asked = facts.policy
    of = {Kind.SANITY: asked.sanity, Kind.COMPOSITION: asked.composition, Kind.REQUIREMENT: asked.requirements}
    return {**of, Kind.PROGRAM: asked.programs}.get(kind, ())


def _all_excused(below: Sequence[str], excused: set[str]) -> bool:
    return bool(below) and all(name in excused for name in below)


def _tool_only(below: Sequence[str], views: Mapping[str, ObligationView]) -> bool:
    return bool(below) and all(name in views and views[name].status in _TOOL for name in below)


def _because(below: Sequence[str]) -> str:
    return f"it rests on {listed(list(map(short, below)), 4)}" if below else "its own evidence is lacking"
