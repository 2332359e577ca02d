"""What a claim is answered does not depend on which others are asked, before it or at all."""

from __future__ import annotations

from random import Random

import pytest
from drawn.contracts import small_contract
from helpers import some

from avow.base.tuning.effort import STEPS
from avow.language.contract import Node
from avow.language.load import check_text
from avow.language.sorts import BOOL, INTEGER, TupleSort
from avow.language.terms import And, Compare, Role, Term, Variable
from avow.sanity.analysis import analyse
from avow.sanity.claims import claims
from avow.sanity.results import Bounds, SanityResult
from avow.solving.limits import spent
from avow.solving.questions import Solution, solve
from avow.solving.translation import translating_once


def generated(seed: int) -> Node:
    """Of the first text that is a contract: not each that is drawn is one."""
    drawn = (check_text(small_contract(seed + 1000 * more), "test.rcl")[0] for more in range(20))
    return next(found for found in drawn if found is not None).nodes[0]


def said(result: SanityResult) -> object:
    return result.name, result.verdict, result.clauses, result.counterexample, result.explanation, result.because


@pytest.mark.parametrize("seed", some(range(40), 0, 3))
def test_claims_are_answered_alike_whichever_are_wanted(seed: int) -> None:
    node = generated(seed)
    bounds = Bounds(60)
    whole = {result.name: said(result) for result in analyse(node, bounds=bounds)}
    names = [claim.name for claim in claims(node)]
    for count in (1, len(names) // 3):
        wanted = Random(seed).sample(names, count)
        assert {r.name: said(r) for r in analyse(node, bounds=bounds, wanted=wanted)} == {n: whole[n] for n in wanted}


def answered(asked: dict[str, Term]) -> tuple[Solution, int]:
    """And the steps that it took."""
    start = spent()
    answer = solve(asked, effort=300)
    return Solution(answer.status, answer.values, answer.core, answer.reason, answer.engine), round(
        (spent() - start) * STEPS
    )


@pytest.mark.parametrize("seed", some(range(40), 3, 8))
def test_a_question_takes_the_same_steps_whatever_was_translated_before(seed: int) -> None:
    """In any order, and alone: the same answer with the same values, and the same effort."""
    node = generated(seed)
    clauses = [(clause.name, clause.formula) for clause in node.clauses]
    questions = [dict(clauses), *({name: formula} for name, formula in clauses), dict(clauses[:2])]
    apart = []
    for asked in questions:
        with translating_once():
            apart.append(answered(asked))
    order = list(range(len(questions)))
    for _ in range(2):
        Random(seed).shuffle(order)
        with translating_once():
            found = {k: answered(questions[k]) for k in order}
        assert [found[k] for k in range(len(questions))] == apart


def test_sorts_of_one_name_stay_apart() -> None:
    """Z3 knows sorts by their names, and tuples of any kind are called alike."""
    one, other = TupleSort((INTEGER, BOOL)), TupleSort((BOOL, BOOL))
    a, b = (Variable(Role.INPUT, name, one) for name in "ab")
    c, d = (Variable(Role.INPUT, name, other) for name in "cd")
    first, second = Compare("==", a, b), Compare("!=", c, d)
    with translating_once():
        assert solve([first]).status == solve([second]).status == solve([first, second]).status == "sat"
        assert solve([second, first, Compare("==", c, d)]).status == "unsat"
        assert solve([And((first, second)), Compare("!=", a, b)]).status == "unsat"
