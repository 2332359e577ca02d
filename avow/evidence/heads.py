"""The index of ledgers: which ledgers there are, and the newest record seen in each.

A ledger's own chain cannot show that the whole file is gone, or that it was rewritten from the first line. So the
folder of the ledgers also has ``index``, a file of chained lines of its own:

    {"event": "reached", "hash": "…", "head": "…", "n": 1, "prev": "…", "records": 36, "system": "rover", "time": "…"}

- ``began``: the first record of a ledger is about to be written. A second one means that the file was deleted in
  between.
- ``reached``: a report was made of so many records, up to that one. They must stay in the ledger.
- ``lost``: there was a report made of another ledger than the one that began.
- ``acknowledged``: a person has accepted the losses and damage that the lines before record, with name and reason.
  Later findings are not covered.

Reports and attestations name the head as well (`stated_heads`), and may be kept elsewhere. Nothing of this is secret:
if ledger, index *and* reports are all rewritten, only a signature or a copy kept elsewhere shows it.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from dataclasses import field, replace
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from avow.base.codec import LATER, Unreadable, canonical, from_text, to_json
from avow.base.files import read_regular, sha256
from avow.base.records import dataclass
from avow.evidence.appending import append, drop_half_line, locked

GENESIS = "0" * 64
"""The hash before the first record of a chain."""


class Event(StrEnum):
    BEGAN = "began"
    REACHED = "reached"
    LOST = "lost"
    ACKNOWLEDGED = "acknowledged"


@dataclass(frozen=True, slots=True)
class Statement:
    """A line of the index. `records` is 0 if only the head is known."""

    event: Event
    system: str
    records: int
    head: str
    time: str
    note: str = field(default="", metadata=LATER)
    """The person who acknowledged, and the reason."""
    state: str = field(default="", metadata=LATER)
    """Digest of the damage that was acknowledged."""


@dataclass(frozen=True, slots=True)
class Line(Statement):
    """The line as written: its number, the hash of the line before it, and its own hash, over all other fields."""

    n: int = field(kw_only=True)
    prev: str = field(kw_only=True)
    hash: str = field(default="", kw_only=True, metadata=LATER)


@dataclass(frozen=True, slots=True)
class Head:
    """The content of ``<ledger>.head``: the newest record's hash, and the number of records."""

    hash: str
    records: int


@dataclass(frozen=True, slots=True)
class Index:
    """The readable lines of the index, and a description of the damage. `marks` are the lines' hashes, for
    signatures."""

    statements: tuple[Statement, ...] = ()
    marks: tuple[str, ...] = ()
    damage: tuple[str, ...] = ()
    exists: bool = False

    def of(self, system: str) -> tuple[Statement, ...]:
        return tuple(s for s in self.statements if s.system == system)

    @property
    def systems(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(s.system for s in self.statements))


def index_path(ledgers: Path) -> Path:
    """The index in a folder of ledgers."""
    return ledgers / "index"


def read_index(path: Path) -> Index:
    """Raises OSError if the file exists and cannot be read."""
    try:
        data = read_regular(path)
    except FileNotFoundError:
        return Index()
    found: list[Statement] = []
    marks: list[str] = []
    damage: list[str] = []
    previous = GENESIS
    *lines, torn = data.split(b"\n")
    for number, line in enumerate(lines):
        entry = _read(line)
        if entry is None:
            damage.append(f"line {number + 1} of the index of ledgers is not as it was written")
            continue
        if entry.n != number or entry.prev != previous:
            damage.append(f"line {number + 1} of the index of ledgers does not follow the line before it")
        previous = entry.hash
        found.append(entry)
        marks.append(entry.hash)
    if torn and not torn.startswith(b'{"event":'):  # else a run was killed while writing it: the next one repairs it
        damage.append("there is something behind the last line of the index of ledgers")
    return Index(tuple(found), tuple(marks), tuple(damage), True)


def note(path: Path, event: Event, system: str, records: int = 0, head: str = GENESIS, **more: str) -> None:
    """Add a line, unless the newest of that system says the same; `more` are `Statement.note` and `.state`. Raises
    OSError: then nothing was added."""
    if event is not Event.BEGAN and _is_newest(read_index(path), event, system, records, head):
        return
    with locked(path) as file:
        drop_half_line(file)
        lines = read_regular(path).splitlines()
        last = _read(lines[-1]) if lines else None
        now = datetime.now(UTC).isoformat(timespec="seconds")
        follows = last.hash if last else GENESIS
        append(file, _written(Line(event, system, records, head, now, **more, n=len(lines), prev=follows)) + b"\n")


def _is_newest(index: Index, event: Event, system: str, records: int, head: str) -> bool:
    newest = index.of(system)[-1:]
    return bool(newest) and (newest[0].event, newest[0].records, newest[0].head) == (event, records, head)


def _written(entry: Line) -> bytes:
    """The line with its hash."""
    mark = sha256(canonical(to_json(replace(entry, hash=""))))
    return canonical(to_json(replace(entry, hash=mark))).encode()


def _read(line: bytes) -> Line | None:
    """None for a line that differs from what was written."""
    try:
        entry = from_text(Line, line)
    except Unreadable:
        return None
    return entry if _written(entry) == line else None


# -- the head as other files state it -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Anchor:
    """A file that names a ledger's newest record as of some day: a report, or an attestation."""

    where: str
    system: str
    head: str


def stated_heads(path: Path, where: str) -> tuple[Anchor, ...]:
    """The ledgers' heads that a ``report.json``, an ``attestation.jsonl`` or a folder with reports in it names; empty
    if it names none that can be read. Raises OSError for a file that cannot be read."""
    if path.is_dir():
        files = [*path.glob("report.json"), *path.glob("*/report.json"), *path.glob("attestation.jsonl")]
        return tuple(a for file in sorted(files) for a in stated_heads(file, where or file.as_posix()))
    found = []
    data = read_regular(path)
    for text in [_short(data)] if path.suffix == ".json" else data.splitlines():
        try:
            found += [Anchor(where or path.as_posix(), *pair) for pair in _heads(json.loads(text))]
        except (ValueError, RecursionError):
            continue
    return tuple(dict.fromkeys(anchor for anchor in found if anchor.head != GENESIS))


def _short(data: bytes) -> bytes:
    """The two items that matter of a report as Avow writes it (an item a line, and no raw line end in any text); else
    all of it. A report has megabytes."""
    lines = []
    for name in (b'\n "ledger_head": "', b'\n "system": "'):
        at = data.find(name)
        if not data.startswith(b"{\n") or at < 0 or data.find(name, at + 1) >= 0:
            return data
        end = data.find(b"\n", at + 1)
        lines.append(data[at + 1 : end].rstrip(b","))
    return b"{%b}" % b",".join(lines)


def _heads(data: object) -> Iterable[tuple[str, str]]:
    match data:
        case {"payload": str(payload), "signatures": [*_]}:  # an envelope: its statement, whoever signed it
            yield from _heads(json.loads(base64.b64decode(payload)))
        case {"ledger_head": str(head), "system": str(system)}:
            yield system, head
        case {"predicate": {"configuration": [*items]}}:
            for item in items:
                match item:
                    case {"name": str(name), "digest": {"sha256": str(head)}} if name.startswith("ledger/"):
                        yield name.removeprefix("ledger/"), head
