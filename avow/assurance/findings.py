"""Expected and accepted findings: what the plan says of results that are not good.

*Expected* (reproducing known-bad material) is strict both ways: a finding that is not listed fails, and so does a
listed one that is not there. *Accepted* is a risk that a named person takes, for a reason, until a date; without one
it lasts a year. An accepted finding that has expired excuses nothing.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from datetime import date, timedelta

from avow.assurance.model import Handled
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Obligation
from avow.evidence.status import Status, roll_up
from avow.system.plan import Finding

LASTS_DAYS = 365
"""How long an accepted finding without an expiry is accepted, from its date."""

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
    """The last day on which an accepted finding is accepted; None where its dates cannot be read."""
    try:
        if finding.expires:
            return date.fromisoformat(finding.expires)
        return date.fromisoformat(finding.date or "") + timedelta(days=LASTS_DAYS)
    except (ValueError, OverflowError):
        return None


def _match(
    how: str,
    finding: Finding,
    obligations: Sequence[Obligation],
    statuses: Mapping[str, Status],
    counting: Mapping[str, tuple[Entry, ...]],
    today: date,
) -> Handled:
    matched = tuple(
        obligation.id
        for obligation in obligations
        if matches(finding.obligation, obligation.local_id)
        and _status(finding, obligation.id, statuses, counting) == finding.verdict
    )
    last_day = expiry(finding)
    return Handled(
        how=how,
        pattern=finding.obligation,
        verdict=finding.verdict,
        method=finding.method or "",
        reason=finding.reason or "",
        who=finding.who or "",
        date=finding.date or "",
        expires=finding.expires or "",
        expired=how == "accepted" and (last_day is None or last_day < today),
        obligations=matched,
    )


def matches(pattern: str, name: str) -> bool:
    """Whether a finding's pattern is about the obligation of that id (without the system)."""
    # only * and ? are wild: an id may hold a bracket, which fnmatch would read as a set
    return fnmatch.fnmatchcase(name, pattern.replace("[", "[[]"))


def _status(
    finding: Finding, obligation: str, statuses: Mapping[str, Status], counting: Mapping[str, tuple[Entry, ...]]
) -> str:
    if finding.method is None:
        return statuses[obligation].value
    return roll_up(e.evidence for e in counting[obligation] if e.evidence.method == finding.method).value
