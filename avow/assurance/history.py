"""The records that a report keeps of the ledger: all that can count, every refutation, and the newest few of the rest.

The records left out change no conclusion: a record with another key than the plan's is of an earlier state, and among
records with the same result for the same claim that count under the same conditions, the newest counts. The ledger has
the others, and the history of the case over the runs is computed from the ledger before anything is left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from avow.assurance.naming import is_advice
from avow.base.codec import canonical, plain, to_json
from avow.base.records import dataclass
from avow.base.tuning.shown import OLDER_RECORDS, TREND_RUNS
from avow.base.verdict import Verdict
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Obligation
from avow.evidence.record import STANDS_ON, Evidence
from avow.evidence.status import Status, roll_up, weigh


@dataclass(frozen=True, slots=True)
class Point:
    """The number of claims after a run that were supported, refuted (or contradicted), and neither."""

    run: str
    started: str
    supported: int
    refuted: int
    open: int


@dataclass(frozen=True, slots=True)
class History:
    left_out: int = 0
    """Records of earlier states that only the ledger has."""
    points: tuple[Point, ...] = ()
    """The claims' statuses after each of the last runs."""


def history(
    records: Sequence[Entry], obligations: Sequence[Obligation], planned: Mapping[tuple[str, str], str]
) -> tuple[frozenset[str], History]:
    """The hashes of the records that a report keeps of a ledger, oldest first, and the history of all of them.

    It keeps every refutation (the newest of those by the same example), and for each claim and method the newest record
    of each result with the key in `planned` for (obligation, method), and the newest of the others. The records must be
    as the ledger has them: whether one of them is of an earlier state for another reason than its key may change
    without the ledger.
    """
    digests = {o.id: o.digest for o in obligations}
    kept: set[str] = set()
    others: Counter[tuple[object, ...]] = Counter()
    for entry in reversed(records):
        record = entry.evidence
        asked = record.obligation, record.method
        current = planned.get(asked) == record.key and digests.get(record.obligation) == record.obligation_digest
        refuting = record.verdict is Verdict.REFUTED or weigh(record).refuted
        alike = (*asked, *_says(record, refuting)) if current or refuting else asked
        others[alike] += 1
        if others[alike] > OLDER_RECORDS:
            continue
        kept.add(entry.hash)
    claims = {o.id for o in obligations if not is_advice(o)}
    return frozenset(kept), History(sum(e.hash not in kept for e in records), _trend(records, claims))


def _says(record: Evidence, refuting: bool) -> tuple[object, ...]:
    """The key by which two current records, or refutations, of a claim and a method count alike."""
    details = {name: plain(item) for name, item in record.details.items() if refuting or name in STANDS_ON}
    left = sorted(record.outputs.items()) if "certificate" in details else []
    shown = to_json(record.counterexample), record.key, record.obligation_digest
    return record.backend, record.verdict, record.strength, record.vacuous, canonical([details, left, *shown])


def _trend(records: Sequence[Entry], claims: set[str]) -> tuple[Point, ...]:
    """One point for each run that left evidence, oldest first. As past keys are not kept, a method's newest record at
    that time is taken as current; for the last run see the case itself."""
    ours = [entry.evidence for entry in records if entry.evidence.obligation in claims]
    known: dict[str, dict[str, list[Evidence]]] = {}
    statuses: dict[str, Status] = {}
    asked: set[str] = set()
    points: list[Point] = []
    for at, record in enumerate(ours):
        methods = known.setdefault(record.obligation, {})
        same = [e for e in methods.get(record.method, []) if e.key == record.key]
        methods[record.method] = [*same, record]
        asked.add(record.obligation)
        if at + 1 == len(ours) or ours[at + 1].run != record.run:
            statuses |= {name: roll_up(e for items in known[name].values() for e in items) for name in asked}
            asked.clear()
            counts = Counter(statuses.values())
            supported = sum(n for status, n in counts.items() if status.supports)
            refuted = counts[Status.REFUTED] + counts[Status.CONTRADICTORY]
            points.append(Point(record.run, record.started, supported, refuted, len(claims) - supported - refuted))
    return tuple(points[-TREND_RUNS:])
