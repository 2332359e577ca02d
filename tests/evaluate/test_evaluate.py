"""Exact evaluation: known answers, refusals, and agreement with Z3 on random formulas over tables."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import pytest

from avow.base.verdict import Verdict
from avow.evaluation.compiler import finite_values, member_of
from avow.evaluation.evaluate import NotEvaluable, compile_term, evaluate
from avow.evaluation.truth import judge
from avow.formulas.values import Data, Element, FunctionValue, SequenceValue, Value
from avow.language import sorts as s
from avow.language import terms as t
from avow.solving.questions import entails

from .terms import (
    COLOUR,
    COMMAND,
    A,
    B,
    C,
    H,
    K,
    N,
    P,
    Q,
    X,
    Y,
    bound,
    eq,
    exists,
    forall,
    given,
    holds,
    nat,
    plus,
    points,
    real,
    unique,
)

# -- known answers -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (points(), False),
        (points((1, 2)), True),
        (points((1, 2), (1, 3)), False),
        (points(default=True), False),
        (points((1, 2), default=True), False),
    ],
)
def test_exists_unique(table: FunctionValue, expected: bool) -> None:
    assert evaluate(unique((X, Y), holds(P, X, Y)), {"in.p": table}) is expected


def test_unique_counts_whole_tuples_and_unmentioned_variables() -> None:
    assert evaluate(unique((X,), eq(X, real(3))), {}) is True
    assert evaluate(unique((X, Y), eq(X, real(3))), {}) is False
    flag = bound("f", s.BOOL)
    assert evaluate(unique((X, flag), eq(X, real(3))), {}) is False
    assert evaluate(unique((X, flag), t.And((eq(X, real(3)), flag))), {}) is True


def test_unique_over_a_disjunction_counts_a_solution_once() -> None:
    body = t.Or((eq(X, real(1)), t.And((eq(X, real(1)), holds(P, X, X)))))
    assert evaluate(unique((X,), body), {"in.p": points((1, 1))}) is True
    assert evaluate(unique((X,), t.Or((eq(X, real(1)), eq(X, real(2))))), {}) is False


@pytest.mark.parametrize("one", [False, True])
@pytest.mark.parametrize("other", [False, True])
@pytest.mark.parametrize("extra", [(), ((1, 2),)])
def test_relations_agree_everywhere(one: bool, other: bool, extra: tuple[tuple[int, ...], ...]) -> None:
    """Not only at the points of the tables: the defaults count too."""
    formula = forall((X, Y), t.Iff(holds(P, X, Y), holds(Q, X, Y)))
    values: dict[str, Value] = {"in.p": points(*extra, default=one), "in.q": points(default=other)}
    assert evaluate(formula, values) is (one == other and not extra)
    assert evaluate(eq(P, Q), values) is (one == other and not extra)


def test_a_function_without_a_value_somewhere() -> None:
    """`forall(x | h(x) != 5)` looks at the default as well as at the points."""
    formula = forall((X,), t.Compare("!=", holds(H, X), real(5)))
    seven = {(Fraction(1),): Fraction(7)}
    assert evaluate(formula, {"in.h": FunctionValue(seven, Fraction(0))}) is True
    assert evaluate(formula, {"in.h": FunctionValue(seven, Fraction(5))}) is False
    assert evaluate(formula, {"in.h": FunctionValue({(Fraction(1),): Fraction(5)}, Fraction(0))}) is False


def test_order_on_reals_looks_between_the_named_values() -> None:
    between = exists((X,), t.And((t.Compare("<", real(1), X), t.Compare("<", X, real(2)))))
    assert evaluate(between, {}) is True
    nothing = exists((X,), t.And((t.Compare("<", real(2), X), t.Compare("<", X, real(2)))))
    assert evaluate(nothing, {}) is False
    one = unique((X,), t.And((t.Compare("<=", real(2), X), t.Compare("<=", X, real(2)))))
    assert evaluate(one, {}) is True
    assert evaluate(unique((X,), t.And((t.Compare("<", real(1), X), t.Compare("<", X, real(2))))), {}) is False


def test_integers_between_bounds() -> None:
    small = t.And((t.Compare("<=", nat(0), N), t.Compare("<", N, nat(3))))
    assert (
        evaluate(
            forall((N,), t.Implies(small, holds(K, N))), {"in.k": FunctionValue({(i,): True for i in range(3)}, False)}
        )
        is True
    )
    assert evaluate(forall((N,), t.Implies(small, holds(K, N))), {"in.k": FunctionValue({(0,): True}, False)}) is False
    i = bound("i", s.INTEGER)
    square = t.Arithmetic("*", i, i, s.INTEGER)
    open_below = exists((i,), t.And((t.Compare("<", i, t.Literal(3, s.INTEGER)), eq(square, t.Literal(4, s.INTEGER)))))
    assert evaluate(open_below, {}) is True


def test_fractional_bounds_of_an_integer() -> None:
    formula = exists((N,), t.And((t.Compare("<", t.Widen(N, s.REAL), real("1/2")), holds(K, N))))
    assert evaluate(formula, {"in.k": FunctionValue({(0,): True}, False)}) is True
    count = forall((N,), t.Implies(t.Compare("<=", t.Widen(N, s.REAL), real("5/2")), t.Compare("<=", N, nat(1))))
    assert evaluate(count, {}) is False


def test_naturals_are_not_negative() -> None:
    """n + 1 == 0 fixes n to -1, which is no natural number."""
    assert evaluate(exists((N,), eq(plus(N, nat(1)), nat(0))), {}) is False
    i = bound("i", s.INTEGER)
    assert evaluate(exists((i,), eq(plus(i, t.Literal(1, s.INTEGER)), t.Literal(0, s.INTEGER))), {}) is True


@pytest.mark.parametrize(
    ("sort", "made"),
    [
        (
            s.TupleSort((s.NATURAL, s.BOOL)),
            lambda i: t.TupleTerm((i, t.Literal(True, s.BOOL)), s.TupleSort((s.INTEGER, s.BOOL))),
        ),
        (s.SequenceSort(s.NATURAL), lambda i: t.SequenceTerm((i,), s.SequenceSort(s.INTEGER))),
    ],
)
def test_naturals_are_not_negative_within_other_values(sort: s.Sort, made: Callable[[t.Term], t.Term]) -> None:
    """``p == (in.i, TRUE)`` fixes a p of naturals to what may be no such value: the solver says the same."""
    i = given("i", s.INTEGER)
    formula = exists((bound("p", sort),), eq(bound("p", sort), made(i)))
    for value in (-1, 2):
        assert evaluate(formula, {"in.i": value}) is (value >= 0)
        here = eq(i, t.Literal(value, s.INTEGER))
        assert entails({}, t.Implies(here, formula)).verdict is (Verdict.PROVED if value >= 0 else Verdict.REFUTED)


def test_a_value_of_an_algebraic_type_belongs_to_it_with_all_its_parts() -> None:
    test = member_of(COMMAND, {})
    assert test is not None
    assert [test(Data("inspect", (k,))) for k in (-1, 1)] == [False, True]
    assert test(Data("move", (Fraction(-1), Fraction(-1))))
    assert member_of(s.TupleSort((s.REAL, COLOUR)), {}) is None


def test_patterns_are_solved_for_their_variables() -> None:
    valuation: dict[str, Value] = {"in.c": Data("move", (Fraction(3), Fraction(4))), "in.p": points((3, 5))}
    moved = exists((X, Y), t.And((eq(C, t.Construct("move", (X, plus(Y, real(1))), COMMAND)), eq(Y, real(3)))))
    assert evaluate(moved, valuation) is True
    assert evaluate(exists((N,), eq(C, t.Construct("inspect", (N,), COMMAND))), valuation) is False
    order = exists((X, Y), holds(P, t.Arithmetic("-", X, Y, s.REAL), t.Arithmetic("+", X, X, s.REAL)))
    assert (
        evaluate(exists((Y,), exists((X,), t.And((eq(Y, real(5)), eq(t.Arithmetic("*", real(2), X, s.REAL), Y))))), {})
        is True
    )
    assert evaluate(order, valuation) is True
    assert evaluate(order, {"in.p": points()}) is False


def test_a_table_found_by_a_nested_existential() -> None:
    """The inner variable of a disjunct must not leak into the outer search."""
    inner = t.Or((exists((Y,), t.And((holds(P, X, Y), holds(Q, Y, X)))), eq(X, real(9))))
    formula = exists((X,), t.And((inner, holds(Q, X, X))))
    values: dict[str, Value] = {"in.p": points((1, 2), (3, 4)), "in.q": points((2, 1), (4, 3), (3, 3))}
    assert evaluate(formula, values) is True
    values["in.q"] = points((2, 1), (4, 3))
    assert evaluate(formula, values) is False


def test_same_names_in_sibling_quantifiers() -> None:
    formula = t.And((exists((X,), holds(P, X, X)), t.Not(exists((X,), holds(Q, X, X)))))
    assert evaluate(formula, {"in.p": points((1, 1)), "in.q": points()}) is True
    both = exists((Y,), t.And((exists((X,), holds(P, X, Y)), exists((X,), holds(Q, X, Y)))))
    assert evaluate(both, {"in.p": points((1, 5)), "in.q": points((2, 5))}) is True


@pytest.mark.parametrize(("spread", "expected"), [("1/2", True), ("51/100", False)])
def test_linear_existential_over_a_tables_points(spread: str, expected: bool) -> None:
    quarter = real("1/4")
    within = t.And(
        tuple(
            t.Compare("<=", low, high)
            for c, v in ((A, X), (B, Y))
            for low, high in ((t.Arithmetic("-", c, quarter, s.REAL), v), (v, t.Arithmetic("+", c, quarter, s.REAL)))
        )
    )
    formula = exists((A, B), forall((X, Y), t.Implies(holds(P, X, Y), within)))
    table = FunctionValue({(Fraction(0), Fraction(0)): True, (Fraction(spread), Fraction(0)): True}, False)
    assert evaluate(formula, {"in.p": table}) is expected
    assert evaluate(formula, {"in.p": points()}) is True
    assert judge(formula, {"in.p": FunctionValue({}, True)}) is False


def test_linear_never_guesses_an_unrestricted_inner_variable() -> None:
    """forall(x | a <= x) has no solution; trying a few x would find one."""
    formula = exists((A,), forall((X,), t.Compare("<=", A, X)))
    assert evaluate(formula, {}) is False
    shifted = exists((A,), forall((X,), t.Compare("<=", plus(A, real(1)), plus(X, real(2)))))
    assert evaluate(shifted, {}) is False


def test_sequences_and_sets() -> None:
    sequence = given("s", s.SequenceSort(s.INTEGER))
    values: dict[str, Value] = {"in.s": SequenceValue((3, 5))}
    assert evaluate(t.Index(sequence, nat(1), s.INTEGER), values) == 5
    assert evaluate(t.Length(sequence, s.NATURAL), values) == 2
    with pytest.raises(NotEvaluable, match="outside a sequence"):
        evaluate(t.Index(sequence, nat(2), s.INTEGER), values)
    i = bound("i", s.INTEGER)
    assert (
        evaluate(forall((i,), t.Implies(t.In(i, sequence), t.Compare(">", i, t.Literal(2, s.INTEGER)))), values) is True
    )
    assert (
        evaluate(
            eq(
                t.SequenceRange(nat(2), nat(4), s.SequenceSort(s.NATURAL)),
                t.SequenceTerm((nat(2), nat(3), nat(4)), s.SequenceSort(s.NATURAL)),
            ),
            {},
        )
        is True
    )
    assert evaluate(t.SequenceRange(nat(2), nat(1), s.SequenceSort(s.NATURAL)), {}) == SequenceValue(())
    colour = given("r", COLOUR)
    dangerous = t.SetTerm((t.EnumValue("red", COLOUR), t.EnumValue("orange", COLOUR)), s.SetSort(COLOUR))
    assert evaluate(t.In(colour, dangerous), {"in.r": Element("red")}) is True
    assert evaluate(t.In(colour, dangerous), {"in.r": Element("green")}) is False
    assert (
        evaluate(
            exists((N,), t.And((t.In(N, t.SequenceRange(nat(4), nat(6), s.SequenceSort(s.NATURAL))), holds(K, N)))),
            {"in.k": FunctionValue({(6,): True}, False)},
        )
        is True
    )


def test_undefined_parts_matter_only_where_they_decide() -> None:
    broken = t.Compare(">", t.Arithmetic("/", real(1), real(0), s.REAL), real(0))
    with pytest.raises(NotEvaluable, match="division by zero"):
        evaluate(broken, {})
    false, true = eq(real(0), real(1)), eq(real(1), real(1))
    assert evaluate(t.And((broken, false)), {}) is False
    assert evaluate(t.Or((broken, true)), {}) is True
    assert evaluate(t.Implies(broken, true), {}) is True
    with pytest.raises(NotEvaluable):
        evaluate(t.And((broken, true)), {})
    found = exists((X,), t.And((holds(P, X, X), t.Compare("==", t.Arithmetic("/", real(6), X, s.REAL), real(2)))))
    assert evaluate(found, {"in.p": points((0, 0), (3, 3))}) is True
    with pytest.raises(NotEvaluable):
        evaluate(found, {"in.p": points((0, 0))})


def test_candidates_that_cannot_be_enumerated_are_not_forgotten() -> None:
    """0 * y == 0 holds of every y: inside a disjunction too, that must not look like no candidate at all."""
    product = eq(t.Arithmetic("*", real(0), Y, s.REAL), real(0))
    formula = exists(
        (Y,), t.And((t.Or((t.And((product, t.Compare("!=", Y, Y))), t.And((product, holds(P, Y, Y))))), holds(Q, Y, Y)))
    )
    agreed: dict[str, Value] = {"in.p": points((1, 1)), "in.q": points((1, 1))}
    assert evaluate(formula, agreed) is True
    hidden = exists(
        (Y,), t.And((t.Or((product, eq(Y, real(7)))), t.Compare(">", t.Arithmetic("*", Y, Y, s.REAL), real(50))))
    )
    with pytest.raises(NotEvaluable):
        evaluate(hidden, {})
    assert judge(hidden, {}) is True


def test_missing_values_and_unspecified_sorts_are_refused() -> None:
    with pytest.raises(NotEvaluable, match=r"in\.p has no value"):
        evaluate(exists((X,), holds(P, X, X)), {})
    z = bound("z", s.OpaqueSort("Sensors"))
    with pytest.raises(NotEvaluable):
        evaluate(forall((z,), eq(z, z)), {})
    with pytest.raises(NotEvaluable, match="nothing restricts z"):
        evaluate(exists((z, X), t.And((t.Compare("<", X, real(1)), eq(z, z)))), {})


def test_what_nothing_restricts_is_asked_of_the_solver() -> None:
    assert evaluate(forall((X,), t.Compare(">", t.Arithmetic("*", X, X, s.REAL), real(-1))), {}) is True
    table = {"in.k": FunctionValue({(0,): True}, False)}
    assert evaluate(exists((N, X), t.And((t.Compare("<", X, real(0)), holds(K, N)))), table) is True


def test_domains_bound_the_quantifiers() -> None:
    formula = forall((N,), holds(K, N))
    table: dict[str, Value] = {"in.k": FunctionValue({(0,): True, (1,): True}, False)}
    assert evaluate(formula, table) is False
    assert evaluate(formula, table, domains={s.NATURAL: (0, 1)}) is True
    inside = exists((N,), holds(K, N))
    assert evaluate(inside, table, domains={s.NATURAL: (2, 3)}) is False


def test_strings_have_more_values_than_are_named() -> None:
    string = bound("s", s.STRING)
    named = given("t", s.STRING)
    assert evaluate(exists((string,), t.Compare("!=", string, named)), {"in.t": "x"}) is True
    assert evaluate(forall((string,), eq(string, named)), {"in.t": "x"}) is False


def test_deep_nesting_is_an_answer_not_a_crash() -> None:
    term: t.Term = eq(real(1), real(1))
    for _ in range(200_000):
        term = t.Not(term)
    with pytest.raises(NotEvaluable, match="too deeply"):
        compile_term(term)


def test_all_values_of_a_finite_sort() -> None:
    pairs = finite_values(s.TupleSort((COLOUR, s.BOOL)))
    assert pairs is not None
    assert len(set(pairs)) == 2 * len(COLOUR.members)
    assert finite_values(s.TupleSort((COLOUR, s.REAL))) is None


def test_negative_and_widen() -> None:
    i = given("i", s.INTEGER)
    assert evaluate(t.Negative(i, s.INTEGER), {"in.i": 3}) == -3
    assert evaluate(t.Arithmetic("/", t.Widen(i, s.REAL), real(2), s.REAL), {"in.i": 3}) == Fraction(3, 2)
