"""Signed review records: whose key signed these bytes; nothing that is edited afterwards counts."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import avow.cli
from avow.backend_kit.protocol import Limits
from avow.backends.review import BACKEND
from avow.backends.review.signature import sign_record
from avow.base.verdict import Outcome, Verdict
from avow.evidence.signing import signature_path

pytest.importorskip("cryptography")

WITH_KEY = {"record": "review.yaml", "key": "ada.pub"}


@pytest.fixture
def key(tmp_path: Path) -> Path:
    from avow.evidence.signing import new_key_pair

    new_key_pair(tmp_path / "ada")
    new_key_pair(tmp_path / "bob")
    return tmp_path / "ada"


def settle(job: Any) -> Outcome:
    return BACKEND.discharge(job, job.root, Limits()).outcomes[0]


def test_a_signed_record_says_by_which_key(make_job: Callable[..., Any], stamped: Path, key: Path) -> None:
    place = sign_record(stamped, key)
    for options, told in ((WITH_KEY, "a trusted key"), ({"record": "review.yaml"}, "nobody here has named")):
        outcome = settle(make_job(options))
        assert outcome.verdict is Verdict.REVIEWED
        assert told in outcome.summary
        assert len(str(outcome.details["signed_by"])) == 64
        assert place in BACKEND.files(make_job(options))
    assert stamped.parent / "ada.pub" in BACKEND.files(make_job(WITH_KEY))
    assert BACKEND.check(make_job(WITH_KEY)) == ()


def test_a_record_that_nobody_signed_is_not_enough_where_a_key_is_named(
    make_job: Callable[..., Any], stamped: Path, key: Path
) -> None:
    assert settle(make_job()).verdict is Verdict.REVIEWED
    outcome = settle(make_job(WITH_KEY))
    assert outcome.verdict is Verdict.UNKNOWN
    assert "signed" in outcome.summary
    assert [d.code for d in BACKEND.check(make_job(WITH_KEY))] == ["REV104"]
    sign_record(stamped, key.with_name("bob"))
    assert settle(make_job(WITH_KEY)).verdict is Verdict.UNKNOWN
    assert settle(make_job({**WITH_KEY, "key": ["ada.pub", "bob.pub"]})).verdict is Verdict.REVIEWED
    assert settle(make_job({**WITH_KEY, "key": "eve.pub"})).verdict is Verdict.ERROR


def forged(place: Path, change: Callable[[dict[str, Any]], None]) -> None:
    body = json.loads(place.read_text())
    change(body)
    place.write_text(json.dumps(body))


EDITS: dict[str, Callable[[Path, Path], object]] = {
    "another remark": lambda record, _: record.write_text(record.read_text() + "remarks: all is well\n"),
    "a comment": lambda record, _: record.write_text(record.read_text() + "# hm\n"),
    "another reviewer": lambda record, _: record.write_text(record.read_text().replace("Ada", "Bob")),
    "an empty signature": lambda _, place: place.write_text(""),
    "no signatures": lambda _, place: forged(place, lambda b: b.update(signatures=[])),
    "another's key": lambda _, place: forged(place, lambda b: b["signatures"][0].update(keyid="0" * 64)),
    "another payload": lambda _, place: forged(place, lambda b: b.update(payload=b["payload"][:-8] + "AAAAAAA=")),
    "a link": lambda record, place: (place.unlink(), place.symlink_to(record)),
    "a folder": lambda _, place: (place.unlink(), place.mkdir()),
}


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("options", [None, WITH_KEY])
def test_what_was_edited_after_it_was_signed_does_not_count(
    make_job: Callable[..., Any], stamped: Path, key: Path, edit: str, options: Any
) -> None:
    sign_record(stamped, key)
    assert settle(make_job(options)).verdict is Verdict.REVIEWED
    EDITS[edit](stamped, signature_path(stamped))
    assert settle(make_job(options)).verdict is Verdict.UNKNOWN


def test_a_signature_of_another_record_does_not_count(make_job: Callable[..., Any], stamped: Path, key: Path) -> None:
    other = stamped.with_name("other.yaml")
    other.write_text(stamped.read_text() + "remarks: x\n")
    signature_path(stamped).write_bytes(sign_record(other, key).read_bytes())
    assert settle(make_job(WITH_KEY)).verdict is Verdict.UNKNOWN


def test_a_rejection_counts_whoever_signed_it(make_job: Callable[..., Any], stamped: Path, key: Path) -> None:
    stamped.write_text(stamped.read_text().replace("conclusion: accepted", "conclusion: rejected"))
    assert settle(make_job(WITH_KEY)).verdict is Verdict.REFUTED


def test_the_command(tmp_path: Path, key: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "s"
    folder.mkdir()
    (folder / "plan.yaml").write_text("system: s\nnodes: {n: {methods: [review: {record: r.yaml}]}}\n")
    (folder / "s.rcl").write_text("node n { inputs() outputs( b : BOOL ) topics() guarantee g ( out.b ) }\n")
    (folder / "r.yaml").write_text(
        "reviewer: Ada\nrole: engineer\ndate: 2026-11-20\nread: [s.rcl]\n"
        'checklist: [{question: "Is it?", answer: yes}]\nconclusion: accepted\n'
    )
    for words, code in ((["--key", str(key)], 0), (["--key", str(tmp_path / "none")], 2), (["--key", str(folder)], 2)):
        with pytest.raises(SystemExit) as left:
            avow.cli.main(["review", "sign", str(folder), "n", *words])
        assert left.value.code == code
    assert signature_path(folder / "r.yaml").is_file()
    assert "Traceback" not in capsys.readouterr().err
