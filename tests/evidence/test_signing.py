"""Signatures: made, believed, and refused after any change."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from assurance.sample import evidence

from avow.base.diagnostics import Rejected
from avow.evidence.ledger import Ledger

pytest.importorskip("cryptography")
from avow.evidence import signing
from avow.evidence.signing import Signed, new_key_pair, signature_path


def chain(ledger: Ledger) -> Signed:
    return Signed(ledger.path.stem, tuple(entry.hash for entry in Ledger(ledger.path).records()))


def sign(ledger: Ledger, key: Path) -> None:
    signing.sign(signature_path(ledger.path), chain(ledger), key)


def verify_signature(ledger: Ledger, public: Path | None) -> str | None:
    return signing.verify_signature(signature_path(ledger.path), chain(ledger), public)[0]


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    ledger = Ledger(tmp_path / "rover.jsonl")
    ledger.append_all([evidence("n.a"), evidence("n.b")])
    return ledger


def test_sign_and_verify(ledger: Ledger, tmp_path: Path) -> None:
    public = new_key_pair(tmp_path / "key")
    assert (tmp_path / "key").stat().st_mode & 0o077 == 0
    sign(ledger, tmp_path / "key")
    assert verify_signature(ledger, public) is None
    assert verify_signature(ledger, None) is None
    ledger.append(evidence("n.c"))  # what follows is not covered, and does not disturb
    assert signing.verify_signature(signature_path(ledger.path), chain(ledger), public) == (None, 2)


def test_a_rewritten_ledger_does_not_match_its_signature(ledger: Ledger, tmp_path: Path) -> None:
    public = new_key_pair(tmp_path / "key")
    sign(ledger, tmp_path / "key")
    for name in (ledger.path, ledger.path.with_name("rover.jsonl.head")):
        name.unlink()
    forged = Ledger(ledger.path)
    forged.append_all([evidence("n.a"), evidence("n.c")])
    assert forged.damage == ()
    assert "are not those" in (verify_signature(forged, public) or "")


def test_another_key_or_a_changed_count_is_refused(ledger: Ledger, tmp_path: Path) -> None:
    public = new_key_pair(tmp_path / "key")
    new_key_pair(tmp_path / "mallory")
    sign(ledger, tmp_path / "mallory")
    assert "by that key" in (verify_signature(ledger, public) or "")
    path = signature_path(ledger.path)
    path.write_text(json.dumps({**json.loads(path.read_text()), "records": 1}))
    assert verify_signature(ledger, None)
    whole = json.loads(path.read_text())
    for bad in ({}, [], {**whole, "records": "2"}, {**whole, "signature": "é"}, {**whole, "more": 1}):
        path.write_text(json.dumps(bad))
        assert "cannot be read" in (verify_signature(ledger, None) or "")


def test_bad_keys_and_empty_ledgers_are_refused(ledger: Ledger, tmp_path: Path) -> None:
    (tmp_path / "no").write_text("no key")
    with pytest.raises(Rejected):
        sign(ledger, tmp_path / "no")
    new_key_pair(tmp_path / "key")
    with pytest.raises(Rejected):
        new_key_pair(tmp_path / "key")  # never overwrites a key
    with pytest.raises(Rejected):
        sign(Ledger(tmp_path / "empty.jsonl"), tmp_path / "key")
