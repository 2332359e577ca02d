"""Conditions by meaning: whatever connectives say it, the same is demanded under the same condition."""

from __future__ import annotations

from itertools import product

import pytest
from drawn.contracts import INPUTS, OUTPUTS, finite_formulas
from hypothesis import given, settings

from avow.evaluation.evaluate import compile_term
from avow.formulas.conditions import conditions
from avow.formulas.values import Value
from avow.language.load import check_text
from avow.language.terms import Not, Term

RCL = """
context {{ Mode : {{off, on}}; }}
node n {{ inputs( a : BOOL, b : BOOL, k : INTEGER, mode : Mode, s : <REAL> ) outputs( x : BOOL, y : BOOL, m : INTEGER )
  topics() guarantee g ( {} ) }}
"""


def formula(text: str) -> Term:
    found, faults = check_text(RCL.format(text), "n.rcl")
    assert found is not None, faults
    return found.nodes[0].guarantees[0].formula


NAMES = ("in.a", "in.b", "out.x", "out.y")
POINTS: list[dict[str, Value]] = [dict(zip(NAMES, p, strict=True)) for p in product((False, True), repeat=4)]


def met(term: Term) -> frozenset[tuple[bool, ...]]:
    """Of each condition, where it holds."""
    found = [compile_term(c.formula) for c in conditions(term)]
    return frozenset(tuple(bool(holds(point)) for point in POINTS) for holds in found)


SAME = {
    "a under x": ("a -> x", "not a or x", "x or not a", "not (a and not x)", "not (not x and a)", "not x -> not a",
                  "a -> (x or x)", "not a or (x and x)"),
    "two conditions": ("a -> (b -> x)", "(a and b) -> x", "not a or not b or x",
                       "not (a and b) or x", "b -> x or not a"),
    "an output among them": ("a and x -> y", "a -> (x -> y)", "not a or not x or y", "x -> (a -> y)"),
    "either": ("(a or b) -> x", "not (a or b) or x", "(not a and not b) or x"),
    "equivalence": ("a <=> x", "x <=> a", "(a -> x) and (x -> a)", "(a and x) or (not a and not x)", "a == x",
                    "not (a <=> not x)", "not (a != x)", "(not a or x) and (not x or a)"),
    "not the same": ("a <=> not x", "not (a <=> x)", "a != x", "(a or x) and not (a and x)",
                     "(a and not x) or (not a and x)"),
    "always": ("x", "x and y", "x or y", "not x", "a and x"),
    "each the other": ("x <=> y", "y <=> x", "x == y", "(x -> y) and (y -> x)", "not (x <=> not y)"),
    "outputs": ("x -> y", "not x or y", "y or not x"),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_the_same_by_meaning(name: str) -> None:
    first, *others = (met(formula(text)) for text in SAME[name])
    assert all(other == first for other in others), SAME[name]
    assert bool(first) is (name != "always")


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("forall(i in NATURAL | s(i) > 0 -> m > i)", 1),
        ("forall(i in NATURAL | not (s(i) > 0) or m > i)", 1),
        ("forall(i in NATURAL | forall(j in NATURAL | s(i) > s(j) -> (a -> m > i)))", 1),
        ("not exists(i in NATURAL | s(i) > 0 and m <= i)", 1),
        ("forall(i in NATURAL | (s(i) > 0 -> m > i) and (s(i) < 0 -> m < i))", 2),
        ("length(s) >= 10 <=> x", 2),
        ("forall(i in NATURAL | s(i) > 0 <=> m > i)", 2),
        ("exists(i in NATURAL | s(i) > 0) -> x", 1),
        ("mode == off or x", 1),
        ("mode != off -> x and y", 1),
        ("forall(i in NATURAL | m > i)", 0),
        ("m > k", 0),
    ],
)
def test_under_quantifiers(text: str, number: int) -> None:
    assert len(conditions(formula(text))) == number


@settings(max_examples=120, deadline=None)
@given(finite_formulas(free=(*INPUTS[:1], *OUTPUTS[:1], INPUTS[2], OUTPUTS[1])))
def test_denying_twice_changes_nothing(term: Term) -> None:
    assert conditions(Not(Not(term))) == conditions(term)
