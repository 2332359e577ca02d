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
    assert (found["grade"] == "proofs certified") == all(p["grade"] != "claimed" for p in found["proofs"])
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
    assert "proofs established again: " in told
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


@pytest.mark.slow
def test_a_loop_with_nothing_to_show(workspace: Path) -> None:
    """Nodes without assumptions in a loop: its rule is proved with no certificate, as it asks nothing."""
    robot = workspace / "contracts/robot"
    robot.mkdir(parents=True)
    node = "node {0} {{ inputs( x : BOOL ) outputs( y : BOOL ) topics() guarantee same ( in.x == out.y ) }}\n"
    (robot / "system.rcl").write_text(node.format("a") + node.format("b"))
    (robot / "plan.yaml").write_text("connections:\n  - {from: a.y, to: b.x}\n  - {from: b.y, to: a.x}\n")
    grades, told = verify(workspace)
    assert "proofs established again: " in told
    assert grades["robot/system/composition/whole.loop.a-b"].startswith("certified-")
