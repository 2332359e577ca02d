"""Printing and reading again gives the equal term."""

from __future__ import annotations

from fractions import Fraction

import pytest
from drawn.contracts import CONTRACT, Varied
from helpers import some

from avow.base.diagnostics import Rejected
from avow.language.load import check_text, parse_formula
from avow.language.printer import show_number, show_sort, show_term, show_type
from avow.language.sorts import REAL, OpaqueSort
from avow.language.terms import And, Literal, Or, Role, Variable

LOADED = check_text(CONTRACT, "t")[0]
assert LOADED is not None
NODE = LOADED.nodes[0]


@pytest.mark.parametrize("seed", some(range(8), 1, slow=2))
def test_round_trip_of_random_formulas(seed: int) -> None:
    formulas = Varied(seed)
    kept, faults = 0, []
    for _ in range(250):
        text = formulas.formula(1 + formulas.random.randrange(4))
        try:
            term = parse_formula(text, NODE, LOADED)
        except Rejected as rejected:
            faults += [d for d in rejected.diagnostics if d.code not in ("RCL302", "RCL309")]
            continue
        kept += 1
        shown = show_term(term, "rcl")
        assert parse_formula(shown, NODE, LOADED) == term, (text, shown)
        assert show_term(term)
    assert kept > 150
    assert faults == []


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("(b and b2) and b", "(in.b and out.b2) and in.b"),
        ("b and (b2 or b)", "in.b and (out.b2 or in.b)"),
        ("(b and b2) or b", "in.b and out.b2 or in.b"),
        ("not (b == b2)", "not in.b == out.b2"),
        ("(b -> b2) -> b", "(in.b -> out.b2) -> in.b"),
        ("b -> (b2 -> b)", "in.b -> out.b2 -> in.b"),
        ("b and b2 -> b", "(in.b and out.b2) -> in.b"),
        ("r - (r - 1) > 0", "in.r - (in.r - 1) > 0"),
        ("(r * 2) + 1 > 0", "in.r * 2 + 1 > 0"),
        ("0 <= r and r < 120", "0 <= in.r < 120"),
        ("i + 1.0 > r", "in.i + 1.0 > in.r"),
        ("-(-(r)) > 0", "-(-in.r) > 0"),
        ("forall(x in REAL, y in REAL | x < y)", "forall(x, y in REAL | x < y)"),
        ("not st in {red}", "in.st !in {red}"),
        ("(forall(x in REAL | x < r)) and b", "forall(x in REAL | x < in.r) and in.b"),
    ],
)
def test_parentheses(text: str, shown: str) -> None:
    assert show_term(parse_formula(text, NODE, LOADED), "rcl") == shown


@pytest.mark.parametrize(
    "text",
    [
        *("1 == in.r + in.i", "1 == in.i + in.r", "1.0 == 1.0 + in.i", "2 == 2.5 * in.i", "1 == in.i / 2"),
        *("in.i < 1.0", "1.0 == -in.i", "-in.r < 2", "5 == -(5.5)", "1.0 == -(2.0)"),
        *("1 == min(in.r, 1.0)", "1 == min(in.i, in.r)", "1.0 == min(in.i, 1.0)", "1.0 == min(in.i, 2)"),
        *("1 == (if in.b then in.r else 1.0)", "1 == (if in.b then 1.0 else in.r)"),
        *("1.0 == (if in.b then 1.0 else 2.0)", "1.0 == (if in.b then in.i else 2)"),
        *("in.r > 1 > in.i", "in.r < 1 and 1 > in.i", "in.i < 2.5 < in.r", "in.b == out.b2 and out.b2 == in.b"),
    ],
)
def test_a_point_is_written_where_nothing_else_shows_a_real(text: str) -> None:
    assert show_term(parse_formula(text, NODE, LOADED), "rcl") == text


def test_styles() -> None:
    term = parse_formula("forall(x' in REAL | in.m(x', 1) and st2 !in Q -> c == move(x', 0.5))", NODE, LOADED)
    assert show_term(term) == "∀ x' ∈ ℝ · in.m(x', 1) ∧ out.st2 ∉ {red, green} → out.c = move(x', 0.5)"
    inner = parse_formula("(forall(x in REAL | x < r)) <=> b", NODE, LOADED)
    assert show_term(inner) == "(∀ x ∈ ℝ · x < in.r) ↔ in.b"


def test_terms_made_by_hand() -> None:
    a = Variable(Role.INPUT, "b", NODE.input("b").sort)
    assert show_term(And(()), "rcl") == "TRUE"
    assert show_term(Or(()), "rcl") == "FALSE"
    assert show_term(And((a,)), "rcl") == "in.b"
    assert show_term(Literal(Fraction(1, 3), REAL), "rcl") == "1 / 3"
    assert show_term(Literal(-5, REAL), "unicode") == "-5.0"
    assert show_term(Variable(Role.INPUT, "n.b", a.sort), "rcl") == "n.in.b"
    assert show_term(Variable(Role.INPUT, "n.b", a.sort)) == "n.b"


def test_numbers_and_sorts() -> None:
    assert [show_number(Fraction(x))[0] for x in ("1/8", "-5/2", "7", "1/1000", "1/7")] == [
        *("0.125", "-2.5", "7", "0.001", "1 / 7")
    ]
    sorts = dict(LOADED.types)
    assert show_sort(sorts["M"]) == "REAL x INTEGER --> BOOL"
    assert show_type(sorts["Cmd"]) == "{move(REAL, REAL), inspect(NATURAL), halt}"
    assert show_sort(OpaqueSort("O")) == "O"
    assert show_type(OpaqueSort("O")) == "{}"


def test_printing_takes_linear_time() -> None:
    text = "b"
    for _ in range(36):
        text = f"b or (b and b -> {text})"
    term = parse_formula(text, NODE, LOADED)
    assert len(show_term(term)) < 5000
    assert parse_formula(show_term(term, "rcl"), NODE, LOADED) == term
