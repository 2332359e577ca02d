"""The gates of hazards and of standards."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from avow.assurance.hazards import HazardView
from avow.assurance.model import Gate, Suggestion
from avow.assurance.standards import StandardView, State
from avow.base.plain import count, listed


def hazards_gate(hazards: Sequence[HazardView]) -> Iterable[Gate]:
    """A gate: each hazard has mitigations, and all of them hold; no gate if no hazard is listed."""
    if not hazards:
        return
    bare = [view for view in hazards if not view.mitigations]
    open_ones = [view for view in hazards if view.mitigations and not view.level.holds]
    reasons = [f"{listed([view.hazard.id for view in bare])}: no mitigation"] if bare else []
    reasons += [f"{view.hazard.id}: {view.stands}" for view in open_ones]
    remedies = []
    if bare:
        where = f"in {bare[0].hazard.span.file}" if bare[0].hazard.span else "with the hazard"
        text = f"name what mitigates {bare[0].hazard.id} under mitigated_by, {where}"
        remedies.append(Suggestion(text, cost=5))
    claims = dict.fromkeys(
        claim for view in open_ones for m in view.mitigations if not m.level.holds for claim in m.claims
    )
    yield Gate(
        "hazards",
        "Every hazard has mitigations, and all of them hold",
        not reasons,
        "; ".join(reasons) or f"{count(len(hazards), 'hazard')} mitigated",
        tuple(claims) or tuple(view.hazard.id for view in bare),
        tuple(remedies),
    )


def standard_gate(standard: StandardView) -> Gate:
    """A gate: every objective that a case can serve is served; objectives outside of Avow are not demanded."""
    lacking = [o for o in standard.objectives if o.state is State.OPEN]
    reason = "; ".join(f"{o.id}: {o.why}" for o in lacking) or standard.counts
    title = f"Objectives of {standard.title} that contracts can serve"
    return Gate("standard", title, not lacking, reason, tuple(o.id for o in lacking))
