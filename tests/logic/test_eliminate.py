"""Quantifiers are eliminated into an equivalent formula."""

from __future__ import annotations

import pytest

from avow.base.verdict import Verdict
from avow.language.terms import Quantified, Term
from avow.solving.quantifier_elimination import eliminated
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
    term = say("forall(y in REAL | in.r < y and y <= 2 * in.r -> y <= 10)")
    assert eliminated(term) is not None
    monkeypatch.setattr("avow.solving.quantifier_elimination.ELIMINATION_STEPS", 10)
    assert eliminated(term) is None
