"""The evidence ledger: one JSON-lines file a system, append-only, hash-chained, safe if a run is killed or the disk is
full.

    {"evidence": {…}, "hash": "…", "n": 7, "prev": "…"}        hash = SHA-256 of the line without its hash

- A record is written whole under a lock and synced before `append` returns. A killed run leaves at most one torn last
  line; the next append removes those bytes and goes on.
- A line in the middle that cannot be read, does not match its hash or does not follow its predecessor is *damage*: it
  is never used as evidence, and always reported (`Ledger.damage`, `avow audit`, a gate).
- ``<file>.head`` names the newest record, so that cutting whole lines off the end is noticed too; the ``index`` of the
  folder names the ledgers themselves (`avow.evidence.heads`).
- A line has one spelling, byte for byte. Another encoding, an extra space or a repeated key is damage.
- The same evidence appended twice is kept once.
- Groups of lines that were found without damage are kept, with their digest and their records, in the user's cache
  (`avow.base.remembered.Kept`). A run does not read them again; `audit` and a fresh run do.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from avow.base.codec import Unreadable, canonical, from_json, from_text, plain, to_json
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import identity, read_regular, sha256, write
from avow.base.records import dataclass
from avow.base.remembered import Kept
from avow.base.tuning.sizes import LINES_KEPT
from avow.base.verdict import Verdict
from avow.evidence.appending import append, drop_half_line, locked, open_file
from avow.evidence.heads import GENESIS as GENESIS
from avow.evidence.heads import Event, Head, index_path, note
from avow.evidence.record import CASE, Evidence


@dataclass(frozen=True, slots=True)
class Entry:
    """A record with its place in the chain. `number` counts lines from 0."""

    number: int
    previous: str
    hash: str
    evidence: Evidence


@dataclass(frozen=True, slots=True)
class Line:
    """A line of Avow's evidence ledger. hash: SHA-256 of the line's canonical JSON without it, in hexadecimal; n: lines
    count from 0; prev: the hash of the line before."""

    evidence: Evidence
    hash: str
    n: int
    prev: str


@dataclass(frozen=True, slots=True)
class Damage:
    """A line of the ledger that must not be used. `line` counts from 1."""

    line: int
    reason: str


class Ledger:
    """One system's ledger file. Safe to use from several threads and several processes at once."""

    def __init__(self, path: Path, *, remembers: bool = False) -> None:
        """`remembers`: groups of lines that this user's Avow found without damage are not read again."""
        self.path = path
        self._kept = Kept("ledgers", path) if remembers else None
        self._lock = threading.RLock()
        self._held = 0
        self._forget()

    # -- reading ------------------------------------------------------------------------------------------------

    def records(self) -> tuple[Entry, ...]:
        """Every record without damage, oldest first. Raises OSError if the file cannot be read."""
        with self._lock:
            self._refresh()
            return tuple(self._entries)

    @property
    def damage(self) -> tuple[Damage, ...]:
        """Every damaged line, and a missing end."""
        with self._lock:
            self._refresh()
            return (*self._damage, *self._garbage(), *self._cut_off())

    @property
    def torn(self) -> bool:
        """Whether the last line is half written: a run was killed, and the next one removes it."""
        with self._lock:
            self._refresh()
            return bool(self._tail) and not self._garbage()

    @property
    def head(self) -> str:
        """The hash of the newest record; `GENESIS` if there is none."""
        entries = self.records()
        return entries[-1].hash if entries else GENESIS

    def current(self, obligation: str, key: str) -> tuple[Entry, ...]:
        """All attempts at an obligation that have the current `key`, oldest first."""
        with self._lock:
            self._refresh()
            return tuple(self._by_key.get((obligation, key), ()))

    def refutations(self, obligation: str, digest: str, backend: str) -> tuple[Entry, ...]:
        """The backend's refutations by a counterexample, of the obligation of that name or that meaning, oldest
        first."""
        with self._lock:
            self._refresh()
            if not self._refuted:
                return ()
            found = [e for name in (obligation, digest) for e in self._refuted.get((name, backend), ())]
            return tuple({e.number: e for e in sorted(found, key=lambda e: e.number)}.values())

    def check(self) -> None:
        """Check every line against the one before it, whatever is kept."""
        with self._lock:
            if self._kept is not None:
                self._kept = None
                self._forget()

    @contextlib.contextmanager
    def still(self) -> Iterator[None]:
        """Holds the ledger fixed for many queries: within the block nothing is read or written. Keep the block short:
        other threads wait."""
        with self._lock:
            self._refresh()
            self._held += 1
            try:
                yield
            finally:
                self._held -= 1

    # -- writing ------------------------------------------------------------------------------------------------

    def append(self, evidence: Evidence) -> Entry:
        """Add a record; it is on the disk when this returns. Raises OSError (a full disk): then nothing was added."""
        return self.append_all((evidence,))[0]

    def append_all(self, evidences: Sequence[Evidence]) -> tuple[Entry, ...]:
        """Add records under one lock with one sync. Raises OSError: then none of them was added."""
        with self._lock, locked(self.path) as file:
            assert not self._held, "nothing is written while the ledger is to stand still"
            drop_half_line(file)
            self._refresh()
            cut = self._lines > 0 and bool(self._cut_off())
            added, lines, result = dict[str, Entry](), [], []
            previous, number = self._stated_head, self._lines
            for evidence in evidences:
                spelled = canonical(encode(evidence))
                known = self._same(evidence, spelled) or added.get(spelled)
                if known is not None:
                    result.append(known)
                    continue
                mark, line = _spell(spelled, number, previous)
                entry = Entry(number, previous, mark, evidence)
                lines.append(line + "\n")
                added[spelled] = entry
                result.append(entry)
                previous, number = mark, number + 1
            if lines and not self._lines:
                note(index_path(self.path.parent), Event.BEGAN, self.path.stem)
            if lines:
                append(file, "".join(lines).encode())
                self._refresh()
            if lines and not cut:  # a new head would hide the cut; a ledger deleted as a whole begins again
                self._write_head(Head(previous, number))
            return tuple(result)

    def accept_end(self) -> None:
        """Accept the newest record that is there as the end: no later one is missing. Raises OSError."""
        with self._lock, locked(self.path) as file:
            assert not self._held, "nothing is written while the ledger is to stand still"
            drop_half_line(file)
            self._refresh()
            self._write_head(Head(self._stated_head, self._lines))

    # -- inside -------------------------------------------------------------------------------------------------

    def _forget(self) -> None:
        self._seen: tuple[int | str, ...] = ()
        self._group: list[bytes] = []
        self._offset = 0
        self._lines = 0
        self._tail = b""
        self._stated_head = GENESIS
        self._entries: list[Entry] = []
        self._damage: list[Damage] = []
        self._by_key: dict[tuple[str, str], list[Entry]] = {}
        self._refuted: dict[tuple[str, str], list[Entry]] = {}

    @property
    def _head_file(self) -> Path:
        return self.path.with_name(self.path.name + ".head")

    def _refresh(self) -> None:
        """Read what was added since the last look (by this or another process)."""
        if self._held:
            return
        try:
            if self._seen and identity(self.path.stat(), self.path) == self._seen:
                return
            with open(self.path, "rb", opener=open_file) as file:
                info = os.fstat(file.fileno())
                if info.st_size < self._offset or (self._seen and (info.st_dev, info.st_ino) != self._seen[:2]):
                    self._forget()
                file.seek(self._offset)
                data = file.read()
        except FileNotFoundError:
            self._forget()
            return
        self._seen = identity(info, self.path)
        whole = data[: data.rfind(b"\n") + 1]
        self._offset += len(whole)
        self._tail = data[len(whole) :]
        lines = whole.split(b"\n")[:-1]
        for line in lines[self._believe(lines) :]:
            self._take(line)
            self._group.append(line)
            if len(self._group) == LINES_KEPT:
                self._keep_group()

    def _believe(self, lines: Sequence[bytes]) -> int:
        """Take the groups at the beginning that are kept; returns the number of their lines."""
        taken = 0
        while self._kept is not None and self._lines == taken <= len(lines) - LINES_KEPT:
            mark = _mark(lines[taken : taken + LINES_KEPT], self._stated_head)
            found: tuple[Entry, ...] | None = self._kept.get(str(taken), mark)
            if found is None:
                break
            for entry in found:
                self._keep(entry)
            taken += LINES_KEPT
            self._lines, self._stated_head = taken, found[-1].hash
        return taken

    def _keep_group(self) -> None:
        if self._kept is not None and not self._damage:
            known: dict[object, object] = {}
            entries = tuple(_shared(entry, known) for entry in self._entries[-LINES_KEPT:])
            self._kept.put(str(self._lines - LINES_KEPT), _mark(self._group, entries[0].previous), entries)
            self._kept.tidy()
        self._group = []

    def _same(self, evidence: Evidence, spelled: str) -> Entry | None:
        """The entry of the same record."""
        alike = self._by_key.get((evidence.obligation, evidence.key), ())
        return next((entry for entry in alike if canonical(encode(entry.evidence)) == spelled), None)

    def _take(self, line: bytes) -> None:
        number = self._lines
        self._lines += 1
        try:
            data = json.loads(line)
            entry = _entry(data)
            evidence = canonical(data["evidence"])
        except (ValueError, RecursionError) as problem:
            self._damage.append(Damage(number + 1, f"cannot be read as a record: {problem}"))
            return
        follows = entry.previous == self._stated_head and entry.number == number
        self._stated_head = entry.hash
        if not follows:  # reported, but the record itself may still be whole: dropping it could hide a refutation
            reason = "does not follow the record before it: a record was removed, inserted, moved or made unreadable"
            self._damage.append(Damage(number + 1, reason))
        mark, spelled = _spell(evidence, entry.number, entry.previous)
        if mark != entry.hash:
            self._damage.append(Damage(number + 1, f"was changed after it was written ({entry.evidence.obligation})"))
            return
        if spelled.encode() != line:  # the content is as it was written, but another program wrote it
            self._damage.append(Damage(number + 1, "is not spelled as it was written (encoding, spaces, doubled keys)"))
        if follows and (same := self._same(entry.evidence, evidence)):
            self._damage.append(Damage(number + 1, f"repeats record {same.number + 1}"))
        self._keep(entry)

    def _keep(self, entry: Entry) -> None:
        self._entries.append(entry)
        record = entry.evidence
        self._by_key.setdefault((record.obligation, record.key), []).append(entry)
        if record.verdict is Verdict.REFUTED and CASE in record.details:
            for name in (record.obligation, record.obligation_digest):
                self._refuted.setdefault((name, record.backend), []).append(entry)

    def _garbage(self) -> tuple[Damage, ...]:
        """Bytes after the last line that are not the beginning of a line."""
        start = b'{"evidence":{'
        if self._tail.startswith(start) or start.startswith(self._tail):
            return ()
        return (Damage(self._lines + 1, "is no record, nor the beginning of one"),)

    def _write_head(self, head: Head) -> None:
        write(self._head_file, canonical(to_json(head)) + "\n")

    def _cut_off(self) -> tuple[Damage, ...]:
        try:
            stated = from_text(Head, read_regular(self._head_file))
        except FileNotFoundError:
            return ()
        except (OSError, Unreadable):
            return (Damage(self._lines + 1, f"{self._head_file.name} cannot be read"),)
        if stated.records > self._lines:
            return (Damage(self._lines + 1, f"{stated.records - self._lines} record(s) were cut off the end"),)
        if not any(entry.hash == stated.hash for entry in reversed(self._entries)):  # nearly always one of the last
            return (Damage(self._lines, f"is not the newest record that {self._head_file.name} names"),)
        return ()


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raises Rejected (``LEDGER001``) for an OSError: a ledger, or the index of ledgers, exists and cannot be read."""
    try:
        yield
    except OSError as error:
        raise Rejected(Diagnostic("LEDGER001", f"{error.filename or path} cannot be read: {error.strerror}")) from None


@functools.cache
def ledger_of(path: Path) -> Ledger:
    """One reader for each file and process: it reads only what was added since."""
    return Ledger(path, remembers=True)


def encode(evidence: Evidence) -> dict[str, Any]:
    """A record as plain JSON data."""
    return {**to_json(evidence), "seconds": plain(float(evidence.seconds))}  # one spelling, whatever the number's type


def _spell(evidence: str, number: int, previous: str) -> tuple[str, str]:
    """A line's hash and the line itself; `evidence` is the record's canonical text."""
    tail = f'"n":{number},"prev":{canonical(previous)}}}'
    mark = sha256(f'{{"evidence":{evidence},{tail}')
    return mark, f'{{"evidence":{evidence},"hash":"{mark}",{tail}'


def _mark(lines: Sequence[bytes], previous: str) -> str:
    """Digest of a group of lines, of the hash before them, and of the code that reads them."""
    return sha256(b"\n".join((_code(), previous.encode(), *lines)))


@functools.cache
def _code() -> bytes:
    modules = (sys.modules[kind.__module__] for kind in (Entry, Evidence, Verdict, Unreadable))
    return b"\n".join((sys.version.encode(), *(read_regular(Path(str(module.__file__))) for module in modules)))


def _shared(value: Any, known: dict[object, Any]) -> Any:
    """The value, with equal texts, and tuples and mappings of texts, as one object: most records of a node say the same
    in most fields. Numbers are left as they are, since 1 equals true."""
    if isinstance(value, Entry | Evidence):
        return replace(value, **{field.name: _shared(getattr(value, field.name), known) for field in fields(value)})
    if type(value) is dict:
        value = {key: _shared(item, known) for key, item in value.items()}
        parts = tuple(value.items())
        return known.setdefault(("of", parts), value) if all(type(item) is str for item in value.values()) else value
    if type(value) is tuple:
        value = tuple(_shared(item, known) for item in value)
        return known.setdefault(value, value) if all(type(item) is str for item in value) else value
    return known.setdefault(value, value) if type(value) is str else value


def _entry(data: object) -> Entry:
    """Raises Unreadable."""
    line = from_json(Line, data)
    return Entry(line.n, line.prev, line.hash, line.evidence)
