"""The audit: every file that the ledger refers to is hashed again, and each discrepancy is named.

A file is compared with the *newest* record that wrote or read it: an older run's file at the same path has been
replaced legitimately, and its record is history. The audit does not check whether a re-run would give the same answer
(``avow verify --fresh`` does); it checks that the answer is the recorded one, to the recorded question.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from enum import StrEnum
from pathlib import Path

from avow.base.files import digest_once
from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.evidence.ledger import Entry, Ledger
from avow.evidence.record import STANDS_ON, Evidence
from avow.evidence.status import Status, effective


class Fault(StrEnum):
    """The kinds of discrepancy between the ledger and the files."""

    LEDGER = "ledger"
    """A line of the ledger was edited, removed, inserted or cannot be read."""
    CHANGED = "changed"
    """A file that an attempt wrote has changed."""
    GONE = "gone"
    """A file that an attempt wrote no longer exists."""
    MISPLACED = "misplaced"
    """A record points at another obligation, method or system than its key belongs to."""
    IMPOSSIBLE = "impossible"
    """A record gives a verdict that its method cannot give."""
    OUTDATED = "outdated"
    """An input has changed since: not tampering, but the evidence is stale."""
    REPLACED = "replaced"
    """The ledger is not the one that was there before, or was started again from the first line."""
    REDIRECTED = "redirected"
    """A symbolic link replaces one of the ledger's own files."""
    CLOCK = "clock"
    """A record is from the future, or the clock went backwards between two records."""
    SIGNATURE = "signature"
    """The ledger does not match its signature, or is not covered by it."""


@dataclass(frozen=True, slots=True)
class Discrepancy:
    """One thing that the audit found. `serious` ones fail the integrity gate."""

    fault: Fault
    subject: str
    """The path, ledger line or obligation that it is about."""
    text: str
    serious: bool = True


def audit(
    ledger: Ledger,
    root: Path,
    *,
    system: str | None = None,
    obligations: Mapping[str, str] | None = None,
    keys: Mapping[tuple[str, str], str] | None = None,
    strengths: Mapping[str, Verdict] | None = None,
    engines: Mapping[tuple[str, str], str] | None = None,
    now: datetime | None = None,
    strict: bool = False,
) -> tuple[Discrepancy, ...]:
    """Every discrepancy, the ledger's own first. `root` is the workspace; `obligations` maps ids to digests as computed
    now, `keys` (obligation id, method) to the key as of now, `engines` the same to the backend that the plan names, and
    `strengths` a backend's name to the strongest verdict that it can give, if the caller knows them. With `now` (with a
    time zone) records of the future are reported. A discrepancy of a file is serious as long as its record is current,
    and with `strict` also while it is the newest of its method. Raises OSError if the ledger cannot be read."""
    entries = ledger.records()
    found = [Discrepancy(Fault.LEDGER, f"line {d.line}", f"ledger line {d.line} {d.reason}") for d in ledger.damage]
    if ledger.torn:
        text = "the last line is half written: a run was killed; the next one removes it"
        found.append(Discrepancy(Fault.LEDGER, "the end", text, serious=False))
    found += _redirected(ledger)
    found += _misplaced(entries, system, obligations or {}, keys or {})
    found += _impossible(entries, strengths or {}, engines or {}, keys or {})
    found += _files(entries, root, keys, strict)
    found += _clock(entries, now)
    return tuple(dict.fromkeys(found))


def _redirected(ledger: Ledger) -> Iterable[Discrepancy]:
    for path in (ledger.path, ledger.path.with_name(ledger.path.name + ".head")):
        if path.is_symlink():
            yield Discrepancy(Fault.REDIRECTED, path.name, f"{path.name} is a symbolic link that leads elsewhere")


def _misplaced(
    entries: tuple[Entry, ...],
    system: str | None,
    obligations: Mapping[str, str],
    keys: Mapping[tuple[str, str], str],
) -> Iterable[Discrepancy]:
    owners: dict[str, tuple[str, str, str]] = {}
    for entry in entries:
        record = entry.evidence
        if system is not None and record.obligation.partition("/")[0] != system:
            text = f"{_where(entry)} is of another system than {system}"
            yield Discrepancy(Fault.MISPLACED, record.obligation, text)
        owner = (record.obligation, record.obligation_digest, record.method)
        other = owners.setdefault(record.key, owner)
        if other != owner:
            text = (
                f"{_where(entry)} carries the key of {other[0]}, {other[2]}: it answers another question than it says"
            )
            yield Discrepancy(Fault.MISPLACED, record.obligation, text)
        now = obligations.get(record.obligation)
        is_current = keys.get((record.obligation, record.method)) == record.key
        if is_current and now is not None and now != record.obligation_digest:
            text = f"{_where(entry)} has the key of today's claim but the digest of another claim"
            yield Discrepancy(Fault.MISPLACED, record.obligation, text)


def _where(entry: Entry) -> str:
    return f"record {entry.number + 1} ({entry.evidence.obligation}, {entry.evidence.method})"


_SLACK = timedelta(hours=1)
"""How far two clocks may differ (a ledger may travel between machines) before it is reported."""


def _clock(entries: tuple[Entry, ...], now: datetime | None) -> Iterable[Discrepancy]:
    """Ages and expiries are computed from the clock: setting it back would make old evidence count as recent."""
    latest: datetime | None = None
    for entry in entries:
        record = entry.evidence
        started, ended = _times(record)
        if started is None or ended is None:
            text = f"{_of(entry)} does not say when it was made: '{record.started[:40]}'"
            yield Discrepancy(Fault.CLOCK, record.obligation, text, serious=False)
            continue
        if now is not None and started > now + _SLACK:
            text = f"is from the future ({record.started}): the clock was set back, or the record was made up"
            yield Discrepancy(Fault.CLOCK, record.obligation, f"{_of(entry)} {text}")
        if latest is not None and ended < latest - _SLACK:
            text = f"{_of(entry)} was made before the record that it follows: the clock was set back between them"
            yield Discrepancy(Fault.CLOCK, record.obligation, text, serious=False)
        latest = ended if latest is None else max(latest, ended)


def _of(entry: Entry) -> str:
    return f"record {entry.number + 1} ({entry.evidence.obligation})"


def _times(record: Evidence) -> tuple[datetime | None, datetime | None]:
    """When the attempt started and ended; None, None if its record does not say."""
    # a mutation score takes its seconds from the record that it is about
    seconds = 0.0 if "mutation" in record.details else max(record.seconds, 0.0)
    try:
        started = datetime.fromisoformat(record.started)
        return (started, started + timedelta(seconds=seconds)) if started.tzinfo else (None, None)
    except (ValueError, OverflowError):
        return None, None


def _impossible(
    entries: tuple[Entry, ...],
    strengths: Mapping[str, Verdict],
    engines: Mapping[tuple[str, str], str],
    keys: Mapping[tuple[str, str], str],
) -> Iterable[Discrepancy]:
    for entry in entries:
        record = entry.evidence
        pair = (record.obligation, record.method)
        if pair in engines and keys.get(pair) == record.key and record.backend != engines[pair]:
            text = (
                f"record {entry.number + 1} answers for {record.method} as '{record.backend}', but the plan's "
                f"{record.method} is '{engines[pair]}'"
            )
            yield Discrepancy(Fault.IMPOSSIBLE, record.obligation, text)
        most = strengths.get(record.backend)
        if most is not None and record.strength.supports and Status(record.strength).rank > Status(most).rank:
            text = (
                f"record {entry.number + 1} says that {record.backend} can show '{record.strength}', but it can "
                f"show no more than '{most}'"
            )
            yield Discrepancy(Fault.IMPOSSIBLE, record.obligation, text)
        counts_as = effective(record)
        if counts_as is not record.verdict:
            text = (
                f"record {entry.number + 1} says '{record.verdict}', but its method ({record.method}) can show no more "
                f"than '{record.strength}': it counts as '{counts_as}'"
            )
            yield Discrepancy(Fault.IMPOSSIBLE, record.obligation, text)


def _files(
    entries: tuple[Entry, ...], root: Path, keys: Mapping[tuple[str, str], str] | None, strict: bool
) -> Iterable[Discrepancy]:
    left: dict[str, Entry] = {}
    read: dict[str, tuple[str, Entry]] = {}
    for entry in entries:  # oldest first: the newest record wins
        left |= dict.fromkeys(entry.evidence.outputs, entry)
        read |= {path: (mark, entry) for path, mark in entry.evidence.inputs.items()}
    # A record that counts today read today's files, even if a later attempt read them in another state in between.
    for entry in entries:
        if keys and keys.get((entry.evidence.obligation, entry.evidence.method)) == entry.evidence.key:
            read |= {path: (mark, entry) for path, mark in entry.evidence.inputs.items()}
    made = [(path, entry.evidence.outputs[path], entry) for path, entry in left.items()]
    wrong = [(path, mark, told) for path, mark, e in made for told in _compare(root, path, mark, e, made=True)]
    relied_upon = _relied_upon(entries, keys, strict) if wrong else set()
    for path, mark, (fault, text) in wrong:
        yield Discrepancy(fault, path, text, (path, mark) in relied_upon)
    for path, (mark, entry) in read.items():
        for fault, text in _compare(root, path, mark, entry, made=False) if path not in left else ():
            yield Discrepancy(fault, path, text, serious=False)


def _relied_upon(
    entries: Sequence[Entry], keys: Mapping[tuple[str, str], str] | None, strict: bool
) -> set[tuple[str, str]]:
    """The files, with their digests, that a status rests on today: files of past attempts may be deleted, and among
    records with the same statement and the same deciding details only the newest counts."""
    newest = {(e.evidence.obligation, e.evidence.method): e.evidence.key for e in entries}
    asked = [newest] if keys is None else [keys, newest] if strict else [keys]
    later: dict[tuple[object, ...], list[Mapping[str, object]]] = {}
    found: set[tuple[str, str]] = set()
    for record in (entry.evidence for entry in reversed(entries)):
        alike, stands = later.setdefault(_words(record), []), _stands_on(record)
        current = any(known.get((record.obligation, record.method)) == record.key for known in asked)
        if current and stands not in alike:
            found.update(record.outputs.items())
        alike.append(stands)
    return found


def _words(record: Evidence) -> tuple[object, ...]:
    """A record's statement and the question it answers: a case keeps only the newest of the records that agree in
    these."""
    return record.obligation, record.method, record.key, effective(record), record.vacuous


def _stands_on(record: Evidence) -> Mapping[str, object]:
    """The details besides the key that decide whether a record counts: of two records that differ in them, the earlier
    may count and the later not."""
    return {name: record.details[name] for name in STANDS_ON if name in record.details}


def _compare(root: Path, path: str, mark: str, entry: Entry, *, made: bool) -> Iterable[tuple[Fault, str]]:
    place = os.path.join(root, path)  # noqa: PTH118 - of each file of each record in every run
    behind = f"{path} (record {entry.number + 1}: {entry.evidence.obligation}, {entry.evidence.method})"
    if made and (os.path.islink(place) or ".." in path.split("/")):  # noqa: PTH114
        yield Fault.REDIRECTED, f"{behind} is a symbolic link, or a path, that leads elsewhere"
    try:
        now = digest_once(Path(place))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        yield Fault.GONE if made else Fault.OUTDATED, f"{behind} cannot be read: {reason}"
        return
    if now != mark and made:
        text = f"{behind} was changed after the record was written: SHA-256 {now[:12]}…, recorded {mark[:12]}…"
        yield Fault.CHANGED, text
    elif now != mark:
        yield Fault.OUTDATED, f"{behind} has changed since: the evidence is stale"
