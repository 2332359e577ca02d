"""A system with other names and types works without touching the code: Hoare, Hypothesis and the agent checker."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FERRY = Path(__file__).parent / "fixtures" / "ferry"


@pytest.fixture
def harbour(workspace: Path) -> Path:
    shutil.copytree(FERRY, workspace / "contracts" / "ferry")
    return workspace


def verify(folder: Path) -> tuple[int, dict[tuple[str, str], dict[str, object]], str]:
    done = subprocess.run(
        [sys.executable, "-m", "doit", "verify"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=200,
        env=os.environ,
        check=False,
    )
    lines = (folder / "artifacts" / "ledger" / "ferry.jsonl").read_text().splitlines()
    records = [json.loads(line)["evidence"] for line in lines]
    found = {(r["obligation"].removeprefix("ferry/"), r["method"]): r for r in records}
    return done.returncode, found, done.stdout + done.stderr


@pytest.mark.nightly
def test_it_verifies(harbour: Path) -> None:
    code, found, text = verify(harbour)
    assert code == 0, text
    assert found["gauge/guarantee/good", "hoare"]["verdict"] == "proved"
    assert found["pilot/guarantee/docks", "ajpf"]["verdict"] == "checked"
    assert found["pilot/guarantee/docks", "hypothesis"]["verdict"] == "tested"
    assert found["pilot/sanity/realizable", "sanity"]["verdict"] == "proved"
    assert found["system/requirement/SAFE", "compose"]["verdict"] == "proved"


@pytest.mark.nightly
def test_a_careless_pilot_is_caught_by_both_of_its_methods(harbour: Path) -> None:
    models = harbour / "contracts" / "ferry" / "models"
    program, function = models / "skipper.gwen", models / "harbour.py"
    program.write_text(program.read_text().replace("+high", "+never"))
    function.write_text(function.read_text().replace('level != "ok"', 'level == "low"'))
    code, found, text = verify(harbour)
    assert code == 1, text
    assert found["pilot/guarantee/waits", "ajpf"]["verdict"] == "refuted"
    assert found["pilot/guarantee/waits", "ajpf"]["counterexample"]["trace"]
    assert found["pilot/guarantee/waits", "hypothesis"]["verdict"] == "refuted"
    assert ["in.level", "high"] in found["pilot/guarantee/waits", "hypothesis"]["counterexample"]["values"]


@pytest.mark.nightly
def test_a_requirement_that_does_not_follow_is_refuted(harbour: Path) -> None:
    plan = harbour / "contracts" / "ferry" / "plan.yaml"
    plan.write_text(plan.read_text().replace("gauge.depth < 2.5 ->", "gauge.depth < 2.6 ->"))
    code, found, text = verify(harbour)
    assert code == 1, text
    record = found["system/requirement/SAFE", "compose"]
    assert record["verdict"] == "refuted"
    depth = next(v for name, v in record["counterexample"]["values"] if name.endswith("depth"))
    assert 2.5 <= float(depth) < 2.6
