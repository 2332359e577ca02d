"""Counterexamples as small tables: nothing of the contract's is lost, runs are grouped by what they say, and cut."""

from __future__ import annotations

import random

from assurance.sample import case, evidence, guarantee, system

from avow.base.verdict import Counterexample, Verdict
from avow.report import example
from avow.report.pdf import _counter
from report.pages import claim_pages
from report.test_page import Page


def steps(*cells: str, small: bool = True) -> tuple[tuple[tuple[str, str], ...], ...]:
    return tuple(
        (("in.x", cell), *((("(believes)", f"belief {at}"),) if small else ())) for at, cell in enumerate(cells)
    )


def test_steps_that_say_the_same_are_one_row_but_the_loop_starts_a_row() -> None:
    run = example.run(Counterexample(trace=steps("a", "a", "b", "b", "b", "a"), loop=3))
    assert [(r.label, r.cells[0].text, r.cells[0].new, r.returns) for r in run.rows] == [
        ("0–1", "a", False, False),
        ("2", "b", True, False),
        ("3–4", "b", False, True),
        ("5", "a", True, False),
    ]
    assert run.rows[0].small == "believes: belief 1"
    assert run.columns == ("in.x",)


def test_a_run_in_the_tools_words_alone_keeps_every_step() -> None:
    run = example.run(Counterexample(trace=((("(believes)", "p"),), (("(believes)", "p"),))))
    assert (run.columns, [r.label for r in run.rows]) == ((), ["0", "1"])


def test_rows_cover_every_step_once_and_say_what_the_step_says() -> None:
    for seed in range(60):
        rng = random.Random(seed)
        trace = steps(*(rng.choice("ab") for _ in range(rng.randrange(1, 90))))
        loop = rng.randrange(len(trace))
        run = example.run(Counterexample(trace=trace, loop=loop))
        covered: list[int] = []
        for row in run.rows:
            first, _, last = row.label.partition("–")
            span = range(int(first), int(last or first) + 1)
            covered += span
            assert all(dict(trace[at])["in.x"] == row.cells[0].text for at in span)
        assert covered == list(range(len(trace)))
        assert [r.label.partition("–")[0] for r in run.rows if r.returns] == [str(loop)]


def test_the_middle_of_a_long_run_is_left_out_on_paper_and_counted() -> None:
    run = example.run(Counterexample(trace=steps(*(str(n) for n in range(60)))))
    kept = [r.label for r in run.rows if not r.middle]
    assert (len(kept), kept[0], kept[-1], run.left_out) == (20, "0", "59", 40)
    short = example.run(Counterexample(trace=steps(*(str(n) for n in range(23)))))
    assert short.left_out == 0
    assert example.run(Counterexample(trace=steps(*(str(n) for n in range(500))))).beyond == 300


def test_two_answers_stand_side_by_side() -> None:
    shown = Counterexample((("in.r", "0"), ("out.s", "red"), ("out.s (another)", "green"), ("(property)", "B(x)")))
    assert example.values(shown) == (example.Value("in.r", "0"), example.Value("out.s", "red", "green"))
    assert example.small_values(shown) == "property: B(x)"
    assert shown.text() == "in.r = 0, out.s = red, out.s (another) = green"


def one(shown: Counterexample) -> str:
    target = guarantee("n", "g")
    record = evidence(target, Verdict.REFUTED, counterexample=shown)
    return claim_pages(case(system({"n": ["g"]}), [target], [record]))["node-n.html"]


def test_the_page_shows_values_run_and_what_paper_leaves_out() -> None:
    shown = Counterexample(
        (("in.<r>", "1"), ("(property)", "B(<x>)")), "w<h>y", steps(*(f"<{n}>" for n in range(60))), 7
    )
    text = one(shown)
    page = Page(text)
    assert page.faults == []
    assert "w&lt;h&gt;y" in text
    assert "40 rows left out on paper" in text
    assert text.count('class="cut"') == 1
    assert "the run returns here" in text
    assert all(f"&lt;{n}&gt;" in text for n in range(60))
    assert "What the contract leaves open" in one(Counterexample((("out.s", "1"), ("out.s (another)", "2"))))


def test_the_pdf_has_the_same_tables() -> None:
    shown = Counterexample((("in.at", "{(2, 3)}"),), "why", steps(*map(str, range(60))), 7)
    told = _counter(shown)
    assert told["values"] == [["in.at", "{(2, 3)}", ""]]
    assert len(told["rows"]) == 20
    assert "40 rows in the middle are left out" in told["note"]
