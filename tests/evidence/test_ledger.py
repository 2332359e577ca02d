"""The ledger on the disk: chain, damage, kills, full disks, two writers at once."""

from __future__ import annotations

import errno
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import jsonschema
import pytest
from assurance.sample import chain, evidence

from avow.assurance.codec import evidence_schema
from avow.base.codec import Unreadable, from_json
from avow.base.notes import cache_folder
from avow.base.verdict import Counterexample, Verdict
from avow.evidence import ledger as module
from avow.evidence.ledger import GENESIS, Ledger, encode
from avow.evidence.record import Evidence


def some(number: int) -> list[Evidence]:
    return [evidence(f"node.g{n}", key=f"k{n}") for n in range(number)]


def test_records_survive_and_are_chained(tmp_path: Path) -> None:
    path = tmp_path / "ledger" / "rover.jsonl"
    entries = Ledger(path).append_all(some(5))
    again = Ledger(path)
    assert again.records() == entries == chain(some(5))
    assert again.damage == ()
    assert again.head == entries[-1].hash
    assert entries[0].previous == GENESIS
    assert all(b.previous == a.hash for a, b in itertools.pairwise(entries))


def test_every_line_meets_the_published_schema(tmp_path: Path) -> None:
    hard = evidence(
        "node.g",
        Verdict.REFUTED,
        counterexample=Counterexample((("in.r", "125"),), "why", (((("a", "1")),), ((("a", "2")),)), 0),
        bound={"cases": 2000, "p": Fraction(1, 3), "set": {2, 1}, "nan": float("nan")},
        details={"nested": {"list": [1, (2, None)]}},
        summary='quote " newline \n unicode ∀ \ud800 nul \x00',
        seconds=3,
    )
    ledger = Ledger(tmp_path / "x.jsonl")
    ledger.append(hard)
    assert Ledger(ledger.path).damage == ()
    line = json.loads(ledger.path.read_text())
    jsonschema.Draft202012Validator(evidence_schema()).validate(line)
    assert line["evidence"]["bound"] == {"cases": 2000, "p": "1/3", "set": [1, 2], "nan": "nan"}
    assert encode(from_json(Evidence, line["evidence"])) == line["evidence"]


def test_what_is_current(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "x.jsonl")
    old, new = evidence("n.g", key="old"), evidence("n.g", Verdict.UNKNOWN, key="new")
    ledger.append_all([old, new, evidence("n.g", method="dafny", key="other")])
    assert [e.evidence for e in ledger.current(old.obligation, "old")] == [old]


def test_the_same_evidence_is_kept_once(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "x.jsonl")
    first = ledger.append(some(1)[0])
    assert ledger.append(some(1)[0]) == first
    assert Ledger(ledger.path).append_all([*some(1), *some(1)]) == (first, first)
    assert len(Ledger(ledger.path).records()) == 1


def test_a_torn_last_line_is_removed_and_the_chain_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "x.jsonl"
    Ledger(path).append_all(some(3))
    whole = path.read_bytes()
    for cut in (1, 7, 200):
        path.write_bytes(whole[:-cut])
        reader = Ledger(path)
        assert len(reader.records()) == 2  # a reader uses what is whole, and changes nothing
        writer = Ledger(path)
        writer.append(evidence("node.g2", key="k2"))
        assert len(Ledger(path).records()) == 3
        assert Ledger(path).damage == ()


@pytest.mark.parametrize(
    ("change", "line", "word"),
    [
        (lambda lines: [lines[0], lines[1].replace(b"proved", b"tested"), *lines[2:]], 2, "changed after"),
        (lambda lines: [lines[0], b"garbage\n", *lines[2:]], 2, "cannot be read"),
        (
            lambda lines: [lines[0], lines[1].replace(b'"seconds":0.25', b'"seconds":NaN'), *lines[2:]],
            2,
            "cannot be read",
        ),
        (
            lambda lines: [lines[0], lines[1].replace(b'"bound":{', b'"bound":{"p":1e999'), *lines[2:]],
            2,
            "cannot be read",
        ),
        (lambda lines: [lines[0], *lines[2:]], 2, "does not follow"),
        (lambda lines: [lines[1], lines[0], *lines[2:]], 1, "does not follow"),
        (lambda lines: [lines[0], lines[0], *lines[1:]], 2, "does not follow"),
        (lambda lines: lines[:-1], 4, "cut off"),
    ],
    ids=["edited", "garbled", "no number", "beyond numbers", "removed", "swapped", "inserted", "cut off"],
)
def test_damage_is_named_and_edited_records_are_not_believed(tmp_path: Path, change, line: int, word: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "x.jsonl"
    entries = Ledger(path).append_all(some(4))
    path.write_bytes(b"".join(change(path.read_bytes().splitlines(keepends=True))))
    ledger = Ledger(path)
    assert any(d.line == line and word in d.reason for d in ledger.damage), ledger.damage
    assert all(e.evidence in [x.evidence for x in entries] for e in ledger.records())


@pytest.mark.parametrize(
    "head", ["", "[" * 100_000, "{}", '{"hash": "", "records": "3"}', '{"hash": null, "records": 1}']
)
def test_a_head_that_is_none_is_damage(tmp_path: Path, head: str) -> None:
    Ledger(tmp_path / "x.jsonl").append_all(some(1))
    (tmp_path / "x.jsonl.head").write_text(head)
    assert [d.reason for d in Ledger(tmp_path / "x.jsonl").damage] == ["x.jsonl.head cannot be read"]


@pytest.mark.parametrize("kept", [1, 2])
def test_a_cut_is_not_healed_by_the_next_record(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "x.jsonl"
    Ledger(path).append_all(some(3))
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:kept]))
    Ledger(path).append_all([evidence(f"node.new{n}", key=f"new{n}") for n in range(6)])
    assert Ledger(path).damage


def test_a_ledger_rechained_after_an_edit_is_given_away_by_its_head(tmp_path: Path) -> None:
    path = tmp_path / "x.jsonl"
    Ledger(path).append_all([*some(2), evidence("node.bad", Verdict.REFUTED)])
    head = path.with_name("x.jsonl.head").read_text()
    path.unlink()
    path.with_name("x.jsonl.head").unlink()
    Ledger(path).append_all([*some(2), evidence("node.bad", Verdict.PROVED)])
    path.with_name("x.jsonl.head").write_text(head)
    assert Ledger(path).damage


def test_an_append_behind_a_garbled_line_is_itself_whole(tmp_path: Path) -> None:
    path = tmp_path / "x.jsonl"
    Ledger(path).append_all(some(2))
    path.write_bytes(path.read_bytes() + b"garbage\n")
    Ledger(path).append(evidence("node.new"))
    ledger = Ledger(path)
    assert [d.line for d in ledger.damage] == [3]
    assert len(ledger.records()) == 3


def test_a_full_disk_adds_nothing_and_breaks_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.jsonl"
    ledger = Ledger(path)
    ledger.append_all(some(2))
    before = path.read_bytes()
    really = os.write

    def full(file: int, data: bytes) -> int:
        if len(data) > 40:
            return really(file, data[:40])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module.os, "write", full)
    with pytest.raises(OSError, match="No space"):
        ledger.append(evidence("node.new"))
    monkeypatch.undo()
    assert path.read_bytes() == before
    ledger.append(evidence("node.new"))
    assert len(Ledger(path).records()) == 3
    assert Ledger(path).damage == ()


_WRITER = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from assurance.sample import evidence
from avow.evidence.ledger import Ledger
ledger = Ledger(Path({path!r}))
print("ready", flush=True)
n = 0
while n < {most}:
    ledger.append(evidence("node.{name}" + str(n), summary="x" * 3000))
    n += 1
"""


def start(path: Path, name: str, most: int) -> subprocess.Popen[bytes]:
    tests = str(Path(__file__).parent.parent)
    code = _WRITER.format(tests=tests, path=str(path), name=name, most=most)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    return process


@pytest.mark.nightly
def test_kill_9_loses_nothing_that_was_acknowledged(tmp_path: Path) -> None:
    path = tmp_path / "x.jsonl"
    for round_number in range(4):
        process = start(path, f"r{round_number}x", 100_000)
        time.sleep(0.05 + 0.03 * round_number)
        process.send_signal(signal.SIGKILL)
        process.wait()
    ledger = Ledger(path)
    ledger.append(evidence("node.last"))
    records = ledger.records()
    assert Ledger(path).damage == ()
    names = [e.evidence.obligation for e in records]
    assert len(names) == len(set(names)) > 4
    for round_number in range(4):  # no gap: each round's records are 0, 1, 2, …
        mine = [n for n in names if f"r{round_number}x" in n]
        assert mine == [f"rover/node/guarantee/r{round_number}x{n}" for n in range(len(mine))]


def test_two_runs_at_once_double_nothing_and_lose_nothing(tmp_path: Path) -> None:
    path = tmp_path / "x.jsonl"
    one, two = start(path, "a", 40), start(path, "b", 40)
    assert one.wait(60) == two.wait(60) == 0
    ledger = Ledger(path)
    assert ledger.damage == ()
    assert len({e.evidence.obligation for e in ledger.records()}) == len(ledger.records()) == 80


def test_a_reader_sees_what_another_process_adds(tmp_path: Path) -> None:
    path = tmp_path / "x.jsonl"
    reader = Ledger(path)
    assert reader.records() == ()
    Ledger(path).append_all(some(2))
    assert len(reader.records()) == 2
    reader.append(evidence("node.mine"))
    assert Ledger(path).damage == ()


@pytest.mark.parametrize(
    "change",
    [
        {"verdict": "splendid"},
        {"seconds": "1"},
        {"command": "rm"},
        {"inputs": []},
        {"counterexample": {"values": [["a"]], "explanation": "", "trace": [], "loop": None}},
        {"vacuous": 1},
        {"surprise": 1},
    ],
)
def test_ill_typed_records_are_not_read(change: dict[str, object]) -> None:
    with pytest.raises(Unreadable):
        from_json(Evidence, {**encode(some(1)[0]), **change})


def test_encoding_keeps_a_whole_record() -> None:
    record = replace(some(1)[0], hypotheses=("h",), command=("a", "b c"), inputs={"p": "d"})
    assert from_json(Evidence, json.loads(json.dumps(encode(record)))) == record


def test_while_it_stands_still_nothing_is_read_and_nothing_written(tmp_path: Path) -> None:
    ledger, other = Ledger(tmp_path / "l.jsonl"), Ledger(tmp_path / "l.jsonl")
    first, second, third = some(3)
    ledger.append(first)
    with ledger.still():
        other.append(second)
        assert len(ledger.records()) == 1
        with pytest.raises(AssertionError):
            ledger.append(third)
    assert len(ledger.records()) == 2
    ledger.append(third)
    assert len(other.records()) == 3
    assert not ledger.damage


@pytest.fixture
def of_three(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A ledger of which groups of three lines are kept as read: two, and one line more."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("avow.evidence.ledger.LINES_KEPT", 3)
    path = tmp_path / "x.jsonl"
    Ledger(path, remembers=True).append_all(some(7))
    return path


def test_lines_that_were_found_whole_are_not_checked_again(of_three: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Ledger(of_three).append(evidence("node.later"))  # by one that keeps nothing
    taken: list[int] = []
    take = Ledger._take
    monkeypatch.setattr(Ledger, "_take", lambda ledger, line: (taken.append(len(line)), take(ledger, line))[1])
    again = Ledger(of_three, remembers=True)
    assert again.records() == Ledger(of_three).records()
    assert len(taken) == 2 + 8
    assert again.append(some(7)[2]).number == 2, "what is there is known"
    again.check()
    assert again.records() == Ledger(of_three).records()
    assert again.damage == ()
    assert len(taken) == 2 + 8 + 8 + 8


def test_what_is_kept_of_a_record_is_all_of_it(of_three: Path) -> None:
    """Equal numbers of different types, too: Python counts 1, 1.0 and true as one key."""
    values = [1, True, 1.0, [1, "a"], {"a": {"b": 1}}, {"a": {"b": True}}, "a", None]
    Ledger(of_three, remembers=True).append_all(
        [replace(evidence(f"n.{at}"), details={"of": value, "a": "b"}) for at, value in enumerate(values)]
    )
    kept, read = Ledger(of_three, remembers=True).records(), Ledger(of_three).records()
    assert [encode(entry.evidence) for entry in kept] == [encode(entry.evidence) for entry in read]
    assert [json.dumps(entry.evidence.details["of"]) for entry in kept[7:]] == list(map(json.dumps, values))


@pytest.mark.parametrize("at", [0, 2, 5])
@pytest.mark.parametrize(
    ("old", "new"), [("proved", "tested"), ('"n":', '"n": '), ('"vacuous":false', '"vacuous":true ')]
)
def test_lines_kept_of_a_ledger_make_no_edit_unseen(of_three: Path, at: int, old: str, new: str) -> None:
    path = of_three
    lines = path.read_text().splitlines(keepends=True)
    lines[at] = lines[at].replace(old, new, 1)
    path.write_text("".join(lines))
    for _ in range(2):
        assert Ledger(path, remembers=True).damage == Ledger(path).damage != ()
    path.write_text("".join(lines[:at] + lines[at + 1 :]))
    assert Ledger(path, remembers=True).damage == Ledger(path).damage != ()


def test_an_edited_group_of_lines_is_none(of_three: Path) -> None:
    (folder,) = (cache_folder() / "ledgers").iterdir()
    for path in folder.iterdir():
        path.write_bytes(path.read_bytes().replace(b"proved", b"tested"))
    assert Ledger(of_three, remembers=True).records() == Ledger(of_three).records()
