"""Grades of proofs in real cached runs: what an edit, a swap of names or a forged certificate leaves of them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

CONTRACT = """
node source { inputs() outputs( v : REAL ) topics()
  guarantee low ( out.v >= 0 )
  guarantee high ( out.v <= 8 ) }
node sink { inputs( v : REAL ) outputs( w : REAL ) topics()
  assume sane ( 0 <= in.v and in.v <= 10 )
  guarantee kept ( out.w == in.v ) }
"""
PLAN = """
requirements:
  R: {text: it stays small, formula: sink.w <= 8}
nodes:
  source: {methods: [{hypothesis: {subject: 'models/source.py:step', cases: 20}}]}
  sink: {methods: [{hypothesis: {subject: 'models/sink.py:step', cases: 20}}]}
"""
SANE, R = "robot/system/composition/whole.sink.sane", "robot/system/requirement/R"


def verify(workspace: Path, *options: str) -> tuple[dict[str, str], str]:
    """The grades of what is proved of composition and requirements, and what was printed."""
    command = [sys.executable, "-m", "doit", *options, "verify"]
    done = subprocess.run(command, cwd=workspace, capture_output=True, text=True, timeout=300, check=False)
    found: Any = json.loads((workspace / "reports/robot/report.json").read_text())
    assert (found["grade"] == "CERTIFIED") == all(p["grade"] != "claimed" for p in found["proofs"])
    return {p["obligation"]: p["grade"] for p in found["proofs"] if "/system/" in p["obligation"]}, done.stdout


@pytest.mark.nightly
def test_grades_in_cached_runs(workspace: Path) -> None:
    robot = workspace / "contracts/robot"
    (robot / "models").mkdir(parents=True)
    (robot / "models/source.py").write_text("def step():\n    return {'v': 4}\n")
    (robot / "models/sink.py").write_text("def step(v):\n    return {'w': v}\n")
    (robot / "system.rcl").write_text(CONTRACT)
    (robot / "plan.yaml").write_text(PLAN)
    first, told = verify(workspace)
    assert first[R].startswith("certified-")
    assert first[SANE].startswith("certified-")
    assert "proofs established again" in told
    verify(workspace)
    assert "established" not in verify(workspace)[1], "a run that reads nothing claims nothing"

    # the certificates are gone: asked anew, never believed
    for kept in workspace.glob("artifacts/robot/**/certificates.json"):
        kept.write_text("{}")
    assert verify(workspace)[0].keys() == first.keys()

    # two guarantees swap names: what R rests on has another name, and it is proved by what it says
    (robot / "system.rcl").write_text(
        CONTRACT.replace("low", "x").replace("high", "low").replace("guarantee x", "guarantee high")
    )
    swapped, _ = verify(workspace)
    assert swapped.keys() == verify(workspace, "-a")[0].keys() == first.keys()

    # an edit elsewhere that takes away what the induction used
    (robot / "system.rcl").write_text(CONTRACT.replace("out.v <= 8", "out.v <= 9"))
    edited, _ = verify(workspace)
    assert R not in edited
    assert SANE in edited
    assert edited.keys() == verify(workspace, "-a")[0].keys()


def statuses(workspace: Path, *options: str) -> dict[str, str]:
    """Every status of the report, after a run."""
    command = [sys.executable, "-m", "doit", *options, "verify"]
    subprocess.run(command, cwd=workspace, capture_output=True, text=True, timeout=300, check=False)
    found: Any = json.loads((workspace / "reports/robot/report.json").read_text())
    views = {json.dumps([o["obligation"][k] for k in ("node", "kind", "name")]): o for o in found["obligations"]}
    told = {name: f"{view['status']} {view['standing']}" for name, view in views.items()}
    return told | {f"requirement {r['id']}": f"{r['answer']} {r['failing']}" for r in found["requirements"]}


ZERO = """
node b { inputs() outputs( s : INTEGER ) topics()
  guarantee zero ( out.s == 0 )
  guarantee small ( out.s < 9 ) }
node a { inputs( s : INTEGER, x0 : INTEGER ) outputs( x : INTEGER ) topics()
  guarantee adds ( out.x == in.x0 + in.s ) }
"""
ZERO_PLAN = """
connections: [{from: a.x, to: a.x0, delayed: true, initial: '0'}]
requirements: {R: {text: it stays, formula: a.x == 0, supported_by: [a]}}
nodes:
  b: {methods: [{hypothesis: {subject: 'models/b.py:step', cases: 20}}]}
  a: {methods: [{hypothesis: {subject: 'models/a.py:step', cases: 20}}]}
accepted:
  - obligation: b/guarantee/zero
    verdict: refuted
    reason: it is known
    who: A. Person
    date: 2026-11-01
    expires: 2030-01-01
"""
NAMED = "compose: {D: {select: [a, b], rule: %s}}\n"


@pytest.mark.nightly
def test_ways_in_through_cached_runs(workspace: Path) -> None:
    """What only the base case of an induction needs, refuted and accepted; a derivation that gets a name, another and
    none; two guarantees that swap names: each in a run over the records of the one before, held against a fresh one."""
    robot = workspace / "contracts/robot"
    (robot / "models").mkdir(parents=True)
    (robot / "models/b.py").write_text("def step():\n    return {'s': 5}\n")
    (robot / "models/a.py").write_text("def step(s, x0):\n    return {'x': x0 + s}\n")
    swapped = ZERO.replace("zero", "x").replace("small", "zero").replace("guarantee x", "guarantee small")
    steps = (
        (ZERO, ZERO_PLAN),
        (ZERO, ZERO_PLAN + NAMED % "R1"),
        (ZERO, ZERO_PLAN + (NAMED % "R4").replace("D:", "E:")),
        (swapped, ZERO_PLAN + (NAMED % "R4").replace("D:", "E:")),
        (ZERO, ZERO_PLAN),
    )
    for contract, plan in steps:
        (robot / "system.rcl").write_text(contract)
        (robot / "plan.yaml").write_text(plan)
        cached = statuses(workspace)
        assert "refuted" in cached["requirement R"], "b puts out 5, whoever accepts it"
        assert cached == statuses(workspace, "-a")


@pytest.mark.slow
def test_a_loop_with_nothing_to_show(workspace: Path) -> None:
    """Nodes without assumptions in a loop: its rule is proved with no certificate, as it asks nothing."""
    robot = workspace / "contracts/robot"
    robot.mkdir(parents=True)
    node = "node {0} {{ inputs( x : BOOL ) outputs( y : BOOL ) topics() guarantee same ( in.x == out.y ) }}\n"
    (robot / "system.rcl").write_text(node.format("a") + node.format("b"))
    (robot / "plan.yaml").write_text("connections:\n  - {from: a.y, to: b.x}\n  - {from: b.y, to: a.x}\n")
    grades, told = verify(workspace)
    assert "proofs established again" in told
    assert grades["robot/system/composition/whole.loop.a-b"].startswith("certified-")
