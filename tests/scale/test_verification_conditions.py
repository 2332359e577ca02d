"""What a verification condition costs, against Z3 alone; and that the cheap question says what the whole one says."""

from __future__ import annotations

from pathlib import Path

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backend_kit.protocol import Job, Limits, Report
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, negation
from avow.language.sorts import INTEGER
from avow.language.terms import Arithmetic, Compare, Implies, Literal, Quantified, Quantifier, Role, Term, Variable
from avow.pipeline.methods import method_backend
from avow.pipeline.work import catalogue
from avow.solving.questions import entails
from avow.solving.settling import Settler
from avow.system.load import load_system

from .made import programs, seconds


def jobs(folder: Path) -> list[Job]:
    works = [work for work in catalogue(load_system(folder)).works if work.engine == "hoare"]
    return [work.planned[1] for work in works if work.planned is not None]


@pytest.mark.nightly
def test_a_condition_takes_three_checks_and_little_more_than_z3_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside Z3's time: the program's parsing, the triples, two questions whether a triple says anything at all."""
    monkeypatch.setattr("avow.backends.hoare.backend.contradicted", lambda *_, **__: False)  # cvc5 is another time
    found = jobs(programs(tmp_path, 3, 12))
    backend = method_backend(found[0].system, found[0].method)
    asked: list[object] = []
    check = z3.Solver.check
    monkeypatch.setattr(z3.Solver, "check", lambda *all_: (asked.append(1), check(*all_))[1])
    reports: list[Report] = []

    def ours() -> None:
        reports[:] = [backend.discharge(job, tmp_path, Limits()) for job in found]

    scripts = [text for job in found for name, text in backend.export(job).items() if name.endswith(".smt2")]

    def alone() -> None:
        for script in scripts:
            solver = z3.Solver()
            solver.from_string(script)
            assert solver.check() == z3.unsat

    ours()
    outcomes = [o for report in reports for o in report.outcomes]
    assert {o.verdict for o in outcomes} == {Verdict.PROVED}
    assert len(asked) <= 3.2 * len(outcomes)
    mine, z3s = seconds(ours, alone)
    assert mine <= 6 * z3s


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
