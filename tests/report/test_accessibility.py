"""Pages that everybody can use: contrast in both themes, headings in order, landmarks, names for whatever is used."""

from __future__ import annotations

import re
from collections.abc import Mapping
from html.parser import HTMLParser
from itertools import pairwise, product

import pytest
from assurance.sample import case as make_case
from assurance.sample import rover_case, system

from avow.assurance.changes import compare
from avow.assurance.state import state_of
from avow.assurance.traceability import trace
from avow.report.answers_page import render_answers, render_argument, render_index
from avow.report.comparison import render_comparison
from avow.report.page import asset, render_details, render_page, render_traceability
from avow.report.qualification import render_qualification
from report.hostile import hostile_case

STYLE = asset("style.css")
VARIABLE = re.compile(r"--([a-z-]+):(#[0-9a-f]{3,6})")
THEMES = list(re.findall(r"\{([^{}]*--paper:[^{}]*)\}", STYLE))


def colours(block: str) -> dict[str, str]:
    return dict(VARIABLE.findall(block))


def luminance(colour: str) -> float:
    """Relative luminance, WCAG 2.2."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * c for c in colour[1:])
    parts = [int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4)]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def ratio(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_the_ratio_is_wcags() -> None:
    assert ratio("#000", "#ffffff") == pytest.approx(21)
    assert ratio("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


def test_there_is_a_light_theme_and_one_dark_one() -> None:
    assert len(THEMES) == 3
    light, chosen, preferred = map(colours, THEMES)
    assert chosen == preferred
    assert light.keys() == chosen.keys()
    assert luminance(light["paper"]) > 0.9
    assert luminance(chosen["paper"]) < 0.05


TONES = ("good", "fair", "open", "bad")
TEXT = [
    *product(("ink", "quiet", "link"), ("paper", "faint", "head")),
    *((tone, f"{tone}-bg") for tone in TONES),
    *product(TONES, ("paper", "faint", "open-bg")),
    *product(("ink", "link", "quiet"), ("open-bg",)),
    *product(("key", "sort", "text", "label", "port", "note", "ink"), ("faint", "open-bg")),
    ("ink", "fair-bg"),
]
"""(text, ground) as the style sheet puts one on the other; a line that a link points at has the ground `open-bg`."""
SHAPES = [*((f"{tone}-line", ground) for tone in TONES for ground in ("paper", f"{tone}-bg")), ("link", "paper")]
"""Borders and bars that mean something, and the ring around what has the focus."""


@pytest.mark.parametrize("theme", [colours(block) for block in THEMES[:2]], ids=["light", "dark"])
def test_contrast(theme: Mapping[str, str]) -> None:
    faint = {pair: round(ratio(theme[pair[0]], theme[pair[1]]), 2) for pair in TEXT}
    assert {pair: r for pair, r in faint.items() if r < 4.5} == {}
    shapes = {pair: round(ratio(theme[pair[0]], theme[pair[1]]), 2) for pair in SHAPES}
    assert {pair: r for pair, r in shapes.items() if r < 3} == {}


def test_no_text_is_made_fainter_by_other_means_and_nothing_moves() -> None:
    rules = re.sub(r"\.map \.way\{[^}]*\}", "", STYLE)  # a line in a picture that is told in words, too
    assert "opacity" not in rules
    assert not re.search(r"transition|animation|scroll-behavior", STYLE)
    assert not re.search(r"behavior:\s*[\"']smooth", asset("script.js"))
    assert ":focus-visible{outline:" in STYLE
    assert "outline:none" not in STYLE
    assert "outline:0" not in STYLE


VOID = {"meta", "img", "br", "input", "link", "hr"}


class Tree(HTMLParser):
    """What assistive technology is told: elements in order, each with its attributes, its ancestors and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str], tuple[str, ...], list[str]]] = []
        self.open: list[int] = []
        self.feed(text)

    def role(self, at: int) -> str:
        role = self.found[at][1].get("role")
        return f"[{role}]" if role else ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        above = tuple(f"{self.found[at][0]}{self.role(at)}" for at in self.open)
        self.found.append((tag, {name: value or "" for name, value in attrs}, above, []))
        if tag not in VOID:
            self.open.append(len(self.found) - 1)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        self.open.pop()

    def handle_data(self, data: str) -> None:
        for at in self.open:
            self.found[at][3].append(data)

    def all(self, *tags: str) -> list[tuple[str, dict[str, str], tuple[str, ...], list[str]]]:
        return [item for item in self.found if item[0] in tags]


def pages() -> dict[str, str]:
    rover, hostile, empty = rover_case(), hostile_case(), make_case(system({}), [], [])
    changes = [("rover", c) for c in compare(state_of(empty), state_of(rover))]
    return {
        "answers": render_answers(rover),
        "argument": render_argument(rover),
        "report": render_page(rover),
        **{name: text for name, text in render_details(rover) if text is not None},
        "hostile": render_page(hostile),
        "empty": render_page(empty),
        "index": render_index([rover, hostile, empty]),
        "traceability": render_traceability(rover, trace(rover)),
        "qualification": render_qualification(rover),
        "hostile qualification": render_qualification(hostile),
        "comparison": render_comparison("a", "b", changes),
    }


PAGES = pages()


@pytest.fixture(params=list(PAGES))
def tree(request: pytest.FixtureRequest) -> Tree:
    return Tree(PAGES[request.param])


def test_language_title_and_landmarks(tree: Tree) -> None:
    assert tree.all("html")[0][1]["lang"] == "en"
    assert "".join(tree.all("title")[0][3]).strip()
    assert len(tree.all("main")) == 1
    assert len(tree.all("header")) == 1
    assert all(attributes.get("aria-label") for _, attributes, _, _ in tree.all("nav"))
    ids = {attributes["id"] for _, attributes, _, _ in tree.found if "id" in attributes}
    for _, attributes, _, _ in tree.found:
        if "aria-labelledby" in attributes:
            assert attributes["aria-labelledby"] in ids
    skip = [a for t, a, _, _ in tree.found if t == "a" and a.get("class") == "skip"]
    assert not skip or skip[0]["href"] == "argument.html" or skip[0]["href"][1:] in ids


def test_headings_are_in_order(tree: Tree) -> None:
    levels = [int(tag[1]) for tag, _, _, _ in tree.found if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert all("".join(text).strip() for tag, _, _, text in tree.found if re.fullmatch(r"h[1-6]", tag))


def test_whatever_can_be_used_has_a_name(tree: Tree) -> None:
    for tag, attributes, above, text in tree.all("a", "button", "summary", "select", "input", "img", "svg"):
        if attributes.get("aria-hidden") == "true" or "hidden" in attributes.get("class", ""):
            continue
        if tag in ("select", "input"):
            assert "label" in above
        elif tag == "img":
            assert attributes["alt"]
        elif tag == "svg":
            assert attributes.get("aria-label")
            assert attributes.get("role")
        else:
            assert "".join(text).strip() or attributes.get("aria-label"), (tag, attributes)


def test_no_picture_hides_links_and_no_tab_order_is_forced(tree: Tree) -> None:
    """Within ``role="img"`` a link could have the focus without being told."""
    for tag, attributes, above, _ in tree.found:
        assert int(attributes.get("tabindex", "0")) <= 0
        if tag == "a" or "tabindex" in attributes:
            assert "svg[img]" not in above


def test_tables_have_headers_with_a_scope_and_words(tree: Tree) -> None:
    for _, attributes, _, text in tree.all("th"):
        assert attributes.get("scope") in ("col", "row", "colgroup")
        assert "".join(text).strip()


def test_what_the_filter_shows_is_announced() -> None:
    found = [a for t, a, _, _ in Tree(PAGES["report"]).found if a.get("id") == "shown"]
    assert found
    assert found[0]["aria-live"] == "polite"
    assert "shown.textContent" in asset("script.js")
