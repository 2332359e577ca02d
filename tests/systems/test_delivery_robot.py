"""The delivery robot among people: its number, its data and network, and its mutants, which are found."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SYSTEM = ROOT / "contracts/delivery_robot"


def avow(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "avow", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def verified(place: Path) -> tuple[int, str, dict[str, Any]]:
    done = avow("verify", cwd=place)
    return done.returncode, done.stdout, json.loads((place / "reports/delivery_robot/report.json").read_text())


def workspace(place: Path) -> Path:
    shutil.copy(ROOT / "dodo.py", place)
    return Path(shutil.copytree(SYSTEM, place / "contracts/delivery_robot"))


MUTANTS = {
    "blind_spot.onnx": {"detector.sees": "9400 runs, 951 failed", "detector.tall": "out.seen"},
    "weak_brake.patch": {"brake.short": "out.distance = 125.792", "brake.halts": "out.speed"},
    "optimistic_rate.patch": {"tracker.follows": "with probability 0.99982"},
}


@pytest.mark.slow
@pytest.mark.needs_perception
@pytest.mark.needs_chance
@pytest.mark.needs_motion
@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_is_caught_and_named(tmp_path: Path, name: str) -> None:
    folder = workspace(tmp_path)
    mutant = folder / "mutants" / name
    if mutant.suffix == ".patch":
        subprocess.run(["git", "apply", mutant], cwd=folder, check=True)
    else:
        shutil.copy(mutant, folder / "models/detector.onnx")
    if name == "optimistic_rate.patch":  # a person who believes the rate
        for requirement in ("STOP", "DRIVES"):
            avow("validate", "delivery_robot", requirement, "--as", "A. Person", cwd=tmp_path)
    code, said, case = verified(tmp_path)
    found = {
        f"{v['obligation']['node']}.{v['obligation']['name']}": str([e["entry"]["evidence"] for e in v["evidence"]])
        for v in case["obligations"]
        if v["status"] == "refuted" and v["obligation"]["kind"] == "guarantee"
    }
    assert (code, found.keys()) == (1, MUTANTS[name].keys())
    for claim, words in MUTANTS[name].items():
        assert f"{claim}: refuted" in said
        assert words in found[claim]
    assert {r["id"]: r["level"] for r in case["requirements"]}["STOP"] == "not shown"


def test_every_mutant_is_on_the_page() -> None:
    page = (ROOT / "docs/delivery-robot.md").read_text()
    assert {path.name for path in (SYSTEM / "mutants").iterdir()} == MUTANTS.keys()
    assert all(f"`{name}`" in page for name in MUTANTS)


@pytest.mark.slow
@pytest.mark.needs_perception
@pytest.mark.needs_chance
@pytest.mark.needs_motion
def test_the_number_is_made_of_what_was_run(tmp_path: Path) -> None:
    folder = workspace(tmp_path)
    code, _, case = verified(tmp_path)
    stop = next(r for r in case["requirements"] if r["id"] == "STOP")
    assert (code, stop["rate"]["bound"], stop["rate"]["confidence"]) == (0, "0.00099", "0.95")
    leaves = {leaf["claim"].rpartition("/")[2]: leaf for leaf in stop["rate"]["leaves"]}
    assert [s["trials"] for s in leaves["sees"]["strata"]] == [4700, 4700]
    with (folder / "data/encounters.csv").open() as file:
        fewer = file.readlines()[:-4000]
    (folder / "data/encounters.csv").write_text("".join(fewer))
    code, said, _ = verified(tmp_path)
    assert (code, "detector.sees: unknown" in said) == (1, True)


@pytest.mark.needs_perception
def test_the_script_makes_the_data_and_the_network(tmp_path: Path) -> None:
    """The weights up to rounding, which differs between machines."""
    import numpy as np
    import onnx

    folder = workspace(tmp_path)
    subprocess.run([sys.executable, folder / "models/train.py"], check=True)
    for name in ("encounters.csv", "readings.csv"):
        assert (folder / "data" / name).read_bytes() == (SYSTEM / "data" / name).read_bytes()
    for name in ("models/detector.onnx", "mutants/blind_spot.onnx"):
        ours, made = (onnx.load(str(place / name)).graph.initializer for place in (SYSTEM, folder))
        for one, other in zip(ours, made, strict=True):
            assert np.allclose(onnx.numpy_helper.to_array(one), onnx.numpy_helper.to_array(other), atol=1e-3)


HIDDEN = """
from importlib import metadata
version = metadata.version
def visible(name):
    if name in ("codac", "maraboupy", "onnxruntime", "stormpy"):
        raise metadata.PackageNotFoundError(name)
    return version(name)
metadata.version = visible
"""
"""Makes the packages of the extras invisible."""


@pytest.mark.slow
def test_without_the_extras_it_ends_honestly(tmp_path: Path) -> None:
    workspace(tmp_path)
    (tmp_path / "sitecustomize.py").write_text(HIDDEN)
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-m", "avow", "verify"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    case = json.loads((tmp_path / "reports/delivery_robot/report.json").read_text())
    assert (done.returncode, case["answers"]["verdict"]) == (0, "Not shown: 4 of 4 requirements")
    report = (tmp_path / "reports/delivery_robot/report.md").read_text()
    assert all(f"pip install 'avow\\[{extra}\\]'" in report for extra in ("perception", "chance", "motion"))
