"""The paper's derivations, by name, on its contracts as published and as repaired."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.calculus.derivation import LoopForm, Rule
from avow.calculus.notation import write_goal

from .case_study import PUBLISHED, PUBLISHED_DELAYED, REPAIRED, SCENARIO
from .make import case_study, outcomes, settled


def test_d1_of_the_repaired_system(tmp_path: Path) -> None:
    composition, answers = settled(case_study(tmp_path, "remote_inspection", REPAIRED), "D1")
    root = answers.goal.root
    assert root.rule is Rule.R3
    assert root.nodes == ("navigation", "radiationSensor", "agent")
    assert answers.verdict is Verdict.PROVED
    by_clause = {condition.clause: answer for condition, answer in answers.settled.items()}
    assert by_clause["one_waypoint"].used == ("navigation",)
    assert by_clause["one_waypoint"].needed == ("navigation.somewhere", "environment in.wayP")
    assert by_clause["exit_known"].trivial
    assert by_clause["exit_known"].needed == ("environment in.wayP",)
    assert "agent.wayP (environment)" in root.outside, "i_A = o_N ∪ o_R holds only up to wayP: say so"
    assert {str(name) for name in root.assumed} == {
        "navigation.one_position",
        "navigation.was_somewhere",
        "radiationSensor.reading",
    }
    assert composition.goal("line").root.rule is Rule.R1


def test_d1_as_published_holds_by_typing_alone(tmp_path: Path) -> None:
    _, answers = settled(case_study(tmp_path, "remote_inspection_published", PUBLISHED), "D1")
    (answer,) = answers.settled.values()
    assert answer.verdict is Verdict.PROVED
    assert answer.trivial
    assert answer.needed == ()
    found = outcomes(case_study(tmp_path, "remote_inspection_published", PUBLISHED))
    assert "no guarantee carries it" in found["D1.agent.A1"].summary


def test_the_published_loops_never_start_and_are_degenerate(tmp_path: Path) -> None:
    found = outcomes(case_study(tmp_path, "remote_inspection_published", PUBLISHED))
    start = found["start.agent-navigation-radiationSensor"]
    assert start.verdict is Verdict.REFUTED
    assert "agent → navigation → agent" in start.summary
    assert found["joint.agent.G2"].verdict is Verdict.REFUTED, "a robot that inspects is nowhere"
    assert "navigation.G1" in found["joint.agent.G2"].summary
    assert found["joint.agent.G1"].verdict is Verdict.PROVED
    assert found["D1.persistence"].verdict is Verdict.JUSTIFIED
    assert found["D1.one-output"].verdict is Verdict.UNKNOWN, "conditional until the plan says why"
    assert found["environment.radiationSensor.A1"].verdict is Verdict.UNKNOWN, "nobody says why 0 <= r"


@pytest.mark.nightly
def test_the_repaired_loop_stands_by_its_initial_values(tmp_path: Path) -> None:
    _, answers = settled(case_study(tmp_path, "remote_inspection", REPAIRED))
    assert answers.verdict is Verdict.PROVED
    (loop,) = answers.loops
    assert loop.form is LoopForm.INITIAL
    assert set(loop.members) == {"navigation", "agent", "radiationSensor"}
    clause = {str(condition.about): answer for condition, answer in answers.settled.items()}
    assert clause["navigation.was_somewhere"].used_before == ("navigation",)
    assert answers.goal.root.assumed == ()


@pytest.mark.nightly
def test_an_initial_value_that_breaks_the_assumption_is_found(tmp_path: Path) -> None:
    plan = REPAIRED.replace(
        "exists(a, b in REAL | forall(x, y in REAL | out.at(x, y) <=> (x == a and y == b)))",
        "out.at(0, 0) and out.at(9, 9)",
    )
    assert plan != REPAIRED
    _, answers = settled(case_study(tmp_path, "remote_inspection", plan), milliseconds=250)
    clause = {str(condition.about): answer for condition, answer in answers.settled.items()}
    assert clause["navigation.was_somewhere"].verdict is not Verdict.PROVED
    assert answers.verdict is not Verdict.PROVED


@pytest.mark.nightly
def test_waypoints_too_close_are_found_at_the_hair(tmp_path: Path) -> None:
    """With the tolerance of ±0.25 m, 0.5 m apart is too close and anything above is not."""
    just_enough = case_study(tmp_path, "remote_inspection", REPAIRED)
    assert settled(just_enough, "D1")[1].verdict is Verdict.PROVED
    closer = REPAIRED.replace("-0.5 <= x - x' <= 0.5", "-0.49 <= x - x' <= 0.49")
    _, answers = settled(case_study(tmp_path, "remote_inspection", closer), "D1", 6_000)
    clause = {condition.clause: answer for condition, answer in answers.settled.items()}
    assert clause["one_waypoint"].verdict is Verdict.REFUTED
    shown = clause["one_waypoint"].cases[0].counterexample
    assert shown is not None
    assert dict(shown.values).keys() >= {"navigation.at", "in.wayP"}


@pytest.mark.nightly
def test_requirements(tmp_path: Path) -> None:
    found = outcomes(case_study(tmp_path, "remote_inspection", REPAIRED + SCENARIO))
    assert "REQ1" not in found, "prose is linked, not settled"
    assert found["REQ3"].verdict is Verdict.PROVED
    behind = {h.name for h in found["REQ3"].rests_on}
    assert "agent/guarantee/abandon" in behind
    assert "system/composition/whole.agent.exit_known" in behind, "under the agent's assumptions"
    for name in ("REQ4", "STAYS_ENDED"):  # the first command is some move; not every one is tried
        assert found[name].verdict is Verdict.TESTED
        assert "before the first step agent.command may have other values" in found[name].summary
    wrong = found["TOO_MUCH"]
    assert wrong.verdict is Verdict.REFUTED
    assert wrong.counterexample is not None
    assert wrong.counterexample.trace
    assert wrong.counterexample.loop is not None
    assert any(("agent.phase", "leaving") in step for step in wrong.counterexample.trace)


def test_req4_fails_for_the_published_contracts(tmp_path: Path) -> None:
    stuck = outcomes(case_study(tmp_path, "remote_inspection_published", PUBLISHED_DELAYED))["REQ4"]
    assert stuck.verdict is Verdict.REFUTED
    assert stuck.counterexample is not None
    assert stuck.counterexample.trace
    never = outcomes(
        case_study(
            tmp_path,
            "remote_inspection_published",
            PUBLISHED_DELAYED.split("connections:")[0] + "scenario:" + PUBLISHED_DELAYED.split("scenario:")[1],
        )
    )
    assert never["REQ4"].verdict is Verdict.REFUTED
    assert "start-up deadlock" in never["REQ4"].summary


def test_d1_is_written_as_the_paper_writes_it(tmp_path: Path) -> None:
    composition = compose(case_study(tmp_path, "remote_inspection", REPAIRED))
    written = write_goal(composition.goal("D1"))
    lines = written.text.splitlines()
    assert lines[0] == "R3 (D1)"
    assert lines[1] == "∀ i_navigation, o_navigation · 𝒜_navigation(i_navigation) ⇒ ◇𝒢_navigation(o_navigation)"
    assert lines[4].startswith("i_agent = o_navigation ∪ o_radiationSensor ")
    assert lines[5].startswith(
        "⊢ (𝒢_navigation(o_navigation) ∧ 𝒢_radiationSensor(o_radiationSensor) ⇒ 𝒜_agent(i_agent))"
    )
    assert set(lines[6]) == {"─"}
    assert written.conclusion == (
        "∀ i_navigation, i_radiationSensor, o_agent · 𝒜_navigation(i_navigation) ∧ "
        "𝒜_radiationSensor(i_radiationSensor) ⇒ ◇𝒢_agent(o_agent)"
    )
    assert written.premises == ("navigation", "radiationSensor", "agent")
    assert "system/composition/D1.persistence" in written.conditional


@pytest.mark.slow
def test_req1_as_the_paper_words_it_is_refuted(tmp_path: Path) -> None:
    """Between orange and red the repaired contracts leave; the paper's sentence has the robot inspect."""
    paper = """
requirements:
  REQ1:
    text: The robot should inspect each waypoint as long as the radiation level at a waypoint is not high ("red").
    formula: >-
      forall(x, y in REAL, i in NATURAL |
        (navigation.at(x, y) and agent.wayP(x, y, i) and radiationSensor.r < 250 and agent.in.phase == exploring) ->
          (radiationSensor.inspected(i) or agent.command == inspect(i)))
"""
    plan = REPAIRED.partition("\nrequirements:")[0] + paper
    found = outcomes(case_study(tmp_path, "remote_inspection", plan))["REQ1"]
    assert found.verdict is Verdict.REFUTED, found.summary
    assert found.counterexample is not None
    run = found.counterexample.trace or (found.counterexample.values,)
    readings = [float(value) for step in run for name, value in step if name.endswith((".r", "in.r"))]
    assert any(120 <= reading < 250 for reading in readings), found.counterexample
