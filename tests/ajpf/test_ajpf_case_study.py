"""The rover's agents: what holds of the repaired one, what fails of the published one, and that faults are caught."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
import yaml

from avow.backend_kit.protocol import Limits, Report
from avow.backends.ajpf import BACKEND
from avow.base.verdict import Outcome, Verdict

REPAIRED = ("remote_inspection", "repaired_method.yaml")
PUBLISHED = ("remote_inspection_published", "published_method.yaml")


def settle(job, tmp_path: Path) -> dict[str, Outcome]:
    report: Report = BACKEND.discharge(job, tmp_path, Limits(seconds=120))
    return {outcome.obligation.rpartition("/")[2]: outcome for outcome in report.outcomes}


@pytest.mark.parametrize("semantics", [pytest.param("mcapl", marks=pytest.mark.slow), "edge"])
def test_the_repaired_agent_meets_every_guarantee_and_not_for_nothing(rover, tmp_path, semantics):
    job = rover(*REPAIRED, {"semantics": semantics})
    assert BACKEND.check(job) == ()
    outcomes = settle(job, tmp_path)
    assert set(outcomes) == {"next_waypoint", "inspect_here", "exit_on_danger", "abandon", "end_of_mission"}
    for outcome in outcomes.values():
        assert outcome.verdict is Verdict.CHECKED, outcome.summary
        assert not outcome.vacuous
        assert all(not entry["vacuous"] for entry in outcome.details["properties"])
        assert "AJPF" not in outcome.summary
        assert semantics in outcome.summary
    instances = [entry["instance"] for entry in outcomes["next_waypoint"].details["properties"]]
    assert instances == [f"i = {i}" for i in range(1, 13)]


def test_the_scenario_decides_where_the_route_ends(rover):
    job = rover(*REPAIRED)
    text = BACKEND.export(job)["jackal.psl"]
    goals = dict(re.findall(r"^(next_waypoint_\d+): .*<> D\(jackal, move\((\d+), _, _, _\)\)", text, re.MULTILINE))
    assert goals == {f"next_waypoint_{i}": str(i + 1 if i < 12 else 0) for i in range(1, 13)}


@pytest.mark.slow
def test_the_order_in_which_percepts_are_taken_up_does_not_matter(rover, tmp_path):
    job = rover(*REPAIRED)
    path = job.root / "models" / "agent_environment.yaml"
    text = path.read_text()
    radiation, move = re.search(r"  radiation:.*\n", text)[0], re.search(r"  move:.*\n", text)[0]
    path.write_text(text.replace(radiation, "").replace(move, move + radiation))
    assert {outcome.verdict for outcome in settle(job, tmp_path).values()} == {Verdict.CHECKED}


FAULTS = {
    "a plan dropped": (
        lambda text: re.sub(r"\+danger_orange :.*?;\n", "", text, flags=re.DOTALL),
        {"exit_on_danger", "abandon"},
    ),
    "a wrong next location": (
        lambda text: text.replace("next_location(4, 5)", "next_location(4, 6)"),
        {"next_waypoint"},
    ),
    "danger ignored on arrival": (
        lambda text: text.replace(
            "+movebase_result(Id, 3) : { B going(L), ~B going(0), ", "+movebase_result(Id, 3) : { B going(L), "
        ).replace("{ ~B danger, ~B going(0), B location_coordinate(L,", "{ B location_coordinate(L,"),
        {"exit_on_danger"},
    ),
    "the inspection not noted": (
        lambda text: text.replace("inspect(L), +inspected(L), -going(L)", "inspect(L), -going(L)"),
        {"inspect_here"},
    ),
    "the old result believed on": (
        lambda text: text.replace("-movebase_result(Old, 3), +going(L)", "+going(L)"),
        {"inspect_here"},
    ),
    "the mission resumed": (
        lambda text: text + "\n-danger_red : { B going(0) } <- -going(0), +!visit(1) [perform];\n",
        {"abandon", "exit_on_danger"},
    ),
    "leaving too early": (
        lambda text: text.replace("next_location(7, 8)", "next_location(7, 0)"),
        {"next_waypoint", "end_of_mission"},
    ),
    "the wrong place inspected": (
        lambda text: text.replace("inspect(L), +inspected(L)", "inspect(Next), +inspected(L)"),
        {"inspect_here"},
    ),
}


MARKS = dict.fromkeys(FAULTS, (pytest.mark.slow,)) | {
    "leaving too early": (),
    "the mission resumed": (pytest.mark.nightly,),
    "danger ignored on arrival": (pytest.mark.nightly,),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", [pytest.param(fault, marks=MARKS[fault]) for fault in FAULTS])
def test_seeded_faults_are_caught(rover, tmp_path, fault):
    change, caught = FAULTS[fault]
    outcomes = settle(rover(*REPAIRED, {"states": 30_000}, program=change), tmp_path)
    refuted = {name for name, outcome in outcomes.items() if outcome.verdict is Verdict.REFUTED}
    assert refuted >= caught
    for name in refuted:
        counterexample = outcomes[name].counterexample
        assert counterexample is not None
        assert counterexample.loop is not None
        assert 0 <= counterexample.loop < len(counterexample.trace)


@pytest.mark.slow
def test_the_published_agent(rover, tmp_path):
    """Every instance of G1 is vacuous, since going(i) goes before inspected(i) comes; G2 and G3 are false."""
    job = rover(*PUBLISHED)
    (warning,) = BACKEND.check(job)  # the paper's properties leave waypoint 0 out
    assert (warning.code, warning.is_error) == ("AJPF133", False)
    outcomes = settle(job, tmp_path)
    assert outcomes["G1"].verdict is Verdict.CHECKED
    assert outcomes["G1"].vacuous
    assert "no trigger is ever met" in outcomes["G1"].summary
    assert outcomes["G2"].verdict is Verdict.REFUTED
    assert ("i", "2") in outcomes["G2"].counterexample.values
    # the scenario has no waypoint 13, so that the formula as published demands that the robot leaves at once
    assert outcomes["G3"].verdict is Verdict.REFUTED
    assert ("i", "12") in outcomes["G3"].counterexample.values
    # what the paper checked is listed, and does not count
    listed = {
        entry["name"]: {p["verdict"] for p in entry["properties"]}
        for outcome in outcomes.values()
        for entry in outcome.details["further_properties"]
    }
    assert listed["phi1"] == {"refuted"}
    assert listed["phi3a"] == listed["phi3b"] == {"checked"}
    assert len(listed) == 6


@pytest.mark.slow
def test_the_route_of_the_publicly_available_program_makes_the_rest_vacuous(rover, tmp_path):
    """Its next_location(5,0) makes waypoints 6 to 12 unreachable: every claim about them passes for nothing."""
    job = rover(*REPAIRED, program=lambda text: text.replace("next_location(5, 6)", "next_location(5, 0)"))
    outcome = settle(job, tmp_path)["inspect_here"]
    assert outcome.verdict is Verdict.CHECKED
    vacuous = [entry["instance"] for entry in outcome.details["properties"] if entry["vacuous"]]
    assert vacuous == [f"i = {i}" for i in range(6, 13)]
    assert "i = 6…12 is never met" in outcome.summary


def test_bounds_give_unknown(rover, tmp_path):
    outcomes = settle(rover(*REPAIRED, {"states": 100}), tmp_path)
    assert {outcome.verdict for outcome in outcomes.values()} == {Verdict.UNKNOWN}
    assert "more than 100 states" in outcomes["abandon"].summary


def test_export_is_pure(rover):
    assert BACKEND.export(rover(*REPAIRED)) == BACKEND.export(rover(*REPAIRED))


@pytest.mark.parametrize("case", [REPAIRED, PUBLISHED])
def test_the_exported_properties(rover, case):
    """Refresh with AVOW_REFRESH=1 where a change is meant."""
    golden = Path(__file__).parent / "golden" / f"{case[0]}.psl"
    text = BACKEND.export(rover(*case))["jackal.psl"]
    if os.environ.get("AVOW_REFRESH"):
        golden.write_text(text)
    assert text == golden.read_text()


@pytest.mark.parametrize(("name", "method"), [REPAIRED, PUBLISHED])
def test_the_shipped_plan_has_what_is_tested(root, name, method):
    plan = yaml.safe_load((root / "contracts" / name / "plan.yaml").read_text())
    (tested,) = yaml.safe_load((root / "tests" / "ajpf" / "fixtures" / method).read_text())
    assert tested in plan["nodes"]["agent"]["methods"]
