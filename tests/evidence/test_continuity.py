"""Whole ledgers deleted, swapped or written anew: what is noticed by the index, by reports, and only by a signature."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from assurance.sample import evidence

from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.cli import main
from avow.evidence.audit import Fault
from avow.evidence.continuity import began, continuity
from avow.evidence.heads import Anchor, Event, index_path, note, read_index, stated_heads
from avow.evidence.ledger import Ledger
from avow.pipeline.integrity import acknowledge, confirm, reported_heads
from avow.report.layout import json_text

TRUE = [evidence("n.a"), evidence("n.b", Verdict.REFUTED)]
FALSE = [evidence("n.a"), evidence("n.b", Verdict.PROVED)]


@pytest.fixture
def place(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    monkeypatch.chdir(workspace)
    return Workspace(workspace)


def ledger(place: Workspace) -> Ledger:
    return Ledger(place.ledger("rover"))


def run(place: Workspace, *records: object) -> None:
    """What a run does with the ledger: it adds, renders a report, and notes how far it came."""
    if records:
        ledger(place).append_all(records)  # type: ignore[arg-type]
    acknowledge(place, ledger(place))
    report = place.report("rover") / "report.json"
    report.parent.mkdir(parents=True, exist_ok=True)
    report.write_text(json.dumps({"system": "rover", "ledger_head": ledger(place).head}))
    confirm(place, ledger(place))


def told(place: Workspace, *anchors: Anchor) -> list[tuple[Fault, bool]]:
    index = read_index(index_path(place.ledgers))
    return [(d.fault, d.serious) for d in continuity(ledger(place), index, anchors or reported_heads(place))]


def forget(place: Workspace, *, index: bool = False, reports: bool = False) -> None:
    for path in place.ledgers.glob("rover.jsonl*"):
        path.unlink()
    if index:
        index_path(place.ledgers).unlink()
    if reports:
        (place.report("rover") / "report.json").unlink()


def audit(*options: str) -> tuple[int, str]:
    """Exit code and all output of ``avow audit``."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out), pytest.raises(SystemExit) as ended:
        main(["audit", *options])
    assert isinstance(ended.value.code, int)
    return ended.value.code, out.getvalue()


def test_a_ledger_that_grows_is_the_same_ledger(place: Workspace) -> None:
    run(place, TRUE[0])
    run(place, TRUE[1])
    run(place)
    assert told(place) == []
    assert [s.event for s in read_index(index_path(place.ledgers)).statements] == ["began", "reached", "reached"]
    assert audit()[0] == 0


def test_a_killed_run_is_behind_the_index_and_no_fault(place: Workspace) -> None:
    run(place, TRUE[0])
    ledger(place).append(TRUE[1])
    assert told(place) == []


def test_a_deleted_ledger_is_missed(place: Workspace) -> None:
    run(place, *TRUE)
    forget(place)
    assert (Fault.GONE, True) in told(place)
    code, text = audit()
    assert code == 1
    assert "rover.jsonl is gone" in text
    assert audit("rover")[0] == 1


def test_deleted_with_the_index_it_is_missed_by_the_report(place: Workspace) -> None:
    run(place, *TRUE)
    forget(place, index=True)
    code, text = audit()
    assert code == 1
    assert "gone with the whole ledger" in text


def test_beginning_anew_is_open_until_acknowledged_and_told_for_ever_after(place: Workspace) -> None:
    run(place, *TRUE)
    forget(place)
    run(place, evidence("n.b", run="later"))
    for _ in range(2):
        assert told(place) == [(Fault.REPLACED, True)]
        run(place, evidence("n.b", run="even later"))
    assert audit()[0] == 1
    assert audit("--acknowledge", "a disk was lost")[0] == 2, "somebody has to say it"
    assert audit("--acknowledge", "a disk was lost", "--as", "A. Person")[0] == 0
    run(place, evidence("n.b", run="after that"))
    code, text = audit()
    assert code == 0
    assert "2 records are lost" in text
    assert "A. Person: a disk was lost" in text


DAMAGES = {
    "cut": lambda data: b"".join(data.splitlines(True)[:2]),
    "edited": lambda data: data.replace(b'"refuted"', b'"proved"', 1),
    "a line gone": lambda data: b"".join(data.splitlines(True)[1:]),
    "junk": lambda data: data + b"junk\n",
}


@pytest.mark.parametrize("name", DAMAGES)
def test_damage_is_open_until_acknowledged_and_new_damage_is_open_again(place: Workspace, name: str) -> None:
    run(place, *TRUE, evidence("n.c", Verdict.REFUTED))
    path = place.ledger("rover")
    damaged = DAMAGES[name](path.read_bytes())
    assert damaged != path.read_bytes()
    path.write_bytes(damaged)
    for _ in range(2):  # no run heals it
        run(place, evidence("n.d"))
        assert audit()[0] == 1
    assert audit("--acknowledge", "seen", "--as", "A. Person")[0] == 0
    run(place, evidence("n.e"))
    assert audit()[0] == 0
    lines = path.read_bytes().splitlines(True)
    path.write_bytes(b"".join(lines[:-1]))
    assert audit()[0] == 1


def test_an_old_folder_of_ledgers_that_is_restored_is_missed(place: Workspace) -> None:
    run(place, evidence("n.a"))
    old = {path: path.read_bytes() for path in place.ledgers.iterdir()}
    run(place, evidence("n.b", Verdict.REFUTED))
    for path in place.ledgers.iterdir():
        path.unlink()
    for path, data in old.items():
        path.write_bytes(data)
    for _ in range(2):
        run(place, evidence("n.c"))
        assert (Fault.REPLACED, True) in told(place)


def test_an_index_that_is_damaged_is_open_until_acknowledged(place: Workspace) -> None:
    run(place, *TRUE)
    path = index_path(place.ledgers)
    path.write_bytes(path.read_bytes().replace(b'"records":2', b'"records":1'))
    run(place)
    assert audit()[0] == 1
    assert audit("--acknowledge", "seen", "--as", "A. Person")[0] == 0
    assert list(place.ledgers.glob("index.damaged-*"))
    run(place, evidence("n.e"))
    assert audit()[0] == 0


def test_beginning_anew_without_an_index_is_told_by_what_the_report_said(place: Workspace) -> None:
    run(place, *TRUE)
    forget(place, index=True)
    run(place, evidence("n.b", run="later"))
    run(place)
    assert told(place) == [(Fault.REPLACED, True)]
    assert began(read_index(index_path(place.ledgers)), "rover")


@pytest.mark.parametrize("index", [False, True])
def test_a_forged_ledger_does_not_pass_by_a_new_report(place: Workspace, index: bool) -> None:
    """Whole in itself, with its head; the index only knows of the old one, or nothing."""
    run(place, *TRUE)
    forged = Ledger(place.root / "forged" / "rover.jsonl")
    forged.append_all(FALSE)
    for path in forged.path.parent.glob("rover.jsonl*"):
        (place.ledgers / path.name).write_bytes(path.read_bytes())
    if index:
        index_path(place.ledgers).unlink()
    assert (Fault.REPLACED, True) in told(place)
    run(place)  # the report is rendered again, of the forgery
    assert (Fault.REPLACED, True) in told(place), "the second run must not be content"
    run(place, evidence("n.c"))
    assert audit()[0] == 1


def test_an_index_that_was_made_later_says_so(place: Workspace) -> None:
    run(place, *TRUE)
    index_path(place.ledgers).unlink()
    assert audit()[0] == 1
    run(place)
    assert told(place) == [(Fault.REPLACED, True)]


def test_whoever_writes_everything_anew_is_found_by_a_copy_kept_elsewhere(place: Workspace, tmp_path: Path) -> None:
    run(place, *TRUE)
    kept = tmp_path / "kept.json"
    kept.write_bytes((place.report("rover") / "report.json").read_bytes())
    forget(place, index=True, reports=True)
    run(place, *FALSE)
    assert audit()[0] == 0, "nothing here can tell: docs/reading-a-report.md says so"
    code, text = audit("--against", str(kept))
    assert code == 1
    assert "kept.json was made of a ledger" in text


def test_what_may_be_kept_elsewhere(place: Workspace, tmp_path: Path) -> None:
    statement = {
        "predicate": {"configuration": [{"name": "ledger/rover", "digest": {"sha256": "a" * 64}}]},
    }
    (tmp_path / "attestation.jsonl").write_text(json.dumps(statement) + "\n")
    assert [(a.system, a.head) for a in stated_heads(tmp_path / "attestation.jsonl", "")] == [("rover", "a" * 64)]
    run(place, *TRUE)
    assert audit("--against", str(tmp_path / "attestation.jsonl"))[0] == 1
    assert audit("--against", str(place.reports))[0] == 0
    (tmp_path / "none.json").write_text("[]")
    assert audit("--against", str(tmp_path / "none.json"))[0] == 2


def test_signed_nothing_goes_by(place: Workspace, tmp_path: Path) -> None:
    pytest.importorskip("cryptography")
    run(place, *TRUE)
    key = str(tmp_path / "key")
    assert audit("--new-key", key)[0] == 0
    assert audit("--key", f"{key}.pub")[0] == 1, "what is not signed is not vouched for"
    assert audit("--sign", key)[0] == 0
    assert audit("--key", f"{key}.pub")[0] == 0
    index_path(place.ledgers).with_name("index.sig").rename(tmp_path / "index.sig")
    assert audit("--key", f"{key}.pub")[0] == 1
    (tmp_path / "index.sig").rename(place.ledgers / "index.sig")
    # everything written anew, without the key
    signature = (place.ledgers / "rover.jsonl.sig").read_bytes()
    forget(place, index=True, reports=True)
    run(place, *FALSE)
    assert audit("--key", f"{key}.pub")[0] == 1
    (place.ledgers / "rover.jsonl.sig").write_bytes(signature)
    code, text = audit("--key", f"{key}.pub")
    assert code == 1
    assert "are not those in the ledger" in text


def test_records_behind_the_signature_are_told(place: Workspace, tmp_path: Path) -> None:
    pytest.importorskip("cryptography")
    run(place, *TRUE)
    key = str(tmp_path / "key")
    audit("--new-key", key)
    audit("--sign", key)
    run(place, evidence("n.c"))
    code, text = audit()
    assert (code, "1 of 3 records are newer" in text) == (0, True)
    assert audit("--key", f"{key}.pub")[0] == 1


def test_a_ledger_gone_with_signature_index_and_report_is_missed(place: Workspace, tmp_path: Path) -> None:
    pytest.importorskip("cryptography")
    run(place, *TRUE)
    key = str(tmp_path / "key")
    audit("--new-key", key)
    audit("--sign", key)
    forget(place, index=True, reports=True)
    assert audit("--key", f"{key}.pub")[0] == 1


# -- the index as a file --------------------------------------------------------------------------------------------


def test_a_half_written_line_is_mended(tmp_path: Path) -> None:
    path = tmp_path / "index"
    note(path, Event.BEGAN, "a")
    whole = path.read_bytes()
    note(path, Event.REACHED, "a", 3, "c" * 64)
    for cut in (1, 30):
        path.write_bytes(whole + path.read_bytes()[len(whole) : -cut])
        assert read_index(path).damage == ()
        note(path, Event.REACHED, "a", 3, "c" * 64)
        assert [s.event for s in read_index(path).statements] == ["began", "reached"]
        assert read_index(path).damage == ()


_NOTER = """
import sys
from pathlib import Path
from avow.evidence.heads import Event, note
print("ready", flush=True)
for n in range({most}):
    note(Path({path!r}), Event.REACHED, {name!r}, n + 1, str(n))
"""


def noter(path: Path, name: str, most: int) -> subprocess.Popen[bytes]:
    code = _NOTER.format(path=str(path), name=name, most=most)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=os.environ)
    assert process.stdout is not None
    process.stdout.readline()
    return process


def test_two_writers_and_a_kill(tmp_path: Path) -> None:
    path = tmp_path / "index"
    one, two, killed = noter(path, "a", 30), noter(path, "b", 30), noter(path, "c", 100_000)
    time.sleep(0.1)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert one.wait(60) == two.wait(60) == 0
    note(path, Event.BEGAN, "d")
    index = read_index(path)
    assert index.damage == ()
    assert [s.records for s in index.of("a")] == [s.records for s in index.of("b")] == list(range(1, 31))


def test_a_report_states_its_head_however_it_is_laid_out(tmp_path: Path) -> None:
    """As Avow writes it only two of its lines are read; nothing that stands elsewhere in it is taken for them."""
    true, false = "a" * 64, "b" * 64
    case = {"schema": "s", "system": "rover", "ledger_head": true, "sources": [{"text": '\n "ledger_head": "b",\n'}]}
    inner = {**case, "baseline": {"system": "other", "ledger_head": false}}
    doubled = json_text(case).replace("{\n", f'{{\n "ledger_head": "{false}",\n', 1)
    path = tmp_path / "report.json"
    for text, said in {
        json_text(case): true,
        json_text(inner): true,
        json.dumps(inner): true,
        json.dumps(inner, indent=1): true,
        json.dumps(inner, indent=4): true,
        doubled: true,  # the last one counts, as it does for who reads it as JSON
        json_text({**case, "ledger_head": '\u00e4\\"'}): '\u00e4\\"',
    }.items():
        path.write_text(text)
        assert [(a.system, a.head) for a in stated_heads(path, "")] == [("rover", said)], text
        assert json.loads(text)["ledger_head"] == said
    for text in (json_text({"system": "rover"}), "{\n", "", json_text(case)[:30]):
        path.write_text(text)
        assert not stated_heads(path, "")
