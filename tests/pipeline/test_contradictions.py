"""Data that the plan names as evidence are evidence against every claim that they contradict, of any node."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from pathlib import Path

import pytest
from helpers import avow, edit

from avow.assurance.codec import read_case
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of
from avow.evidence.status import Status
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.run_info import Run
from avow.pipeline.workload import Survey, survey

RCL = """node a {
  inputs( x : REAL ) outputs( y : REAL )
  topics( std_msgs/Float64 x matches(in.x), std_msgs/Float64 y matches(out.y) )
  guarantee g ( out.y <= 10 )
}
node b {
  inputs( y : REAL ) outputs( z : REAL )
  topics( std_msgs/Float64 y matches(in.y), std_msgs/Float64 z matches(out.z) )
  assume small ( in.y <= 11 )
  guarantee h ( out.z <= in.y + 1 )
}
"""
PLAN = """system: s
ros: {distro: humble}
environment: {a.x: {assume: "in.x <= 100", because: measured}}
requirements: {Z: {text: z never exceeds 11, formula: "b.z <= 11", supported_by: [a.g, b.h]}}
nodes:
  a: {methods: []}
  b: {methods: [METHOD]}
"""
TRACE = "rosmonitoring: {traces: [t.jsonl], answers: {by: arrival, because: one process}}"
TABLE = "experiment: {data: t.csv, mapping: {in.y: y, out.z: z}}"
A, SMALL, X, Z = "a/guarantee/g", "composition/whole.b.small", "composition/environment.a.x", "requirement/Z"
Steps = Sequence[tuple[float, float, float]]
"""The values of x, y and z."""


@pytest.fixture
def place(tmp_path: Path) -> Workspace:
    (tmp_path / "contracts" / "s").mkdir(parents=True)
    (tmp_path / "dodo.py").write_text("")
    return Workspace(tmp_path)


def write(place: Workspace, method: str, steps: Steps) -> Path:
    folder = place.contracts / "s"
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN.replace("METHOD", method))
    events = [
        (name, 3 * at + k, value)
        for at, step in enumerate(steps)
        for k, (name, value) in enumerate(zip("xyz", step, strict=True))
    ]
    lines = [json.dumps({"topic": topic, "time": time / 10, "data": value}) for topic, time, value in events]
    (folder / "t.jsonl").write_text("\n".join(lines) + "\n")
    rows = "".join(f"{at},{y},{z}\n" for at, (_, y, z) in enumerate(steps))
    (folder / "t.csv").write_text(f"run,y,z\n{rows}")
    return folder


def refuted(place: Workspace, folder: Path) -> set[str]:
    found = survey(folder)
    assert isinstance(found, Survey), found
    for work in (w for w in found.catalogue.works if w.planned is not None):
        discharge(place, work, Run("run", False))
        assert not open_obligations(place, work, Run("later", False)), "a later run has nothing to do"
    records = (entry.evidence for entry in ledger_of(place.ledger("s")).records())
    return {r.obligation.removeprefix("s/").removeprefix("system/") for r in records if r.verdict is Verdict.REFUTED}


GOOD = [(1.0, float(k % 10), float(k % 10)) for k in range(40)]


@pytest.mark.parametrize(
    ("method", "bad", "broken"),
    [
        (TRACE, (1.0, 50.0, 51.0), {A}),  # the assumption is broken by a message that breaks a's guarantee
        (TRACE, (200.0, 5.0, 5.0), {X}),
        (TRACE, (1.0, 10.5, 11.2), {A, Z}),
        (TABLE, (1.0, 50.0, 51.0), {SMALL}),
        (TABLE, (1.0, 10.5, 11.2), {Z}),
    ],
)
def test_data_refute_what_they_contradict(
    place: Workspace, method: str, bad: tuple[float, ...], broken: set[str]
) -> None:
    folder = write(place, method, [*GOOD[:20], (bad[0], bad[1], bad[2]), *GOOD[20:]])
    assert refuted(place, folder) == broken


def test_an_honest_run_refutes_nothing(place: Workspace) -> None:
    rng = random.Random(27)
    for method in (TRACE, TABLE):
        for _ in range(8):
            ys = [rng.uniform(-20, 10) for _ in range(40)]
            folder = write(place, method, [(rng.uniform(-9, 100), y, y + rng.uniform(-5, 1)) for y in ys])
            assert not refuted(place, folder)


@pytest.mark.parametrize(
    ("method", "old", "new"),
    [
        (TRACE, "t.jsonl", "{path: t.jsonl, outside: {small: faults were injected}}"),
        (TABLE, "data: t.csv", "data: t.csv, outside: {small: faults were injected}"),
    ],
)
def test_a_run_outside_of_an_assumption_on_purpose_refutes_it_not(
    place: Workspace, method: str, old: str, new: str
) -> None:
    folder = write(place, method.replace(old, new), [*GOOD, (1.0, 50.0, 51.0)])
    assert refuted(place, folder) == set()
    edit(folder / "plan.yaml", ("small: faults", "smal: faults"))
    told = avow("check", "s", cwd=place.root)
    assert told.returncode == 2
    assert "no assumption or input 'smal'" in told.stdout + told.stderr


def test_the_gates_fail_for_what_a_recording_contradicts(place: Workspace) -> None:
    write(place, TRACE, [*GOOD, (200.0, 5.0, 5.0)])
    assert avow("verify", "s", cwd=place.root).returncode == 1
    case = read_case(place.report("s"))
    status = {view.obligation.local_id: view.status for view in case.obligations}
    assert status[f"system/{X}"] is Status.REFUTED
