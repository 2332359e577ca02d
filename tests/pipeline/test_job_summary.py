"""The summary that CI services show: well-formed Markdown, whatever the texts hold."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.pipeline.results import Result
from avow.pipeline.summary import append_job_summary, job_summary

GOOD = Result("crane", 0, {"proved": 3, "tested": 1}, "reports/crane/index.html", (("all", True, "fine"),))
BAD = Result(
    "hook",
    1,
    {"refuted": 2},
    "reports/hook/index.html",
    (("Nothing | is <b>refuted</b>", False, "a\n| b | `c`"),),
)


def test_every_row_has_as_many_cells_as_the_head() -> None:
    table = [line for line in job_summary([GOOD, BAD], ["broken"]).splitlines() if line.startswith("|")]
    assert len(table) == 2 + 3
    assert {line.count("|") for line in table} == {table[0].count("|")}


def test_texts_do_not_become_markup() -> None:
    text = job_summary([BAD], [])
    assert "<b>" not in text.replace("\\<b\\>", "")
    assert "Nothing \\| is \\<b\\>refuted\\</b\\>: a \\| b \\| \\`c\\`" in text


def test_it_is_appended_where_the_service_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "summary.md"
    path.write_text("before\n")
    append_job_summary([GOOD], [])
    assert path.read_text() == "before\n"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(path))
    append_job_summary([GOOD], [])
    assert path.read_text().startswith("before\n## Assurance\n")
    assert "| crane | 3 | 1 | ✅ every gate passes |" in path.read_text()
