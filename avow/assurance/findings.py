"""Expected and accepted findings: the plan's statements about results that are not good.

*Expected* (reproducing known-bad material) is strict both ways: a finding that is not listed fails, and so does a
listed one that is absent, or whose last day (if it names one) has passed. *Accepted* is a risk that a named person
takes, for a reason, until a date. A finding that has expired excuses nothing. Wildcards cover what they matched when
they were written, as the plan records it; further matches are open items. A finding with a mark (``found``) covers the
refutation that was known when it was written: a later, perhaps worse refutation of the same claim is another finding.
"""

from __future__ import annotations

import fnmatch
import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import date

from avow.assurance.model import Handled
from avow.base import codec
from avow.base.files import sha256
from avow.base.verdict import Hypothesis, Verdict
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Obligation
from avow.evidence.status import Status, roll_up
from avow.system.plan import Finding, is_wild

FINDINGS = frozenset({Status.REFUTED, Status.CONTRADICTORY, Status.VACUOUS, Status.CIRCULAR})
"""Statuses that mean that something is wrong (the others mean that something is missing)."""


def handle(
    how: str,
    findings: Iterable[Finding],
    obligations: Sequence[Obligation],
    statuses: Mapping[str, Status],
    counting: Mapping[str, tuple[Entry, ...]],
    today: date,
) -> tuple[Handled, ...]:
    """Each finding with the obligations that it matches."""
    return tuple(_match(how, finding, obligations, statuses, counting, today) for finding in findings)


def expiry(finding: Finding) -> date | None:
    """The last day on which a finding is accepted; None if it has no readable date."""
    try:
        return date.fromisoformat(finding.expires or "")
    except ValueError:
        return None


def _match(
    how: str,
    finding: Finding,
    obligations: Sequence[Obligation],
    statuses: Mapping[str, Status],
    counting: Mapping[str, tuple[Entry, ...]],
    today: date,
) -> Handled:
    alike = [
        obligation
        for obligation in obligations
        if _matches(finding.obligation, obligation.local_id)
        and _status(finding, obligation.id, statuses, counting) == finding.verdict
    ]
    now = ""
    if alike and finding.verdict in FINDINGS and not is_wild(finding.obligation):
        asked = (e for e in counting[alike[0].id] if finding.method in (None, e.evidence.method))
        now = mark(asked)
    if finding.verdict == Status.MISSING:
        rested = (h for entries in counting.values() for e in entries for h in e.evidence.rests_on)
        now = next((text_mark(h) for h in rested if h.name == finding.obligation), "")
    now = now if now != finding.found else ""
    if now and finding.found:
        alike = []
    taken = tuple(o.id for o in alike if takes(finding.obligation, finding.matched, o.local_id))
    return Handled(
        how=how,
        pattern=finding.obligation,
        verdict=finding.verdict,
        method=finding.method or "",
        reason=finding.reason or "",
        who=finding.who or "",
        date=finding.date or "",
        expires=finding.expires or "",
        expired=_is_out(finding, today) if how == "accepted" or finding.expires else False,
        obligations=taken,
        matched=finding.matched,
        unlisted=tuple(o.local_id for o in alike if o.id not in taken),
        found=finding.found,
        now=now,
        says=finding.says,
    )


def mark(counting: Iterable[Entry]) -> str:
    """A digest of what was found about a claim: the methods and their counterexamples. The claim itself is included."""
    records = (e.evidence for e in counting)
    found = [
        [e.obligation_digest, e.method, e.verdict.value, codec.to_json(e.counterexample)]
        for e in records
        if e.verdict is Verdict.REFUTED or e.vacuous
    ]
    return sha256(json.dumps(sorted(found, key=json.dumps)))[:12]


def _is_out(finding: Finding, today: date) -> bool:
    """Whether its last day has passed, its first day has not come, or its last day cannot be read."""
    last_day = expiry(finding)
    return (
        last_day is None or last_day < today or (finding.date is not None and date.fromisoformat(finding.date) > today)
    )


def takes(pattern: str, matched: Sequence[str], name: str) -> bool:
    """Whether a finding covers the obligation of that id (without the system): one with wildcards covers only what it
    matched when it was written, as the plan records it."""
    return _matches(pattern, name) and (not is_wild(pattern) or name in matched)


def text_mark(hypothesis: Hypothesis) -> str:
    """The mark (``found``) of what a method supposes: a digest of its text."""
    return hypothesis.digest[:12]


def accepts(name: str, found: str, hypothesis: Hypothesis) -> bool:
    """Whether an entry of that name, marked with `found`, accepts what a method supposes: an edit of the text that says
    it (a box, initial values) ends the acceptance."""
    return name == hypothesis.name and found == text_mark(hypothesis)


def _matches(pattern: str, name: str) -> bool:
    # only * and ? are wild: an id may hold a bracket, which fnmatch would read as a set
    return fnmatch.fnmatchcase(name, pattern.replace("[", "[[]"))


def _status(
    finding: Finding, obligation: str, statuses: Mapping[str, Status], counting: Mapping[str, tuple[Entry, ...]]
) -> str:
    if finding.method is None:
        return statuses[obligation].value
    return roll_up(e.evidence for e in counting[obligation] if e.evidence.method == finding.method).value
