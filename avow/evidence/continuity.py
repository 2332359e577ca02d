"""Continuity: whether this ledger is the one that was there before, compared with the index of ledgers and with the
reports that name its head.

A ledger only grows, so every record once named as its newest must still be in it; otherwise lines were cut off the end,
or the whole file was deleted, swapped or rewritten. A user may delete everything and start again, but this is reported:
a refutation may have gone with the records. Each discrepancy stays open until a person acknowledges it by name (``avow
audit --acknowledge``), and is reported in every later run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from avow.evidence.audit import Discrepancy, Fault
from avow.evidence.heads import GENESIS, Anchor, Event, Index, Statement
from avow.evidence.ledger import Ledger


def continuity(ledger: Ledger, index: Index, anchors: Sequence[Anchor] = ()) -> tuple[Discrepancy, ...]:
    """Statements of the index and of other files about this ledger that do not hold. Raises OSError."""
    system = ledger.path.stem
    entries = ledger.records()
    places = {entry.hash: entry.number for entry in entries}
    found = [Discrepancy(Fault.LEDGER, "index", text) for text in index.damage]
    statements = index.of(system)
    if entries and not statements:
        text = f"{ledger.path.name} has {len(entries)} records, but the index of ledgers does not know it"
        found.append(Discrepancy(Fault.LEDGER, ledger.path.name, text))
    found += _history(ledger, statements)
    found += _reached(ledger, statements, places)
    until = max((at for at, s in enumerate(statements) if s.event is Event.ACKNOWLEDGED), default=-1)
    seen = {statement.head for statement in statements[: until + 1]}
    for anchor in anchors:
        if anchor.system == system and anchor.head not in places:
            text, serious = _of_another(ledger, anchor), anchor.head not in seen
            found.append(Discrepancy(Fault.REPLACED, anchor.where, text, serious))
    return tuple(dict.fromkeys(found))


def acknowledged(index: Index, system: str) -> Statement | None:
    """The newest acknowledgement."""
    found = [s for s in index.of(system) if s.event is Event.ACKNOWLEDGED]
    return found[-1] if found else None


def _of_another(ledger: Ledger, anchor: Anchor) -> str:
    what = "is not in it" if ledger.path.is_file() else "is gone with the whole ledger"
    return f"{anchor.where} was made of a ledger of {anchor.system} up to record {anchor.head[:12]}…, which {what}"


def began(index: Index, system: str) -> bool:
    """Whether the index saw the ledger's first record written (else it only found records already there)."""
    return any(s.event is Event.BEGAN for s in index.of(system))


def _history(ledger: Ledger, statements: Sequence[Statement]) -> Iterable[Discrepancy]:
    """The recorded losses, reported in every later run; open until a later line acknowledges them."""
    name, records = ledger.path.name, 0
    until = max((at for at, s in enumerate(statements) if s.event is Event.ACKNOWLEDGED), default=-1)
    if statements and statements[0].event is Event.REACHED:
        text = f"the index of ledgers found {name} with records already in it: it was itself deleted, or is younger"
        yield Discrepancy(Fault.REPLACED, name, text, serious=until < 0)
    for at, statement in enumerate(statements):
        match statement.event:
            case Event.BEGAN:
                if records:
                    text = f"{name} was deleted and begun anew on {statement.time}: {records} records are lost"
                    yield Discrepancy(Fault.REPLACED, name, text, serious=at > until)
                records = 0
            case Event.REACHED:
                records = statement.records
            case Event.LOST:
                text = (
                    f"{name} was begun anew, cut or rolled back: the report that stood here on {statement.time} was "
                    f"made of another ledger, up to record {statement.head[:12]}…"
                )
                yield Discrepancy(Fault.REPLACED, name, text, serious=at > until)
            case Event.ACKNOWLEDGED:
                records = statement.records
                text = f"what was lost before {statement.time} was acknowledged by {statement.note}"
                yield Discrepancy(Fault.REPLACED, name, text, serious=False)


def _reached(ledger: Ledger, statements: Sequence[Statement], places: dict[str, int]) -> Iterable[Discrepancy]:
    """Whether the ledger still contains every head that was recorded since it last began."""
    starts = (Event.BEGAN, Event.ACKNOWLEDGED)
    since = max((at for at, s in enumerate(statements) if s.event in starts), default=0)
    name = ledger.path.name
    for statement in statements[since:]:
        if statement.event not in (Event.REACHED, Event.ACKNOWLEDGED) or statement.head == GENESIS:
            continue
        if not ledger.path.is_file():
            text = f"{name} is gone: on {statement.time} it had {statement.records} records"
            yield Discrepancy(Fault.GONE, name, text)
            return
        place = places.get(statement.head)
        if place is None or (statement.records and place != statement.records - 1):
            text = (
                f"{name} is not the ledger that reached record {statement.records or '?'} ({statement.head[:12]}…) on "
                f"{statement.time}: it was cut, swapped or written anew"
            )
            yield Discrepancy(Fault.REPLACED, name, text)
            return
