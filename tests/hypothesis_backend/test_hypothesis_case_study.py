"""The case study's subjects, and agreement of the two backends that judge the same step in two languages."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path

import pytest
from helpers import some
from hoare.systems import make_job

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND as HOARE
from avow.backends.hypothesis import BACKEND
from avow.base.verdict import Object, Outcome, Verdict
from avow.conformance.seeded import settle as conformance_settle
from avow.pipeline.methods import method_job
from avow.system.load import load_system

SYSTEM = "contracts/remote_inspection"


def settle(
    folder: Path, root: Path, node: str, file: str, old: str = "", new: str = "", cases: int = 200
) -> dict[str, Outcome]:
    name = file.partition(":")[0]
    text = (root / SYSTEM / "models" / name).read_text()
    assert old in text
    rcl = (root / SYSTEM / "system.rcl").read_text()
    options = {"subject": f"models/{file}", "cases": cases}
    wanted = make_job(folder, rcl, node, options, {f"models/{name}": text.replace(old, new, 1)}, "hypothesis")
    assert BACKEND.check(wanted) == ()
    found = BACKEND.discharge(wanted, folder, Limits()).outcomes
    return {o.obligation.rpartition("/")[2]: o for o in found}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("node", "file"), some([("radiationSensor", "radiation_sensor.py:step"), ("agent", "agent.py:decide")], 1)
)
def test_the_repaired_nodes_pass(tmp_path: Path, root: Path, node: str, file: str) -> None:
    found = settle(tmp_path, root, node, file)
    assert {o.verdict for o in found.values()} == {Verdict.TESTED}, {n: o.summary for n, o in found.items()}


@pytest.mark.parametrize(
    ("old", "new", "broken"),
    [
        pytest.param("here + 1", "here + 2", {"next_waypoint", "end_of_mission"}, marks=pytest.mark.slow),
        pytest.param(
            '("move", *following)', '("move", *place(wayP, EXIT))', {"next_waypoint"}, marks=pytest.mark.nightly
        ),
        pytest.param('("inspect", here)', '("inspect", here + 1)', {"inspect_here"}, marks=pytest.mark.nightly),
        pytest.param('("red", "orange")', '("red",)', {"exit_on_danger", "abandon"}, marks=pytest.mark.slow),
        pytest.param('or phase == "leaving"', "", {"exit_on_danger", "abandon"}, marks=pytest.mark.nightly),
        pytest.param(
            "not inspected(here)", "inspected(here)", {"next_waypoint", "inspect_here"}, marks=pytest.mark.slow
        ),
        pytest.param("EXIT = 0", "EXIT = 1", {"exit_on_danger"}, marks=pytest.mark.nightly),
    ],
)
def test_agents_with_a_fault_are_refuted(tmp_path: Path, root: Path, old: str, new: str, broken: set[str]) -> None:
    found = settle(tmp_path, root, "agent", "agent.py:decide", old, new, cases=300)
    worse = {name for name, o in found.items() if not o.verdict.supports}
    assert broken <= worse
    assert any(o.verdict in {Verdict.REFUTED, Verdict.ERROR} for o in found.values())


# -- agreement ---------------------------------------------------------------------------------------------------------


def thresholds(seed: int) -> tuple[str, str, str]:
    """A contract with some thresholds, and one step as a program and as a function, sometimes off by one of them."""
    chance = random.Random(seed)
    limits = sorted(chance.sample(range(-50, 300), 3))
    used = list(limits)
    strict = [True] * 3
    if chance.random() < 0.7:
        k = chance.randrange(3)
        if chance.random() < 0.5:
            used[k] += chance.choice([-7, -1, 1, 9])
        else:
            strict[k] = False
    lows = ["", *limits]
    highs = [*limits, ""]
    clauses = []
    for k, (low, high) in enumerate(zip(lows, highs, strict=True)):
        left, right = (f"{low} <= " if low != "" else ""), (f" < {high}" if high != "" else "")
        clauses.append(f"guarantee g{k} ( {left}in.r{right} -> out.level == l{k} )")
    rcl = (
        "context { Level : {l0, l1, l2, l3}; }\nnode n { inputs( r : REAL ) outputs( level : Level )\n"
        f"topics( a/B r matches(in.r) )\nassume( TRUE )\n{chr(10).join(clauses)} }}"
    )
    tests = [f"r {'<' if s else '<='} {u}" for s, u in zip(strict, used, strict=True)]
    program = (
        f"IF {tests[0]} THEN\n  level := l0\nELSE IF {tests[1]} THEN\n  level := l1\n"
        f"ELSE IF {tests[2]} THEN\n  level := l2\nELSE\n  level := l3\n"
    )
    function = (
        f"def step(r):\n    return 'l0' if {tests[0]} else 'l1' if {tests[1]} else 'l2' if {tests[2]} else 'l3'\n"
    )
    return rcl, program, function


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(6))
def test_hoare_and_hypothesis_agree(tmp_path: Path, seed: int) -> None:
    rcl, program, function = thresholds(seed)
    proof = make_job(tmp_path / "a", rcl, "n", {"program": "p.imp"}, {"p.imp": program}, "hoare")
    trial = make_job(tmp_path / "b", rcl, "n", {"subject": "s.py:step", "cases": 250}, {"s.py": function}, "hypothesis")
    proved = {o.obligation: o.verdict for o in HOARE.discharge(proof, tmp_path, Limits()).outcomes}
    tested = {o.obligation: o.verdict for o in BACKEND.discharge(trial, tmp_path, Limits()).outcomes}
    expected = {Verdict.PROVED: Verdict.TESTED, Verdict.REFUTED: Verdict.REFUTED}
    assert {name: expected[v] for name, v in proved.items()} == tested


def test_the_generated_contracts_hold_both_kinds() -> None:
    """Some of the steps above are right and some are wrong; else the agreement would show little."""
    wrong = [thresholds(seed)[1] for seed in range(6)]
    assert len({("<=" in text) for text in wrong}) == 2


@pytest.mark.slow
def test_a_scenario_gives_the_places(tmp_path: Path) -> None:
    """With a scenario, its rows are the map: a place that only they have is tried."""
    rcl = """
    context { Map : REAL x NATURAL --> BOOL; }
    node n { inputs( map : Map, x : REAL ) outputs( id : NATURAL ) topics( a/B r matches(in.x) )
      assume( TRUE )
      guarantee g ( forall(x' in REAL, i in NATURAL | in.map(x', i) -> out.id == 0) ) }
    """
    plan = {
        "map": [{"x": -8.18, "id": 7}, {"x": 3.25, "id": 9}],
        "interpret": {"in.map": "map(x, id)"},
    }
    make_job(tmp_path, rcl, "n", {"subject": "s.py:step", "cases": 60}, {"s.py": "def step(): return 1"}, "hypothesis")
    given = json.loads((tmp_path / "plan.yaml").read_text())
    (tmp_path / "plan.yaml").write_text(json.dumps({**given, "scenario": plan}))
    system = load_system(tmp_path)
    node = system.contract.nodes[0]
    (outcome,) = BACKEND.discharge(
        method_job(system, node, system.plan.nodes[0].methods[0]), tmp_path, Limits()
    ).outcomes
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None
    shown = dict(outcome.counterexample.values)["in.map"]
    assert "-8.18" in shown or "3.25" in shown


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "broken"),
    [
        ("", "", set()),
        ("r < self.orange", "r <= self.orange", {"medium"}),
        ("elif r < self.red", "elif r < self.red or self.readings == 7", {"high"}),  # only after seven readings
        ('params["red"]', '(params["red"] + 1e-9)', {"high"}),
    ],
)
def test_the_class_that_the_robot_runs(tmp_path: Path, root: Path, old: str, new: str, broken: set[str]) -> None:
    folder = tmp_path / "remote_inspection"
    shutil.copytree(root / SYSTEM, folder)
    sensor = folder / "robot/nodes/radiation_sensor.py"
    text = sensor.read_text(encoding="utf-8")
    assert old in text
    sensor.write_text(text.replace(old, new, 1), encoding="utf-8")
    system = load_system(folder)
    method = next(m for m in system.plan.node("radiationSensor").methods if m.id == "driven")
    job = method_job(system, system.contract.node("radiationSensor"), method)
    found = conformance_settle(BACKEND, job, tmp_path / "made", Limits()).outcomes
    assert {o.of for o in found} == {Object.SOURCE}
    verdicts = {o.obligation.rpartition("/")[2]: o.verdict for o in found}
    assert {n for n, v in verdicts.items() if v is Verdict.REFUTED} == broken
    assert {v for n, v in verdicts.items() if n not in broken} == {Verdict.TESTED}
