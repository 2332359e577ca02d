"""The exported text asks the same question: two solvers that read it agree with the answer that Avow got."""

from __future__ import annotations

import pytest
import z3
from drawn.contracts import finite_formulas
from helpers import some
from hypothesis import HealthCheck, given, settings

from avow.formulas.formula import negation
from avow.language.sorts import NATURAL, REAL, STRING, SequenceSort
from avow.language.terms import Compare, Length, Literal, Not, Role, Term, Variable
from avow.solving.apart import Apart
from avow.solving.questions import solve
from avow.solving.smtlib import ask_cvc5, formulas_script

from .contracts import case_study
from .test_smt import FALSE_SOMEWHERE, TRUE_ALWAYS, say

LINEAR = [pair for pair in TRUE_ALWAYS + FALSE_SOMEWHERE if "in.r *" not in pair[0]]


def ask_z3(script: str) -> str:
    solver = z3.Solver(ctx=z3.Context())
    solver.set("timeout", 5_000)
    solver.from_string(script)
    return str(solver.check())


@pytest.mark.needs_cvc5
@pytest.mark.parametrize(("hypothesis", "goal"), some(LINEAR, 10))
def test_both_solvers_read_it_and_agree(hypothesis: str, goal: str) -> None:
    question = {"hypothesis": say(hypothesis), "goal": negation(say(goal))}
    script = formulas_script(question, comment=f"{hypothesis} |- {goal}\n(check-sat)")
    expected = "unsat" if (hypothesis, goal) in TRUE_ALWAYS else "sat"
    assert ask_z3(script) in {expected, "unknown"}
    answer = ask_cvc5(script, effort=5_000)
    assert answer in {expected, "unknown"}, "cvc5 must be able to read it, and must not contradict"
    if expected == "unsat":
        assert answer == "unsat"


@pytest.mark.nightly
@pytest.mark.needs_cvc5
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(finite_formulas())
def test_cvc5_never_contradicts_z3(term: Term) -> None:
    answer = solve([term], effort=10_000).status
    other = ask_cvc5(formulas_script([term]), effort=5_000)
    assert other in {answer, "unknown"}


@pytest.mark.nightly
@pytest.mark.needs_cvc5
@pytest.mark.parametrize("system", ["remote_inspection", "remote_inspection_published"])
def test_the_case_study_s_clauses_export(system: str) -> None:
    for node in case_study(system).nodes:
        script = formulas_script({clause.name: clause.formula for clause in node.clauses}, comment=node.name)
        assert ask_z3(script) != "unsat"
        assert ask_cvc5(script, effort=500) in {"sat", "unknown"}
        assert all(f"|clause {clause.name}|" in script for clause in node.clauses)


@pytest.mark.parametrize("text", ["a|b\\c\n(exit)", "x'", ") (assert false"])
def test_labels_and_comments_are_data(text: str) -> None:
    s = Variable(Role.INPUT, "s'", STRING)
    script = formulas_script({text: Compare("==", s, Literal(text, STRING))}, comment=text)
    assert ask_z3(script) == "sat"
    both = {text: Compare("==", s, Literal(text, STRING)), "other": Not(Compare("==", s, Literal(text, STRING)))}
    assert ask_z3(formulas_script(both)) == "unsat"


def test_the_same_question_gives_the_same_text() -> None:
    node = case_study("remote_inspection").node("agent")
    clauses = {clause.name: clause.formula for clause in node.clauses}
    assert formulas_script(clauses) == formulas_script(clauses)


def test_a_missing_or_puzzled_cvc5_says_nothing() -> None:
    assert ask_cvc5("(this is no script") is None


def test_scripts_with_sequences_say_how_cvc5_reads_them() -> None:
    reals = Variable(Role.INPUT, "s", SequenceSort(REAL))
    long = Compare("<", Literal(0, NATURAL), Length(reals, NATURAL))
    assert formulas_script([long]).startswith("; cvc5 reads sequences with --strings-exp\n")
    assert "strings-exp" not in formulas_script([say("in.r < 3")])


@pytest.mark.slow
def test_a_cvc5_that_does_not_keep_its_time_limit_is_ended() -> None:
    """On some scripts it does not look at its clock; nothing but the end of its process ends it."""
    pytest.importorskip("cvc5")
    script, solver = "(set-logic ALL)\n(check-sat)\n", Apart("cvc5")
    with pytest.raises(TimeoutError):
        solver.ask(script, 100_000, 0.0)  # its process has not even started
    assert solver.ask(script, 100_000, 60.0)[0] == "sat"
    solver.close()
