"""Stamping through a whole system: the plan says which record, the contract which meanings."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import avow.cli
from avow.backends.review.record import read_record
from avow.backends.review.stamp import stamp
from avow.base.diagnostics import Rejected

PLAN = """\
system: s
title: S
contract: s.rcl
nodes:
  n:
    methods:
      - review: {record: review.yaml}
      - review: {id: second, record: other.yaml}
"""
CONTRACT = "node n { inputs( r : REAL ) outputs( b : BOOL ) topics( ) guarantee high ( in.r > 120 -> out.b ) }"
RECORD = """\
reviewer: Ada
role: engineer
date: 2026-11-20
read: [code.py]
checklist: [{question: "Is it?", answer: yes}]
conclusion: accepted
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "plan.yaml").write_text(PLAN)
    (tmp_path / "s.rcl").write_text(CONTRACT)
    (tmp_path / "code.py").write_text("pass\n")
    for name in ("review.yaml", "other.yaml"):
        (tmp_path / name).write_text(RECORD)
    return tmp_path


def main(arguments: list[str]) -> int:
    """``avow review stamp …``, with its exit code."""
    with pytest.raises(SystemExit) as left:
        avow.cli.main(["review", "stamp", *arguments])
    assert isinstance(left.value.code, int)
    return left.value.code


def test_one_of_two_reviews_is_stamped(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(Rejected, match="2 of review"):
        stamp(folder, "n")
    assert main([str(folder), "n", "--method", "second"]) == 0
    assert "code.py: " in capsys.readouterr().out
    assert (folder / "review.yaml").read_text() == RECORD
    record = read_record(folder / "other.yaml")
    assert record.read[0].sha256 is not None
    assert [j.clause for j in record.clauses] == ["high"]
    assert main([str(folder), "n", "--method", "second"]) == 0
    assert "nothing to stamp" in capsys.readouterr().out


def test_a_changed_contract_must_be_read_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stamp(folder, "n", method="review")
    (folder / "s.rcl").write_text(CONTRACT.replace("node", "// a comment changes nothing\nnode"))
    assert stamp(folder, "n", method="review") == ()
    (folder / "s.rcl").write_text(CONTRACT.replace("120", "121"))
    assert main([str(folder), "n", "--method", "review"]) == 2
    assert "high has changed" in capsys.readouterr().err
    before = (folder / "review.yaml").read_text()
    for day, why in (
        ("2026-11-19", "cannot have been renewed"),
        ("2999-01-01", "in the future"),
        ("21.11.", "not a date"),
    ):
        assert main([str(folder), "n", "--method", "review", "--renewed", day]) == 2
        assert why in capsys.readouterr().err
        assert (folder / "review.yaml").read_text() == before
    assert main([str(folder), "n", "--method", "review", "--renewed", "2026-11-21"]) == 0
    assert read_record(folder / "review.yaml").date == "2026-11-21"


@pytest.mark.parametrize("day", ["TBD", "2999-01-01", "21.11.2026"])
def test_a_date_that_none_was_is_mended_by_renewing(folder: Path, day: str) -> None:
    stamp(folder, "n", method="review")
    (folder / "s.rcl").write_text(CONTRACT.replace("120", "121"))
    record = folder / "review.yaml"
    record.write_text("".join(f"date: {day}\n" if x.startswith("date:") else x for x in record.open()))
    assert main([str(folder), "n", "--method", "review", "--renewed", "2026-11-21"]) == 0
    assert read_record(record).date == "2026-11-21"


@pytest.mark.parametrize("arguments", [["nobody"], ["n", "--method", "third"]])
def test_what_is_not_there_is_told(folder: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(folder), *arguments]) == 2
    assert "REV120" in capsys.readouterr().err


def test_a_folder_without_a_plan(tmp_path: Path) -> None:
    shutil.rmtree(tmp_path)
    assert main([str(tmp_path), "n"]) == 2


def test_the_short_form_names_the_record(folder: Path) -> None:
    """``review: review.yaml``, as the plan's documentation has it."""
    (folder / "plan.yaml").write_text(PLAN.split("      - review")[0] + "      - review: review.yaml\n")
    assert len(stamp(folder, "n")) == 2
    assert read_record(folder / "review.yaml").clauses[0].clause == "high"


@pytest.mark.parametrize("damage", ["conclusion: rejected", "reviewer: Eve", "remarks: fine", "read: []", "- torn"])
def test_a_stamp_that_says_something_else_is_not_written(
    folder: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    """Whatever an edit does to the rest of the record: it is read once more before anything is written."""
    record = folder / "review.yaml"
    before = record.read_text()
    key = damage.split(":")[0]
    kept = "".join(line for line in before.splitlines(True) if not line.startswith(key))
    monkeypatch.setattr("avow.backends.review.stamp._Editor.result", lambda self: f"{kept}{damage}\n")
    with pytest.raises(Rejected):
        stamp(folder, "n", method="review")
    assert record.read_text() == before
