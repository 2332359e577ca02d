"""Records that were cut off the end of the ledger stay missed, whatever is appended afterwards."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from avow.base.verdict import Link, Verdict
from avow.evidence.ledger import Ledger
from avow.evidence.record import Evidence


def record(number: int) -> Evidence:
    return Evidence(
        obligation="s/n/guarantee/g",
        obligation_digest="d",
        key="k",
        method="hoare",
        backend="hoare",
        tool="z3",
        tool_version="4",
        command=(),
        verdict=Verdict.REFUTED,
        strength=Verdict.PROVED,
        link=Link.GENERATED,
        summary=str(number),
        started="2026-11-21T00:00:00.000+00:00",
        seconds=1.0,
    )


@pytest.mark.parametrize("kept", [1, 2])
def test_a_cut_is_not_healed_by_the_next_record(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "s.jsonl"
    Ledger(path).append_all([record(n) for n in range(3)])
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:kept]))
    Ledger(path).append_all([record(n) for n in range(3, 9)])
    assert Ledger(path).damage
    assert json.loads((tmp_path / "s.jsonl.head").read_text())["records"] == 3


def test_a_ledger_deleted_as_a_whole_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "s.jsonl"
    Ledger(path).append_all([record(n) for n in range(3)])
    path.unlink()
    assert Ledger(path).damage
    Ledger(path).append(record(7))
    assert not Ledger(path).damage


def test_what_was_not_cut_is_not_missed(tmp_path: Path) -> None:
    path = tmp_path / "s.jsonl"
    for number in range(3):
        Ledger(path).append(record(number))
    assert not Ledger(path).damage
