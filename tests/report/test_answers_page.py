"""The first page: what stands on it, and how it is laid out in a browser."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, node_plan, rover_case, system

from avow.assurance.answers import Failure, Level
from avow.assurance.codec import read_case
from avow.assurance.model import Case
from avow.assurance.state import baseline_of
from avow.base.verdict import Verdict
from avow.evidence.obligation import Kind
from avow.report.answers_page import render_answers, render_argument
from avow.report.markdown import render_markdown
from avow.report.pdf import _data as pdf_data
from avow.report.short import comment, terminal_lines
from avow.report.wording import NO_HAZARD
from avow.system.plan import Hazard, Requirement, Statement
from report.chromium import measure
from report.first_screen import counts, departures, words
from report.hostile import hostile_case
from report.pages import claim_pages
from report.test_page import Page


@cache
def large_case(nodes: int = 12, requirements: int = 30) -> Case:
    """Nodes with many guarantees, and more requirements than rows."""
    names = [f"arm{n}Joint" for n in range(nodes)]
    made = {name: [f"g_{i}" for i in range(1 + at * 2)] for at, name in enumerate(names)}
    said = "What this node promises of its output, whatever the input is that it is given in a step"
    claims = [guarantee(n, g, said, f"in.{g} > 0 -> out.{n}.{g} < in.{g} + 1") for n, gs in made.items() for g in gs]
    records = []
    for at, claim in enumerate(claims):
        drawn = at % 3 == 0
        records.append(
            evidence(
                claim,
                Verdict.TESTED if drawn else Verdict.PROVED,
                "hypothesis" if drawn else "hoare",
                hypotheses=("the inputs are drawn as they will be",) if drawn else (),
                bound={
                    "cases": 300,
                    "triggered": 12,
                    "failure_probability_when_triggered_below": 0.221,
                    "confidence": 0.95,
                }
                if drawn
                else {},
            )
        )
    asked = [
        Requirement(
            f"REQ_{n}",
            f"The robot does what sentence {n} of its list of requirements asks of it.",
            None,
            None,
            tuple(names[: 1 + n % nodes]),
        )
        for n in range(requirements)
    ]
    subject = system(made, plans=[node_plan(n, "low", "hoare", "hypothesis") for n in names], requirements=asked)
    words = Statement(
        "assumptions.hypothesis.drawn", "Inputs are drawn as the robot will meet them", "", "A. Person", "2030-01-01"
    )
    subject = replace(subject, plan=replace(subject.plan, statements=(words,)))
    return make_case(subject, claims, records)


CASES = {
    "rover": rover_case,
    "large": large_case,
    "hostile": hostile_case,
    "empty": lambda: make_case(system({}), [], []),
}


def test_each_gate_that_fails_is_in_the_banner_and_each_hazard_on_the_first_screen() -> None:
    target, asked = guarantee("n", "g"), Requirement("R", "It is safe.", None, None, ("n.g",))
    formal = replace(asked, id="F", formula="n.x > 0", supported_by=())
    hazards = [Hazard(f"H{at}", "It burns", "critical", mitigated_by=("R",)[at:]) for at in range(9)]
    subject = system({"n": ["g"]}, requirements=[asked, formal], hazards=hazards)
    found = make_case(subject, [target], [evidence(target)])
    failures = tuple(Failure(f"Gate {at}", "why", "") for at in range(4))
    page = render_answers(replace(found, answers=replace(found.answers, failures=failures)))
    told = " ".join(re.sub(r"<[^>]*>", " ", page).split())
    assert "“Gate 0” fails." in told
    assert "Also fail: Gate 1; Gate 2; Gate 3 ." in told
    assert "✘ mitigation not shown H1 It burns (critical), H2 It burns (critical), H3" in told
    assert "H3 It burns (critical) and 5 more ; ◐ mitigation argued H0 It burns (critical) ." in told
    assert f"{found.gates[0].title}: {found.gates[0].state}." in page, "the gates by name, under the pointer"
    assert "◐ argued argued: a person&#39;s word" in told
    assert pdf_data(found)["first"]["hazards"].startswith("✘ mitigation not shown: H1 It burns (critical)")
    assert "Hazards: H1 mitigation not shown, H2 mitigation not shown, " in comment(found)
    assert "| H8 | It burns | critical | ✘ no mitigation |" in render_markdown(found)
    bare = make_case(system({"n": ["g"]}, requirements=[asked]), [target], [evidence(target)])
    assert "none is declared" in render_answers(bare)
    assert NO_HAZARD in render_answers(bare)
    assert NO_HAZARD in render_markdown(bare)
    every = replace(found.requirements[1], level=Level.SHOWN, rests_on=(target.id,))
    assert "counts as resting on all" in render_argument(replace(found, requirements=(every,)))
    assert "Entailment by the composed contracts" in render_argument(found)


def test_each_condition_of_the_composition_stands_once_with_the_requirements_that_need_it() -> None:
    found = rover_case()
    page = " ".join(re.sub(r"<[^>]*>", " ", render_argument(found)).split())
    table = page.partition("needed by ")[2].partition("Assumptions, each once")[0]
    for view in found.obligations:
        needing = [r.id for r in found.requirements if view.id in r.closure]
        if view.obligation.kind is Kind.COMPOSITION and needing:
            assert table.count(f": {view.obligation.claim} ") == 1
    assert "1 of 1 guarantee: one_position stale" in page


@pytest.mark.parametrize("name", CASES)
def test_elements_nest_ids_are_unique_and_links_lead_somewhere(name: str) -> None:
    found = CASES[name]()
    made = {"index.html": render_answers(found), "argument.html": render_argument(found), **claim_pages(found)}
    pages = {name: Page(text) for name, text in made.items()}
    for here, page in pages.items():
        assert page.faults == []
        assert page.open == []
        assert {name for name in page.ids if page.ids.count(name) > 1} == set()
        for _, attribute, value in page.attributes:
            if attribute == "href" and "#" in value:
                name, _, place = value.partition("#")
                assert place in pages[name or here].ids, value


def both(found: Case) -> str:
    """The first page and the argument behind it."""
    return render_answers(found) + render_argument(found)


def test_texts_of_contract_and_plan_are_data() -> None:
    text = both(hostile_case())
    assert "<script>alert" not in text
    assert "<img" not in text
    assert text.count("<script>") == 2


def test_each_assumption_stands_in_full_once_and_counts_agree() -> None:
    found = large_case()
    text = both(found)
    assert text.count('class="assumption"') == len(found.assumptions)
    assert found.answers.verdict in text
    assert len(re.findall(r'<details id="requirement', text)) == len(found.requirements)
    assert len(re.findall(r'<details id="node', text)) == len(found.nodes)


FAULTS = {
    "line": (".v b{width:90px;white-space:nowrap;display:block}", "closed"),
    "box": (".five>section{height:40px}", "closed"),
    "picture": (".pic .b{width:60px;white-space:nowrap}", "open"),
    "shifted": (".m{position:relative;left:-60px}", "closed"),
    "square": (".sq i{width:2px}", "closed"),
}


@pytest.mark.nightly
@pytest.mark.needs_chromium
@pytest.mark.parametrize("name", ["rover", pytest.param("large", marks=pytest.mark.nightly)])
def test_in_a_browser_nothing_is_clipped_and_the_budgets_hold(name: str, tmp_path: Path) -> None:
    found = CASES[name]()
    assert departures(found, render_answers(found), tmp_path) == []


@pytest.mark.slow
@pytest.mark.needs_chromium
def test_the_seven_answers_fit_a_screen_after_any_number_of_changes(tmp_path: Path) -> None:
    signed = baseline_of(rover_case(), "f", "A. Person", "2026-11-20", "2027-11-20")
    other = tuple((about, name, of, ("in.r < 120 ∧ x > 1",)) for about, name, of, _ in signed.items if of == "formula")
    found = rover_case(baseline=replace(signed, items=other))
    assert len(found.changes.entries) > 20
    assert measure({"page": (render_answers(found), 1400)}, tmp_path)["page"]["bottom"] <= 1000


@pytest.mark.slow
@pytest.mark.needs_chromium
def test_faults_of_layout_are_found(tmp_path: Path) -> None:
    pages = {"picture": render_argument(rover_case())}
    text = render_answers(rover_case())
    asked = {key: (pages.get(key, text).replace("</style>", css + "</style>"), 420) for key, (css, _) in FAULTS.items()}
    failure = Failure("A gate", f"system/composition/{'Agent.' * 12}persistence", "")
    wide = replace(rover_case(), answers=replace(rover_case().answers, failures=(failure,)))
    large = large_case()
    longest = tuple(replace(r, level=Level.TESTED_MODELS) for r in large.requirements)
    told = replace(large.answers, by_level=((Level.TESTED_MODELS, len(longest)),))
    levels = render_answers(replace(large, requirements=longest, answers=told))
    measured = measure({**asked, "wide": (render_answers(wide), 320), "levels": (levels, 1024)}, tmp_path)
    assert measured["wide"]["closed"] == [], "a long name is broken"
    assert measured["levels"]["closed"] == [], "a level overprints the names beside it"
    assert [fault for fault in FAULTS if not measured[fault][FAULTS[fault][1]]] == []


FRONT_WORDS = 1500
"""Words of the first page, folds and all."""
REPORTS = sorted(path.parent for path in (Path(__file__).parents[2] / "reports").glob("*/report.json"))
"""Of the shipped systems, where `doit verify` was run here, as CI does before the tests."""


@pytest.mark.needs_chromium
@pytest.mark.nightly
@pytest.mark.skipif(not REPORTS, reason="no system has been verified here: `doit verify`")
@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.name)
def test_the_shipped_systems_reports_keep_to_it(folder: Path, tmp_path: Path) -> None:
    found = read_case(folder)
    assert departures(found, render_answers(found), tmp_path) == []


@pytest.mark.slow
@pytest.mark.skipif(not REPORTS, reason="no system has been verified here: `doit verify`")
@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.name)
def test_the_front_page_of_a_shipped_system_is_short(folder: Path) -> None:
    text = render_answers(read_case(folder))
    shown = " ".join(Page(text[text.index("<body") : text.index("<script")]).text)
    assert len(shown.split()) < FRONT_WORDS


def test_words_that_differ_are_told() -> None:
    found = large_case()
    assert words(found) == []
    a = found.answers
    assert a.weakest is not None
    for bad in (
        replace(a, next_weakest="the arm, 47 runs, 0 failed (at most 6.2 % fail)"),
        replace(a, weakest=replace(a.weakest, words="300 cases, none failed (fewer than 1 % fail)")),
        replace(a, weakened="weakened in 3 ways"),
        replace(a, objects=""),
    ):
        assert words(replace(found, answers=bad)) != []


def test_what_a_signature_accepts_stands_in_words_on_the_page_that_is_signed() -> None:
    """On screen, on paper, and however many assumptions there are: in box 4, or below the signature."""
    found = rover_case()
    one = found.assumptions[0]
    many = tuple(replace(one, number=f"A{at}", says=f"It is so, {at}", who="") for at in range(1, 40))
    line = replace(found.answers.supposed[0], number="A7", says="It is so, 7")
    full = replace(found, assumptions=many, answers=replace(found.answers, supposed=(line,)))
    page = " ".join(re.sub(r"<[^>]*>", " ", render_answers(full)).split())
    accepted = page.partition("that a signature accepts")[2].partition("Hazards")[0]
    assert [accepted.count(f"A{at} It is so, {at} ◐ no owner, ") for at in range(1, 40)] == [
        int(n != 7) for n in range(1, 40)
    ]
    assert page.count("A7 It is so, 7") == 1
    assert "All is in words above or below: assumptions , deficits ." in page


def test_counts_that_differ_are_told() -> None:
    found = large_case()
    page = both(found)
    assert counts(found, page) == []
    for good, bad in ((found.answers.verdict, "Holds"), ('class="assumption"', "class=s"), ("policy: ", "policy ")):
        assert counts(found, page.replace(good, bad)) != [], good


ELSEWHERE = Requirement("R", "It is safe.", None, None, ("b.g",))


@pytest.mark.parametrize("requirements", [[], [ELSEWHERE]], ids=["none", "of another node"])
def test_what_evidence_supposes_is_told_whether_or_not_a_requirement_needs_it(requirements: list[Requirement]) -> None:
    claims = [guarantee("a", "g"), guarantee("a", "h"), guarantee("b", "g")]
    made = system({"a": ["g", "h"], "b": ["g"]}, plans=[node_plan(n, "low", "hoare") for n in "ab"])
    made = replace(made, plan=replace(made.plan, requirements=tuple(requirements)))
    listed = [evidence(g, hypotheses=("inputs are finite",) if g.node == "a" else ()) for g in claims]
    found = make_case(made, claims, listed)
    (finite,) = [s for s in found.assumptions if s.text == "inputs are finite"]
    assert (finite.needed_by, finite.needing, finite.where) == ((), ("guarantees only",), (claims[0].id, claims[1].id))
    assert finite.key in {w for kind in found.deficits if kind.key == "unowned" for w in kind.claims}
    assert "it rests on no assumptions" not in found.answers.statement
    assert not counts(found, both(found))
    assert f">{finite.number}</a> inputs are finite" in claim_pages(found)["node-a.html"]
    page = " ".join(both(found).split())
    assert "inputs are finite" in page
    assert "guarantees only" in page
    assert "inputs are finite" in str(pdf_data(found))
    (line,) = [line for line in terminal_lines(found) if line.startswith("4 Assumed")]
    assert line == f"4 Assumed ({found.answers.owned} with an owner and an end)"
    assert "Nothing." not in render_markdown(found).split("## 4")[1].split("## 5")[0]
