"""What a claim says of partial operations: against a three-valued truth that shares no code with it."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import product
from typing import Any

import pytest
from helpers import some

from avow.base.tuning.sizes import NESTING
from avow.evaluation.evaluate import compile_term
from avow.formulas.formula import conjunction
from avow.formulas.values import SequenceValue
from avow.language.contract import Node
from avow.language.definedness import defined, unless_without_value, with_value
from avow.language.load import check_text, parse_formula
from avow.language.printer import show_term
from avow.language.terms import TRUE

TEXT = "node n { inputs( x : REAL, i : INTEGER, k : NATURAL, s : <INTEGER>, b : BOOL ) outputs() topics() "
TEXT += "guarantee ( b or not b ) }"
POINTS: list[dict[str, Any]] = [
    {"x": Fraction(x), "i": i, "k": k, "s": s, "b": b}
    for x, i, k, s, b in product((-1, 0, 2), (-1, 0, 1, 2), (0, 1, 2), ((), (0,), (0, 1)), (False, True))
]


def own() -> Node:
    contract, _ = check_text(TEXT, "n.rcl")
    assert contract is not None
    return contract.nodes[0]


NODE = own()


class Valueless(Exception):  # noqa: N818 - it names what an atom is
    """An atom has no value."""


# a formula as the test has it: its text, and its truth (True, False, None: no value)
Made = tuple[str, Any]


def atom(r: random.Random) -> Made:
    def element(text: str, at: Any) -> tuple[str, Any]:
        def value(p: dict[str, Any]) -> int:
            if not 0 <= at(p) < len(p["s"]):
                raise Valueless
            return int(p["s"][at(p)])

        return f"s({text})", value

    def quotient(p: dict[str, Any]) -> Fraction:
        if p["x"] == 0:
            raise Valueless
        return 1 / p["x"]

    shift = r.choice([0, 1])
    terms: list[tuple[str, Any]] = [
        ("1 / x", quotient),
        element("i", lambda p: p["i"]),
        element(f"k + {shift}", lambda p: p["k"] + shift),
        element("0", lambda p: 0),
    ]
    number = r.choice([0, 1])
    plain: list[Made] = [
        ("b", lambda p: p["b"]),
        ("x != 0", lambda p: p["x"] != 0),
        ("x > 0", lambda p: p["x"] > 0),
        ("0 <= i", lambda p: p["i"] >= 0),
        ("i < length(s)", lambda p: p["i"] < len(p["s"])),
        (f"k + {shift} < length(s)", lambda p: p["k"] + shift < len(p["s"])),
        ("k <= i", lambda p: p["k"] <= p["i"]),
        (f"length(s) > {number}", lambda p: len(p["s"]) > number),
        ("s != <>", lambda p: p["s"] != ()),
        ("i in <0 upto length(s) - 1>", lambda p: 0 <= p["i"] < len(p["s"])),
    ]
    if r.random() < 0.5:
        return r.choice(plain)
    text, value = r.choice(terms)
    return f"{text} == {number}", lambda p: value(p) == number


def made(r: random.Random, depth: int) -> Made:
    if depth == 0 or r.random() < 0.2:
        text, holds = atom(r)

        def truth(p: dict[str, Any]) -> bool | None:
            try:
                return bool(holds(p))
            except Valueless:
                return None

        return text, truth
    (one, left), (two, right) = made(r, depth - 1), made(r, depth - 1)

    def conjunction(p: dict[str, Any], deny: tuple[bool, bool] = (False, False)) -> bool | None:
        parts = [None if t is None else t != d for t, d in zip((left(p), right(p)), deny, strict=True)]
        return False if False in parts else None if None in parts else True

    def negated(found: bool | None) -> bool | None:
        return None if found is None else not found

    match r.randrange(6):
        case 0:
            return f"not ({one})", lambda p: negated(left(p))
        case 1:
            return f"(({one}) or ({two}))", lambda p: negated(conjunction(p, (True, True)))
        case 2:
            return f"(({one}) -> ({two}))", lambda p: negated(conjunction(p, (False, True)))
        case 3:
            return f"(({one}) <=> ({two}))", lambda p: None if None in (left(p), right(p)) else left(p) == right(p)
        case 4:
            test, chosen = atom(r)

            def conditional(p: dict[str, Any]) -> bool | None:
                try:
                    return left(p) if chosen(p) else right(p)
                except Valueless:
                    return None

            return f"(if {test} then {one} else {two})", conditional
    return f"(({one}) and ({two}))", conjunction


def values(p: dict[str, Any]) -> dict[str, Any]:
    return {f"in.{name}": SequenceValue(value) if name == "s" else value for name, value in p.items()}


@pytest.mark.parametrize("seed", some(range(400), 30, slow=30))
def test_a_claim_holds_where_it_is_true_and_nowhere_else(seed: int) -> None:
    """No truth where three-valued truth says there is no value; and what it asks for can only be asked of partial
    operations. (Where two parts need each other's value it may say so where a more patient reader finds one.)"""
    text, truth = made(random.Random(seed), 3)
    claim = with_value(formula := parse_formula(text, NODE))
    holds, stands = compile_term(claim), compile_term(unless_without_value(formula))
    for p in POINTS:
        held = bool(holds(values(p)))  # and it always has a value
        assert not held or truth(p) is True, (text, p, show_term(claim))
        denied = bool(stands(values(p)))
        assert denied or truth(p) is False, (text, p)
    assert parse_formula(show_term(claim, "rcl"), NODE) == claim
    assert with_value(claim) == claim, (text, show_term(claim))


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("1 / x == 1 or 1 / x != 1", "x != 0"),
        ("exists(y in REAL | y == 1 / x)", "forall(y in REAL | x != 0)"),
        ("s(1) == 0", "1 < length(s)"),
        ("s(i) == 0", "0 <= i and i < length(s)"),
        ("b -> 1 / x > 0", "b -> x != 0"),
        # what guards exclude asks for nothing
        ("x != 0 -> 1 / x < 2", ""),
        ("x > 0.5 and 1 / x < 2", ""),
        ("not (x == 0) -> 1 / (2 * x) < 2", "not x == 0 -> 2 * x != 0"),  # not plain: so it is asked
        ("if x == 0 then b else 1 / x < 2", ""),
        ("1 / x < 2 or x == 0", ""),
        ("1 / 2 < x", ""),
        ("forall(j in NATURAL | j < length(s) -> s(j) > 0)", ""),
        ("forall(j in <0 upto length(s) - 1> | s(j) > 0)", ""),
        ("forall(j, m in NATURAL | j <= m and m < length(s) -> s(j) <= s(m))", ""),
        ("forall(j in NATURAL | j + 1 < length(s) -> s(j) <= s(j + 1))", ""),
        ("length(s) == 2 and s(0) < s(1)", ""),
        ("s != <> -> s(0) == 1", ""),
        ("k != 1 -> s(k - 2) == 0", "k != 1 -> 0 <= k - 2 and k - 2 < length(s)"),  # only of 0 it says: it is more
        ("exists(j in NATURAL | s(j) == 1)", "forall(j in NATURAL | j < length(s))"),
    ],
)
def test_what_a_claim_asks_for(text: str, asked: str) -> None:
    formula = parse_formula(text, NODE)
    needed = parse_formula(asked, NODE) if asked else TRUE
    assert defined(formula) == needed
    assert show_term(with_value(formula)) == show_term(conjunction((needed, formula)))


def test_deep_formulas() -> None:
    text = "1 / x > 0"
    for _ in range(NESTING // 4):
        text = f"(b or not {text})"
    assert with_value(parse_formula(text, NODE)) != parse_formula(text, NODE)


def test_clauses_say_so() -> None:
    """In a contract, with the formula as written for what is said of the text."""
    contract, found = check_text(TEXT.replace("topics()", "topics() assume lucky ( 1 / x > 3 )"), "n.rcl")
    assert contract is not None, found
    (clause,) = contract.nodes[0].assumptions
    assert show_term(clause.formula, "rcl") == "in.x != 0 and 1 / in.x > 3"
    assert clause.written == parse_formula("1 / x > 3", NODE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("once(1 / x > 2)", "once(in.x != 0 and 1 / in.x > 2)"),
        ("b -> within[3 steps](1 / x > 2)", "in.b -> within[3 steps](in.x != 0 and 1 / in.x > 2)"),
        ("1 / x > 2 -> within[3 steps](b)", "(in.x != 0 and 1 / in.x > 2) -> within[3 steps](in.b)"),
        ("once(x != 0 -> 1 / x > 2)", "once(in.x != 0 -> 1 / in.x > 2)"),
        # a value of the step before was one there, whatever holds now
        ("previous(1 / x, 1) > 2", "previous(in.x != 0, TRUE) and previous(1 / in.x, 1) > 2"),
        ("previous(x, 1 / x) > 2", "previous(TRUE, in.x != 0) and previous(in.x, 1 / in.x) > 2"),
        (
            "x != 0 -> previous(1 / x, 1) > 2",
            "(in.x != 0 -> previous(in.x != 0, TRUE)) and (in.x != 0 -> previous(1 / in.x, 1) > 2)",
        ),
        (
            "previous(previous(1 / x, 1), 2) > 2",
            "previous(previous(in.x != 0, TRUE), TRUE) and previous(previous(1 / in.x, 1), 2) > 2",
        ),
        (
            "x != 0 -> changed(1 / x)",
            "(in.x != 0 -> previous(in.x != 0, TRUE)) and (in.x != 0 -> changed(1 / in.x))",
        ),
        ("once(previous(1 / x, 1) > 2)", "once(previous(in.x != 0, TRUE) and previous(1 / in.x, 1) > 2)"),
        # a response stays one under a quantifier
        (
            "forall(j in NATURAL | 1 / j > x -> within[3 steps](1 / j > 2))",
            "forall(j in NATURAL | (j != 0.0 and 1 / j > in.x) -> within[3 steps](j != 0.0 and 1 / j > 2))",
        ),
    ],
)
def test_what_speaks_of_other_steps_has_its_conditions_there(text: str, said: str) -> None:
    contract, found = check_text(TEXT.replace("b or not b", text), "n.rcl")
    assert contract is not None, found
    (clause,) = contract.nodes[0].guarantees
    assert show_term(clause.formula, "rcl") == said
    assert with_value(clause.formula) == clause.formula
