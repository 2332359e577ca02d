"""The cheap question about a verification condition says what the whole one says."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, negation
from avow.language.sorts import INTEGER
from avow.language.terms import Arithmetic, Compare, Implies, Literal, Quantified, Quantifier, Role, Term, Variable
from avow.solving.questions import entails
from avow.solving.settling import Settler


def variables() -> st.SearchStrategy[Term]:
    return st.sampled_from([Variable(Role.BOUND, name, INTEGER) for name in "xyz"])


def numbers() -> st.SearchStrategy[Term]:
    literals = st.integers(-3, 3).map(lambda n: Literal(n, INTEGER))
    atoms = variables() | literals
    return atoms | st.builds(lambda a, b, o: Arithmetic(o, a, b, INTEGER), atoms, atoms, st.sampled_from("+-*"))


def formulas() -> st.SearchStrategy[Term]:
    plain = st.builds(Compare, st.sampled_from(["<=", "<", "=="]), numbers(), numbers())
    return st.recursive(
        plain,
        lambda inner: st.one_of(
            st.builds(lambda a, b: conjunction((a, b)), inner, inner),
            st.builds(Implies, inner, inner),
            st.builds(negation, inner),
            st.builds(lambda v, b: Quantified(Quantifier.EXISTS, (v,), b), variables(), inner),
        ),
        max_leaves=5,
    )


@pytest.mark.nightly
@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.lists(formulas(), max_size=3), formulas()), min_size=1, max_size=4))
def test_one_solver_for_many_questions_says_what_the_whole_question_says(asked: list[tuple[list[Term], Term]]) -> None:
    settler = Settler()
    for hypotheses, goal in asked:
        said = settler.settles(hypotheses, goal, effort=300)
        whole = entails(hypotheses, goal, effort=300).verdict
        assert said != "unsat" or whole is not Verdict.REFUTED
        assert said != "sat" or whole is not Verdict.PROVED


def test_where_operations_are_partial_the_whole_question_is_asked() -> None:
    x = Variable(Role.BOUND, "x", INTEGER)
    divided = Compare("==", Arithmetic("/", x, x, INTEGER), Literal(1, INTEGER))
    assert Settler().settles([], divided, effort=300) == "unknown"
    assert not Settler().proves([], divided, effort=300)
