"""Quantifiers that the one-point rule takes away leave the meaning as it was."""

from __future__ import annotations

import random
from itertools import product
from typing import Any

import pytest
import z3
from helpers import some
from oracle.domains import domain
from reference.meaning import Meaning, Run, Step

from avow.base.verdict import Verdict
from avow.formulas.formula import free_variables
from avow.formulas.one_point_rule import made_with, solved, without_points
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.printer import show_term
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


def term(text: str) -> t.Term:
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
    assert isinstance(whole, t.Quantified)
    found = solved(whole.body, whole.variables)
    assert (found and {v.name: show_term(value, "rcl") for v, value in found.values.items()}) == values
    assert not found or all(value.sort == variable.sort for variable, value in found.values.items())


def test_a_condition_says_what_a_value_was_made_with_only_of_its_own_parts() -> None:
    one, other = (t.Variable(t.Role.INPUT, name, _DEED) for name in "de")

    def made(value: t.Variable, constructor: str, operator: str = "==") -> t.Compare:
        parts = tuple(t.Argument(value, constructor, k, part) for k, part in enumerate((_COLOUR, s.INTEGER)))
        return t.Compare(operator, one, t.Construct("go", parts, _DEED))

    assert made_with(made(one, "go")) == made_with(made(one, "go", "!=")) == "go"
    assert made_with(made(other, "go")) is made_with(made(one, "dig")) is made_with(made(one, "go", "<")) is None
    assert made_with(t.Compare("==", one, t.Construct("halt", (), _DEED))) is None


# -- generated formulas, judged by enumeration -------------------------------------------------------------------------

_COLOUR = s.EnumSort("Colour", ("red", "green"))
_PAIR = s.TupleSort((_COLOUR, s.INTEGER))
_DEED = s.DataSort(
    "Deed", (s.Constructor("go", (_COLOUR, s.INTEGER)), s.Constructor("dig", (_PAIR,)), s.Constructor("halt", ()))
)
_RELATION = s.FunctionSort((_COLOUR,), s.BOOL)
_INPUTS = tuple(
    t.Variable(t.Role.INPUT, name, sort)
    for name, sort in [("d", _DEED), ("e", _DEED), ("c", _COLOUR), ("k", s.INTEGER), ("b", s.BOOL), ("p", _PAIR)]
)
_RELATED = t.Variable(t.Role.INPUT, "r", _RELATION)


class _Drawn:
    """Formulas whose quantified numbers range over what `oracle.domains.domain` has of their sort."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def formula(self, scope: tuple[t.Variable, ...], depth: int) -> t.Term:
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
                return t.And(tuple(parts))
            case "or":
                return t.Or(tuple(parts))
            case "implies":
                return t.Implies(*parts)
            case "iff":
                return t.Iff(*parts)
        return t.Not(parts[0])

    def quantified(self, scope: tuple[t.Variable, ...], depth: int) -> t.Term:
        quantifier = self.random.choice((*t.Quantifier, t.Quantifier.EXISTS, t.Quantifier.FORALL))
        sorts = self.random.choices((_COLOUR, s.INTEGER, s.NATURAL, s.BOOL, _PAIR), k=self.random.choice((1, 2, 2)))
        # names are used again in other quantifiers: what is put into one must not be caught there
        variables = tuple(t.Variable(t.Role.BOUND, f"{'xyz'[n]}", sort) for n, sort in enumerate(sorts))
        inner = (*(v for v in scope if v.name not in {v.name for v in variables}), *variables)
        parts = [self.atom(inner) for _ in variables]
        body: t.Term = t.And((*parts, self.formula(inner, depth - 1)))
        ranges = t.And(tuple(limit for v in variables for limit in _limits(v)))
        if quantifier is t.Quantifier.FORALL:
            return t.Quantified(quantifier, variables, t.Implies(t.And((ranges, *parts)), body.items[-1]))
        return t.Quantified(quantifier, variables, t.And((ranges, body)))

    def atom(self, scope: tuple[t.Variable, ...]) -> t.Term:
        sort = self.random.choice((_DEED, _DEED, _COLOUR, s.INTEGER, s.INTEGER, s.BOOL, _PAIR))
        if sort == s.INTEGER and self.random.random() < 0.3:
            return t.Compare(
                self.random.choice(("<", "<=", ">")), self.term(s.INTEGER, scope), self.term(s.INTEGER, scope)
            )
        if self.random.random() < 0.1:
            return t.Apply(_RELATED, (self.term(_COLOUR, scope),), s.BOOL)
        operator = self.random.choice(("==", "==", "==", "!="))
        return t.Compare(operator, self.term(sort, scope), self.term(sort, scope))

    def term(self, sort: s.Sort, scope: tuple[t.Variable, ...], depth: int = 2) -> t.Term:
        found: list[t.Term] = [v for v in scope if v.sort == sort or (sort == s.INTEGER and v.sort == s.NATURAL)]
        if found and self.random.random() < 0.6:
            return self.random.choice(found)
        match sort:
            case s.EnumSort(members=members):
                return t.EnumValue(self.random.choice(members), sort)
            case s.DataSort(constructors=constructors):
                made = self.random.choice(constructors)
                return t.Construct(made.name, tuple(self.term(p, scope, depth - 1) for p in made.parameters), sort)
            case s.TupleSort(items=items):
                return t.TupleTerm(tuple(self.term(item, scope, depth - 1) for item in items), sort)
        if sort == s.BOOL:
            return t.Literal(self.random.random() < 0.5, s.BOOL)
        if not depth or self.random.random() < 0.5:
            return t.Literal(self.random.randrange(-1, 3), s.INTEGER)
        one, other = (self.term(s.INTEGER, scope, depth - 1) for _ in range(2))
        return t.Arithmetic(self.random.choice("+-"), one, other, s.INTEGER)


def _limits(variable: t.Variable) -> list[t.Term]:
    if variable.sort == _PAIR:
        colours = (t.EnumValue(member, _COLOUR) for member in _COLOUR.members)
        pairs = (t.TupleTerm((c, t.Literal(n, s.INTEGER)), _PAIR) for c, n in product(colours, domain(s.INTEGER)))
        return [t.In(variable, t.SetTerm(tuple(pairs), s.SetSort(_PAIR)))]
    if variable.sort not in (s.INTEGER, s.NATURAL):
        return []
    numbers = domain(variable.sort)
    low, high = t.Literal(numbers[0], s.INTEGER), t.Literal(numbers[-1], s.INTEGER)
    if variable.sort == s.NATURAL:  # the sort itself is the other limit
        return [t.Compare("<=", variable, high)]
    if variable.name == "y":  # bounds are read too
        return [t.Compare("<=", low, variable), t.Compare("<", variable, t.Literal(numbers[-1] + 1, s.INTEGER))]
    return [t.In(variable, t.SequenceRange(low, high, s.SequenceSort(s.INTEGER)))]


_RANGES = {sort: domain(sort) for sort in (s.INTEGER, s.NATURAL, _PAIR)}


class _Total(Meaning):
    """Every term has a value: what it was not made with is one of its sort's."""

    def __init__(self, unspecified: int) -> None:
        super().__init__(_RANGES)
        self.unspecified = unspecified

    def without_value(self, term: t.Term) -> Any:
        return domain(term.sort)[self.unspecified]

    def unwritten(self, term: t.Term, run: Run, k: int, bound: Step) -> Any:
        assert isinstance(term, t.Argument)
        name, *given = self.value(term.value, run, k, bound)
        return given[term.position] if name == term.constructor else self.without_value(term)


@pytest.mark.parametrize("seed", some(range(3000), 10, slow=110))
def test_generated_formulas_keep_their_meaning(seed: int) -> None:
    drawn = _Drawn(seed)
    whole = drawn.quantified(_INPUTS, 2)
    less = without_points(whole)
    assert free_variables(less) <= free_variables(whole)
    for _ in range(10):
        step = {v.qualified: drawn.random.choice(domain(v.sort)) for v in (*_INPUTS, _RELATED)}
        for unspecified in (0, 1):  # what a value was not made with never matters
            assert _Total(unspecified).met(less, [step]) is _Total(0).met(whole, [step])


def test_the_drawn_formulas_have_points() -> None:
    drawn = [_Drawn(seed).quantified(_INPUTS, 2) for seed in range(100)]
    assert sum(without_points(term) is not term for term in drawn) > 60


@pytest.mark.parametrize("seed", some(range(300), 5, slow=15))
def test_the_solver_finds_no_difference(seed: int) -> None:
    """Between the translation with the rule and without it, over all numbers."""
    translator, whole = Translator(), _Drawn(seed).quantified(_INPUTS, 2)
    plain = translator._term(whole, {}, {})
    assert check(translator, [plain != translator.term(whole)], effort=200_000).status != "sat"


def test_what_a_witness_defines_is_seen_and_catches_nothing() -> None:
    """Its constants have names that a quantifier of the formula may have, too."""
    output = t.Variable(t.Role.OUTPUT, "f", s.FunctionSort((s.INTEGER,), s.BOOL))
    chosen, at = (t.Variable(t.Role.BOUND, name, s.INTEGER) for name in ("x", "at"))
    positive = t.Compare(">", chosen, t.Literal(0, s.INTEGER))
    guarantee = t.Quantified(t.Quantifier.FORALL, (chosen,), t.Implies(t.Apply(output, (chosen,), s.BOOL), positive))
    defined = applied(guarantee, {output: Definition((at,), t.Compare("==", at, chosen))})
    assert free_variables(defined) == {chosen}
    assert entails([without_points(defined)], positive).verdict is Verdict.PROVED
    assert not isinstance(without_points(defined), t.Quantified)
