"""What the first page of any report has to keep to, measured in a browser: its budgets, its words, its layout."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from avow.assurance.model import Case
from avow.base.plain import identifiers
from avow.report.answers_page import render_argument
from avow.report.markdown import render_markdown
from avow.report.pdf import _data as pdf_data
from avow.report.short import LINES, WIDTH, WORDS, comment, terminal_lines
from avow.report.wording import clean
from report.chromium import dark, frames_of, measure

OWN_WORDS, ALL_WORDS, BOXES_WITHIN, CONTRAST = 430, 3000, 960, 4.5
"""Own words above the signature, visible words in all, pixels within which the seven boxes end, least contrast."""
SHEET = 1010
"""Pixels of a sheet of A4 between its margins: 269 mm, less the rounding of lines."""
WIDTHS = (320, 390, 420, 1366, 1400)


def departures(found: Case, page: str, folder: Path) -> list[str]:
    """In what the page departs from what it should be; empty where in nothing."""
    measured = measure(frames_of(page, WIDTHS) | {"dark": (dark(page), 1400)}, folder)
    return [*_layout(measured), *_budgets(measured["1400"]), *counts(found, page + render_argument(found))]


def _layout(measured: dict[str, Any]) -> list[str]:
    told = []
    for width, said in measured.items():
        told += [f"{width}, folds closed: {text}" for text in said["closed"]]
        told += [f"{width}, folds open: {text}" for text in said["open"]]
        if width == "print" and said["sheet"] > SHEET:
            told.append(f"print: the first screen ends at {said['sheet']:.0f}, a sheet at {SHEET}")
        if said["scroll"] or said["openScroll"]:
            told.append(f"{width}: scrolls sideways")
        worst = min(said["contrast"], said["openContrast"])
        if worst[0] < CONTRAST:
            told.append(f"{width}: contrast {worst}")
    return told


def _budgets(wide: dict[str, Any]) -> list[str]:
    told = []
    if [head[0] for head in wide["heads"]] != ["1", "2", "3", "4", "5", "6", "7"]:
        told.append(f"the seven questions: {wide['heads']}")
    for name, most in (("own", OWN_WORDS), ("all", ALL_WORDS), ("bottom", BOXES_WITHIN)):
        if wide[name] > most:
            told.append(f"{name}: {wide[name]}, at most {most}")
    told += [f"an identifier: {word}" for word in identifiers(wide["ownText"])]
    return told


def counts(found: Case, page: str) -> list[str]:
    """Page, Markdown, terminal, comment and PDF say the same, and each assumption in full once."""
    a, told = found.answers, []
    pdf = pdf_data(found)["answers"]
    plain = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", "", page))
    markdown = render_markdown(found).replace("\\", "")
    terminal = terminal_lines(found)
    for name, text in (
        ("page", plain),
        ("Markdown", markdown),
        ("terminal", " ".join(" ".join(terminal).split())),
        ("comment", comment(found).replace("\\", "")),
        ("PDF", f"{pdf['verdict']} {pdf['beside']}"),
    ):
        told += [f"{name} lacks {part!r}" for part in (a.verdict, *a.beside.split(" · ")) if part not in text]
    told += words(found)
    if page.count('class="assumption"') != len(found.assumptions):
        told.append("an assumption stands not once on the page")
    if len(re.findall(r'<details id="requirement', page)) != len(found.requirements):
        told.append("a requirement stands not once on the page")
    if len(terminal) > LINES or any(len(line) > WIDTH for line in terminal):
        told.append(f"the terminal has {LINES} lines of {WIDTH} columns")
    outside = re.sub(r"<details>.*?</details>", "", comment(found), flags=re.DOTALL)
    if len(outside.split()) > WORDS:
        told.append(f"the comment has {len(outside.split())} words, at most {WORDS}")
    return told


def words(found: Case) -> list[str]:
    """One wording for one thing: bounds with their confidence, deficits, what was looked at, assumptions on paper."""
    a, told = found.answers, []
    for said in (a.weakest.words if a.weakest else "", a.next_weakest):
        if " fail)" in said and not re.search(
            r"confidence( not recorded)?: at most [0-9.]+ %( of \w+ drawn like these)? fail\)", said
        ):
            told.append(f"a bound without its confidence: {said!r}")
    if found.deficits and a.weakened not in a.statement:
        told.append(f"{a.weakened!r} is counted otherwise when it is signed: {a.statement!r}")
    used = {word for b in a.bases for word in re.findall(r"\((\w+)", b.words)}
    explained = {part.split(":")[0] for part in a.objects.split("; ") if part}
    if used != explained:
        told.append(f"looked at {sorted(used)}, explained {sorted(explained)}")
    paper = pdf_data(found)["first"]
    listed = " ".join(" ".join(line) for line in paper["supposed"])
    if any(line.more and clean(line.more) not in listed for line in a.supposed):
        told.append("on paper without a number")
    return told
