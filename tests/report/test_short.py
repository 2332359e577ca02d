"""The five answers in few words, and that every format counts alike."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pypdf
import pytest
from assurance.sample import case as make_case
from assurance.sample import rover_case, system

from avow.assurance.codec import read_case
from avow.assurance.model import Case
from avow.assurance.state import baseline_of
from avow.base.tuning.shown import PDF_OBLIGATIONS
from avow.report.answers_page import render_answers, render_argument
from avow.report.markdown import render_markdown
from avow.report.short import LINES, WIDTH, WORDS, comment, terminal_lines
from avow.report.wording import clean
from report.hostile import hostile_case
from report.test_answers_page import REPORTS, large_case

CASES = {
    "rover": rover_case,
    "large": large_case,
    "hostile": hostile_case,
    "empty": lambda: make_case(system({}), [], []),
}


@pytest.fixture(params=list(CASES))
def found(request: pytest.FixtureRequest) -> Case:
    case: Case = CASES[request.param]()
    return case


def test_a_terminal_shows_all_five(found: Case) -> None:
    lines = terminal_lines(found)
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    heads = [line[0] for line in lines if re.match(r"[1-5] [A-Z]", line)]
    assert heads == ["1", "2", "3", "4", "5"]
    assert lines[-1].startswith("next: ")
    assert not any("\n" in line or "\x1b" in line for line in lines)


def test_a_comment_is_short_outside_its_fold(found: Case) -> None:
    text = comment(found)
    shown = re.sub(r"<details>.*</details>|<!--.*?-->", "", text, flags=re.DOTALL)
    assert len(re.findall(r"\w+", shown)) <= WORDS
    assert text.startswith("<!-- avow ")
    assert text.count("<details>") == text.count("</details>") == 1


def test_a_comment_says_what_the_verdict_was() -> None:
    case = rover_case()
    from dataclasses import replace

    old = replace(baseline_of(case, "f", "A. Person", "2026-11-20"), verdict="Holds")
    assert "Holds → " in comment(replace(case, baseline=old))


def test_page_markdown_terminal_and_pdf_count_alike(found: Case) -> None:
    import json

    from avow.report.pdf import _data

    a = found.answers
    page, text = render_answers(found), render_markdown(found)
    pdf = json.dumps(_data(found), ensure_ascii=False)
    plain = text.replace("\\", "")
    terminal = "\n".join(terminal_lines(found))
    for part in (a.verdict, a.weakened):
        for made in (page, plain, terminal, pdf):
            assert part in made
    for s in found.assumptions:
        assert plain.count(f"- {s.number} (") == 1
        assert render_argument(found).count(f'<tr id="{s.number}">') == 1
    assert len(_data(found)["assumptions"]) == len(found.assumptions)


@pytest.fixture(scope="module", params=["rover", "large", "hostile", "empty"])
def printed(request: pytest.FixtureRequest) -> tuple[Case, Any]:
    """A case, and its PDF as an independent reader has it."""
    pytest.importorskip("typst")
    from avow.report.pdf import render_pdf

    found = CASES[request.param]()
    return found, pypdf.PdfReader(io.BytesIO(render_pdf(found)), strict=True)


def bookmarks(reader: Any) -> list[tuple[str, int]]:
    """(title, page) of each bookmark, deeper ones too."""

    def told(items: Any) -> Iterator[tuple[str, int]]:
        for item in items:
            if isinstance(item, list):
                yield from told(item)
            else:
                yield str(item.title), reader.get_destination_page_number(item) + 1

    return list(told(reader.outline))


def test_a_pdf_has_bookmarks_in_the_order_of_its_pages(printed: tuple[Case, Any]) -> None:
    found, reader = printed
    marks = bookmarks(reader)
    names = [name for name, _ in marks]
    assert {"Assumptions, each once", "Gates of the policy", "Obligations", "What is not shown"} <= set(names)
    assert {clean(r.id) for r in found.requirements} <= {name.strip() for name in names} or "hostile" in found.title
    pages = [page for _, page in marks]
    assert pages == sorted(pages)
    assert min(pages) >= 1
    assert max(pages) <= len(reader.pages)
    told = {v.obligation.node for v in found.obligations[:PDF_OBLIGATIONS] if v.obligation.node.isalnum()} - {"system"}
    assert told <= set(names)


def test_a_pdf_can_be_read_aloud(printed: tuple[Case, Any]) -> None:
    """Tagged, with a title and a language, and declared as PDF/UA-1, which Typst checks."""
    found, reader = printed
    root = reader.trailer["/Root"]
    assert root["/MarkInfo"]["/Marked"]
    assert root["/Lang"] == "en"
    assert root["/ViewerPreferences"]["/DisplayDocTitle"]
    assert reader.metadata.title == clean(found.title)
    assert b"<pdfuaid:part>1</pdfuaid:part>" in root["/Metadata"].get_data()


def test_no_column_of_a_pdf_is_as_narrow_as_a_word(printed: tuple[Case, Any]) -> None:
    found, reader = printed
    lines = [line for page in reader.pages for line in page.extract_text().splitlines() if line.strip()]
    for s in found.assumptions:
        first = " ".join(s.words.split()[:4])
        assert any(first in line for line in lines), first


@pytest.mark.parametrize("name", ["rover", "large"])
def test_pdf_sheet_one_has_the_five_answers_and_the_signature(name: str, tmp_path: Path) -> None:
    import shutil
    import subprocess

    pytest.importorskip("typst")
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext is not on this machine")
    from avow.report.pdf import render_pdf

    path = tmp_path / "report.pdf"
    path.write_bytes(render_pdf(CASES[name]()))
    done = subprocess.run(
        ["pdftotext", "-f", "1", "-l", "1", "-layout", str(path), "-"], capture_output=True, text=True, check=True
    )
    for head in (
        "1 What is claimed",
        "2 What is it based on",
        "3 What is the weakest",
        "4 What is assumed",
        "5 What",
        "6 What",
        "7 What must be trusted",
    ):
        assert head in done.stdout, done.stdout
    assert "Signature" in done.stdout
    assert "signature, or key fingerprint" in done.stdout


@pytest.mark.nightly
@pytest.mark.skipif(not REPORTS, reason="no system has been verified here: `doit verify`")
@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.name)
def test_sheet_one_of_a_shipped_system_has_room_for_the_signature(folder: Path) -> None:
    pytest.importorskip("typst")
    from avow.report.pdf import render_pdf

    reader = pypdf.PdfReader(io.BytesIO(render_pdf(read_case(folder))), strict=True)
    first = reader.pages[0].extract_text()
    assert "7 What must be trusted" in first
    assert "signature, or key fingerprint" in first
    assert max(page for _, page in bookmarks(reader)) <= len(reader.pages)
