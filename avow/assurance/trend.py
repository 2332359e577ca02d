"""How a case came about: where its claims stood after each run, computed from the ledger's history alone."""

from __future__ import annotations

from collections import Counter

from avow.assurance.model import Case
from avow.base.records import dataclass
from avow.evidence.record import Evidence
from avow.evidence.status import Status, roll_up
from avow.tuning.shown import TREND_RUNS


@dataclass(frozen=True, slots=True)
class Point:
    """After a run: how many claims were supported, refuted (or contradicted), and neither."""

    run: str
    started: str
    supported: int
    refuted: int
    open: int


def trend(case: Case) -> tuple[Point, ...]:
    """One point a run that left evidence, oldest first. As keys of the past are not kept, a method's newest record of
    the time is taken as current; for the last run see the case itself."""
    records = sorted(
        (view.entry for o in case.obligations if not o.advice for view in o.evidence),
        key=lambda e: e.number,
    )
    total = sum(not o.advice for o in case.obligations)
    known: dict[str, dict[str, list[Evidence]]] = {}
    statuses: dict[str, Status] = {}
    points: list[Point] = []
    for at, entry in enumerate(records):
        record = entry.evidence
        methods = known.setdefault(record.obligation, {})
        same = [e for e in methods.get(record.method, []) if e.key == record.key]
        methods[record.method] = [*same, record]
        statuses[record.obligation] = roll_up(e for items in methods.values() for e in items)
        if at + 1 == len(records) or records[at + 1].evidence.run != record.run:
            counts = Counter(statuses.values())
            supported = sum(n for status, n in counts.items() if status.supports)
            refuted = counts[Status.REFUTED] + counts[Status.CONTRADICTORY]
            points.append(Point(record.run, record.started, supported, refuted, total - supported - refuted))
    return tuple(points[-TREND_RUNS:])
