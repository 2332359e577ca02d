"""Every kind of tampering that the audit must name, each seeded on purpose."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest
from assurance.sample import evidence, guarantee, key_of

from avow.base.files import digest_file, sha256
from avow.base.verdict import Verdict
from avow.evidence.audit import Fault, audit
from avow.evidence.ledger import Ledger
from avow.evidence.record import STANDS_ON


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    for name in ("a.log", "b.log", "prog.imp"):
        (tmp_path / name).write_text(name)
    ledger = Ledger(tmp_path / "artifacts/ledger/rover.jsonl")

    def files(*names: str) -> dict[str, str]:
        return {name: digest_file(tmp_path / name) for name in names}

    ledger.append_all(
        [
            evidence("node.a", outputs=files("a.log"), inputs=files("prog.imp")),
            evidence("node.b", Verdict.REFUTED, outputs=files("b.log")),
        ]
    )
    return ledger


def faults(ledger: Ledger, root: Path, **more: object) -> list[tuple[Fault, str, bool]]:
    return [(d.fault, d.subject, d.serious) for d in audit(Ledger(ledger.path), root, **more)]  # type: ignore[arg-type]


def test_an_untouched_workspace_has_no_discrepancy(ledger: Ledger, tmp_path: Path) -> None:
    assert faults(ledger, tmp_path, system="rover") == []


def test_an_edited_log(ledger: Ledger, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("all is well")
    assert faults(ledger, tmp_path) == [(Fault.CHANGED, "a.log", True)]


def test_swapped_result_files(ledger: Ledger, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("b.log")
    (tmp_path / "b.log").write_text("a.log")
    assert faults(ledger, tmp_path) == [(Fault.CHANGED, "a.log", True), (Fault.CHANGED, "b.log", True)]


def test_a_deleted_file(ledger: Ledger, tmp_path: Path) -> None:
    (tmp_path / "b.log").unlink()
    assert faults(ledger, tmp_path) == [(Fault.GONE, "b.log", True)]


def test_a_changed_input_makes_stale_but_is_no_tampering(ledger: Ledger, tmp_path: Path) -> None:
    (tmp_path / "prog.imp").write_text("x := 1")
    assert faults(ledger, tmp_path) == [(Fault.OUTDATED, "prog.imp", False)]


def test_an_edited_ledger_line(ledger: Ledger, tmp_path: Path) -> None:
    ledger.path.write_text(ledger.path.read_text().replace('"refuted"', '"proved"'))
    assert (Fault.LEDGER, "line 2", True) in faults(ledger, tmp_path)


def test_a_record_that_points_at_another_obligation(ledger: Ledger, tmp_path: Path) -> None:
    stolen = evidence("node.b", key=key_of(guarantee("node", "a"), "hoare"))
    ledger.append(stolen)
    assert (Fault.MISPLACED, stolen.obligation, True) in faults(ledger, tmp_path)


def test_a_poisoned_cache_entry(ledger: Ledger, tmp_path: Path) -> None:
    """A record with today's key, so that it would be taken from the cache, but of a claim with another meaning."""
    claim = guarantee("node", "c")
    ledger.append(evidence(claim, obligation_digest=sha256("another claim")))
    known = {"obligations": {claim.id: claim.digest}, "keys": {(claim.id, "hoare"): key_of(claim, "hoare")}}
    assert (Fault.MISPLACED, claim.id, True) in faults(ledger, tmp_path, **known)


def test_a_clock_that_is_set_back(ledger: Ledger, tmp_path: Path) -> None:
    """Else a risk whose acceptance has expired would be accepted again."""
    late = evidence("node.c", started="2999-01-01T00:00:00.000+00:00")
    ledger.append_all([late, evidence("node.d")])
    now = datetime(2026, 11, 25, tzinfo=UTC)
    found = [(fault, serious) for fault, _, serious in faults(ledger, tmp_path, now=now) if fault is Fault.CLOCK]
    assert found == [(Fault.CLOCK, True), (Fault.CLOCK, False)]


def test_a_record_that_claims_more_than_its_method_can(ledger: Ledger, tmp_path: Path) -> None:
    record = evidence("node.c", Verdict.PROVED, "hypothesis", strength=Verdict.TESTED)
    ledger.append(record)
    assert (Fault.IMPOSSIBLE, record.obligation, True) in faults(ledger, tmp_path)


@pytest.mark.parametrize("name", ["rover.jsonl", "rover.jsonl.head"])
def test_a_link_in_the_place_of_the_ledger_or_its_head(ledger: Ledger, tmp_path: Path, name: str) -> None:
    path = ledger.path.with_name(name)
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    assert faults(ledger, tmp_path) == [(Fault.REDIRECTED, name, True)]


def test_a_record_of_another_system(ledger: Ledger, tmp_path: Path) -> None:
    ledger.append(evidence(guarantee("node", "a", of="other")))
    assert (Fault.MISPLACED, "other/node/guarantee/a", True) in faults(ledger, tmp_path, system="rover")


def test_files_of_superseded_attempts_are_history(ledger: Ledger, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("second run")
    ledger.append(evidence("node.a", key="newer", outputs={"a.log": sha256("second run")}))
    assert faults(ledger, tmp_path) == []
    (tmp_path / "b.log").unlink()
    assert faults(ledger, tmp_path, keys={}) == [(Fault.GONE, "b.log", False)]


def test_of_several_that_say_the_same_the_newest_is_relied_upon(ledger: Ledger, tmp_path: Path) -> None:
    """As in a case: what an earlier attempt left of the same question may go, unless it said something else, or
    something that still counts left the same file."""
    for name in ("second.log", "third.log"):
        (tmp_path / name).write_text(name)
    first = ledger.records()[0].evidence

    def more(obligation: str, verdict: Verdict, *names: str) -> None:
        ledger.append(evidence(obligation, verdict, outputs={name: digest_file(tmp_path / name) for name in names}))

    more("node.a", first.verdict, "second.log")
    (tmp_path / "a.log").unlink()
    assert faults(ledger, tmp_path) == [(Fault.GONE, "a.log", False)]
    more("node.a", Verdict.REFUTED, "third.log")
    (tmp_path / "second.log").unlink()
    assert (Fault.GONE, "second.log", True) in faults(ledger, tmp_path)
    more("node.b", Verdict.REFUTED, "third.log")
    more("node.a", Verdict.REFUTED)
    (tmp_path / "third.log").unlink()
    assert (Fault.GONE, "third.log", True) in faults(ledger, tmp_path)


@pytest.mark.parametrize("name", STANDS_ON)
def test_what_stands_on_something_else_may_be_relied_upon_again(ledger: Ledger, tmp_path: Path, name: str) -> None:
    """What the newer one saw may be gone, or its day over: then the status rests on the earlier one, and on its log."""
    first = ledger.records()[0].evidence
    for told, serious in (("another", True), ("another", True), (None, False)):
        ledger.append(evidence("node.a", first.verdict, details={} if told is None else {name: told}))
        (tmp_path / "a.log").unlink(missing_ok=True)
        assert faults(ledger, tmp_path) == [(Fault.GONE, "a.log", serious)]


def test_what_was_tried_in_between_makes_nothing_stale(ledger: Ledger, tmp_path: Path) -> None:
    """A fault was planted and taken out again: the newest record is of another text, the one that counts is not."""
    program = tmp_path / "prog.imp"
    before = program.read_text()
    program.write_text("x := 1")
    ledger.append(evidence("node.a", Verdict.REFUTED, key="planted", inputs={"prog.imp": digest_file(program)}))
    program.write_text(before)
    first = ledger.records()[0].evidence
    keys = {(first.obligation, first.method): first.key}
    assert faults(ledger, tmp_path, keys=keys) == []
    program.write_text("x := 2")
    assert faults(ledger, tmp_path, keys=keys) == [(Fault.OUTDATED, "prog.imp", False)]
