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
from avow.evidence.record import Evidence
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
RATED = TABLE.replace("data", "at_least: 0.8, data")
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


def records(place: Workspace, folder: Path) -> list[Evidence]:
    found = survey(folder)
    assert isinstance(found, Survey), found
    for work in (w for w in found.catalogue.works if w.planned is not None):
        discharge(place, work, Run("run", False))
        assert not open_obligations(place, work, Run("later", False)), "a later run has nothing to do"
    return [entry.evidence for entry in ledger_of(place.ledger("s")).records()]


def refuted(place: Workspace, folder: Path) -> set[str]:
    found = (r for r in records(place, folder) if r.verdict is Verdict.REFUTED)
    return {r.obligation.removeprefix("s/").removeprefix("system/") for r in found}


GOOD = [(1.0, float(k % 10), float(k % 10)) for k in range(40)]


@pytest.mark.parametrize(
    ("method", "bad", "broken"),
    [
        (TRACE, (1.0, 50.0, 51.0), {A}),  # the assumption is broken by a message that breaks a's guarantee
        (TRACE, (200.0, 5.0, 5.0), {X}),
        (TRACE, (1.0, 10.5, 11.2), {A, Z}),
        (TABLE, (1.0, 50.0, 51.0), {SMALL}),
        (TABLE, (1.0, 10.5, 11.2), {Z}),
        (RATED, (1.0, 10.5, 11.2), {Z}),  # b.h, for which the rate is claimed, holds in this row
        (RATED, (1.0, 9.0, 20.0), set()),  # the rate of b.h counts this row
        (RATED.replace("at_least: 0.8, ", ""), (1.0, 9.0, 20.0), {"b/guarantee/h", Z}),
    ],
)
def test_data_refute_what_they_contradict(
    place: Workspace, method: str, bad: tuple[float, ...], broken: set[str]
) -> None:
    folder = write(place, method, [*GOOD[:20], (bad[0], bad[1], bad[2]), *GOOD[20:]])
    assert refuted(place, folder) == broken


def test_a_recording_of_an_older_program_has_a_next_step(place: Workspace) -> None:
    """Another node names it; a node's own recording is replaced where its program is repaired."""
    folder = write(place, TRACE, [*GOOD, (1.0, 10.5, 20.0)])
    told = {r.obligation: r.details.get("next", "") for r in records(place, folder) if r.verdict is Verdict.REFUTED}
    older = "if t.jsonl, which b names, was made with an older program, record again, or name under `outside`"
    assert {claim: older in str(step) for claim, step in told.items()} == {
        f"s/{A}": True,
        "s/b/guarantee/h": False,
        f"s/system/{Z}": False,
    }


def test_an_edit_re_runs_the_recordings_that_it_reaches(place: Workspace) -> None:
    """The first node that names a recording compares it with all claims; the others depend on what reaches them."""
    folder = write(place, TRACE, GOOD)
    apart = "node c { inputs( w : REAL ) outputs( v : REAL ) topics() guarantee k ( out.v == in.w ) }\n"
    edit(folder / "s.rcl", ("node b", f"{apart}node b"))
    edit(folder / "plan.yaml", ("methods: []", f"methods: [{TRACE}]"), ("  b:", f"  c: {{methods: [{TRACE}]}}\n  b:"))

    def keys() -> dict[str, str]:
        found = survey(folder)
        assert isinstance(found, Survey), found
        return {work.node: min(work.keys.values()) for work in found.catalogue.works if work.planned is not None}

    def reached(old: str, new: str) -> set[str]:
        before = keys()
        edit(folder / "s.rcl", (old, new))
        return {node for node, key in keys().items() if key != before[node]}

    assert reached("out.z <= in.y + 1", "out.z <= in.y + 2") == {"a", "b"}
    assert reached("out.v == in.w", "out.v >= in.w") == {"a", "c"}
    assert reached("out.y <= 10", "out.y <= 9") == {"a", "b"}


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


def test_a_rate_of_a_guarantee_that_supports_it_not_covers_no_requirement(place: Workspace) -> None:
    folder = write(place, RATED, [*GOOD, (1.0, 9.0, 20.0)])
    edit(folder / "plan.yaml", ("[a.g, b.h]", "[a.g]"))
    assert refuted(place, folder) == {Z}


def test_avow_monitor_judges_the_environment_and_requirements_as_avow_verify_does(place: Workspace) -> None:
    folder = write(place, TRACE, [*GOOD, (200.0, 5.0, 5.0), (1.0, 10.5, 11.2)])
    for trace in (str(folder / "t.jsonl"), "-"):
        told = avow("monitor", "s", trace, "--json", cwd=place.root, stdin=(folder / "t.jsonl").read_text())
        assert told.returncode == 1
        assert {c.removeprefix("system/") for c in json.loads(told.stdout)["contradicted"]} == {X, Z}
    assert refuted(place, folder) == {A, X, Z}
    told = avow("monitor", "s", str(write(place, TRACE, GOOD) / "t.jsonl"), cwd=place.root)
    assert told.returncode == 0, told.stdout


def test_a_breach_in_an_unknown_order_of_steps_is_an_assumption(place: Workspace) -> None:
    folder = write(place, TRACE, GOOD)  # nothing says which x a value of y answers
    edit(folder / "s.rcl", ("out.y <= 10", "out.y <= in.x + 7"))
    found = [r for r in records(place, folder) if r.backend == "rosmonitoring"]
    assert [(r.verdict, len(r.hypotheses)) for r in found] == [(Verdict.MONITORED, 1)]
    assert str(found[0].hypotheses[0]).startswith("no step breaks a.g: in the order of the recording it does")


WORLD = """import json, sys
with open(sys.argv[1], "w") as file:
    for n, (topic, value) in enumerate([("x", 1.0), ("y", float(sys.argv[2])), ("z", float(sys.argv[2]))]):
        print(json.dumps({"topic": topic, "time": n, "data": value}), file=file)
"""
CAMPAIGN = """rosmonitoring: {answers: {by: arrival, because: one process}}, experiment: {data: runs.csv, seed: 1, RATE,
    campaign: {command: [python3, world.py, "{trace}", "{y}"], scenario: {y: {from: 0, to: 9}}, trace: r.jsonl,
      runs: 20}}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "broken"),
    [
        (("1.0", "1.0"), set()),
        (('("x", 1.0)', '("x", 200.0)'), {X}),
        (('("y", float(sys.argv[2]))', '("y", 11.0)'), {A}),
        (('("z", float(sys.argv[2]))', '("z", 11.1 - (float(sys.argv[2]) < 8) * 9)'), {Z}),  # at times, as h allows
    ],
)
def test_runs_of_a_campaign_refute_what_they_contradict(
    place: Workspace, fault: tuple[str, str], broken: set[str]
) -> None:
    for rate in ("confidence: 0.95", "at_least: 0.8"):
        folder = write(place, CAMPAIGN.replace("RATE", rate), GOOD)
        edit(folder / "s.rcl", ("out.z <= in.y + 1", "out.z <= in.y + 4"))
        (folder / "world.py").write_text(WORLD)
        edit(folder / "world.py", fault)
        told = avow("campaign", "s", cwd=place.root)
        assert told.returncode == 0, told.stdout + told.stderr
        assert refuted(place, folder) == broken
