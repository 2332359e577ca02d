"""The gates of hazards, of failure rates and of standards."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from avow.assurance.answers import Level
from avow.assurance.hazards import HazardView
from avow.assurance.model import Gate, ObligationView, RequirementView, Suggestion
from avow.assurance.naming import requirement_claim
from avow.assurance.policy import CRITICALITIES, Policy
from avow.assurance.rates import exceeds
from avow.assurance.standards import StandardView, State
from avow.base.percent import percent
from avow.base.plain import count, listed
from avow.evidence.obligation import Kind


def steps(found: Iterable[Suggestion]) -> tuple[Suggestion, ...]:
    """At most ten, the cheapest first."""
    return tuple({s.text: s for s in sorted(found, key=lambda s: (s.cost, s.text))}.values())[:10]


def remedies(names: Iterable[str], views: Mapping[str, ObligationView]) -> Iterator[Suggestion]:
    """The next steps for claims that fail; an assumption that a person has to accept is named in the plan."""
    for name in names:
        if name.startswith("assumption:"):
            about, _, mark = name.removeprefix("assumption:").rpartition(":")
            entry = f"{{obligation: {about}, verdict: missing, found: {mark}, reason: …, who: …, date: …, expires: …}}"
            yield Suggestion(f"accept the assumption: `accepted: [{entry}]`", cost=5)
        elif name in views and (suggestion := views[name].suggestion):
            yield suggestion


def hazards_gate(hazards: Sequence[HazardView], views: Mapping[str, ObligationView]) -> Iterable[Gate]:
    """A gate: each hazard has mitigations, and all of them hold; no gate if no hazard is listed."""
    if not hazards:
        return
    bare = [view for view in hazards if not view.mitigations]
    open_ones = [view for view in hazards if view.mitigations and not view.level.holds]
    reasons = [f"{listed([view.hazard.id for view in bare])}: no mitigation"] if bare else []
    reasons += [f"{view.hazard.id}: {view.stands}" for view in open_ones]
    found = [step for h in open_ones for step in remedies(h.failing, views)]
    if bare:
        where = f"in {bare[0].hazard.span.file}" if bare[0].hazard.span else "with the hazard"
        text = f"name what mitigates {bare[0].hazard.id} under mitigated_by, {where}"
        found.append(Suggestion(text, cost=5))
    claims = dict.fromkeys(
        claim for view in open_ones for m in view.mitigations if not m.level.holds for claim in m.claims
    )
    yield Gate(
        "hazards",
        "Every hazard has mitigations, and all of them hold",
        not reasons,
        "; ".join(reasons) or f"{count(len(hazards), 'hazard')} mitigated: {_how_far(hazards)}",
        tuple(claims) or tuple(view.hazard.id for view in bare),
        steps(found),
    )


def _how_far(hazards: Sequence[HazardView]) -> str:
    """``1 shown of models, 2 shown by tests``."""
    number = Counter(view.level for view in hazards)
    return ", ".join(f"{number[level]} {level}" for level in Level if number[level])


def rates_gate(
    policy: Policy, requirements: Sequence[RequirementView], views: Mapping[str, ObligationView]
) -> Iterable[Gate]:
    """A gate: a requirement that rests on samples fails no more often than the policy allows for the most critical node
    below it."""
    allowed = dict(policy.max_failure_rate)
    if not allowed:
        return
    wrong = dict[str, str]()
    asked = 0
    for r in requirements:
        below = {views[name].criticality for name in r.closure if views[name].obligation.kind is Kind.GUARANTEE}
        highest = min((CRITICALITIES.index(c) for c in below if c in CRITICALITIES), default=0)
        most = min((allowed[c] for c in CRITICALITIES[highest:] if c in allowed), key=float, default=None)
        if r.rate is not None and most is not None:
            asked += 1
            if why := exceeds(r.rate, most):
                wrong[r.id] = why
    yield Gate(
        "rates",
        "Requirements that rest on samples fail rarely enough",
        not wrong,
        "; ".join(f"{name}: {why}" for name, why in wrong.items()) or f"{count(asked, 'requirement')} within the limit",
        tuple(requirement_claim(name) for name in wrong),
        (Suggestion("make more trials, or ask each sample for more confidence", cost=30),) if wrong else (),
        asks=", ".join(f"at most {percent(rate)} at {criticality}" for criticality, rate in allowed.items()),
        idle=not asked,
    )


def standard_gate(standard: StandardView) -> Gate:
    """A gate: every objective that a case can serve is served; objectives outside of Avow are not demanded."""
    lacking = [o for o in standard.objectives if o.state is State.OPEN]
    reason = "; ".join(f"{o.id}: {o.why}" for o in lacking) or standard.counts
    title = f"Objectives of {standard.title} that contracts can serve"
    steps = tuple(Suggestion(text) for text in dict.fromkeys(o.next for o in lacking))
    return Gate("standard", title, not lacking, reason, tuple(o.id for o in lacking), steps)
