"""Currency: which records still answer today's question, judged by the files that the program under test was observed
to read.

A record's key covers what the plan declares. The other files that the program under test read are in the record, with
digests: if one of them has changed, the record is of an earlier state, whatever its key says.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from avow.base.codec import from_json
from avow.base.files import sha256
from avow.base.verdict import Isolation, Verdict
from avow.evidence.ledger import Entry, Ledger
from avow.evidence.record import ISOLATION, OBSERVED, Evidence
from avow.isolation.level import wanted
from avow.isolation.observed import Observed, Seen, look, marks


def stands(record: Evidence, root: Path) -> bool:
    """Whether everything that the program under test read is unchanged, and it was isolated as strongly as is required
    now. A refutation counts under any isolation: changing the isolation repairs nothing."""
    return not changed(record, root) and (record.verdict is Verdict.REFUTED or _apart(record))


def changed(record: Evidence, root: Path) -> tuple[str, ...]:
    """The paths that have changed; relative ones are under `root`, the workspace."""
    seen = _rows(record)
    return ("what was observed cannot be read",) if seen is None else tuple(o.path for o in differing(seen, root))


def differing(seen: Iterable[Observed], root: Path) -> tuple[Observed, ...]:
    """Those that differ on this machine; relative paths are under `root`, the workspace."""
    return tuple(o for o in seen if _now(o.kind, os.path.join(root, o.path)) != o.digest)  # noqa: PTH118


def outlived(entry: Entry, refutations: Sequence[Entry]) -> bool:
    """Whether a refutation by a counterexample came after the entry: an earlier success must be re-run on that case,
    too."""
    return entry.evidence.verdict.supports and any(r.number > entry.number for r in refutations[-1:])


def as_of_now(ledger: Ledger, root: Path) -> tuple[Entry, ...]:
    """The entries; those that do not count get a key that matches no question, so that they count as of an earlier
    state."""
    with ledger.still():
        known = [(entry, refutations(ledger, entry)) for entry in ledger.records()]
    return tuple(
        entry if stands(entry.evidence, root) and not outlived(entry, refuted) else changed_since(entry)
        for entry, refuted in known
    )


def changed_since(entry: Entry) -> Entry:
    """The entry of a record whose inputs have changed, or that a later refutation supersedes, with a key that matches
    no question."""
    return replace(entry, evidence=replace(entry.evidence, key=sha256(f"changed since: {entry.hash}")))


def not_established(entry: Entry) -> Entry:
    """The entry of a proof that the kernel no longer establishes, with a key that matches no question."""
    return replace(entry, evidence=replace(entry.evidence, key=sha256(f"not established: {entry.hash}")))


def refutations(ledger: Ledger, entry: Entry) -> tuple[Entry, ...]:
    """The refutations by a counterexample, of the same claim and by the same backend."""
    record = entry.evidence
    return ledger.refutations(record.obligation, record.obligation_digest, record.backend)


def looked_at(entries: Iterable[Entry], root: Path) -> tuple[Observed, ...]:
    """Everything that programs under test read, each once, with its whole path; relative ones are under `root`, the
    workspace."""
    found: dict[tuple[str, Seen], Observed] = {}
    for entry in entries:
        found |= {(o.path, o.kind): o for o in _rows(entry.evidence) or () if o.kind is not Seen.OUTSIDE}
    return tuple(Observed(o.kind, os.path.join(root, o.path), o.digest) for o in found.values())  # noqa: PTH118


def _rows(record: Evidence) -> tuple[Observed, ...] | None:
    """The files that its program under test was observed to read; None if the details cannot be read: a ledger may be
    forged."""
    if OBSERVED not in record.details:
        return ()
    try:
        return from_json(tuple[Observed, ...], record.details[OBSERVED])
    except ValueError:
        return None


def _apart(record: Evidence) -> bool:
    level = record.details.get(ISOLATION)
    return level is None or wanted() is not Isolation.SEALED or level == Isolation.SEALED.value


def _now(kind: Seen, path: str) -> str:
    """As `look`, without reading again what has not changed since the last look."""
    mark = marks(Observed(kind, path))
    return look(kind, path) if mark is None else _digest(kind, path, mark)


@functools.lru_cache(maxsize=100_000)
def _digest(kind: Seen, path: str, mark: tuple[object, ...]) -> str:
    return look(kind, path)
