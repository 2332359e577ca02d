"""The translation, satisfiability, entailment and realizability against enumeration of everything there is."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from drawn.contracts import FUNCTION_OUTPUT, INPUTS, OUTPUTS, finite_formulas
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracle.domains import domain, plain, situations
from reference.meaning import Step, holds

from avow.base.verdict import Verdict
from avow.formulas.formula import digest, free_variables, normalise
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.values import Element, FunctionValue, Value
from avow.language.terms import Not, Term, Variable
from avow.sanity.realizability import realizable
from avow.solving.questions import entails, solve
from avow.solving.replay import replay

few = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


def named(values: Mapping[Variable, Value]) -> Step:
    """A solver's values in the oracle's terms."""
    return {variable.qualified: plain(value) for variable, value in values.items()}


def as_value(value: object) -> Value:
    if isinstance(value, dict):
        return FunctionValue({tuple(map(as_value, k)): as_value(v) for k, v in value.items()}, False)
    if isinstance(value, str):
        return Element(value)
    assert isinstance(value, bool)
    return value


@few
@given(finite_formulas())
def test_satisfiability_is_right_and_models_are_models(term: Term) -> None:
    free = tuple(sorted(free_variables(term), key=lambda v: v.qualified))
    expected = any(holds(term, s) for s in situations(free))
    answer = solve([term], effort=20_000)
    assert answer.status == ("sat" if expected else "unsat")
    if expected:
        assert holds(term, named(answer.values)) is True


@few
@given(finite_formulas(), finite_formulas())
def test_entailment_is_right(left: Term, right: Term) -> None:
    free = tuple(sorted(free_variables(left) | free_variables(right), key=lambda v: v.qualified))
    expected = all(holds(right, s) for s in situations(free) if holds(left, s))
    answer = entails({"H": left}, right, effort=20_000)
    assert answer.verdict is (Verdict.PROVED if expected else Verdict.REFUTED)
    if not expected:
        values = {**{v: as_value(domain(v.sort)[0]) for v in free}, **answer.values}
        assert holds(left, named(values)) is True
        assert holds(right, named(values)) is False


@few
@given(finite_formulas(), st.data())
def test_replay_agrees_with_evaluation(term: Term, data: st.DataObject) -> None:
    free = tuple(sorted(free_variables(term), key=lambda v: v.qualified))
    situation = data.draw(st.sampled_from(situations(free)))
    assert replay([term], {v: as_value(situation[v.qualified]) for v in free}) is holds(term, situation)


@few
@given(finite_formulas())
def test_normal_forms_keep_the_meaning(term: Term) -> None:
    free = tuple(sorted(free_variables(term), key=lambda v: v.qualified))
    for form in (normalise(term), push_negations(term)):
        assert free_variables(form) <= set(free)
        assert all(holds(term, s) == holds(form, s) for s in situations(free))
    assert digest(normalise(term)) == digest(term)
    assert digest(Not(term)) != digest(term)


@pytest.mark.parametrize(
    "outputs",
    [OUTPUTS, pytest.param((*OUTPUTS, FUNCTION_OUTPUT), marks=pytest.mark.nightly)],
    ids=["scalars", "with a function"],
)
def test_realizability_is_right(outputs: tuple[Variable, ...]) -> None:
    verdicts: list[Verdict] = []

    @settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
    @given(finite_formulas(INPUTS), st.lists(finite_formulas(INPUTS + outputs), min_size=1, max_size=3))
    def check(assumption: Term, guarantees: list[Term]) -> None:
        def met(inputs: Step) -> bool:
            return any(all(holds(g, {**inputs, **out}) for g in guarantees) for out in situations(outputs))

        allowed = [inputs for inputs in situations(INPUTS) if holds(assumption, inputs)]
        expected = all(met(inputs) for inputs in allowed)
        labelled = {f"G{k}": g for k, g in enumerate(guarantees)}
        answer = realizable(INPUTS, outputs, {"A": assumption}, labelled, effort=20_000)
        verdicts.append(answer.verdict)
        assert answer.verdict in {Verdict.PROVED if expected else Verdict.REFUTED, Verdict.UNKNOWN}
        if answer.verdict is Verdict.REFUTED:
            inputs = named({v: as_value(domain(v.sort)[0]) for v in INPUTS} | dict(answer.inputs))
            assert holds(assumption, inputs)
            assert not met(inputs)

    check()
    assert verdicts.count(Verdict.UNKNOWN) <= len(verdicts) // 10, "too much is left open"
    assert Verdict.PROVED in verdicts
    assert Verdict.REFUTED in verdicts
