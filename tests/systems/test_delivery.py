"""The delivery robot among people: its faults are found and named."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import edit

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.slow, pytest.mark.needs_perception, pytest.mark.needs_motion]


def avow(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "avow", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def blind(folder: Path) -> None:
    """A network that sees no person under a height of about 1.2."""
    import onnx
    from onnx import numpy_helper

    model = onnx.load(str(folder / "models/detector.onnx"))
    (bias,) = (each for each in model.graph.initializer if each.name == "b2")
    bias.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(bias) - 8, "b2"))
    onnx.save(model, str(folder / "models/detector.onnx"))


MUTANTS = {
    "a blind spot": (None, "STOP", "detector.sees: refuted"),
    "a weaker brake": (("system.rcl", "2 <= in.deceleration", "1 <= in.deceleration"), "SHORT", "brake.short: refuted"),
    "an optimistic rate": (
        ("plan.yaml", "at_least: 0.99,", "at_least: 0.999,"),
        "STOP",
        "the guarantees give at least 0.99, and 0.999 is asked: detector.sees with 0.99 in each step",
    ),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_is_caught_and_named(tmp_path: Path, name: str) -> None:
    place = tmp_path / "robot"
    assert avow("init", "robot", cwd=tmp_path).returncode == 0
    shutil.rmtree(place / "contracts/thermostat")
    folder = Path(shutil.copytree(ROOT / "docs/examples/delivery", place / "contracts/delivery"))
    change, requirement, words = MUTANTS[name]
    if change is None:
        blind(folder)
    else:
        edit(folder / change[0], change[1:])
        if change[0] == "system.rcl":  # the world is weaker, too
            edit(folder / "plan.yaml", ("assume: 2 <=", "assume: 1 <="))
    for each in ("STOP", "SHORT"):
        avow("validate", "delivery", each, "--as", "A. Person", cwd=place)
    done = avow("verify", cwd=place)
    assert (done.returncode, words in done.stdout) == (1, True), done.stdout + done.stderr
    case = json.loads((place / "reports/delivery/report.json").read_text())
    levels = {r["id"]: r["level"] for r in case["requirements"]}
    assert levels[requirement] in ("not shown", "refuted")
    assert sum(level in ("not shown", "refuted") for level in levels.values()) == 1
