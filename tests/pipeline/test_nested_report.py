"""Subsystems through the whole pipeline: the report's derivations rest on what is shown inside; edits inside re-run
what they touch."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

CONTRACT = """
node source { inputs() outputs( raw : REAL ) topics()
  guarantee small ( 0 <= out.raw and out.raw <= 8 ) }
node reader { inputs( raw : REAL ) outputs( value : REAL ) topics()
  assume sane ( 0 <= in.raw and in.raw <= 10 )
  guarantee scaled ( out.value == in.raw / 2 ) }
node grader { inputs( value : REAL ) outputs( high : BOOL ) topics()
  assume half ( 0 <= in.value and in.value <= 5 )
  guarantee grade ( out.high <=> in.value > 4 ) }
node sink { inputs( high : BOOL ) outputs( off : BOOL ) topics()
  assume calm ( not in.high )
  guarantee on ( not out.off ) }
"""

PLAN = """
subsystems:
  sensor: {nodes: [reader, grader]}
  front: {nodes: [source, sensor]}
requirements:
  R: {text: the alarm stays quiet, formula: not grader.high, supported_by: [front]}
nodes:
"""

STEPS = {
    "source": "{'raw': 4}",
    "reader": "{'value': raw / 2}",
    "grader": "{'high': value > 4}",
    "sink": "{'off': False}",
}


def verify(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "doit", "verify"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def status(workspace: Path) -> dict[str, tuple[str, list[str]]]:
    found: Any = json.loads((workspace / "reports/robot/report.json").read_text())
    return {d["derivation"]["name"]: (d["status"], d["below"]) for d in found["derivations"]}


@pytest.mark.nightly
def test_what_is_built_on_a_subsystem_rests_on_its_inside(workspace: Path) -> None:
    robot = workspace / "contracts/robot"
    (robot / "models").mkdir(parents=True)
    (robot / "system.rcl").write_text(CONTRACT)
    plan = PLAN
    for name, result in STEPS.items():
        inputs = ", ".join({"reader": ["raw"], "grader": ["value"], "sink": ["high"]}.get(name, []))
        (robot / f"models/{name}.py").write_text(f"def step({inputs}):\n    return {result}\n")
        plan += f"  {name}: {{methods: [{{hypothesis: {{subject: 'models/{name}.py:step', cases: 60}}}}]}}\n"
    (robot / "plan.yaml").write_text(plan)
    done = verify(workspace)
    assert {name: found for name, (found, _) in status(workspace).items()} == {
        "sensor": "tested",
        "front": "tested",
        "whole": "tested",
    }, done.stdout
    page = (workspace / "reports/robot/system.html").read_text()
    drawn = json.loads((workspace / "reports/robot/report.json").read_text())["graph_svg"]
    assert "inside sensor" in drawn, "the picture shows the inside"
    assert "sensor as a node" in page, "and the derivation the contract"

    # grader wants less than reader may give: refuted inside, and nothing around stands
    (robot / "system.rcl").write_text(CONTRACT.replace("in.value <= 5", "in.value <= 3"))
    done = verify(workspace)
    assert done.returncode != 0
    broken = "robot/system/composition/sensor.grader.half"
    assert {found for found, _ in status(workspace).values()} == {"unsupported"}
    assert all(broken in below for _, below in status(workspace).values())
    again = re.findall(r"^  discharge +(\S+)", done.stdout, re.MULTILINE)
    assert again, done.stdout
    assert all("grader" in step for step in again), "only its cone"
