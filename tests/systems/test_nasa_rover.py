"""The NASA rover: what is derived of it, and that the published R1.4 does not keep it from running dry."""

from __future__ import annotations

import csv
import itertools
import random
from collections import Counter, deque
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest
from calculus.make import requirement_obligations, settle_all
from click.testing import CliRunner

from avow.base.verdict import Outcome, Verdict
from avow.calculus.composition import Composition, compose
from avow.calculus.derivation import Phase, Rule
from avow.calculus.obligations import composition_obligations
from avow.calculus.variables import frame
from avow.cli import simulate
from avow.evaluation.evaluate import compile_term
from avow.formulas.values import FunctionValue
from avow.pipeline.slices import sanity_slice
from avow.sanity.analysis import analyse
from avow.system.load import load_system
from avow.system.plan import System

from .nasa_rover_run import (
    AWAY,
    CHARGER,
    FOLDER,
    FREE,
    FREE_TABLE,
    STEP_TABLE,
    STEPS,
    USE,
    WAYS,
    as_value,
    function,
    planned,
    published,
    rover,
    run,
)

MISSION = (11, 11, 6, 13, 15, 8, 11)
"""Heat points on which a rover with the published R1.4 runs dry."""

SHIPPED_R1_4 = "( in.battery <= (in.lengthC + 2) * Use -> out.recharge )"
PUBLISHED_R1_4 = "( 0.95 * in.battery <= in.lengthC * Use -> out.recharge )"


@dataclass(frozen=True)
class Limits:
    seconds: float = 10.0
    seed: int = 0


@cache
def system() -> System:
    return load_system(FOLDER)


@cache
def composition() -> Composition:
    return compose(system())


def requirement(name: str, limits: Limits | None = None, of: Composition | System | None = None) -> Outcome:
    """One composition shares what its answers have in common."""
    composed = compose(of) if isinstance(of, System) else of or composition()
    [obligation] = [o for o in requirement_obligations(composed.frame.system) if o.name == name]
    [outcome] = settle_all(composed, [obligation], limits or Limits())
    return outcome


# -- the requirements ------------------------------------------------------------------------------------------------


REWORDED = {"R1_1", "R2_2", "R2_2_1"}
"""Requirements whose published sentence says more than their formula: the plan says what is shown, and why."""


def test_the_plan_has_every_published_requirement_and_its_sentence() -> None:
    with (FOLDER / "data" / "nasa_rover_requirements.csv").open(encoding="utf-8") as file:
        published_set = {row["id"].replace(".", "_"): row["statement"] for row in csv.DictReader(file)}
    shown = {r.id: r.text.rstrip(".") for r in system().plan.requirements}
    assert published_set.keys() <= shown.keys()
    assert {name for name, text in published_set.items() if shown[name] != text} == REWORDED
    assert len(published_set) == 15


@pytest.mark.parametrize(
    "name",
    [
        *(pytest.param(name, marks=pytest.mark.nightly) for name in ("R1_kept", "R1_4")),
        pytest.param("R1_2", marks=pytest.mark.slow),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("R1_3", "R1_5", "R1_6", "PLANS")),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("R2", "R2_2_2", "R3_2", "R3_5")),
        "RECHARGES",
    ],
)
def test_requirements_are_proved_and_not_vacuously(name: str) -> None:
    outcome = requirement(name)
    assert outcome.verdict is Verdict.PROVED, outcome.summary
    assert not outcome.vacuous
    assert outcome.rests_on, "it rests on guarantees"


@pytest.mark.nightly
def test_the_battery_is_proved_by_induction_over_steps() -> None:
    outcome = requirement("R1")
    assert outcome.verdict is Verdict.PROVED, outcome.summary
    assert outcome.details["phase"] == Phase.LATER.value
    assert "Interface/guarantee/in_time" in {h.name for h in outcome.rests_on}
    assert "system/composition/environment.in.away" in {h.name for h in outcome.rests_on}


# -- the paper's derivations -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "rule", "consumers"),
    [
        ("ReasoningAgent", Rule.R2, {"ComputePlan2Charging", "ComputePlan2Destination"}),
        ("BatteryInterface", Rule.R3, {"Interface"}),
    ],
)
def test_the_papers_derivations_are_found_and_discharged(name: str, rule: Rule, consumers: set[str]) -> None:
    goal = composition().goal(name)
    assert goal.root.rule is rule
    assert {condition.consumer for condition in goal.conditions} == consumers
    wanted = [o for o in composition_obligations(system()) if o.name.startswith(f"{name}.")]
    for outcome in settle_all(composition(), wanted, Limits()):
        assert outcome.verdict in {Verdict.PROVED, Verdict.JUSTIFIED}, outcome.summary
        assert not outcome.vacuous


def test_the_interface_reads_exactly_what_the_papers_linking_equation_says() -> None:
    frame = composition().frame
    outputs = {
        port.name
        for node in ("ComputePlan2Charging", "ComputePlan2Destination", "BatteryMonitor")
        for port in frame.node(node).outputs
    }
    assert {port.name for port in frame.node("Interface").inputs} == outputs


def test_the_loop_the_paper_does_not_mention_has_a_first_element() -> None:
    [start] = [o for o in composition_obligations(system()) if o.name.startswith("start.")]
    [outcome] = settle_all(composition(), [start], Limits())
    assert outcome.verdict is Verdict.PROVED
    assert {"initial Interface.recharge", "initial Interface.atGoal"} <= set(outcome.details["initial"])  # type: ignore[call-overload]


# -- the published R1.4 ------------------------------------------------------------------------------------------------


def copy(tmp_path: Path, *changes: tuple[str, str], use: str = "0.03") -> System:
    """The rover with changed texts; with another use of a step, over charges that are as far apart."""
    for file in FOLDER.rglob("*"):
        target = tmp_path / "nasa_rover" / file.relative_to(FOLDER)
        if file.is_file() and file.suffix in {".rcl", ".yaml", ".csv"}:
            target.parent.mkdir(parents=True, exist_ok=True)
            text = file.read_text(encoding="utf-8")
            for old, new in (*changes, ("Use = 0.03", f"Use = {use}")):
                text = text.replace(old, new)
            target.write_text(text, encoding="utf-8")
    charges = {max(1 - k * Fraction(use), Fraction(0)) for k in range(60)}
    table = tmp_path / "nasa_rover" / "models" / "charges.csv"
    table.write_text("\n".join(["charge", *map(str, sorted(charges))]), encoding="utf-8")
    return load_system(tmp_path / "nasa_rover")


SMALL = ("in.count: 7", "in.count: 2")
PUBLISHED = (SHIPPED_R1_4, PUBLISHED_R1_4)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["R1", "R1_kept"])
def test_with_the_published_margin_avow_finds_the_run_to_an_empty_battery(tmp_path: Path, name: str) -> None:
    """The solver builds no map; the search over the plan's scenario needs none built."""
    faulty = copy(tmp_path, PUBLISHED)
    assert PUBLISHED_R1_4 in (tmp_path / "nasa_rover" / "system.rcl").read_text(encoding="utf-8")
    outcome = requirement(name, of=faulty)
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None
    places = [int(dict(step)["Hardware.position"]) for step in outcome.counterexample.trace]
    charges = [Fraction(dict(step)["Hardware.charge"]) for step in outcome.counterexample.trace]
    assert charges[-1] == 0 or charges[-1] < USE * AWAY[places[-1], CHARGER]
    for place, following, before, after in zip(places, places[1:], charges, charges[1:], strict=False):
        assert place == following or (place, following) in STEPS
        assert after == 1 or before - USE <= after <= before


# -- the contracts, run on the grid ------------------------------------------------------------------------------------


def test_the_charges_of_the_scenario_are_a_step_apart() -> None:
    with (FOLDER / "models" / "charges.csv").open(encoding="utf-8") as file:
        charges = [Fraction(row["charge"]) for row in csv.DictReader(file)]
    assert charges == sorted({max(1 - k * USE, Fraction(0)) for k in range(60)})
    with (FOLDER / "models" / "mission.csv").open(encoding="utf-8") as file:
        assert tuple(int(row["cell"]) for row in csv.DictReader(file)) == MISSION


@pytest.mark.nightly
def test_every_step_on_the_grid_is_looked_at() -> None:
    """But of the charges that the contract allows only those of the table: so it is no exhaustive check."""
    for name in ("R1_grid", "PLANS_grid"):
        outcome = requirement(name)
        assert outcome.verdict is Verdict.TESTED, outcome.summary
        assert "the scenario's values cut runs off" in outcome.summary


@pytest.mark.nightly
def test_a_small_mission_on_the_grid(tmp_path: Path) -> None:
    of = compose(copy(tmp_path, SMALL, use="0.08"))
    for name in ("R1_grid", "PLANS_grid"):
        outcome = requirement(name, of=of)
        assert outcome.verdict is Verdict.TESTED, outcome.summary
        assert "the scenario's values cut runs off" in outcome.summary


FREE_MOVES = "(in.step(out.planC(k), out.planC(k + 1)) and in.free(out.planC(k)) and in.free(out.planC(k + 1)))"
SHORTEST = "in.away(out.planC(k), in.charger) + k == out.lengthC"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("R1_grid", (PUBLISHED,)),
        ("R1_grid", (("in.energy - Use <= out.charge", "in.energy - 3 * Use <= out.charge"),)),
        ("PLANS_grid", ((FREE_MOVES, "in.free(out.planC(k))"), (SHORTEST, "out.lengthC <= 2"))),
    ],
)
def test_faults_are_found_on_the_grid(tmp_path: Path, name: str, faults: tuple[tuple[str, str], ...]) -> None:
    outcome = requirement(name, of=copy(tmp_path, SMALL, *faults, use="0.08"))
    assert outcome.verdict is Verdict.REFUTED, outcome.summary
    assert outcome.counterexample is not None
    last = [dict(step) for step in outcome.counterexample.trace]
    if name == "R1_grid":
        assert any(Fraction(step["Hardware.charge"]) == 0 for step in last)


def test_a_run_is_shown() -> None:
    arguments = [str(FOLDER), "--seed", "1", "--steps", "5"]
    result = CliRunner().invoke(simulate.command, arguments, standalone_mode=False)
    assert result.exception is None
    assert "step 5" in result.output
    assert "ComputePlan2Destination.planD    {0: 0, " in result.output


def test_the_counterexample_meets_every_contract_but_the_repaired_clause() -> None:
    """A whole run: every clause is evaluated exactly at every step; only Interface.in_time is ever broken."""
    steps = run(MISSION, published, 60)
    assert steps[-1]["Hardware"]["charge"] == 0
    assert steps[-1]["Hardware"]["position"] != CHARGER
    assert len(steps) == 34
    assert broken_clauses(steps) == {"Interface.in_time"}


def test_on_the_same_mission_the_repaired_rover_gets_home() -> None:
    steps = run(MISSION, rover().interface, 300)
    assert len(steps) == 300
    assert min(s["Hardware"]["charge"] for s in steps) > 0
    assert steps[-1]["GRA"]["done"] == len(MISSION)
    assert steps[-1]["Hardware"]["position"] == CHARGER
    assert broken_clauses(steps[:40]) == set()


def broken_clauses(steps: list[dict[str, dict[str, object]]]) -> set[str]:
    away = FunctionValue(dict(AWAY), max(AWAY.values()) + 2)
    way = FunctionValue(dict(WAYS), max(WAYS.values()) + 2)
    given = {"free": FREE_TABLE, "step": STEP_TABLE, "away": away, "way": way}
    judges = [
        (node, clause.name, compile_term(clause.formula)) for node in system().contract.nodes for clause in node.clauses
    ]
    found: set[str] = set()
    for step in steps:
        for node, name, holds in judges:
            values = given | {port: as_value(value) for port, value in step[node.name].items()}
            valuation = {f"in.{p.name}": values[p.name] for p in node.inputs}
            valuation |= {f"out.{p.name}": values[p.name] for p in node.outputs}
            if not holds(valuation):
                found.add(f"{node.name}.{name}")
    return found


@pytest.mark.parametrize(("margin", "safe"), [("repaired", True), ("published", False)])
def test_every_walk_on_the_grid(margin: str, safe: bool) -> None:
    """Explicit search over places and charges, whatever destination is chosen, at the greatest use that is allowed."""
    waiting = deque([(CHARGER, Fraction(1))])
    seen = set(waiting)
    dry = False
    while waiting:
        place, charge = waiting.popleft()
        battery, length = charge * Fraction(95, 100), AWAY[place, CHARGER]
        if margin == "repaired":
            recharge = battery <= (length + 2) * USE
        else:
            recharge = battery * Fraction(95, 100) <= length * USE
        if place == CHARGER and battery < Fraction(95, 100):
            recharge = True
        following = [b for a, b in STEPS if a == place]
        if recharge:
            following = [b for b in following if AWAY[b, CHARGER] == length - 1] or [place]
        else:
            following.append(place)
        for cell in following:
            left = Fraction(1) if cell == CHARGER else charge - USE
            dry = dry or left <= 0
            if left > 0 and (cell, left) not in seen:
                seen.add((cell, left))
                waiting.append((cell, left))
    assert dry is not safe
    assert len(seen) > 100


# -- the map -----------------------------------------------------------------------------------------------------------


def test_the_tables_are_what_breadth_first_search_finds() -> None:
    assert set(STEPS) == {(a, b) for a in FREE for b in FREE if abs(a % 4 - b % 4) + abs(a // 4 - b // 4) == 1}
    for goal in FREE:
        found = {goal: 0}
        waiting = deque([goal])
        while waiting:
            cell = waiting.popleft()
            for a, b in STEPS:
                if b == cell and a not in found:
                    found[a] = found[cell] + 1
                    waiting.append(a)
        assert {a: AWAY[a, goal] for a in FREE} == found


def test_the_environment_assumptions_hold_of_the_grid() -> None:
    for a in FREE:
        for g in FREE:
            way = [WAYS[a, g, k] for k in range(AWAY[a, g] + 1)]
            assert way[0] == a
            assert way[-1] == g
            assert all(pair in STEPS for pair in itertools.pairwise(way))
            assert [AWAY[cell, g] for cell in way] == list(range(AWAY[a, g], -1, -1))
    assert all(AWAY[b, g] <= AWAY[a, g] + 1 and AWAY[a, g] <= AWAY[b, g] + 1 for a, b in STEPS for g in FREE)


PLANNERS = {
    "ComputePlan2Charging": ("charger", "planC", "lengthC", "plan_to_charging"),
    "ComputePlan2Destination": ("goal", "planD", "lengthD", "plan_to_destination"),
}


@pytest.mark.parametrize("planner", PLANNERS)
def test_on_every_map_that_meets_the_assumptions_breadth_first_search_meets_the_guarantees(planner: str) -> None:
    """Also where the map's table of distances is made up: a walk of so many moves is its way."""
    to, plan, length, name = PLANNERS[planner]
    node, chance, count = system().contract.node(planner), random.Random(0), Counter[bool]()
    for _ in range(600):
        cells = range(chance.randrange(2, 5))
        steps = [(a, b) for a in cells for b in cells if chance.random() < 0.6]
        walk = [chance.choice(cells)]
        for _ in range(chance.randrange(4)):
            walk.append(chance.choice([b for a, b in steps if a == walk[-1]] or walk[-1:]))
        away = {(cell, walk[-1]): len(walk) - 1 - k for k, cell in enumerate(walk)}
        away = {(cell, walk[-1]): away.get((cell, walk[-1]), chance.randrange(4)) for cell in cells}
        maps = {"free": FREE_TABLE, "step": FunctionValue(dict.fromkeys(steps, True), False)}
        maps["free"] = FunctionValue(dict.fromkeys(((cell,) for cell in cells), True), False)
        maps["away"] = FunctionValue(away, 9)
        maps["way"] = FunctionValue({(walk[0], walk[-1], k): cell for k, cell in enumerate(walk)}, walk[-1])
        step = {f"in.{port}": value for port, value in {"start": walk[0], to: walk[-1], **maps}.items()}
        found = getattr(rover(), name)(walk[0], walk[-1], function(maps["free"]), function(maps["step"]))
        step |= {f"out.{length}": found[length], f"out.{plan}": as_value(planned(found[plan]))}
        allowed = all(compile_term(clause.formula)(step) for clause in node.assumptions)
        count[allowed] += 1
        if allowed:
            assert all(compile_term(clause.formula)(step) for clause in node.guarantees), step
    assert count[True] > 50
    assert count[False] > 50


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["ComputePlan2Charging", "ComputePlan2Destination"])
def test_that_a_plan_begins_at_the_start_does_not_follow_from_the_rest(planner: str) -> None:
    """What shows it is a table that the solver finds late or not at all, for the scenario's map."""
    system = load_system(FOLDER)
    whole, node = frame(system), system.contract.node(planner)
    cut = sanity_slice(whole, node)
    (found,) = analyse(node, scenario=cut.given, wanted={"not-redundant-from_start"})
    assert found.verdict in (Verdict.PROVED, Verdict.UNKNOWN)
