"""What readers do with the two pages in a browser: follow a link into a fold, open folds by keyboard; no clipping."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from assurance.sample import rover_case

from avow.report.answers_page import render_argument
from avow.report.page import render_page
from report.chromium import frames_of, measure
from report.driven import Driven, driven
from report.pages import claim_pages

pytestmark = pytest.mark.needs_chromium

PAGES = {"argument.html": render_argument, "claims.html": render_page}


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Driven, Path]]:
    folder = tmp_path_factory.mktemp("reader")
    for name, render in PAGES.items():
        (folder / name).write_text(render(rover_case()), encoding="utf-8")
    with driven(folder) as tab:
        yield tab, folder


CLOSED = "[...document.querySelectorAll('details [id], details[id]')].filter((e) => !e.checkVisibility())"


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_link_opens_every_fold_around_its_place(name: str, reader: tuple[Driven, Path]) -> None:
    tab, folder = reader
    tab.open(folder / name)
    hidden = tab.value(f"{CLOSED}.map((e) => e.id)")
    folds = tab.value("[...document.querySelectorAll('details[id]:not([open])')].map((e) => e.id)")
    assert folds
    wanted = [*hidden[:3], *hidden[-2:], folds[0]]
    for target in wanted:
        tab.open(folder / name, target)
        around = "(e) => { for (; e; e = e.parentElement) if (e.tagName === 'DETAILS' && !e.open) return 0; return 1 }"
        assert tab.value(f"({around})(document.getElementById({target!r}))") == 1, target
        # A fold that opens moves what lies below it, and the page scrolls there in the frames that follow.
        tab.frames(4)
        top = tab.value(f"document.getElementById({target!r}).getBoundingClientRect().top")
        assert -2 <= top <= 1000, target


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("key", ["Enter", " "])
def test_folds_open_and_close_by_keyboard(name: str, key: str, reader: tuple[Driven, Path]) -> None:
    tab, folder = reader
    tab.open(folder / name)
    tab.value("document.body.focus()")
    for _ in range(300):
        tab.press("Tab")
        if tab.value("document.activeElement.tagName === 'SUMMARY' && !document.activeElement.parentElement.open"):
            break
    else:
        raise AssertionError("no fold is reached with the Tab key")
    assert tab.value("getComputedStyle(document.activeElement).outlineStyle") != "none", "the focus cannot be seen"
    tab.press(key)
    assert tab.value("document.activeElement.parentElement.open") is True
    tab.press(key)
    assert tab.value("document.activeElement.parentElement.open") is False
    lost = "[...document.querySelectorAll('summary')].filter((e) => e.checkVisibility() && e.tabIndex < 0).length"
    assert tab.value(lost) == 0


@pytest.mark.nightly
def test_nothing_is_clipped_in_the_pages_of_all_claims(tmp_path: Path) -> None:
    made = claim_pages(rover_case())
    frames = {
        f"{at}{width}": frame for at, text in enumerate(made.values()) for width, frame in frames_of(text).items()
    }
    fault = made["node-agent.html"].replace("</style>", ".ob{position:relative;left:-60px}</style>")
    measured = measure(frames | {"fault": (fault, 420)}, tmp_path)
    assert measured.pop("fault")["open"]
    for width, said in measured.items():
        assert said["closed"] == [], width
        assert said["open"] == [], width
        assert (said["scroll"], said["openScroll"]) == (0, 0), width
