"""Which of finitely many values of some ports make an entailment hold: the weakest condition, as a set of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product

from avow.base.tuning.bounds import VALUES_TRIED
from avow.base.verdict import Verdict
from avow.evaluation.evaluate import finite_values
from avow.formulas.formula import conjunction, disjunction, free_variables, substitute
from avow.formulas.written import value_term
from avow.language.sorts import SetSort
from avow.language.terms import Compare, In, Not, SetTerm, Term, Variable
from avow.solving.questions import entails, solve


def enumerated(
    known: Mapping[str, Term], goal: Term, ports: Sequence[Variable], effort: int
) -> tuple[Term, bool] | None:
    """A condition on some of the ports with which the goal follows, and whether it is the weakest. None where there is
    none, or where they have too many values."""
    spoken = free_variables(goal).union(*map(free_variables, known.values()))
    finite = [(v, values) for v in ports if v in spoken and (values := finite_values(v.sort))]
    # A relation's values are as finite as its points, and a question each: only what can be written as a set is tried.
    if not finite or math.prod(len(values) for _, values in finite) > VALUES_TRIED:
        return None
    good: list[tuple[Term, ...]] = []
    bad: list[tuple[Term, ...]] = []
    possible = sure = True
    for choice in product(*(values for _, values in finite)):
        terms = tuple(value_term(value, v.sort) for (v, _), value in zip(finite, choice, strict=True))
        given = {v: term for (v, _), term in zip(finite, terms, strict=True)}
        facts = {label: substitute(term, given) for label, term in known.items()}
        verdict = entails(facts, substitute(goal, given), effort=effort).verdict
        (good if verdict is Verdict.PROVED else bad).append(terms)
        sure = sure and verdict is not Verdict.UNKNOWN
    variables = [v for v, _ in finite]
    if not good or not bad:
        return None
    found = Not(_one_of(variables, bad)) if len(bad) < len(good) else _one_of(variables, good)
    together = {**known, "the condition": found}
    possible = solve(together, effort=effort).status == "sat"
    if not possible or entails(together, goal, effort=effort).verdict is not Verdict.PROVED:
        return None
    return found, sure and frozenset(variables) >= spoken & frozenset(ports)


def _one_of(variables: Sequence[Variable], choices: Sequence[tuple[Term, ...]]) -> Term:
    if len(variables) == 1:
        [variable] = variables
        options = [option for (option,) in choices]
        if len(options) == 1:
            return Compare("==", variable, options[0])
        return In(variable, SetTerm(tuple(options), SetSort(variable.sort)))
    return disjunction(
        conjunction(Compare("==", v, term) for v, term in zip(variables, choice, strict=True)) for choice in choices
    )
