"""The records that a report keeps of the ledger: each that can count, every refutation, and the newest few of the rest.

The records left out change no conclusion: a record with another key than the plan's is of an earlier state, and among
records with the same result for the same claim that count under the same conditions, the newest counts. The ledger has
the others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from avow.base.codec import canonical, plain, to_json
from avow.base.tuning.shown import OLDER_RECORDS
from avow.base.verdict import Verdict
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Obligation
from avow.evidence.record import STANDS_ON, Evidence
from avow.evidence.status import weigh


def kept_records(
    records: Sequence[Entry], obligations: Sequence[Obligation], planned: Mapping[tuple[str, str], str]
) -> frozenset[str]:
    """The hashes of the records that a report keeps of a ledger, oldest first.

    It keeps every refutation (the newest two of those by the same example), and for each claim and method the newest
    record of each result with the key in `planned` for (obligation, method), and the newest two of the others, unless a
    newer one with that key says the same. Of a claim that was refuted it keeps the newest two of each: whether the plan
    has left out what refuted it depends on what was recorded before. The records must be as the ledger has them:
    whether one of them is of an earlier state for another reason than its key may change without the ledger.
    """
    digests = {o.id: o.digest for o in obligations}
    answers = Counter((entry.evidence.obligation, entry.evidence.method) for entry in records)
    refuted = {entry.evidence.obligation for entry in records if _refutes(entry.evidence)}
    kept: set[str] = set()
    found: Counter[tuple[object, ...]] = Counter()
    said: set[tuple[object, ...]] = set()
    for entry in reversed(records):
        record = entry.evidence
        asked = record.obligation, record.method
        current = planned.get(asked) == record.key and digests.get(record.obligation) == record.obligation_digest
        result = (*asked, record.verdict, record.strength, record.vacuous)
        alike: tuple[object, ...] = asked
        most = OLDER_RECORDS
        if answers[asked] > 1 and (current or _refutes(record)):
            alike = (*asked, *_says(record, _refutes(record)))
        if record.obligation not in refuted:
            most = 1 if current else 0 if result in said else OLDER_RECORDS
            said |= {result} if current else set()
        found[alike] += 1
        if found[alike] <= most:
            kept.add(entry.hash)
    return frozenset(kept)


def _refutes(record: Evidence) -> bool:
    return record.verdict is Verdict.REFUTED or weigh(record).refuted


def _says(record: Evidence, refuting: bool) -> tuple[object, ...]:
    """The key by which two current records, or refutations, of a claim and a method count alike."""
    details = {name: plain(item) for name, item in record.details.items() if refuting or name in STANDS_ON}
    left = sorted(record.outputs.items()) if "certificate" in details else []
    shown = to_json(record.counterexample), record.key, record.obligation_digest
    return record.backend, record.verdict, record.strength, record.vacuous, canonical([details, left, *shown])
