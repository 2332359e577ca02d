"""What would make it hold: the assumption found does, and no weaker one would."""

from __future__ import annotations

import pytest

from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction
from avow.language.terms import And, Iff, Quantified, Term
from avow.solving.quantifier_elimination import eliminated, remedy
from avow.solving.questions import entails

from .contracts import contract, formula

CONTRACT = contract(
    """context { Colour : {red, orange, green}; }
    node n {
      inputs( r : REAL, k : INTEGER, b : BOOL, c : Colour, at : REAL --> BOOL )
      outputs( o : REAL, d : Colour ) topics() guarantee( out.o == in.r ) }"""
)
NODE = CONTRACT.nodes[0]
INPUTS = [port.variable for port in NODE.inputs]


def say(text: str) -> Term:
    return formula(text, NODE, CONTRACT)


@pytest.mark.parametrize(
    ("hypotheses", "goal", "expected"),
    [
        (["out.o == in.r + 1"], "out.o >= 5", "in.r >= 4"),
        (["out.o >= in.r"], "out.o > 5", "in.r > 5"),
        (["out.o >= in.r", "out.o <= 2 * in.r"], "out.o <= 10", "in.r <= 5"),
        (["in.c == red -> out.d == red"], "out.d == red", "in.c == red"),
        (["in.b -> out.o == 3", "not in.b -> out.o == in.r"], "out.o == 3", "in.b or in.r == 3"),
        (["in.r > 2"], "in.r > 5", "in.r > 5"),
        (["out.d != red -> in.c == green", "in.c != orange"], "out.d == red", "in.c == red"),
        (["in.k > 3"], "in.k > 10", "in.k >= 11"),
    ],
)
def test_the_weakest_assumption(hypotheses: list[str], goal: str, expected: str) -> None:
    known = {f"H{k}": say(h) for k, h in enumerate(hypotheses)}
    found = remedy(known, say(goal), INPUTS)
    assert found is not None
    assert found.weakest
    assert entails({**known, "found": found.assumption}, say(goal)).verdict is Verdict.PROVED
    same = entails(known, Iff(found.assumption, say(expected)))
    assert same.verdict is Verdict.PROVED, found.assumption


def test_nothing_about_the_inputs_would_help() -> None:
    assert remedy({"H": say("out.o >= in.r")}, say("out.o <= 3"), INPUTS) is None
    assert remedy({"H": say("in.r > 2")}, say("in.r < 1"), INPUTS) is None


def test_functions_are_beyond_it() -> None:
    assert remedy({"H": say("in.at(in.r)")}, say("in.at(1)"), INPUTS) is None


def test_it_reads_back_what_it_shows() -> None:
    from avow.language.printer import show_term

    found = remedy({"H": say("out.o == in.r + 1")}, conjunction([say("out.o >= 5"), say("out.o <= 7")]), INPUTS)
    assert found is not None
    assert isinstance(found.assumption, And)
    assert entails([say(show_term(found.assumption, "rcl"))], found.assumption).verdict is Verdict.PROVED


def test_conditions_within_numbers_are_read_back() -> None:
    """As limits in seconds leave them: an age that is there, or none."""
    term = say("forall(y in REAL | y > (if in.b then in.r else 3) -> y > (if in.r > 1 then 2 else in.k))")
    found = eliminated(term)
    assert found is not None
    assert not any(isinstance(part, Quantified) for part in parts_of(found))
    assert entails({"h": found}, term).verdict is Verdict.PROVED
    assert entails({"h": term}, found).verdict is Verdict.PROVED


def parts_of(term: Term) -> list[Term]:
    return [term, *(part for child in term.children for part in parts_of(child))]


def test_what_takes_too_many_steps_is_thrown_away_on_every_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Z3 finished, but what a fast machine finishes in time is not to be told apart from what a slow one does not."""
    known = {"h": say("out.o >= in.r"), "k": say("out.o <= 2 * in.r")}
    goal = say("out.o <= 10")
    assert remedy(known, goal, INPUTS) is not None
    monkeypatch.setattr("avow.solving.quantifier_elimination.ELIMINATION_STEPS", 10)
    assert remedy(known, goal, INPUTS) is None
