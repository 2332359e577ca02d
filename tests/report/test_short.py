"""The five answers in few words, and that every format counts alike."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from assurance.sample import case as make_case
from assurance.sample import rover_case, system

from avow.assurance.changes import baseline_of
from avow.assurance.model import Case
from avow.report.answers_page import render_answers, render_argument
from avow.report.markdown import render_markdown
from avow.report.short import LINES, WIDTH, WORDS, comment, terminal_lines
from report.hostile import hostile_case
from report.test_answers_page import large_case

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
    for head in ("1 What is claimed", "2 What is it based on", "3 What is the weakest", "4 What is assumed", "5 What"):
        assert head in done.stdout, done.stdout
    assert "Signature" in done.stdout
    assert "signature, or key fingerprint" in done.stdout
