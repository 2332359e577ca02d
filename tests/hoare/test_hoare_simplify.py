"""The simplifier keeps meaning, over generated formulas against enumeration; and a wrong one could prove nothing."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from drawn.contracts import INPUTS, OUTPUTS, finite_formulas
from drawn.formulas import checked
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND, triples
from avow.backends.hoare.simplify import simplify
from avow.base.verdict import Outcome, Verdict
from avow.evaluation.evaluate import compile_term
from avow.formulas.values import Element, FunctionValue, Value
from avow.language import terms as t
from avow.language.sorts import INTEGER, REAL, EnumSort
from avow.solving.questions import entails
from hoare.systems import make_job

COLOUR = INPUTS[1].sort
assert isinstance(COLOUR, EnumSort)
ONE = EnumSort("One", ("only",))
COLOURS = tuple(Element(m) for m in COLOUR.members)
RELATIONS = tuple(
    FunctionValue({(c,): value for c, value in zip(COLOURS, values, strict=True)}, False)
    for values in product((False, True), repeat=3)
)


def valuations() -> list[dict[str, Value]]:
    names = [v.qualified for v in (*INPUTS, *OUTPUTS)]
    return [dict(zip(names, point, strict=True)) for point in product(
        (False, True), COLOURS, RELATIONS[1::3], (False, True), COLOURS)]  # fmt: skip


VALUATIONS = valuations()


@st.composite
def with_constants(draw: st.DrawFn) -> t.Term:
    """Formulas some of whose parts are constants, also below quantifiers of sorts of one value."""
    inner = draw(st.one_of(finite_formulas(depth=2), st.sampled_from((t.TRUE, t.FALSE))))
    other = draw(st.one_of(finite_formulas(depth=1), st.sampled_from((t.TRUE, t.FALSE))))
    sort = draw(st.sampled_from((COLOUR, ONE)))
    quantified = t.Quantified(draw(st.sampled_from(tuple(t.Quantifier))), (t.Variable(t.Role.BOUND, "z", sort),), inner)
    kind = draw(st.sampled_from((t.And, t.Or, t.Implies, t.Iff)))
    joined = kind((quantified, other)) if kind in (t.And, t.Or) else kind(quantified, other)
    return t.Not(joined) if draw(st.booleans()) else joined


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.one_of(finite_formulas(), with_constants()))
def test_simplified_formulas_mean_the_same(formula: t.Term) -> None:
    long, short = compile_term(formula), compile_term(simplify(formula))
    for values in VALUATIONS:
        assert long(values) is short(values), values


A, B, X, Y = (t.Variable(t.Role.INPUT, n, s) for n, s in (("a", INTEGER), ("b", INTEGER), ("x", REAL), ("y", REAL)))


@st.composite
def numeric(draw: st.DrawFn, depth: int = 3) -> t.Term:
    if depth and draw(st.booleans()):
        kind = draw(st.sampled_from((t.And, t.Or, t.Implies, t.Iff, t.Not)))
        left, right = draw(numeric(depth=depth - 1)), draw(numeric(depth=depth - 1))
        return t.Not(left) if kind is t.Not else kind((left, right)) if kind in (t.And, t.Or) else kind(left, right)  # type: ignore[operator]
    if draw(st.integers(0, 9)) == 0:
        return draw(st.sampled_from((t.TRUE, t.FALSE)))
    if draw(st.booleans()):
        parts: list[t.Term] = [A, B, *(t.Literal(k, INTEGER) for k in (-1, 0, 2))]
    else:
        parts = [
            X,
            Y,
            *(t.Literal(k, REAL) for k in (0, 1)),
            t.Arithmetic("/", X, Y, REAL),
            t.Arithmetic("/", Y, X, REAL),
        ]
    operator = draw(st.sampled_from(("==", "!=", "<", "<=", ">", ">=")))
    return t.Compare(operator, draw(st.sampled_from(parts)), draw(st.sampled_from(parts)))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(numeric())
def test_also_with_numbers_and_divisions_by_anything(formula: t.Term) -> None:
    """Asked of the solver, for which a quotient by zero is some number."""
    assert entails([], t.Iff(formula, simplify(formula)), effort=4000).verdict is not Verdict.REFUTED


CONTRACT = """
context {{ One : {{only}}; Two : {{one, other}}; }}
node n {{ inputs( a : INTEGER ) outputs( y : INTEGER ) topics() guarantee g ( {formula} ) }}
"""


def settle(folder: Path, formula: str) -> Outcome:
    contract = CONTRACT.format(formula=formula)
    job = make_job(folder, contract, "n", {"program": "n.imp"}, {"n.imp": "y := 0\n"}, "hoare")
    return BACKEND.discharge(job, folder, Limits(seconds=20)).outcomes[0]


@pytest.mark.parametrize(
    ("formula", "holds"),
    [
        ("exists_unique(i in NATURAL | TRUE)", False),
        ("exists_unique(t in Two | y == 0)", False),
        ("exists_unique(i in REAL | 0 == 0 or i < 3)", False),
        ("exists_unique(t in One | y == 0)", True),
        ("exists_unique(t in Two | t == one and y == 0)", True),
        ("not exists_unique(t in Two | y == 0 or t == one)", True),
        ("exists_unique(i in INTEGER | i == a and y == 0)", True),
    ],
)
def test_exactly_one_of_what_always_holds(tmp_path: Path, formula: str, holds: bool) -> None:
    outcome = settle(tmp_path, formula)
    assert outcome.verdict is (Verdict.PROVED if holds else Verdict.REFUTED), outcome.summary


@pytest.mark.parametrize(
    ("text", "short"),
    [
        ("mark(out.y) == mark(1)", "out.y == 1"),
        ("mark(out.y) != mark(1)", "out.y != 1"),
        ("mark(out.y) == halt", "FALSE"),
        ("mark(out.y) != halt", "TRUE"),
    ],
)
def test_constructors_are_injective_and_differ(text: str, short: str) -> None:
    whole = "context {{ C : {{mark(INTEGER), halt}}; }}" + CONTRACT.partition("}}; }}")[2]
    simple, wanted = (checked(whole.format(formula=each)).nodes[0].guarantees[0].formula for each in (text, short))
    assert simplify(simple) == wanted


@pytest.mark.parametrize(
    "wrong", [lambda _: t.TRUE, lambda _: t.FALSE, lambda term: getattr(term, "items", (term,))[0]]
)
def test_a_wrong_simplifier_is_an_error_and_no_proof(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: object
) -> None:
    monkeypatch.setattr(triples, "simplify", wrong)
    outcome = settle(tmp_path, "y == 0 and a == 7 or y == 3")
    assert outcome.verdict is Verdict.ERROR, outcome.summary
