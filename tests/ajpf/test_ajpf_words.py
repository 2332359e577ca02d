"""Counterexamples in the contract's words: the plan's table, read backwards."""

from __future__ import annotations

import re
from pathlib import Path

from avow.backend_kit.protocol import Limits
from avow.backends.ajpf import BACKEND, psl
from avow.backends.ajpf.instances import instances
from avow.backends.ajpf.options import read
from avow.backends.ajpf.psl_parser import parse_psl
from avow.backends.ajpf.words import Wording
from avow.base.verdict import Counterexample

FIXTURES = Path(__file__).parent / "fixtures"
DEAF = {
    "cabin.yaml": "draws: {at_quiescence: repeatedly}\npercepts: {door: [open, nothing], c: [call(1), nothing]}\n",
    "cabin.gwen": (FIXTURES / "lift" / "cabin.gwen").read_text().replace("+open : { True } <- halt(0);", ""),
}


def refuted(lift, tmp_path) -> Counterexample:
    report = BACKEND.discharge(lift({"semantics": "edge"}, DEAF), tmp_path, Limits(seconds=60))
    (shown,) = [o.counterexample for o in report.outcomes if o.obligation.endswith("/answers")]
    assert shown is not None
    return shown


def test_the_reason_speaks_of_ports_not_of_beliefs(lift, tmp_path):
    shown = refuted(lift, tmp_path)
    assert "B(" not in shown.explanation
    assert "D(" not in shown.explanation
    assert re.match(r"in step \d+: .*in\.\w+.*; what must follow never does: .*out\.\w+", shown.explanation)
    assert "B(" not in shown.text()
    assert dict(shown.values)["(property)"].startswith("[] (")


def test_each_step_says_what_the_table_makes_of_it(lift, tmp_path):
    """The contract's cells follow from the beliefs beside them: checked by the table, written here by hand."""
    shown = refuted(lift, tmp_path)
    called = 0
    for step in shown.trace:
        names = [name for name, _ in step]
        split = names.index("(last action)")
        assert all(name.startswith("(") for name in names[split:])
        assert all(re.match(r"¬?\(?(in|out)\.", name) for name in names[:split]), names
        believes = dict(step)["(believes)"]
        calls = re.findall(r"call\((\d+)\)", believes)
        cells = [value for name, value in step if "in.call" in name or "in.request" in name or "in.floor" in name]
        for floor in calls:
            called += 1
            assert any(cell == f"f = {floor}" for cell in cells), (step, cells)
        if not calls:
            assert all(cell == "no" for cell in cells), step
    assert called


def test_the_step_named_is_one_where_the_occasion_comes_about(lift, tmp_path):
    shown = refuted(lift, tmp_path)
    step = int(re.match(r"in step (\d+)", shown.explanation)[1])
    assert "call(1)" in dict(shown.trace[step])["(believes)"]
    assert all("go(1)" not in dict(later)["(last action)"] for later in shown.trace[step + 1 :])


def wording(lift) -> Wording:
    setup = read(lift())
    return Wording(setup.rows, instances(lift(), setup).words, setup.instances)


def test_conjunctions_are_taken_apart_as_the_table_has_them(lift):
    words = wording(lift)
    for formula, said in words.told.items():
        assert words.say(formula) == said
        assert words.say(psl.negation(formula)) in (f"¬({said})", words.told.get(psl.negation(formula)))
    both = psl.conjunction(list(words.told)[:2])
    assert set(words.say(both).split(" ∧ ")) >= {said for said in list(words.told.values())[:2] if " ∧ " not in said}


def test_what_no_row_covers_stays_in_the_agents_words(lift):
    words = wording(lift)
    assert words.say(parse_psl("B(cabin, stuck(7))")) == "B(cabin, stuck(7))"
    assert words.say(psl.TRUE) == "always"
    either = Wording((), {parse_psl("B(cabin, a) || B(cabin, b)"): "in.x ∈ {a, b}"})
    assert either.say(parse_psl("B(cabin, a)")) == "in.x ∈ {a, b} (here B(cabin, a))"
