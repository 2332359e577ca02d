"""Quantifiers that go away in the translation leave the meaning as it was."""

from __future__ import annotations

import pytest
import z3

from avow.base.verdict import Verdict
from avow.language.terms import Term
from avow.solving.questions import Translator, entails

from .contracts import contract, formula

CONTRACT = contract(
    """context { Command : {move(REAL, REAL), inspect(NATURAL), halt}; }
    node n { inputs( c : Command, p : (REAL, NATURAL), n : NATURAL, k : INTEGER, f : NATURAL --> BOOL )
      outputs( v : BOOL ) topics() guarantee( out.v ) }"""
)


def term(text: str) -> Term:
    return formula(text, CONTRACT.nodes[0], CONTRACT)


SAME = [
    (
        "exists(i in NATURAL | in.c == inspect(i) and in.f(i))",
        "not forall(i in NATURAL | in.c == inspect(i) -> not in.f(i))",
    ),
    ("exists(x, y in REAL | in.c == move(x, y))", "in.c != halt and forall(i in NATURAL | in.c != inspect(i))"),
    ("exists(x in REAL | in.c == move(x, x))", "exists(x, y in REAL | in.c == move(x, y) and x == y)"),
    ("exists(x in REAL | in.c == move(x, 2 * x))", "exists(x, y in REAL | in.c == move(x, y) and y == x + x)"),
    (
        "forall(x in REAL, i in NATURAL | in.p == (x, i) -> x > i)",
        "exists(x in REAL, i in NATURAL | in.p == (x, i) and x > i)",
    ),
    ("exists(i in NATURAL | i + 1 == in.k and i == in.k - 1)", "in.k > 0"),
    ("exists(i in NATURAL | i == in.k)", "in.k >= 0"),
    ("forall(i in NATURAL | i < 3 -> in.f(i))", "in.f(0) and in.f(1) and in.f(2)"),
    ("exists(i in NATURAL | 1 <= i <= 2 and in.f(i))", "in.f(1) or in.f(2)"),
    ("forall(i in NATURAL | not (i >= 2) -> in.f(i))", "in.f(0) and in.f(1)"),
    ("exists(i in NATURAL | i < 0)", "FALSE"),
    ("forall(i in NATURAL | i < 0 -> in.f(i))", "TRUE"),
    ("forall(i in NATURAL | 2 > i -> exists(j in NATURAL | j < i and in.f(j)))", "FALSE"),
    ("exists(x in REAL | 0 < x and x < 1)", "TRUE"),
]


@pytest.mark.parametrize(("one", "other"), SAME)
def test_the_meaning_stays(one: str, other: str) -> None:
    left, right = term(one), term(other)
    assert entails([left], right).verdict is Verdict.PROVED
    assert entails([right], left).verdict is Verdict.PROVED


@pytest.mark.parametrize(
    "text",
    [
        "exists(i in NATURAL | in.c == inspect(i) and in.f(i))",
        "forall(x, y in REAL | in.c == move(x, y) -> x < y)",
        "forall(x in REAL, i in NATURAL | in.p == (x, i) -> x > i)",
        "exists(i in NATURAL | i <= 4 and in.f(i))",
    ],
)
def test_the_quantifier_goes(text: str) -> None:
    stack = [Translator().term(term(text))]
    while stack:
        part = stack.pop()
        assert not z3.is_quantifier(part)
        stack.extend(part.children())
