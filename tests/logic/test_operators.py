"""The table of operators: it is whole, and every pass gives an operator the meaning that enumeration gives it."""

from __future__ import annotations

import contextlib
import dataclasses
import random
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import z3
from helpers import some
from reference.meaning import Meaning, NoValue

from avow.backend_kit.protocol import Limits
from avow.backends.dafny.modules import generate
from avow.backends.dafny.runner import verify
from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.evaluation.compiler import member_of
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.cases import TooManyCases, lifted
from avow.formulas.formula import digest, free_variables, normalise
from avow.formulas.negation_normal_form import push_negations
from avow.isolation.outside import Outside
from avow.kernel.text import Text
from avow.language import terms as t
from avow.language.contract import Node
from avow.language.definedness import defined
from avow.language.load import check_text, parse_formula
from avow.language.operators import OPERATORS, Operator, Typing, Why, definition, operation
from avow.language.printer import show_term
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, Sort
from avow.language.subterms import subterms
from avow.sanity.mutants import mutants
from avow.solving.questions import entails, solve
from avow.solving.smtlib import ask_cvc5, formulas_script

CONTRACT = (
    "node n { inputs( a : INTEGER, k : NATURAL, p : BOOL, x : REAL ) outputs( q : BOOL ) topics() guarantee( q ) }"
)


def node() -> Node:
    contract, _ = check_text(CONTRACT, "f")
    assert contract is not None
    return contract.nodes[0]


NODE = node()
GRID = [
    dict(zip(("a", "k", "p", "x", "q"), values, strict=True))
    for values in product(
        (-7, -1, 0, 2, 6), (0, 3), (False, True), (Fraction(-3, 2), Fraction(0), Fraction(6)), (False,)
    )
]


LOGICAL = [name for name in t.Builtin if OPERATORS[name].typing.takes_formulas]


SAMPLES = {
    **{sign: f"(a {sign} k) == (2 {sign} 3)" for sign in ("+", "-", "*")},
    "/": "a / 4 == 2 / 4",
    **{sign: f"(a {sign} k) <=> (p)" for sign in ("==", "!=", "<", "<=", ">", ">=")},
    **{sign: f"p {sign} (a < 0)" for sign in ("and", "or", "->", "<=>")},
    "not": "not p", "xor": "xor(p, a < 0)", "if": "if p then a < 2 else a > 3",
    "abs": "abs(a) == 2", "min": "min(a, k) == 2", "max": "max(a, k) == 2", "mod": "mod(a, 3) == 2",
    "div": "div(a, 3) == -3", "sqrt": "sqrt(k + 1) == 2",
    "sin": "sin(x) <= x", "cos": "cos(x) >= 1 - x * x / 2 and x <= 1", "atan2": "atan2(x, k + 1) > 0.5",
}  # fmt: skip
"""A formula with each operator of the table."""


class Writer:
    """Random formulas in which nearly everything is one of the operators of the table."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def whole(self, depth: int) -> str:
        choice = self.random.choice
        if depth == 0:
            return choice(("a", "k", "0", "1", "-2", "5"))
        one, other = self.whole(depth - 1), self.whole(depth - 1)
        return choice(
            (
                f"min({one}, {other})",
                f"max({one}, {other}, {self.whole(0)})",
                f"abs({one})",
                f"mod({one}, {choice((1, 2, 3))})",
                f"div({one}, {choice((1, 2, 5))})",
                f"({one} {choice('+-*')} {other})",
                f"-({one})",
                f"(if {self.formula(depth - 1)} then {one} else {other})",
            )
        )

    def real(self, depth: int) -> str:
        choice = self.random.choice
        if depth == 0:
            return choice(("x", "0.5", "-1.5", "a", "k"))
        one, other = self.real(depth - 1), self.real(depth - 1)
        return choice(
            (
                f"min({one}, {other})",
                f"max({one}, {other})",
                f"abs({one})",
                f"({one} / 2)",
                f"({one} / x)",
                f"sqrt({one})",
                f"{choice(('sin', 'cos'))}({one})",
                f"atan2({one}, {other})",
                f"({one} + {other})",
                f"(if {self.formula(depth - 1)} then {one} else {other})",
            )
        )

    def formula(self, depth: int) -> str:
        choice = self.random.choice
        if depth == 0:
            return choice(("p", "TRUE", "a < 2", "k != 3", "x >= 0", "0 < a <= k"))
        one, other = self.formula(depth - 1), self.formula(depth - 1)
        sign = choice(("==", "!=", "<", "<=", ">", ">="))
        return choice(
            (
                f"({self.whole(depth)} {sign} {self.whole(depth)})",
                f"({self.real(depth)} {sign} {self.real(depth)})",
                *(f"{name}({one}, {other})" for name in LOGICAL),
                f"(if {one} then {other} else {self.formula(depth - 1)})",
                f"({one} {choice(('and', 'or', '->', '<=>'))} {other})",
                f"(not {one})",
            )
        )


def named(values: dict[str, Any]) -> dict[str, Any]:
    return {("out." if name == "q" else "in.") + name: value for name, value in values.items()}


def made(seed: int, depth: int = 3) -> t.Term:
    return parse_formula(Writer(seed).formula(depth), NODE)


# -- the table ---------------------------------------------------------------------------------------------------------


def test_every_operator_has_every_column_or_a_reason() -> None:
    assert set(OPERATORS) >= {*map(str, t.Builtin), "if", "and", "or", "not", "->", "<=>", "==", "+", "/"}
    for row in OPERATORS.values():
        for column in dataclasses.fields(Operator):
            entry = getattr(row, column.name)
            assert entry is not None, (row.name, column.name)
            assert not isinstance(entry, Why) or len(entry.reason) > 10, (row.name, column.name)


def test_every_operator_is_described() -> None:
    page = (Path(__file__).parents[2] / "docs" / "language.md").read_text("utf-8")
    assert [name for name in t.Builtin if f"`{name}(" not in page] == [], "describe it in docs/language.md: `NAME(…)`"


def test_every_operator_is_drawn_and_has_a_sample() -> None:
    drawn = {part.operator for seed in range(60) for part in subterms(made(seed)) if isinstance(part, t.Operation)}
    assert set(t.Builtin) - drawn == set(), "draw it in `Writer`"
    assert set(OPERATORS) - set(SAMPLES) == set(), "a formula with it in `SAMPLES`, true for some values"


@pytest.mark.parametrize("name", t.Builtin)
def test_a_definition_means_what_the_operator_means(name: t.Builtin) -> None:
    """Passes that take formulas apart take the definition for the operator."""
    term = next(p for p in subterms(parse_formula(SAMPLES[name], NODE)) if isinstance(p, t.Operation))
    said = definition(term)
    if said is None:
        return
    formula = t.Iff(term, said) if term.sort == BOOL else t.Compare("==", term, said)
    for values in GRID:
        assert evaluate(formula, named(values)) is True, values


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_the_kernel_says_it_by_itself(name: str) -> None:
    """In a text of its own, in which Z3 finds the values for which evaluation has the sample true, and no others."""
    formula = parse_formula(SAMPLES[name], NODE)
    text = Text()
    said = text.formula(formula, lambda variable: (f"|{variable.qualified}|", variable.sort))
    for values in GRID[::7]:
        known = {part for part in subterms(formula) if isinstance(part, t.Variable)}
        fixed = [t.Compare("==", part, t.Literal(values[part.name], part.sort)) for part in known]
        given = [text.formula(term, lambda variable: (f"|{variable.qualified}|", variable.sort)) for term in fixed]
        solver = z3.Solver()
        solver.from_string(text.script([*given, said]))
        assert (solver.check() == z3.sat) is evaluate(formula, named(values)), (values, said)


def test_an_operator_without_a_column_is_an_error() -> None:
    with pytest.raises(TypeError, match="required positional"):
        dataclasses.replace(OPERATORS["xor"]).__class__("nand")  # type: ignore[call-arg]


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_the_columns_of_one_operator_agree(name: str) -> None:
    """What evaluation computes of small values, Z3 proves; and its script has the head that the table says."""
    formula = parse_formula(SAMPLES[name], NODE)
    row = OPERATORS[name]
    assert solve([formula]).status == "sat"  # in a context of its own, where the table's column may make no other
    script = formulas_script([formula])
    assert f"({row.smtlib} " in script or ((name in ("!=", "if") and "not" in script) or "ite" in script), script
    checked = 0
    for values in GRID:
        held = Meaning().met(formula, [named(values)])
        assert evaluate(formula, named(values)) is held
        checked += held
    assert entails([], formula).verdict is not Verdict.PROVED
    assert checked or name in ("+", "-", "*", "/")


def test_the_words_are_names_wherever_they_can_be() -> None:
    """`min`, `mod`, … are operators only directly before a parenthesis, and not where a contract declares them."""
    names = ", ".join(f"{name} : BOOL" for name in t.Builtin)
    contract, found = check_text(
        f"context {{ E : {{{', '.join(f'{n}_e' for n in t.Builtin)}}}; F : INTEGER --> INTEGER; }}\n"
        f"node n {{ inputs( {names} ) outputs( abs' : BOOL ) topics()\n"
        "guarantee( xor and abs and min and max and (mod or div) -> out.abs' ) }\n"
        "node m { inputs( mod : F, abs : INTEGER ) outputs( b : BOOL ) topics()\n"
        "guarantee( out.b <=> mod(in.abs) == 1 )\n"
        "guarantee( forall(max in INTEGER | max < 3 -> min(max, 3) == max) ) }\n",
        "f",
    )
    assert contract is not None, [d.message for d in found]
    first = contract.nodes[1].guarantees[0].formula
    assert not any(isinstance(part, t.Operation) for part in subterms(first))


@pytest.mark.parametrize("word", ["if", "then", "else"])
def test_the_words_of_a_conditional_are_reserved(word: str) -> None:
    contract, found = check_text(CONTRACT.replace("k :", f"{word} :"), "f")
    assert contract is None
    assert any("keyword" in (d.hint or "") for d in found), [(d.message, d.hint) for d in found]


@pytest.mark.parametrize(
    "text",
    ["mod(a, 0) == 0", "mod(a, -1) == 0", "div(a, k) == 0", "mod(x, 2) == 0", "abs(p)", "xor(a, p)", "min(a) == 0",
     "a == if p then 1 else 2", "(if p then a else p) == a", "if p then a", "(if a then 1 else 2) == 1", "abs() == 1",
     "sqrt(p) == 1", "sqrt() == 1", "norm(x) == 1", "norm(x, p) == 1", "norm() == 1", "norm(x, x, x, x) == 1",
     "dot(x, x) == 1", "dot((x, a), (1, 2, 3)) == 1", "dot((x, a)) == 1", "dot((x, p), (x, p)) == 1"],
)  # fmt: skip
def test_what_means_nothing_is_refused_with_a_place(text: str) -> None:
    with pytest.raises(Rejected) as rejected:
        parse_formula(text, NODE)
    assert all(d.span is not None for d in rejected.value.diagnostics)


def test_a_divisor_stays_positive_in_mutants() -> None:
    for mutant in mutants(parse_formula("mod(a, 1) == 0 and div(a - 1, 2) > mod(k, 3)", NODE)):
        for part in subterms(mutant.formula):
            if isinstance(part, t.Operation) and part.operator in (t.Builtin.MOD, t.Builtin.DIV):
                assert isinstance(part.arguments[1], t.Literal)
                assert int(part.arguments[1].value) > 0


NUMBERS: dict[Sort, tuple[Any, ...]] = {
    NATURAL: (0, 1, 3),
    INTEGER: (-7, -1, 0, 2),
    REAL: (Fraction(-3, 2), Fraction(0), Fraction(1, 4), Fraction(2)),
}
"""Values of every type that an operator may be of, below, at, and above 0."""


def every_use() -> list[tuple[t.Builtin, Sort]]:
    """Each operator with each type of what it may be of."""
    taken = {Typing.WHOLE: (NATURAL, INTEGER), Typing.FORMULA: (BOOL,), Typing.FORMULAS: (BOOL,)}
    return [(name, sort) for name in t.Builtin for sort in taken.get(OPERATORS[name].typing, tuple(NUMBERS))]


def uses(name: t.Builtin, sort: Sort) -> list[tuple[t.Operation, Any]]:
    """The operator of values of the type, with what enumeration says that it yields."""
    takes = OPERATORS[name].takes
    assert not isinstance(takes, Why)
    least, most = takes
    values = NUMBERS.get(sort, (False, True))
    whole = OPERATORS[name].typing is Typing.WHOLE
    found = []
    columns = (values, (1, 3)) if whole else (values,) * (most or least + 1)
    for given in product(*columns):
        sorts = (sort, NATURAL) if whole else (sort,) * len(given)
        term = operation(name, [t.Literal(v, s) for v, s in zip(given, sorts, strict=True)], None)
        assert isinstance(term, t.Operation)
        with contextlib.suppress(NoValue):
            value = Meaning().value(term, [{}])
            if not isinstance(value, Fraction) or value.denominator < 10**9:  # what is irrational, no literal says
                found.append((term, value))
    return found


def said_equal(term: t.Operation, value: Any) -> t.Term:
    return (
        term if value is True else t.Not(term) if value is False else t.Compare("==", term, t.Literal(value, term.sort))
    )


@pytest.mark.parametrize(("name", "sort"), every_use())
def test_an_operator_means_the_same_of_every_type(name: t.Builtin, sort: Sort) -> None:
    """What it yields is a value of the type that the checker gives it, for every pass the one that enumeration says,
    whatever it is of: whole numbers, naturals, or reals."""
    claims = []
    for term, value in uses(name, sort):
        got = evaluate(term, {})
        assert got == value, show_term(term, "rcl")
        belongs = member_of(term.sort, {})
        assert belongs is None or belongs(got), f"{show_term(term, 'rcl')} is of type {term.sort}, and yields {got}"
        claim = said_equal(term, value)
        by_definition = definition(term)
        assert by_definition is None or by_definition.sort == term.sort
        for form in (normalise(claim), push_negations(claim), lifted(claim)):
            assert evaluate(form, {}) is True, show_term(term, "rcl")
        claims.append(claim)
    every = t.And(tuple(claims))
    assert entails([], every).verdict is Verdict.PROVED
    text = Text()
    solver = z3.Solver()
    solver.from_string(text.script([f"(not {text.formula(every, lambda variable: (variable.name, variable.sort))})"]))
    assert solver.check() == z3.unsat


@pytest.mark.slow
@pytest.mark.needs_dafny
def test_dafny_proves_of_every_type_what_an_operator_yields() -> None:
    """In the text that `backends/dafny/modules.py` has for each type, which nothing but Dafny reads."""
    asked = [use for use in every_use() if use[1] != NATURAL and not isinstance(OPERATORS[use[0]].dafny, Why)]
    claims = [t.And(tuple(said_equal(*use) for use in uses(*each))) for each in asked]
    clauses = "\n".join(f"guarantee g{k} ( {show_term(claim, 'rcl')} )" for k, claim in enumerate(claims))
    contract, found = check_text(CONTRACT.replace("guarantee( q )", f"\n{clauses}\n"), "f")
    assert contract is not None, found
    made = generate(contract.nodes[0], [g.name for g in contract.nodes[0].guarantees])
    assert made.uncovered == ()
    lemmas = [f"  lemma Is{k}() ensures Contract.g{k}() {{}}" for k in range(len(claims))]
    check = "\n".join(["module Check {", "  import Contract", *lemmas, "}", ""])
    files = {made.types_file: made.types, made.contract_file: made.contract, "check.dfy": check}
    run = verify(files, Limits(seconds=400), Outside(()))
    assert run.members is not None, run.output
    proved = {m.name for m in run.members if m.kind == "Impl" and m.outcome == "correct"}
    assert [show_term(claim, "rcl") for k, claim in enumerate(claims) if f"Is{k}" not in proved] == []


# -- generated formulas ------------------------------------------------------------------------------------------------


def wherever_defined(term: t.Term, values: dict[str, Any]) -> bool | None:
    """The truth by enumeration; None where it may depend on what a division by zero yields."""
    return Meaning().truth(term, [named(values)])


@pytest.mark.parametrize("seed", some(range(150), 10, slow=40))
def test_evaluation_normal_forms_and_lifting_keep_the_meaning(seed: int) -> None:
    term = made(seed)
    forms = [term, push_negations(term), normalise(term)]
    try:
        forms.append(lifted(term))
        kept = [p for p in subterms(forms[-1]) if isinstance(p, t.Conditional | t.Operation)]
        assert all(isinstance(p, t.Operation) and p.operator in ("mod", "div", "sqrt", *t.CIRCULAR) for p in kept)
    except TooManyCases:
        pass
    condition = defined(term)
    for values in GRID[seed % 3 :: 3]:
        held = wherever_defined(term, values)
        if held is None:
            continue
        for form in forms:
            try:
                assert evaluate(form, named(values)) is held, (show_term(form, "rcl"), values)
            except NotEvaluable:
                assert form is not term or any(
                    isinstance(p, t.Arithmetic) and p.operator == "/" for p in subterms(term)
                )
        assert wherever_defined(condition, values) is not None  # the condition itself asks for nothing undefined


@pytest.mark.parametrize("seed", some(range(150), 50, slow=100))
def test_what_is_printed_reads_back(seed: int) -> None:
    term = made(seed)
    again = parse_formula(show_term(term, "rcl"), NODE)
    assert again == term
    assert digest(again) == digest(term)


def fixed(values: dict[str, Any], term: t.Term) -> list[t.Term]:
    return [t.Compare("==", v, t.Literal(values[v.name], v.sort)) for v in free_variables(term)]


@pytest.mark.parametrize("seed", some(range(40), 10, slow=10))
def test_z3_agrees_with_enumeration(seed: int) -> None:
    term = made(seed)
    for values in random.Random(seed).sample(GRID, 3):
        held = wherever_defined(term, values)
        if held is not None:
            status = solve([term, *fixed(values, term)], effort=20_000).status
            assert status == ("sat" if held else "unsat"), (show_term(term, "rcl"), values)


@pytest.mark.needs_cvc5
@pytest.mark.parametrize("seed", range(5))
def test_cvc5_agrees_with_enumeration(seed: int) -> None:
    term = made(seed)
    for values in random.Random(seed).sample(GRID, 2):
        held = wherever_defined(term, values)
        if held is not None:
            answer = ask_cvc5(formulas_script([term, *fixed(values, term)]), effort=10_000)
            assert answer in ("sat" if held else "unsat", "unknown"), (show_term(term, "rcl"), values)


@pytest.mark.parametrize(
    "shape", ["(if {0} then u + v < {1} else u > a + v)", "xor({0}, u + v < {1})", "({0} <=> x < {1})"]
)
def test_operators_within_operators_never_take_for_ever(shape: str) -> None:
    """What reads a condition twice would double with each level."""
    text = "u > v"
    for level in range(40):
        text = shape.format(text, level)
    term = parse_formula(f"exists(u, v in REAL | u - v < 100 and {text})", NODE)
    with contextlib.suppress(NotEvaluable):
        evaluate(term, named(GRID[0]))
    with contextlib.suppress(TooManyCases):
        lifted(term)
    push_negations(term)
    assert defined(term)
