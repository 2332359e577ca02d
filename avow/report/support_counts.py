"""What each requirement rests on in all, by status: what one word for the weakest claim does not tell."""

from __future__ import annotations

from collections import Counter

from avow.assurance.model import Case
from avow.assurance.naming import derivation_claim, requirement_claim
from avow.base.tuning.bounds import SUPPORT_STEPS
from avow.evidence.status import Status


def resting(case: Case) -> dict[str, list[tuple[Status, int]]]:
    """How many claims of which status each supported requirement rests on, through derivations and all: one word for
    the weakest of them does not tell that five others were only tested. Empty where that would take too long."""
    if len(case.requirements) * len(case.obligations) > SUPPORT_STEPS:
        return {}
    below = {view.id: view.rests_on for view in case.obligations}
    below |= {derivation_claim(d.derivation.name): d.rests_on for d in case.derivations}
    below |= {requirement_claim(r.id): (*r.rests_on, *r.obligations) for r in case.requirements}
    statuses = {view.id: view.status for view in case.obligations}
    told = {}
    for requirement in case.requirements:
        seen: set[str] = set()
        stack = [requirement_claim(requirement.id)]
        while stack:
            name = stack.pop()
            if name not in seen:
                seen.add(name)
                stack += below.get(name, ())
        found = Counter(statuses[name] for name in seen if name in statuses)
        told[requirement.id] = [(status, found[status]) for status in Status if found[status]]
    return told
