"""Digests are of meanings; substitution captures nothing; depth breaks nothing."""

from __future__ import annotations

from fractions import Fraction

import pytest

from avow.formulas.formula import (
    conjunction,
    digest,
    disjunction,
    free_variables,
    node_digest,
    normalise,
    sort_digest,
    substitute,
)
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.traversal import depth
from avow.language import terms as t
from avow.language.sorts import BOOL, REAL, EnumSort, FunctionSort

from .contracts import contract, formula, node

NODE = node(
    "inputs( r : REAL, n : NATURAL, b : BOOL, at : REAL x REAL --> BOOL ) outputs( q : REAL )"
    "| guarantee( out.q == in.r )"
)

SAME = [
    ("in.r < 120", "120 > in.r"),
    ("0 <= in.r < 120", "in.r < 120 and in.r >= 0"),
    ("in.r == 1", "1 == in.r"),
    ("in.r != 1", "not (in.r == 1)"),
    ("in.b == TRUE", "in.b"),
    ("in.b == FALSE", "not in.b"),
    ("in.b and (in.r < 1 and out.q < 1)", "(out.q < 1 and in.b) and in.r < 1"),
    ("in.b or in.b", "in.b"),
    ("forall(x, y in REAL | in.at(x, y))", "forall(u in REAL | forall(v in REAL | in.at(u, v)))"),
    ("in.r + out.q == 1", "out.q + in.r == 1"),
    ("in.r in {1, 2, 2}", "in.r in {2, 1}"),
    ("in.r == 0.5 /* half */", "in.r == 0.50"),
]

DIFFERENT = [
    ("in.r < 120", "in.r <= 120"),
    ("in.r < 120", "in.r < 120.5"),
    ("in.r < out.q", "out.q < in.r"),
    ("forall(x, y in REAL | in.at(x, y))", "forall(x, y in REAL | in.at(y, y))"),
    ("forall(x in REAL | exists(y in REAL | in.at(x, y)))", "exists(y in REAL | forall(x in REAL | in.at(x, y)))"),
    ("exists(x, y in REAL | in.at(x, y))", "exists_unique(x, y in REAL | in.at(x, y))"),
    ("in.r - out.q == 1", "out.q - in.r == 1"),
    ("in.b -> in.r < 1", "in.r < 1 -> in.b"),
    ("exists(x in REAL | x > 0)", "exists(x in INTEGER | x > 0)"),
]


@pytest.mark.parametrize(("one", "other"), SAME)
def test_the_same_meaning_has_the_same_digest(one: str, other: str) -> None:
    assert digest(formula(one, NODE)) == digest(formula(other, NODE))


@pytest.mark.parametrize(("one", "other"), DIFFERENT)
def test_another_meaning_has_another_digest(one: str, other: str) -> None:
    assert digest(formula(one, NODE)) != digest(formula(other, NODE))


def test_a_node_digest_follows_assumptions_but_not_names_or_comments() -> None:
    text = "inputs( r : REAL ) outputs( q : REAL )| assume( 0 <= in.r ) guarantee( out.q == in.r )"
    original = node(text)

    def key(other: str) -> str:
        changed = node(other)
        return node_digest(changed, changed.guarantees[0])

    base = node_digest(original, original.guarantees[0])
    assert key(text.replace("assume(", "assume /* why */ low (")) == base
    assert key(text.replace("guarantee(", 'guarantee q "so it is" (')) == base
    assert key(text.replace("0 <= in.r", "1 <= in.r")) != base
    assert key(text.replace("out.q == in.r", "out.q == in.r + 1")) != base
    assert key(text.replace("r : REAL", "r : INTEGER")) != base


def test_types_count_by_definition() -> None:
    assert sort_digest(EnumSort("A", ("x", "y"))) == sort_digest(EnumSort("B", ("y", "x")))
    assert sort_digest(EnumSort("A", ("x", "y"))) != sort_digest(EnumSort("A", ("x", "y", "z")))
    first, second = (
        contract(
            f"context {{ T : {{a, b{more}}}; }}node n {{ inputs(t : T) outputs(u : T) topics() guarantee(out.u == a) }}"
        )
        for more in ("", ", c")
    )
    assert digest(first.nodes[0].guarantees[0].formula) != digest(second.nodes[0].guarantees[0].formula)


def test_substitution_does_not_capture() -> None:
    x, y = t.Variable(t.Role.BOUND, "x", REAL), t.Variable(t.Role.BOUND, "y", REAL)
    r = t.Variable(t.Role.INPUT, "r", REAL)
    at = t.Variable(t.Role.INPUT, "at", FunctionSort((REAL, REAL), BOOL))
    term = t.Quantified(t.Quantifier.FORALL, (x,), t.Apply(at, (x, r), BOOL))
    replaced = substitute(term, {r: x})
    assert free_variables(replaced) == {at, x}
    assert digest(replaced) == digest(t.Quantified(t.Quantifier.FORALL, (y,), t.Apply(at, (y, x), BOOL)))
    # a bound variable is not a free one of the same name
    assert substitute(term, {x: r}) == term


def test_substitution_is_simultaneous() -> None:
    a, b = t.Variable(t.Role.INPUT, "a", REAL), t.Variable(t.Role.INPUT, "b", REAL)
    assert substitute(t.Compare("<", a, b), {a: b, b: a}) == t.Compare("<", b, a)


def test_junctions_of_constants() -> None:
    b = t.Variable(t.Role.INPUT, "b", BOOL)
    assert conjunction([]) == t.TRUE
    assert conjunction([t.TRUE, b]) == b
    assert conjunction([b, t.Not(t.TRUE)]) == t.And((b, t.Not(t.TRUE)))
    assert disjunction([t.TRUE, b]) == t.TRUE
    assert normalise(t.Or((b, t.Not(t.Not(b))))) == b


def test_negations_are_pushed_to_the_atoms() -> None:
    pushed = push_negations(formula("not (in.b -> forall(x in REAL | in.r < x))", NODE))
    assert digest(pushed) == digest(formula("in.b and exists(x in REAL | not in.r < x)", NODE))


def nested(levels: int) -> t.Term:
    r = t.Variable(t.Role.INPUT, "r", REAL)
    term: t.Term = t.Compare("<", r, t.Literal(Fraction(1), REAL))
    for k in range(levels):
        term = t.Not(t.And((term, t.Implies(term if k < 3 else t.TRUE, t.Not(t.TRUE)))))
    return term


@pytest.mark.nightly
def test_depth_is_no_obstacle() -> None:
    term = nested(4_000)
    assert depth(term) > 4_000
    assert len(digest(term)) == 64
    r = t.Variable(t.Role.INPUT, "r", REAL)
    assert free_variables(term) == {r}
    assert digest(substitute(term, {r: t.Literal(Fraction(2), REAL)})) != digest(term)
    push_negations(term)


def test_hostile_names_do_not_collide() -> None:
    # An encoding without lengths would read these two the same way.
    one, other = EnumSort("T", ("a", "b")), EnumSort("T", ("ab",))
    assert sort_digest(one) != sort_digest(other)
    assert digest(t.Literal("1", one)) != digest(t.Literal(1, one))
    assert digest(t.EnumValue("a", one)) != digest(t.EnumValue("b", one))
