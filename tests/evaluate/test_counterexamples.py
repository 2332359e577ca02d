"""The values that make a claim about all values false, and the names that a valuation has to hold."""

from __future__ import annotations

import pytest

from avow.evaluation.evaluate import NotEvaluable, compile_counterexample, free_names
from avow.formulas.values import FunctionValue
from avow.language.sorts import NATURAL
from avow.language.terms import And, Compare, Implies, Not

from .terms import K, M, N, P, X, eq, exists, forall, given, holds, nat, unique


def test_a_counterexample_has_the_names_of_the_formula() -> None:
    below = Compare("<", N, given("n", NATURAL))
    find = compile_counterexample(forall((N, M), Implies(And((below, holds(K, M))), Compare("<", N, M))))
    table = FunctionValue({(1,): True}, False)
    found = find({"in.n": 2, "in.k": table})
    assert found == {"n": 1, "m": 1}
    assert list(found) == ["n", "m"]
    assert find({"in.n": 1, "in.k": table}) is None
    with pytest.raises(NotEvaluable, match=r"in\.n has no value"):
        find({"in.k": table})


def test_only_a_claim_about_all_values_has_a_counterexample() -> None:
    never = And((Compare("<", N, nat(3)), Compare(">", N, nat(5))))
    for other in (exists((N,), never), unique((N,), never), Not(exists((N,), Not(never)))):
        assert compile_counterexample(other)({}) is None
    assert compile_counterexample(forall((N,), Not(Compare("<", N, nat(1)))))({}) == {"n": 0}


def test_the_names_that_a_valuation_has_to_hold() -> None:
    """A bound name that is free elsewhere in the formula is one of them."""
    formula = And((exists((N,), And((holds(K, N), holds(P, X, X)))), eq(N, given("n", NATURAL))))
    assert free_names(formula) == {"in.k", "in.p", "x", "n", "in.n"}
    assert free_names(exists((N,), eq(N, nat(1)))) == frozenset()
