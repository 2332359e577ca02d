"""Chains of thousands of operators: no nesting, so accepted everywhere; and what they become means the same."""

from __future__ import annotations

import random
import time
from fractions import Fraction
from itertools import product
from typing import Any

import pytest
from helpers import calls, some

from avow.base.tuning.bounds import CHAIN
from avow.language.format import format_text
from avow.language.load import check_text, parse_formula, parse_term
from avow.language.printer import show_term
from avow.language.terms import (
    And,
    Arithmetic,
    Compare,
    Iff,
    Implies,
    In,
    Literal,
    Negative,
    Not,
    Or,
    Quantified,
    Term,
    Variable,
    Widen,
)
from avow.language.translate import FORMATS

MANY = 5_000
FRAME = """\
context {{ Big = {{{names}}}; T : {{u, v, w}}; }}
node n {{ inputs( a : BOOL, b : BOOL, i : INTEGER, r : REAL, k : NATURAL, t : T ) outputs( o : BOOL ) topics()
  guarantee( {formula} ) }}
"""


def chain(sign: str, parts: tuple[str, ...] = ("a", "b", "o")) -> str:
    return sign.join(parts[i % len(parts)] for i in range(MANY))


LONG_FORMULAS = {
    "and": chain(" and "),
    "or": chain(" or "),
    "->": chain(" -> "),
    "<=>": chain(" <=> "),
    "+": chain(" + ", ("r", "i", "2.5")) + " > 0",
    "-": chain(" - ", ("r", "k", "1")) + " > 0",
    "+-": "i" + " + k - i" * (MANY // 2) + " == 0",
    "*": chain(" * ", ("r", "i", "2")) + " > 0",
    "</": "r / 2" + " * i" * MANY + " < 1",
    "<": chain(" <= ", ("r", "i", "k")),
    "==": chain(" == ", ("r", "i", "k")),
    "set": f"i in {{{', '.join(map(str, range(MANY)))}}}",
    "sequence": f"i in <{', '.join(map(str, range(MANY)))}>",
    "and ->": " -> ".join([" and ".join(["a", "b"] * 400), *["a"] * 400, " or ".join(["o"] * 400)]),
    "forall": "forall(" + ", ".join(f"x{i}" for i in range(1000)) + " in REAL | x1 > x2 or o)",
    "not (…)": " and ".join(["not (a or b -> o)"] * 800),
}
WHEN: dict[str, Any] = {"->": (), "+-": pytest.mark.slow}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=WHEN.get(name, pytest.mark.nightly)) for name in LONG_FORMULAS]
)
def test_a_chain_is_accepted_laid_out_and_translated(name: str) -> None:
    text = FRAME.format(names="red", formula=LONG_FORMULAS[name])
    began = time.process_time()
    contract, found = check_text(text, "f")
    assert contract is not None, [d.message for d in found if d.is_error]
    assert all(len(d.message) + len(d.hint or "") < 2000 for d in found)
    assert depth(contract.nodes[0].guarantees[0].formula) <= CHAIN + 10
    formatted = format_text(text, "f")
    assert format_text(formatted, "f") == formatted
    assert check_text(formatted, "f")[0] == contract
    back = check_text(FORMATS["rcl"](contract), "f")[0]
    assert back == contract
    for style in ("text", "unicode", "latex", "json"):
        assert len(FORMATS[style](contract)) > 1000
    assert time.process_time() - began < 10


@pytest.mark.slow
def test_many_elements_and_many_clauses() -> None:
    names = ", ".join(f"e{i}" for i in range(MANY))
    contract, found = check_text(FRAME.format(names=names, formula="o") + "\n", "f")
    assert contract is not None, [d.message for d in found if d.is_error]
    clauses = "\n".join(f"  guarantee( o or i > {i} )" for i in range(MANY))
    contract, found = check_text(FRAME.format(names="red", formula="o").replace(" ) }", f" )\n{clauses} }}"), "f")
    assert contract is not None, [d.message for d in found if d.is_error]
    assert len(contract.nodes[0].guarantees) == MANY + 1


@pytest.mark.slow
def test_smtlib_of_a_chain() -> None:
    import z3

    from avow.solving.smtlib import to_smtlib

    for name in ("and", "->", "<=>", "+-"):
        contract = check_text(FRAME.format(names="red", formula=LONG_FORMULAS[name]), "f")[0]
        assert contract is not None
        assert len(z3.parse_smt2_string(to_smtlib(contract))) > 0


def test_what_cannot_be_made_shallow_is_an_error() -> None:
    """A quotient of quotients has no equal of less depth: by zero, `/` is nobody knows what."""
    contract, found = check_text(FRAME.format(names="red", formula="r" + " / r" * MANY + " > 0"), "f")
    assert contract is None
    assert [d.code for d in found if d.is_error] == ["RCL110"]


# --- meaning ---------------------------------------------------------------------------------------------------------


def depth(term: Term) -> int:
    """How deep a term is, without recursion."""
    deepest, stack = 0, [(term, 1)]
    while stack:
        part, level = stack.pop()
        deepest = max(deepest, level)
        stack += [(child, level + 1) for child in part.children]
    return deepest


def value(term: Term, values: dict[str, bool | Fraction]) -> bool | Fraction:
    match term:
        case Literal(value=bool() as known):
            return known
        case Literal(value=int() | Fraction() as number):
            return Fraction(number)
        case Variable(name=name):
            return values[name]
        case Widen(term=inner):
            return value(inner, values)
        case Negative(term=inner):
            return -value(inner, values)
        case Arithmetic(operator=operator, left=left, right=right):
            one, other = Fraction(value(left, values)), Fraction(value(right, values))
            return {"+": one + other, "-": one - other, "*": one * other}.get(operator) or (
                one / other if operator == "/" else Fraction(0)
            )
        case And(items=items):
            return all(value(i, values) for i in items)
        case Or(items=items):
            return any(value(i, values) for i in items)
        case Implies(left=left, right=right):
            return not value(left, values) or bool(value(right, values))
        case Iff(left=left, right=right):
            return value(left, values) == value(right, values)
    raise AssertionError(term)


def _node():  # type: ignore[no-untyped-def]
    contract = check_text(FRAME.format(names="red", formula="o"), "f")[0]
    assert contract is not None
    return contract.nodes[0], contract


def _folded(signs: list[str], values: list[Fraction]) -> Fraction:
    total = values[0]
    for sign, one in zip(signs, values[1:], strict=True):
        total = {"+": total + one, "-": total - one, "*": total * one}.get(sign, total / one if one else total)
    return total


@pytest.mark.parametrize("seed", range(12))
def test_a_long_chain_means_what_the_short_one_does(seed: int) -> None:
    source = random.Random(seed)
    node, contract = _node()
    size = source.choice((CHAIN, CHAIN + 1, CHAIN + 2, 70, 129, 513, 800))
    family = ("+-", "*", "*/")[seed % 3]
    signs = [source.choice(family) for _ in range(size)]
    if family == "*/":
        signs = [s if s == "*" or i % 40 == 0 else "*" for i, s in enumerate(signs)]
    names = [source.choice(("i", "k", "r", "2", "0.5")) for _ in range(size + 1)]
    text = names[0] + "".join(f" {s} {n}" for s, n in zip(signs, names[1:], strict=True))
    term = parse_term(text, node, contract)
    values: dict[str, bool | Fraction] = {"i": Fraction(-3), "k": Fraction(2), "r": Fraction(7, 5)}
    numbers = [Fraction(values[n]) if n in values else Fraction(n) for n in names]
    assert value(term, values) == _folded(signs, numbers)
    assert parse_term(show_term(term, "rcl"), node, contract) == term
    letters = [source.choice("abo") for _ in range(size + 1)]
    for sign in ("->", "<=>"):
        formula = parse_formula(f" {sign} ".join(letters), node, contract)
        assert depth(formula) <= CHAIN + 1
        assert parse_formula(show_term(formula, "rcl"), node, contract) == formula
        for _ in range(20):
            known: dict[str, bool | Fraction] = {n: source.random() < 0.8 for n in "abo"}
            row = [bool(known[n]) for n in letters]
            wanted = {"->": row[-1] or not all(row[:-1]), "<=>": (len(row) - sum(row)) % 2 == 0}[sign]
            assert value(formula, known) == wanted


@pytest.mark.parametrize(("outer", "inner"), some(product((1, 10, 40, 64, 100), (1, 30, 63, 64, 65, 200)), 10, slow=20))
def test_chains_in_chains_read_back(inner: int, outer: int) -> None:
    node, contract = _node()
    for sign, part, end in (("+", "i", " > 0"), ("*", "r", " > 0"), ("->", "a", ""), ("<=>", "a", "")):
        within = "(" + f" {sign} ".join([part] * inner) + ")"
        for text in (
            f" {sign} ".join([within, *[part] * outer]) + end,
            f" {sign} ".join([*[part] * outer, within]) + end,
        ):
            term = parse_formula(text, node, contract)
            assert parse_formula(show_term(term, "rcl"), node, contract) == term


def test_up_to_the_limit_a_chain_is_the_tree_that_it_is_written_as() -> None:
    node, contract = _node()
    for sign in ("->", "<=>"):
        term = parse_formula(f" {sign} ".join(["a"] * (CHAIN + 1)), node, contract)
        assert depth(term) == CHAIN + 1
        short = parse_formula(f" {sign} ".join(["a"] * 4), node, contract)
        assert isinstance(short, Implies | Iff)
        assert not isinstance(short, And | Not | In | Compare | Quantified)


def test_growth_is_linear() -> None:
    """Calls are counted: seconds hang on the machine."""

    def accepted(sign: str, count: int) -> None:
        text = FRAME.format(names="red", formula=f" {sign} ".join(["a"] * count))
        assert check_text(text, "f")[0] is not None

    for sign in ("and", "->"):
        accepted(sign, 10)  # what is made once
        short, long = (calls(lambda: accepted(sign, count)) for count in (400, 2_000))  # noqa: B023
        assert long < 6 * short, sign
