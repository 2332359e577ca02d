"""The index of ledgers: which there are, and how far each was seen to reach.

A ledger's own chain cannot tell that the whole file is gone, or that it was written anew from the first line. So beside
the ledgers stands ``index``, a file of chained lines of its own:

    {"event": "reached", "hash": "…", "head": "…", "n": 1, "prev": "…", "records": 36, "system": "rover", "time": "…"}

- ``began``: the first record of a ledger is about to be written. A second one says that the file was deleted meanwhile.
- ``reached``: a report was made of so many records, up to that one. They must be in the ledger for ever after.
- ``lost``: a report stood here that was made of another ledger than the one that began.
- ``acknowledged``: a person has seen what the lines before say is lost or damaged, and why; with name and reason. What
  comes to light later is another matter.

Reports and attestations name the head as well (`stated_heads`), and may be kept elsewhere. Nothing of this is secret:
somebody who writes ledger, index *and* reports anew is only found out by a signature or by a copy kept elsewhere.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterable
from dataclasses import field, replace
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from avow.base.codec import LATER, Unreadable, canonical, from_text, to_json
from avow.base.files import read_regular, sha256
from avow.base.records import dataclass
from avow.evidence.appending import append, locked

GENESIS = "0" * 64
"""What the first record of a chain follows."""


class Event(StrEnum):
    BEGAN = "began"
    REACHED = "reached"
    LOST = "lost"
    ACKNOWLEDGED = "acknowledged"


@dataclass(frozen=True, slots=True)
class Statement:
    """A line of the index. `records` is 0 where only the head is known."""

    event: Event
    system: str
    records: int
    head: str
    time: str
    note: str = field(default="", metadata=LATER)
    """Who acknowledged, and why."""
    state: str = field(default="", metadata=LATER)
    """Digest of the damage that was acknowledged."""


@dataclass(frozen=True, slots=True)
class Line(Statement):
    """As it is written: its number, the hash of the line before it, and its own, of all the rest."""

    n: int = field(kw_only=True)
    prev: str = field(kw_only=True)
    hash: str = field(default="", kw_only=True, metadata=LATER)


@dataclass(frozen=True, slots=True)
class Head:
    """What ``<ledger>.head`` holds: the newest record's hash, and how many records there are."""

    hash: str
    records: int


@dataclass(frozen=True, slots=True)
class Index:
    """What can be read of the index, and in words what cannot. `marks` are the lines' hashes, for signatures."""

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
    """Raises OSError where there is a file that cannot be read."""
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
        said = _read(line)
        if said is None:
            damage.append(f"line {number + 1} of the index of ledgers is not as it was written")
            continue
        if said.n != number or said.prev != previous:
            damage.append(f"line {number + 1} of the index of ledgers does not follow the line before it")
        previous = said.hash
        found.append(said)
        marks.append(said.hash)
    if torn and not torn.startswith(b'{"event":'):  # else a run was killed while writing it: the next one mends it
        damage.append("there is something behind the last line of the index of ledgers")
    return Index(tuple(found), tuple(marks), tuple(damage), True)


def note(path: Path, event: Event, system: str, records: int = 0, head: str = GENESIS, **more: str) -> None:
    """Add a line, unless the newest of that system says the same; `more` are `Statement.note` and `.state`. Raises
    OSError: then nothing was added."""
    if event is not Event.BEGAN and _is_newest(read_index(path), event, system, records, head):
        return
    with locked(path) as file:
        data = read_regular(path)
        whole = data[: data.rfind(b"\n") + 1]
        os.ftruncate(file, len(whole))  # what a killed run left half written
        lines = whole.splitlines()
        last = _read(lines[-1]) if lines else None
        now = datetime.now(UTC).isoformat(timespec="seconds")
        follows = last.hash if last else GENESIS
        append(file, _written(Line(event, system, records, head, now, **more, n=len(lines), prev=follows)) + b"\n")


def _is_newest(index: Index, event: Event, system: str, records: int, head: str) -> bool:
    newest = index.of(system)[-1:]
    return bool(newest) and (newest[0].event, newest[0].records, newest[0].head) == (event, records, head)


def _written(said: Line) -> bytes:
    """With its hash."""
    mark = sha256(canonical(to_json(replace(said, hash=""))))
    return canonical(to_json(replace(said, hash=mark))).encode()


def _read(line: bytes) -> Line | None:
    """None for a line that is not as it was written."""
    try:
        said = from_text(Line, line)
    except Unreadable:
        return None
    return said if _written(said) == line else None


# -- the head as other files state it -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Anchor:
    """A file that names a ledger's newest record as of some day: a report, or an attestation."""

    where: str
    system: str
    head: str


def stated_heads(path: Path, where: str) -> tuple[Anchor, ...]:
    """What a ``report.json``, an ``attestation.jsonl`` or a folder with reports in it says of ledgers' heads; nothing
    where it says nothing that can be read. Raises OSError for a file that cannot be read."""
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
    """Of a report as Avow writes it (an item a line, and no raw line end in any text) the two items that matter; else
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
        case {"payload": str(payload), "signatures": [*_]}:  # an envelope: what it says, whoever signed it
            yield from _heads(json.loads(base64.b64decode(payload)))
        case {"ledger_head": str(head), "system": str(system)}:
            yield system, head
        case {"predicate": {"configuration": [*items]}}:
            for item in items:
                match item:
                    case {"name": str(name), "digest": {"sha256": str(head)}} if name.startswith("ledger/"):
                        yield name.removeprefix("ledger/"), head
