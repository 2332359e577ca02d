"""Poisoned ledgers and swapped files: random tamperings of each kind (AVOW_TAMPERINGS=100), and every one is found.

The tamperer is given more and more: first single bytes and lines, then the hash chain and the file that names its head
(`rechain`), then whole files. What a tamperer who writes *everything* anew is noticed by stands in `test_continuity`.
"""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from assurance.sample import METHODS as METHOD_INFOS
from assurance.sample import case, evidence, guarantee, key_of, system
from helpers import some

from avow.base.codec import canonical
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.evidence.audit import Discrepancy, audit
from avow.evidence.continuity import continuity
from avow.evidence.heads import GENESIS, Event, index_path, note, read_index
from avow.evidence.ledger import Ledger
from avow.evidence.record import Evidence

TIMES = int(os.environ.get("AVOW_TAMPERINGS", "20"))
NAMES = [f"c{n}" for n in range(12)]
CLAIMS = {name: guarantee("node", name) for name in NAMES}
METHODS = ("hoare", "dafny", "hypothesis")


def records(root: Path) -> list[Evidence]:
    found = []
    for at, (name, claim) in enumerate(CLAIMS.items()):
        method = METHODS[at % 3]
        log = root / f"logs/{name}.log"
        log.parent.mkdir(exist_ok=True)
        log.write_text(f"{name}: verified, {at} goals\n")
        verdict = Verdict.REFUTED if at % 4 == 3 else Verdict.TESTED if method == "hypothesis" else Verdict.PROVED
        found.append(evidence(claim, verdict, method, outputs={f"logs/{name}.log": sha256(log.read_text())}))
    return found


class Place:
    """A workspace that is tampered with and put right again."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.ledger = root / "artifacts/ledger/rover.jsonl"
        for name in ("rover", "other"):
            made = Ledger(self.ledger.with_name(f"{name}.jsonl"))
            made.append_all(records(root) if name == "rover" else [evidence(guarantee("node", "x", of="other"))])
            note(self.index, Event.REACHED, name, len(made.records()), made.head)
        self.files = {p: p.read_bytes() for p in root.rglob("*") if p.is_file()}

    @property
    def index(self) -> Path:
        return index_path(self.ledger.parent)

    @property
    def head(self) -> Path:
        return self.ledger.with_name("rover.jsonl.head")

    def restore(self) -> None:
        for path in self.root.rglob("*"):
            if path.is_symlink() or path.is_fifo() or (path not in self.files and not path.is_dir()):
                path.unlink()
        for path, data in self.files.items():
            if path.is_dir():
                shutil.rmtree(path)
            if not path.is_file() or path.read_bytes() != data:
                path.write_bytes(data)

    def found(self) -> list[str]:
        return [d.text for d in self.audit() if d.serious]

    def audit(self) -> tuple[Discrepancy, ...]:
        ledger = Ledger(self.ledger)
        found = audit(
            ledger,
            self.root,
            system="rover",
            obligations={c.id: c.digest for c in CLAIMS.values()},
            keys={(c.id, METHODS[at % 3]): key_of(c, METHODS[at % 3]) for at, c in enumerate(CLAIMS.values())},
            strengths={method.name: method.strength for method in METHOD_INFOS},
            engines={(c.id, METHODS[at % 3]): METHODS[at % 3] for at, c in enumerate(CLAIMS.values())},
            now=datetime.now(UTC),
        )
        return (*found, *continuity(ledger, read_index(self.index)))

    def lines(self) -> list[bytes]:
        return self.files[self.ledger].splitlines(keepends=True)

    def write(self, lines: list[bytes]) -> None:
        self.ledger.write_bytes(b"".join(lines))

    def rechain(self, evidences: list[dict[str, Any]]) -> None:
        """A ledger that is whole in itself, and its head: what somebody writes who has read how it is done."""
        lines, previous = [], GENESIS
        for number, data in enumerate(evidences):
            body = {"evidence": data, "n": number, "prev": previous}
            previous = sha256(canonical(body))
            lines.append(canonical({**body, "hash": previous}).encode() + b"\n")
        self.write(lines)
        self.head.write_text(canonical({"hash": previous, "records": len(lines)}) + "\n")

    def evidences(self) -> list[dict[str, Any]]:
        return [json.loads(line)["evidence"] for line in self.lines()]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    return Place(tmp_path_factory.mktemp("tamper"))


def flip_a_byte(place: Place, rng: random.Random) -> None:
    data = bytearray(place.files[place.ledger])
    at = rng.randrange(len(data))
    data[at] ^= 1 << rng.randrange(7)
    place.ledger.write_bytes(bytes(data))


def change_a_verdict(place: Place, rng: random.Random) -> None:
    lines = place.lines()
    at = rng.randrange(len(lines))
    data = json.loads(lines[at])
    old = data["evidence"]["verdict"]
    data["evidence"]["verdict"] = rng.choice([v.value for v in Verdict if v.value != old])
    lines[at] = canonical(data).encode() + b"\n"
    place.write(lines)


def change_a_record_and_its_hash(place: Place, rng: random.Random) -> None:
    """Cleverer: the line's own hash is computed again; the chain tells."""
    lines = place.lines()
    at = rng.randrange(len(lines))
    data = json.loads(lines[at])
    data["evidence"]["summary"] += " (surely)"
    body = {name: data[name] for name in ("evidence", "n", "prev")}
    lines[at] = canonical({**body, "hash": sha256(canonical(body))}).encode() + b"\n"
    place.write(lines)


def remove_a_line(place: Place, rng: random.Random) -> None:
    lines = place.lines()
    del lines[rng.randrange(len(lines))]
    place.write(lines)


def cut_the_end(place: Place, rng: random.Random) -> None:
    place.ledger.write_bytes(place.files[place.ledger][: -rng.randrange(1, 4000)])


def swap_lines(place: Place, rng: random.Random) -> None:
    lines = place.lines()
    a, b = rng.sample(range(len(lines)), 2)
    lines[a], lines[b] = lines[b], lines[a]
    place.write(lines)


def repeat_a_line(place: Place, rng: random.Random) -> None:
    lines = place.lines()
    lines.insert(rng.randrange(len(lines) + 1), rng.choice(lines))
    place.write(lines)


def insert_a_forgery(place: Place, rng: random.Random) -> None:
    lines = place.lines()
    at = rng.randrange(len(lines))
    data = json.loads(lines[at])
    data["evidence"]["verdict"], data["evidence"]["run"] = "proved", "forged"
    body = {"evidence": data["evidence"], "n": at, "prev": data["prev"]}
    lines.insert(at, canonical({**body, "hash": sha256(canonical(body))}).encode() + b"\n")
    place.write(lines)


def edit_a_log(place: Place, rng: random.Random) -> None:
    log = place.root / f"logs/{rng.choice(NAMES)}.log"
    data = bytearray(log.read_bytes())
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    log.write_bytes(bytes(data))


def swap_logs(place: Place, rng: random.Random) -> None:
    a, b = (place.root / f"logs/{name}.log" for name in rng.sample(NAMES, 2))
    first, second = a.read_bytes(), b.read_bytes()
    a.write_bytes(second)
    b.write_bytes(first)


def remove_or_empty_a_log(place: Place, rng: random.Random) -> None:
    log = place.root / f"logs/{rng.choice(NAMES)}.log"
    if rng.random() < 0.5:
        log.unlink()
    else:
        log.write_bytes(b"")


def poison_the_cache(place: Place, rng: random.Random) -> None:
    """Through the front door: a whole record with today's key, for a claim with another meaning."""
    at = rng.randrange(len(NAMES))
    claim, method = CLAIMS[NAMES[at]], METHODS[at % 3]
    Ledger(place.ledger).append(evidence(claim, method=method, obligation_digest=sha256(str(rng.random()))))


def point_at_another_claim(place: Place, rng: random.Random) -> None:
    a, b = rng.sample(range(len(NAMES)), 2)
    key = key_of(CLAIMS[NAMES[a]], METHODS[a % 3])
    Ledger(place.ledger).append(evidence(CLAIMS[NAMES[b]], method=METHODS[b % 3], key=key, summary=str(rng.random())))


def claim_too_much(place: Place, rng: random.Random) -> None:
    claim = CLAIMS[rng.choice(NAMES)]
    weak = rng.choice([Verdict.TESTED, Verdict.MONITORED, Verdict.REVIEWED, Verdict.CHECKED])
    record = evidence(claim, Verdict.PROVED, "hypothesis", strength=weak, key=str(rng.random()))
    Ledger(place.ledger).append(record)


def lend_a_method_strength(place: Place, rng: random.Random) -> None:
    """Tests that say of themselves that they can prove."""
    claim = CLAIMS[rng.choice(NAMES)]
    record = evidence(claim, Verdict.PROVED, "hypothesis", strength=Verdict.PROVED, key=str(rng.random()))
    Ledger(place.ledger).append(record)


def speak_for_another_system(place: Place, rng: random.Random) -> None:
    Ledger(place.ledger).append(evidence(guarantee("node", rng.choice(NAMES), of=f"other{rng.random()}")))


def lend_another_backends_name(place: Place, rng: random.Random) -> None:
    """What tests answered, with today's key, as if a prover had."""
    at = rng.choice([n for n in range(len(NAMES)) if METHODS[n % 3] == "hypothesis"])
    record = evidence(CLAIMS[NAMES[at]], Verdict.PROVED, "hypothesis", backend="dafny", strength=Verdict.PROVED)
    Ledger(place.ledger).append(record)


# -- with the chain computed again ----------------------------------------------------------------------------------


def rechain_after_a_verdict(place: Place, rng: random.Random) -> None:
    listed = place.evidences()
    chosen = rng.choice(listed)
    chosen["verdict"] = rng.choice([v.value for v in Verdict if v.value != chosen["verdict"]])
    place.rechain(listed)


def rechain_without_some(place: Place, rng: random.Random) -> None:
    listed = place.evidences()
    del listed[rng.randrange(len(listed)) :][: rng.randrange(1, 4)]
    place.rechain(rng.sample(listed, rng.randrange(len(listed))))


def rechain_without_the_end(place: Place, rng: random.Random) -> None:
    place.rechain(place.evidences()[: -rng.randrange(1, 5)])


def rechain_in_another_order(place: Place, rng: random.Random) -> None:
    listed = place.evidences()
    a, b = rng.sample(range(len(listed)), 2)
    listed[a], listed[b] = listed[b], listed[a]
    place.rechain(listed)


def rechain_with_a_double(place: Place, rng: random.Random) -> None:
    listed = place.evidences()
    listed.insert(rng.randrange(len(listed) + 1), rng.choice(listed))
    place.rechain(listed)


def rechain_between_methods(place: Place, rng: random.Random) -> None:
    """A test's record stands in for a proof's."""
    listed = place.evidences()
    a, b = rng.choice(listed), rng.choice(listed)
    while a["method"] == b["method"]:
        b = rng.choice(listed)
    a["outputs"], b["outputs"] = b["outputs"], a["outputs"]
    a["method"], b["method"] = b["method"], a["method"]
    place.rechain(listed)


# -- whole files ----------------------------------------------------------------------------------------------------


def delete_the_ledger(place: Place, rng: random.Random) -> None:
    place.ledger.unlink()
    if rng.random() < 0.5:
        place.head.unlink()


def empty_the_ledger(place: Place, rng: random.Random) -> None:
    place.ledger.write_bytes(b"\n" * rng.randrange(2))
    if rng.random() < 0.5:
        place.head.unlink()


def swap_ledgers(place: Place, rng: random.Random) -> None:
    other = place.ledger.with_name("other.jsonl")
    place.ledger.write_bytes(place.files[other])
    if rng.random() < 0.5:
        place.head.write_bytes(place.files[other.with_name("other.jsonl.head")])


def append_garbage(place: Place, rng: random.Random) -> None:
    garbage = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 90)))
    place.ledger.write_bytes(place.files[place.ledger] + garbage + b"\n" * rng.randrange(2))


def another_encoding(place: Place, rng: random.Random) -> None:
    data = place.files[place.ledger]
    text = data.decode()
    place.ledger.write_bytes(
        rng.choice(
            [
                lambda: text.encode("utf-16"),
                lambda: text.encode("utf-32-le"),
                lambda: b"\xef\xbb\xbf" + data,
                lambda: data.replace(b"\n", b"\r\n"),
                lambda: data.replace(b":", b": ", rng.randrange(1, 9)),
                lambda: data.replace(b"e", b"\\u0065", rng.randrange(1, 9)),
            ]
        )()
    )


def say_it_twice(place: Place, rng: random.Random) -> None:
    """A key that stands twice: one reader takes the first, another the last."""
    lines = place.lines()
    at = rng.randrange(len(lines))
    lines[at] = lines[at].replace(b'"verdict":', b'"verdict":"refuted","verdict":')
    place.write(lines)


def link_elsewhere(place: Place, rng: random.Random) -> None:
    """What it leads to says the same, for now."""
    path = rng.choice([place.ledger, place.head, *(place.root / f"logs/{name}.log" for name in NAMES)])
    elsewhere = place.root / f"elsewhere{rng.random()}"
    elsewhere.write_bytes(place.files[path])
    path.unlink()
    path.symlink_to(elsewhere)


def put_no_file_there(place: Place, rng: random.Random) -> None:
    """Reading a pipe or a device would never end."""
    log = place.root / f"logs/{rng.choice(NAMES)}.log"
    log.unlink()
    rng.choice([lambda: os.mkfifo(log), lambda: log.symlink_to("/dev/zero"), log.mkdir])()


def set_the_clock_back(place: Place, rng: random.Random) -> None:
    """Its ages are counted by the clock; the record that gives it away is one of a later day."""
    later = (datetime.now(UTC) + timedelta(hours=rng.randrange(2, 9999))).isoformat()
    Ledger(place.ledger).append(evidence(CLAIMS[rng.choice(NAMES)], started=later))


def edit_the_index(place: Place, rng: random.Random) -> None:
    data = bytearray(place.files[place.index])
    at = rng.randrange(len(data) - 1)
    data[at] ^= 1 << rng.randrange(7)
    place.index.write_bytes(bytes(data))


def delete_the_index(place: Place, rng: random.Random) -> None:
    if rng.random() < 0.5:
        place.index.unlink()
    else:  # as if there had never been but the other ledger
        place.index.unlink()
        note(place.index, Event.BEGAN, "other")


KINDS: tuple[Callable[[Place, random.Random], None], ...] = (
    flip_a_byte,
    change_a_verdict,
    change_a_record_and_its_hash,
    remove_a_line,
    cut_the_end,
    swap_lines,
    repeat_a_line,
    insert_a_forgery,
    edit_a_log,
    swap_logs,
    remove_or_empty_a_log,
    poison_the_cache,
    point_at_another_claim,
    claim_too_much,
    lend_a_method_strength,
    speak_for_another_system,
    lend_another_backends_name,
    rechain_after_a_verdict,
    rechain_without_some,
    rechain_without_the_end,
    rechain_in_another_order,
    rechain_with_a_double,
    rechain_between_methods,
    delete_the_ledger,
    empty_the_ledger,
    swap_ledgers,
    append_garbage,
    another_encoding,
    say_it_twice,
    link_elsewhere,
    put_no_file_there,
    set_the_clock_back,
    edit_the_index,
    delete_the_index,
)


def test_nothing_is_found_where_nothing_was_done(place: Place) -> None:
    place.restore()
    assert place.found() == []


@pytest.mark.parametrize("kind", some(KINDS, 6, slow=len(KINDS) - 6), ids=lambda kind: kind.__name__)
def test_every_tampering_is_found(place: Place, kind: Callable[[Place, random.Random], None]) -> None:
    for seed in range(TIMES):
        place.restore()
        kind(place, random.Random(seed))
        assert place.found(), (kind.__name__, seed)
    place.restore()
    assert place.found() == []


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_the_gate_fails_for_it(place: Place, kind: Callable[[Place, random.Random], None]) -> None:
    place.restore()
    kind(place, random.Random(7))
    told = place.audit()
    subject = system({"node": NAMES})
    found = case(
        subject, tuple(CLAIMS.values()), [e.evidence for e in Ledger(place.ledger).records()], discrepancies=told
    )
    gate = next(g for g in found.gates if g.id == "integrity")
    assert not gate.passed
    assert found.exit_code == 1
    place.restore()
