"""Is this ledger the one that was there before? Held against the index of ledgers, and against what reports say of it.

A ledger only grows. So whatever record anybody once named as its newest must be in it now; where it is not, lines were
cut off the end, or the whole file was deleted, swapped or written anew. Deleting everything to begin anew is anybody's
right, but it does not go by in silence: the index says that a ledger *began* twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from avow.evidence.audit import Discrepancy, Fault
from avow.evidence.heads import GENESIS, Anchor, Event, Index, Statement
from avow.evidence.ledger import Ledger


def continuity(ledger: Ledger, index: Index, anchors: Sequence[Anchor] = ()) -> tuple[Discrepancy, ...]:
    """What the index and other files say of this ledger that is not so. Raises OSError."""
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
    for anchor in anchors:
        if anchor.system == system and anchor.head not in places:
            found.append(Discrepancy(Fault.REPLACED, anchor.where, _of_another(ledger, anchor)))
    return tuple(dict.fromkeys(found))


def _of_another(ledger: Ledger, anchor: Anchor) -> str:
    what = "is not in it" if ledger.path.is_file() else "is gone with the whole ledger"
    return f"{anchor.where} was made of a ledger of {anchor.system} up to record {anchor.head[:12]}…, which {what}"


def began(index: Index, system: str) -> bool:
    """Whether the index saw the ledger's first record written (else it only found records already there)."""
    return any(s.event is Event.BEGAN for s in index.of(system))


def _history(ledger: Ledger, statements: Sequence[Statement]) -> Iterable[Discrepancy]:
    """What is told for ever after, and makes nothing unsound: what is here now was computed anew."""
    name, records = ledger.path.name, 0
    if statements and statements[0].event is Event.REACHED:
        text = f"the index of ledgers found {name} with records already in it: it was itself deleted, or is younger"
        yield Discrepancy(Fault.REPLACED, name, text, serious=False)
    for statement in statements:
        match statement.event:
            case Event.BEGAN:
                if records:
                    text = f"{name} was deleted and begun anew on {statement.time}: {records} records are lost"
                    yield Discrepancy(Fault.REPLACED, name, text, serious=False)
                records = 0
            case Event.REACHED:
                records = statement.records
            case Event.LOST:
                text = (
                    f"{name} was begun anew: the report that stood here on {statement.time} was made of another "
                    f"ledger, up to record {statement.head[:12]}…"
                )
                yield Discrepancy(Fault.REPLACED, name, text, serious=False)


def _reached(ledger: Ledger, statements: Sequence[Statement], places: dict[str, int]) -> Iterable[Discrepancy]:
    """How far it was seen to reach since it last began."""
    since = max((at for at, s in enumerate(statements) if s.event is Event.BEGAN), default=0)
    name = ledger.path.name
    for statement in statements[since:]:
        if statement.event is not Event.REACHED or statement.head == GENESIS:
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
