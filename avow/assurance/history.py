"""The records that a report keeps of the ledger: all that can count, every refutation, and the newest few of the rest.

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

    It keeps every refutation (the newest of those by the same example), and for each claim and method the newest record
    of each result with the key in `planned` for (obligation, method), and the newest of the others. The records must be
    as the ledger has them: whether one of them is of an earlier state for another reason than its key may change
    without the ledger.
    """
    digests = {o.id: o.digest for o in obligations}
    answers = Counter((entry.evidence.obligation, entry.evidence.method) for entry in records)
    kept: set[str] = set()
    others: Counter[tuple[object, ...]] = Counter()
    for entry in reversed(records):
        record = entry.evidence
        asked = record.obligation, record.method
        if answers[asked] <= OLDER_RECORDS:  # nearly always
            kept.add(entry.hash)
            continue
        current = planned.get(asked) == record.key and digests.get(record.obligation) == record.obligation_digest
        refuting = record.verdict is Verdict.REFUTED or weigh(record).refuted
        alike = (*asked, *_says(record, refuting)) if current or refuting else asked
        others[alike] += 1
        if others[alike] > OLDER_RECORDS:
            continue
        kept.add(entry.hash)
    return frozenset(kept)


def _says(record: Evidence, refuting: bool) -> tuple[object, ...]:
    """The key by which two current records, or refutations, of a claim and a method count alike."""
    details = {name: plain(item) for name, item in record.details.items() if refuting or name in STANDS_ON}
    left = sorted(record.outputs.items()) if "certificate" in details else []
    shown = to_json(record.counterexample), record.key, record.obligation_digest
    return record.backend, record.verdict, record.strength, record.vacuous, canonical([details, left, *shown])
