"""Quantifiers that the one-point rule takes away leave the meaning as it was."""

from __future__ import annotations

import random
from itertools import product

import pytest
import z3
from helpers import some
from oracle.values import Meaning, domain

from avow.base.verdict import Verdict
from avow.formulas.formula import free_variables
from avow.formulas.one_point_rule import made_with, solved, without_points
from avow.formulas.traversal import run
from avow.language.printer import show_term
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    Constructor,
    DataSort,
    EnumSort,
    FunctionSort,
    SequenceSort,
    SetSort,
    Sort,
    TupleSort,
)
from avow.language.terms import (
    And,
    Apply,
    Argument,
    Arithmetic,
    Compare,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Literal,
    Not,
    Or,
    Quantified,
    Quantifier,
    Role,
    SequenceRange,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
)
from avow.sanity.witness_candidates import Definition
from avow.sanity.witnesses import applied
from avow.solving.checking import check
from avow.solving.questions import entails
from avow.solving.translation import Translator

from .contracts import contract, formula

CONTRACT = contract(
    """context { Command : {move(REAL, REAL), inspect(NATURAL), halt}; }
    node n { inputs( c : Command, p : (REAL, NATURAL), n : NATURAL, k : INTEGER, r : REAL, f : NATURAL --> BOOL )
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
    ("exists(i in NATURAL | in.f(i) and i == in.n)", "in.f(in.n)"),
    ("exists(i in NATURAL | 0 < i and i < 3 and in.f(i))", "in.f(1) or in.f(2)"),
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
        "exists(i in INTEGER | 0 < i and i < 3 and i * in.k == 4)",
    ],
)
def test_the_quantifier_goes(text: str) -> None:
    stack = [Translator().term(term(text))]
    while stack:
        part = stack.pop()
        assert not z3.is_quantifier(part)
        stack.extend(part.children())


@pytest.mark.parametrize(
    ("equation", "values"),
    [
        ("x + 1 == in.r", {"x": "in.r - 1"}),
        ("1 + x == in.r", {"x": "in.r - 1"}),
        ("in.r == x - 1", {"x": "in.r + 1"}),
        ("1 - x == in.r", {"x": "1 - in.r"}),
        ("i + 1 == in.k", {"i": "in.k - 1"}),
        ("(x, in.n - i) == (in.r, in.k)", {"x": "in.r", "i": "in.n - in.k"}),
        ("x - x == in.r", None),
        ("in.k - in.n == 3", None),
        ("2 * i == in.k", None),
        ("in.k + 1 != i", None),
    ],
)
def test_an_equation_is_solved_for_what_it_determines(equation: str, values: dict[str, str] | None) -> None:
    whole = term(f"exists(x in REAL, i in INTEGER | {equation})")
    assert isinstance(whole, Quantified)
    found = solved(whole.body, whole.variables)
    assert (found and {v.name: show_term(value, "rcl") for v, value in found.values.items()}) == values
    assert not found or all(value.sort == variable.sort for variable, value in found.values.items())


def test_a_condition_says_what_a_value_was_made_with_only_of_its_own_parts() -> None:
    one, other = (Variable(Role.INPUT, name, _DEED) for name in "de")

    def made(value: Variable, constructor: str, operator: str = "==") -> Compare:
        parts = tuple(Argument(value, constructor, k, s) for k, s in enumerate((_COLOUR, INTEGER)))
        return Compare(operator, one, Construct("go", parts, _DEED))

    assert made_with(made(one, "go")) == made_with(made(one, "go", "!=")) == "go"
    assert made_with(made(other, "go")) is made_with(made(one, "dig")) is made_with(made(one, "go", "<")) is None
    assert made_with(Compare("==", one, Construct("halt", (), _DEED))) is None


# -- generated formulas, judged by enumeration -------------------------------------------------------------------------

_COLOUR = EnumSort("Colour", ("red", "green"))
_PAIR = TupleSort((_COLOUR, INTEGER))
_DEED = DataSort("Deed", (Constructor("go", (_COLOUR, INTEGER)), Constructor("dig", (_PAIR,)), Constructor("halt", ())))
_RELATION = FunctionSort((_COLOUR,), BOOL)
_INPUTS = tuple(
    Variable(Role.INPUT, name, sort)
    for name, sort in [("d", _DEED), ("e", _DEED), ("c", _COLOUR), ("k", INTEGER), ("b", BOOL), ("p", _PAIR)]
)
_RELATED = Variable(Role.INPUT, "r", _RELATION)


class _Drawn:
    """Formulas whose quantified numbers range over what `oracle.values.domain` has of their sort."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def formula(self, scope: tuple[Variable, ...], depth: int) -> Term:
        if not depth:
            return self.atom(scope)
        kind = self.random.choice(("and", "and", "or", "implies", "not", "iff", "quantified", "quantified", "atom"))
        if kind == "atom":
            return self.atom(scope)
        if kind == "quantified":
            return self.quantified(scope, depth)
        parts = [self.formula(scope, depth - 1) for _ in range(1 if kind == "not" else 2)]
        match kind:
            case "and":
                return And(tuple(parts))
            case "or":
                return Or(tuple(parts))
            case "implies":
                return Implies(*parts)
            case "iff":
                return Iff(*parts)
        return Not(parts[0])

    def quantified(self, scope: tuple[Variable, ...], depth: int) -> Term:
        quantifier = self.random.choice((*Quantifier, Quantifier.EXISTS, Quantifier.FORALL))
        sorts = self.random.choices((_COLOUR, INTEGER, NATURAL, BOOL, _PAIR), k=self.random.choice((1, 2, 2)))
        # names are used again in other quantifiers: what is put into one must not be caught there
        variables = tuple(Variable(Role.BOUND, f"{'xyz'[n]}", sort) for n, sort in enumerate(sorts))
        inner = (*(v for v in scope if v.name not in {v.name for v in variables}), *variables)
        parts = [self.atom(inner) for _ in variables]
        body: Term = And((*parts, self.formula(inner, depth - 1)))
        ranges = And(tuple(limit for v in variables for limit in _limits(v)))
        if quantifier is Quantifier.FORALL:
            return Quantified(quantifier, variables, Implies(And((ranges, *parts)), body.items[-1]))
        return Quantified(quantifier, variables, And((ranges, body)))

    def atom(self, scope: tuple[Variable, ...]) -> Term:
        sort = self.random.choice((_DEED, _DEED, _COLOUR, INTEGER, INTEGER, BOOL, _PAIR))
        if sort == INTEGER and self.random.random() < 0.3:
            return Compare(self.random.choice(("<", "<=", ">")), self.term(INTEGER, scope), self.term(INTEGER, scope))
        if self.random.random() < 0.1:
            return Apply(_RELATED, (self.term(_COLOUR, scope),), BOOL)
        operator = self.random.choice(("==", "==", "==", "!="))
        return Compare(operator, self.term(sort, scope), self.term(sort, scope))

    def term(self, sort: Sort, scope: tuple[Variable, ...], depth: int = 2) -> Term:
        found: list[Term] = [v for v in scope if v.sort == sort or (sort == INTEGER and v.sort == NATURAL)]
        if found and self.random.random() < 0.6:
            return self.random.choice(found)
        match sort:
            case EnumSort(members=members):
                return EnumValue(self.random.choice(members), sort)
            case DataSort(constructors=constructors):
                made = self.random.choice(constructors)
                return Construct(made.name, tuple(self.term(p, scope, depth - 1) for p in made.parameters), sort)
            case TupleSort(items=items):
                return TupleTerm(tuple(self.term(item, scope, depth - 1) for item in items), sort)
        if sort == BOOL:
            return Literal(self.random.random() < 0.5, BOOL)
        if not depth or self.random.random() < 0.5:
            return Literal(self.random.randrange(-1, 3), INTEGER)
        one, other = (self.term(INTEGER, scope, depth - 1) for _ in range(2))
        return Arithmetic(self.random.choice("+-"), one, other, INTEGER)


def _limits(variable: Variable) -> list[Term]:
    if variable.sort == _PAIR:
        colours = (EnumValue(member, _COLOUR) for member in _COLOUR.members)
        pairs = (TupleTerm((c, Literal(n, INTEGER)), _PAIR) for c, n in product(colours, domain(INTEGER)))
        return [In(variable, SetTerm(tuple(pairs), SetSort(_PAIR)))]
    if variable.sort not in (INTEGER, NATURAL):
        return []
    numbers = domain(variable.sort)
    low, high = Literal(numbers[0], INTEGER), Literal(numbers[-1], INTEGER)
    if variable.sort == NATURAL:  # the sort itself is the other limit
        return [Compare("<=", variable, high)]
    if variable.name == "y":  # bounds are read too
        return [Compare("<=", low, variable), Compare("<", variable, Literal(numbers[-1] + 1, INTEGER))]
    return [In(variable, SequenceRange(low, high, SequenceSort(INTEGER)))]


_RANGES = {sort: domain(sort) for sort in (INTEGER, NATURAL, _PAIR)}


@pytest.mark.parametrize("seed", some(range(3000), 10, slow=110))
def test_generated_formulas_keep_their_meaning(seed: int) -> None:
    drawn = _Drawn(seed)
    whole = drawn.quantified(_INPUTS, 2)
    less = without_points(whole)
    assert free_variables(less) <= free_variables(whole)
    for _ in range(10):
        step = {v.qualified: drawn.random.choice(domain(v.sort)) for v in (*_INPUTS, _RELATED)}
        for unspecified in (0, 1):  # what a value was not made with never matters
            assert Meaning(unspecified, _RANGES).holds(less, step) is Meaning(0, _RANGES).holds(whole, step)


def test_the_drawn_formulas_have_points() -> None:
    drawn = [_Drawn(seed).quantified(_INPUTS, 2) for seed in range(100)]
    assert sum(without_points(term) is not term for term in drawn) > 60


@pytest.mark.parametrize("seed", some(range(300), 5, slow=15))
def test_the_solver_finds_no_difference(seed: int) -> None:
    """Between the translation with the rule and without it, over all numbers."""
    translator, whole = Translator(), _Drawn(seed).quantified(_INPUTS, 2)
    plain = run(translator._term(whole, {}, {}))
    assert check(translator, [plain != translator.term(whole)], effort=200_000).status != "sat"


def test_what_a_witness_defines_is_seen_and_catches_nothing() -> None:
    """Its constants have names that a quantifier of the formula may have, too."""
    output = Variable(Role.OUTPUT, "f", FunctionSort((INTEGER,), BOOL))
    chosen, at = (Variable(Role.BOUND, name, INTEGER) for name in ("x", "at"))
    positive = Compare(">", chosen, Literal(0, INTEGER))
    guarantee = Quantified(Quantifier.FORALL, (chosen,), Implies(Apply(output, (chosen,), BOOL), positive))
    defined = applied(guarantee, {output: Definition((at,), Compare("==", at, chosen))})
    assert free_variables(defined) == {chosen}
    assert entails([without_points(defined)], positive).verdict is Verdict.PROVED
    assert not isinstance(without_points(defined), Quantified)
