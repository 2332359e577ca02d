"""The HTML page: complete, self-contained, safe, small enough, linked within itself."""

from __future__ import annotations

import html
import random
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, obligation, rover_case, system
from helpers import every_text, some

from avow.assurance.model import Case
from avow.assurance.traceability import trace
from avow.base.verdict import Verdict
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.evidence.record import IN_PART
from avow.evidence.status import Status
from avow.report import gsn_svg, render_all, wording
from avow.report.answers_page import render_index
from avow.report.page import render_page, render_traceability
from report.hostile import hostile_case
from report.pages import all_claims, claim_pages

VOID = {"meta", "img", "br", "input", "link", "hr"}


class Page(HTMLParser):
    """Collects what a browser would make of the page, and checks that elements nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.open: list[str] = []
        self.faults: list[str] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            self.attributes.append((tag, name, value or ""))
            if name == "id":
                self.ids.append(value or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open[-1] != tag:
            self.faults.append(f"</{tag}> within {self.open[-3:]}")
        else:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.text.append(data)


CASES = {"rover": rover_case, "hostile": hostile_case, "empty": lambda: make_case(system({}), [], [])}


@pytest.fixture(params=list(CASES))
def found(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]()


def test_nothing_is_fetched_and_nothing_foreign_runs(found: Case) -> None:
    made = claim_pages(found).values()
    for text in (*made, render_index([found]), render_traceability(found, trace(found))):
        page = Page(text)
        assert page.tags.count("script") <= 1
        assert not [a for a in page.attributes if a[1].startswith("on")]
        for tag, name, value in page.attributes:
            if name in ("src", "href", "xlink:href", "action", "data"):
                assert not re.match(r"(?i)\s*(https?:|//|javascript:|file:)", value), (tag, value)
        assert ("meta", "http-equiv", "Content-Security-Policy") in page.attributes
        assert page.tags.count("img") <= 1  # the dataflow picture, if there is one


def test_templates_do_not_evaluate_what_they_show() -> None:
    text = all_claims(hostile_case())
    plain = re.sub(r"<[^<>]*>", "", text)  # pictures break lines within it, and so does colouring
    assert len(re.findall(r"\{\{ ?7\*7 \}\}", plain)) == plain.count("{% raw %}") > 0
    assert "alert(1)</script>" not in text


def test_every_obligation_and_all_that_matters_is_there() -> None:
    found = rover_case()
    text = all_claims(found)
    page = Page(text)
    words = " ".join(page.text)
    plain = " ".join(words.split())  # long formulas are broken into lines
    for view in found.obligations:
        assert wording.anchor(view.id) in page.ids
        assert view.obligation.claim in words
        assert " ".join(view.obligation.formula.split()) in plain
    for r in found.requirements:
        assert r.text in words
        assert r.answer in words or all(wording.anchor(name) in text for name in r.below)
    for part in [g.title for g in found.gates]:
        assert part in words
    for value in ("120", "distance_m", "waypoint 2", "bought component", "the map is loaded"):
        assert value in words
    assert "46 of 50 mutants killed" in words
    assert "AVOW_FRESH=1 doit discharge:rover:agent:ajpf" in words
    assert found.ledger_head in words


def test_the_sections_stand_in_the_prescribed_order() -> None:
    text = render_page(rover_case())
    order = [
        "answer",
        "open",
        "summary",
        "obligations",
        "environment",
        "justifications",
    ]
    places = [text.index(f'<section id="{name}"') for name in order]
    assert places == sorted(places)


def test_the_page_is_small_and_the_same_every_time() -> None:
    assert render_page(rover_case()) == render_page(rover_case())
    assert len(render_page(rover_case())) < 2_000_000


def test_a_person_who_sees_no_colours_and_no_pictures_misses_nothing() -> None:
    page = Page(render_page(rover_case()))
    assert page.tags.count("h1") == 1
    assert ("html", "lang", "en") in page.attributes
    assert all(wording.MARKS[s] and wording.MEANINGS[s] for s in Status)
    assert len(set(wording.MARKS.values())) >= 12
    assert {"nav", "main", "header", "footer"} <= set(page.tags)
    assert page.tags.count("th") == len([a for a in page.attributes if a[0] == "th" and a[1] == "scope"])


@pytest.mark.nightly
def test_two_thousand_obligations_stay_pages_that_open() -> None:
    nodes = {f"n{n}": [f"g{k}" for k in range(100)] for n in range(20)}
    obligations = [guarantee(n, g) for n, gs in nodes.items() for g in gs]
    made = claim_pages(make_case(system(nodes), obligations, [evidence(o) for o in obligations]))
    for text in made.values():
        page = Page(text)
        assert page.faults == []
        assert len(text) < 600 * len(obligations)
        ids = set(page.ids)
        told = [o for o in obligations if made[wording.page_of(o.node)] is text or made["claims.html"] is text]
        assert all(wording.anchor(o.id) in ids for o in told)


def test_details_are_told_readably() -> None:
    record = evidence(
        "n.g", details={"reviewer": "A", "checklist": [{"question": "q?", "answer": True}], "retry": True}
    )
    assert wording.details_text(record) == "reviewer: A\nchecklist:\n- question: q?\n  answer: true"
    triple = evidence("n.g", details={"triples": [{"pre": "p", "post": "q", "verdict": "proved"}]})
    assert wording.outline(triple) == "{ p }  …  { q }   proved"
    assert wording.details_text(triple) == ""
    assert len(wording.details_text(evidence("n.g", details={"x": "y" * 10_000}))) < 6100


# -- the picture ----------------------------------------------------------------------------------------------------


def test_boxes_do_not_overlap_and_texts_fit() -> None:
    from report.test_answers_page import large_case  # which takes `Page` from here

    for found in (rover_case(), hostile_case(), large_case(), make_case(system({}), [], [])):
        svg = gsn_svg.draw(found)
        match = re.search(r'viewBox="0 0 720 (\d+)"', svg)
        assert match
        rect = r'<rect[^>]* x="(\d+)" y="(\d+)" width="(\d+)" height="(\d+)"/>((?:<text[^>]*>[^<]*</text>)*)'
        boxes = re.findall(rect, svg)
        for at, (x, y, w, h, texts) in enumerate(boxes):
            box = (int(x), int(y), int(w), int(h))
            assert box[0] >= 0
            assert box[0] + box[2] <= 720
            assert box[1] + box[3] <= int(match[1])
            for tx, ty, text in re.findall(r'<text[^>]*x="(\d+)" y="(\d+)">([^<]*)</text>', texts):
                shown = html.unescape(text)
                assert int(tx) + gsn_svg.width_of(shown) <= box[0] + box[2]
                assert box[1] + 8 < int(ty) < box[1] + box[3]
            for a, b, c, d, _ in boxes[at + 1 : at + 40]:
                apart = box[0] + box[2] <= int(a) or int(a) + int(c) <= box[0]
                assert apart or box[1] + box[3] <= int(b) or int(b) + int(d) <= box[1]


def test_a_goal_says_how_its_claim_stands_all_things_considered() -> None:
    """A refuted claim is no open one, and one whose node's contract fails is not proved."""
    good, bad = guarantee("n", "kept"), guarantee("m", "broken")
    fails = obligation("n", Kind.SANITY, "consistent")
    records = [evidence(good), evidence(bad, Verdict.REFUTED), evidence(fails, Verdict.REFUTED, "sanity")]
    made = dict(every_text(make_case(system({"n": ["kept"], "m": ["broken"]}), [good, bad, fails], records)))
    drawn, told = made["gsn.svg"], made["gsn.yaml"]
    assert isinstance(drawn, str)
    assert isinstance(told, str)
    assert re.findall(r'class="h"[^>]*>(\w+)</text><text[^>]*>(\w) meets', drawn) == [
        ("unsupported", "n"),
        ("refuted", "m"),
    ]
    assert re.findall(r"(kept|broken) \[(\w+)\]", told) == [("kept", "unsupported"), ("broken", "refuted")]


def test_circles_in_the_support_do_not_hang_the_picture() -> None:
    from avow.system.plan import Requirement

    subject = system(
        {"n": ["g"]},
        requirements=[Requirement("A", "a", None, None, ("B",)), Requirement("B", "b", None, None, ("A", "n"))],
    )
    found = make_case(subject, [guarantee("n", "g")], [])
    assert dict(every_text(found))["gsn.svg"]


def test_index_tells_every_system() -> None:
    good, bad = CASES["empty"](), rover_case()
    text = render_index([good, bad])
    assert "1 of 2 systems not shown" in text
    assert 'href="rover/index.html"' in text
    assert bad.answers.verdict in text


def test_a_long_formula_is_broken_where_its_structure_is() -> None:
    text = (
        "∀ x, y ∈ ℝ, i ∈ ℕ · in.at(x, y) ∧ in.wayP(x, y, i) ∧ (in.level ∉ {red, orange} ∨ in.known(i)) → "
        "∃ k ∈ ℕ · in.wayP(x, y, k) ∧ out.command = move(x, y)"
    )
    assert wording.in_lines(text).splitlines() == [
        "∀ x, y ∈ ℝ, i ∈ ℕ · in.at(x, y)",
        "  ∧ in.wayP(x, y, i)",
        "  ∧ (in.level ∉ {red, orange} ∨ in.known(i))",
        "  → ∃ k ∈ ℕ · in.wayP(x, y, k) ∧ out.command = move(x, y)",
    ]


@pytest.mark.parametrize("seed", some(range(200), 50, slow=150))
def test_breaking_a_formula_changes_nothing_but_blanks(seed: int) -> None:
    rng = random.Random(seed)
    pieces = ["∀ x ∈ ℝ · ", "(", ")", " ∧ ", " ∨ ", " → ", "in.at(x, y)", "¬", "{red, orange}", "· ", '"a → b"', "]"]
    text = "".join(rng.choice(pieces) for _ in range(rng.randrange(1, 80)))
    assert wording.in_lines(text).split() == text.split()


def test_a_derivation_is_set_as_in_the_paper_and_stays_text() -> None:
    from avow.report.page import _derivation

    above = "R3 (D1)\n∀ i_a, o_a · 𝒜_a(i_a) ⇒ ◇𝒢_a(o_a)    [<b>up to</b> x]\n"
    text = above + "──────────\n⊢ <script>\n  provided that o_a persists"
    shown = str(_derivation(text, "R3 (D1)"))
    assert "R3 (D1)" not in shown
    assert '<span class="stream">i<sub>a</sub></span>' in shown
    assert "𝒢<sub>a</sub>" in shown
    assert "&lt;b&gt;up to" in shown
    assert '<div class="line under">⊢ &lt;script&gt;</div>' in shown
    assert "provided that o_a persists" in shown


def test_gates_that_ask_nothing_do_not_look_passed() -> None:
    found = rover_case()
    idle = replace(found, gates=tuple(replace(gate, idle=True, passed=True) for gate in found.gates))
    text = render_page(idle)
    assert text.count('<li class="idle">') == len(found.gates)
    assert '<li class="pass">' not in text


def test_the_plans_reason_comes_first() -> None:
    found = rover_case()
    item = next(i for i in found.open_items if not i.advice)
    told = replace(found, open_items=(replace(item, reason="because of <the> wind", title="It flies"),))
    text = render_page(told)
    assert "<b>because of &lt;the&gt; wind</b>" in text
    assert "<p>It flies</p>" in text


def test_a_bound_that_is_empty_is_not_named() -> None:
    from avow.report.wording import bound_text

    assert bound_text({"tables": [], "steps": 2, "indices": (), "seed": 0, "exhaustive": False}) == (
        "steps 2, seed 0, not every state explored"
    )


def test_a_page_is_another_one_only_if_something_of_its_node_is(tmp_path: Path) -> None:
    """Neither a later run nor news of another node touches it; the page of a node that is gone goes."""
    subject = system({"a": ["g"], "b": ["g"]})
    claims = [guarantee("a", "g"), guarantee("b", "g")]
    kept = evidence(claims[0])
    first = make_case(subject, claims, [kept, evidence(claims[1])])
    later = make_case(subject, claims, [kept, evidence(claims[1], Verdict.REFUTED)])
    later = replace(later, today="2030-01-01", ledger_head="f" * 64, run=replace(later.run, id="another"))
    was, now = claim_pages(first), claim_pages(later)
    changed = {name for name in was if was[name] != now[name]}
    assert changed == {"claims.html", "node-b.html"}
    render_all(first, tmp_path)
    assert (tmp_path / "node-b.html").read_text() == was["node-b.html"]
    written = render_all(make_case(system({"a": ["g"]}), claims[:1], [kept]), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in written}
    assert "node-b.html" not in {path.name for path in written}


def test_node_names_of_any_kind_have_a_page_each() -> None:
    names = ["a", "a/b", "a b", "système", "../a", SYSTEM_LEVEL, "contracts", "-"]
    pages = [wording.page_of(name) for name in names]
    assert len(set(pages)) == len(names)
    assert all(re.fullmatch(r"[\w.-]+\.html", page, re.ASCII) for page in pages)


def test_a_verdict_that_shows_nothing_of_a_part_of_the_claim_says_so_where_it_stands() -> None:
    target = guarantee("a", "g")
    for hollow, shown in (([], "checked</span>"), (["g_3"], "checked, in part</span>")):
        record = evidence(target, Verdict.CHECKED, bound={IN_PART: hollow})
        texts = dict(every_text(make_case(system({"a": ["g"]}), [target], [record])))
        assert shown in texts["claims.html"]
        assert ("nothing shown for g" in texts["report.md"]) is bool(hollow)
