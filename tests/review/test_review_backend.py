"""A review speaks only of what was reviewed, and its record must say all that a review says."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from helpers import edit

from avow.backend_kit.protocol import Backend, Job, Limits
from avow.backends.review import BACKEND
from avow.backends.review.record import read_record
from avow.backends.review.stamp import stamp_record
from avow.base.diagnostics import Rejected
from avow.base.verdict import Link, Outcome, Verdict
from avow.language.contract import Node

MakeJob = Callable[..., Job]
MakeNode = Callable[..., Node]


def settle(job: Job) -> tuple[Outcome, Outcome]:
    first, second = BACKEND.discharge(job, job.root, Limits()).outcomes
    return first, second


def test_it_is_a_backend() -> None:
    assert isinstance(BACKEND, Backend)


@pytest.mark.parametrize("options", [None, "review.yaml"])
def test_an_accepted_and_fresh_review(make_job: MakeJob, stamped: Path, options: Any) -> None:
    job = make_job(options)
    assert BACKEND.check(job) == ()
    for outcome in settle(job):
        assert outcome.verdict is Verdict.REVIEWED
        assert outcome.link is Link.GUIDED
        assert outcome.details["reviewer"] == "Ada"
        assert outcome.details["valid_until"] == "2027-11-20"
    assert {p.name for p in BACKEND.files(job)} == {"review.yaml", "code.py", "more.py", "odd name.py"}


def test_a_changed_file_makes_it_stale(make_job: MakeJob, stamped: Path) -> None:
    (stamped.parent / "models/more.py").write_text("other")
    for outcome in settle(make_job()):
        assert outcome.verdict is Verdict.UNKNOWN
        assert outcome.summary == (
            "stale: models/more.py changed since the review of 2026-11-20; read it again and date the record anew"
        )


def test_a_lost_file_makes_it_stale(make_job: MakeJob, stamped: Path) -> None:
    (stamped.parent / "models/more.py").unlink()
    assert "models/more.py is gone" in settle(make_job())[0].summary


def test_a_changed_threshold_makes_only_its_guarantee_stale(
    make_job: MakeJob, make_node: MakeNode, stamped: Path
) -> None:
    first, second = settle(make_job(node=make_node(threshold=121)))
    assert first.verdict is Verdict.UNKNOWN
    assert "G1" in first.summary
    assert second.verdict is Verdict.REVIEWED


def test_a_changed_assumption_makes_all_guarantees_stale(make_job: MakeJob, make_node: MakeNode, stamped: Path) -> None:
    for outcome in settle(make_job(node=make_node(assumed=1))):
        assert outcome.verdict is Verdict.UNKNOWN


def test_a_guarantee_that_was_not_judged_is_not_reviewed(make_job: MakeJob, stamped: Path) -> None:
    stamped.write_text(re.sub(r"\n  G2: [0-9a-f]{64}", "", stamped.read_text()))
    first, second = settle(make_job())
    assert first.verdict is Verdict.REVIEWED
    assert second.verdict is Verdict.UNKNOWN
    assert "does not speak of G2" in second.summary


def test_an_unstamped_review_is_not_green(make_job: MakeJob, stamped: Path) -> None:
    stamped.write_text(re.sub(r"[0-9a-f]{64}", "", stamped.read_text()))
    for outcome in settle(make_job()):
        assert outcome.verdict is Verdict.UNKNOWN
        assert "never stamped" in outcome.summary


def test_a_rejection_refutes(make_job: MakeJob, stamped: Path) -> None:
    edit(stamped, ("conclusion: accepted", "conclusion: rejected\nremarks: two publishers"))
    for outcome in settle(make_job()):
        assert outcome.verdict is Verdict.REFUTED
        assert outcome.counterexample is not None
        assert outcome.counterexample.explanation == "two publishers"
    (stamped.parent / "models/more.py").write_text("other")
    assert settle(make_job())[0].verdict is Verdict.UNKNOWN, "a stale rejection is stale too"


def test_conditions_become_hypotheses(make_job: MakeJob, stamped: Path) -> None:
    edit(stamped, ("conclusion: accepted", "conclusion: conditional\nconditions: [the map is loaded]"))
    outcome = settle(make_job())[0]
    assert outcome.verdict is Verdict.REVIEWED
    assert outcome.hypotheses == ("the map is loaded",)


def test_one_guarantee_may_fare_worse_but_not_better(make_job: MakeJob, stamped: Path) -> None:
    stamped.write_text(
        re.sub(r"G1: ([0-9a-f]{64})", r"G1: {meaning: \1, conclusion: rejected, remark: why}", stamped.read_text())
    )
    first, second = settle(make_job())
    assert (first.verdict, second.verdict) == (Verdict.REFUTED, Verdict.REVIEWED)
    text = stamped.read_text().replace("conclusion: accepted", "conclusion: rejected")
    stamped.write_text(text.replace("conclusion: rejected, remark", "conclusion: accepted, remark"))
    assert settle(make_job())[0].verdict is Verdict.REFUTED


def test_material_kept_elsewhere_is_a_hypothesis(make_job: MakeJob, stamped: Path) -> None:
    edit(stamped, ("read:\n", "read:\n  - material: the data sheet\n"))
    outcome = settle(make_job())[0]
    assert outcome.verdict is Verdict.REVIEWED
    assert "the data sheet" in outcome.hypotheses[0]


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("reviewer: Ada", "", "'reviewer' is missing"),
        ("role: safety engineer", "role: ", "role: text is wanted"),
        ("date: 2026-11-20", "date: 20 November", "not a date of the calendar"),
        ("date: 2026-11-20", "date: 2026-02-30", "not a date of the calendar"),
        ("date: 2026-11-20", "date: ２０２６-11-20", "not a date of the calendar"),
        ("date: 2026-11-20", "date: 20261120", "date: text is wanted"),
        ("date: 2026-11-20", "date: 1026-11-20", "too early for any contract"),
        ("date: 2026-11-20", "date: 2999-11-20", "in the future"),
        ("valid_until: 2027", "valid_until: 1027", "too early for any contract"),
        ("valid_until: 2027", "valid_until: 2025", "expires before"),
        ("    answer: yes", "", "'answer' is missing"),
        ("answer: yes", "answer: perhaps", "'perhaps' is not one of"),
        ("answer: yes", "answer: no\n    note: n", "accepted, although question 1"),
        ("answer: yes", "answer: no", "needs a 'note'"),
        ("answer: no, wanted: no", "answer: yes, wanted: no, note: n", "accepted, although question 2"),
        ("conclusion: accepted", "conclusion: fine", "'fine' is not one of"),
        ("conclusion: accepted", "conclusion: conditional", "must list"),
        ("conclusion: accepted", "conclusion: accepted\nconditions: [x]", "'conditional', not 'accepted'"),
        ("conclusion: accepted", "", "'conclusion' is missing"),
        ("format: 1", "format: 2", "1 is wanted, not 2"),
        ("reviewer: Ada", "reviewr: Ada", "unknown key"),
        ("reviewer: Ada", "reviewer: [Ada]", "reviewer: text is wanted"),
        ("reviewer: Ada", "reviewer: Ada\nreviewer: Bob", "given twice"),
        ("reviewer: Ada", "reviewer: Ada\nnode: other", "review of node 'other'"),
        ("reviewer: Ada", "reviewer: Ada\nsystem: other", "for system 'other'"),
        ("file: models/more.py", "file: ../more.py", "system's folder"),
        ("  G1:", "  G7:", "no guarantee 'G7'"),
        ("checklist:", "checklist: []\nother:", "must not be empty (expected: what was asked)"),
    ],
)
def test_a_bad_record_is_told_and_never_green(make_job: MakeJob, stamped: Path, old: str, new: str, word: str) -> None:
    edit(stamped, (old, new))
    job = make_job()
    problems = BACKEND.check(job)
    assert any(word in p.message for p in problems), problems
    assert all(p.span is not None for p in problems)
    for outcome in settle(job):
        assert outcome.verdict is Verdict.ERROR
    BACKEND.files(job)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({}, "needs 'record'"),
        ({"record": "no.yaml"}, "no file"),
        ({"record": "../x.yaml"}, "system's folder"),
        ({"record": 3}, "needs 'record'"),
        ([], "needs 'record'"),
        ("/etc/passwd", "system's folder"),
    ],
)
def test_bad_options(make_job: MakeJob, stamped: Path, options: Any, word: str) -> None:
    job = make_job(options)
    assert any(word in p.message for p in BACKEND.check(job))
    assert settle(job)[0].verdict is Verdict.ERROR
    BACKEND.files(job)


@pytest.mark.parametrize(
    "text", ["", "[]", "a: [", "\t- x", "x", "clauses: [1]", "read: {a: b}", "&a [*a]", "- " * 3000]
)
def test_files_that_are_no_records(make_job: MakeJob, stamped: Path, text: str) -> None:
    stamped.write_text(text)
    assert BACKEND.check(make_job())
    assert settle(make_job())[0].verdict is Verdict.ERROR


def test_export_gives_the_meanings(make_job: MakeJob, stamped: Path) -> None:
    text = BACKEND.export(make_job())["to-review.json"]
    recorded = {j.clause: j.meaning for j in read_record(stamped).clauses}
    assert all(f'"meaning": "{meaning}"' in text for meaning in recorded.values())


class TestStamp:
    def test_all_else_stays_as_it_was_written(self, stamped: Path, record_text: str) -> None:
        text = stamped.read_text()
        assert "# kept: a comment\n" in text
        assert "# kept too\n" in text
        assert yaml.safe_load(text)["checklist"] == yaml.safe_load(record_text)["checklist"]

    def test_a_second_stamp_changes_nothing(self, stamped: Path, make_node: MakeNode) -> None:
        before = stamped.read_bytes()
        assert stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2")) == ()
        assert stamped.read_bytes() == before

    def test_it_never_refreshes_by_habit(self, stamped: Path, make_node: MakeNode) -> None:
        (stamped.parent / "models/code.py").write_text("other")
        before = stamped.read_bytes()
        with pytest.raises(Rejected, match=r"models/code.py has changed"):
            stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2"))
        with pytest.raises(Rejected, match="G1 has changed"):
            stamp_record(stamped, stamped.parent, make_node(threshold=9), ("G1",))
        assert stamped.read_bytes() == before

    def test_a_renewed_review_has_a_new_date(self, make_job: MakeJob, stamped: Path, make_node: MakeNode) -> None:
        (stamped.parent / "models/code.py").write_text("other")
        with pytest.raises(Rejected, match="date"):
            stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2"), renewed="today")
        assert read_record(stamped).date == "2026-11-20"
        assert stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2"), renewed="2026-11-21")
        assert read_record(stamped).date == "2026-11-21"
        assert settle(make_job())[0].verdict is Verdict.REVIEWED

    @pytest.mark.parametrize(
        "clauses",
        [
            "clauses: {}",
            "clauses: {G2: }",
            "clauses:\n    G2:",
            "clauses: ~",
            "clauses: {G1: {remark: x}}",
            "clauses:\n  G1:\n    remark: x",
            "",
        ],
    )
    def test_every_shape_of_clauses(self, make_job: MakeJob, stamped: Path, make_node: MakeNode, clauses: str) -> None:
        stamped.write_text(re.sub(r"clauses:\n(  .*\n)*", clauses + "\n" if clauses else "", stamped.read_text()))
        stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2"))
        assert [o.verdict for o in settle(make_job())] == [Verdict.REVIEWED] * 2

    def test_windows_line_ends(self, make_job: MakeJob, stamped: Path, make_node: MakeNode) -> None:
        text = re.sub(r"[0-9a-f]{64}", "", stamped.read_text())
        stamped.write_bytes(text.replace("\n", "\r\n").encode())
        stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2"))
        assert settle(make_job())[0].verdict is Verdict.REVIEWED

    def test_a_missing_file_is_told(self, stamped: Path, make_node: MakeNode) -> None:
        (stamped.parent / "models/code.py").unlink()
        with pytest.raises(Rejected, match="no file"):
            stamp_record(stamped, stamped.parent, make_node(), ("G1", "G2"))


def test_a_text_with_a_comma_needs_quotes(make_job: MakeJob, stamped: Path) -> None:
    edit(stamped, ("read:\n", "read:\n  - {material: data sheet of the lidar, rev. 4}\n"))
    (found,) = [d for d in BACKEND.check(make_job()) if d.code == "REV111"]
    assert "quotes" in (found.hint or "")
