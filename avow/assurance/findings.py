"""Expected and accepted findings: what the plan says of results that are not good.

*Expected* (reproducing known-bad material) is strict both ways: a finding that is not listed fails, and so does a
listed one that is not there, or whose last day (where it names one) has gone by. *Accepted* is a risk that a named
person takes, for a reason, until a date. A finding that has expired excuses nothing.
Wildcards stand for what they matched when they were written, as the plan records it; what they match besides is an
open item. A finding with a mark (``found``) stands for what was found when it was written: a later, perhaps worse
refutation of the same claim is another finding.
"""

from __future__ import annotations

import fnmatch
import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import date

from avow.assurance.model import Handled
from avow.base import codec
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Obligation
from avow.evidence.status import Status, roll_up
from avow.system.plan import Finding, is_wild

FINDINGS = frozenset({Status.REFUTED, Status.CONTRADICTORY, Status.VACUOUS, Status.CIRCULAR})
"""Statuses that say that something is wrong (the others say that something is lacking)."""


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
    """The last day on which a finding is accepted; None where there is none that can be read."""
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
    )


def mark(counting: Iterable[Entry]) -> str:
    """Of what was found of a claim: who found it, and by which counterexample. The claim itself is in it, too."""
    records = (e.evidence for e in counting)
    found = [
        [e.obligation_digest, e.method, e.verdict.value, codec.to_json(e.counterexample)]
        for e in records
        if e.verdict is Verdict.REFUTED or e.vacuous
    ]
    return sha256(json.dumps(sorted(found, key=json.dumps)))[:12]


def _is_out(finding: Finding, today: date) -> bool:
    """Whether its days have gone by, have not come, or cannot be read."""
    last_day = expiry(finding)
    return (
        last_day is None or last_day < today or (finding.date is not None and date.fromisoformat(finding.date) > today)
    )


def takes(pattern: str, matched: Sequence[str], name: str) -> bool:
    """Whether a finding is about the obligation of that id (without the system): one with wildcards is about what it
    matched when it was written, as the plan records it, and about nothing else."""
    return _matches(pattern, name) and (not is_wild(pattern) or name in matched)


def _matches(pattern: str, name: str) -> bool:
    # only * and ? are wild: an id may hold a bracket, which fnmatch would read as a set
    return fnmatch.fnmatchcase(name, pattern.replace("[", "[[]"))


def _status(
    finding: Finding, obligation: str, statuses: Mapping[str, Status], counting: Mapping[str, tuple[Entry, ...]]
) -> str:
    if finding.method is None:
        return statuses[obligation].value
    return roll_up(e.evidence for e in counting[obligation] if e.evidence.method == finding.method).value
