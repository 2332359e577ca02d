"""The worked examples verify, as a reader of docs/examples would do it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from golden.recorded import same, verdicts
from helpers import some
from report.first_screen import departures

from avow.assurance.codec import read_case

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs/examples"
TOOLS = ("clang", "strace", "dafny")
"""The recorded verdicts of the examples are those of a machine that has these."""
VERDICTS = {
    "warehouse": "Shown by tests and of models (failure rate in use unknown)",
    "ventilator": "Shown of models",
    "geofence": "Shown by tests and of models (failure rate in use unknown)",
    "rover": "Shown by tests and of models (at most 14 % of runs fail, at 95 % confidence)",
    "docking": "Shown by tests and of models (failure rate in use unknown)",
}


def avow(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "avow", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def test_every_example_is_in_the_gallery() -> None:
    folders = {path.parent.name for path in EXAMPLES.glob("*/plan.yaml")}
    assert folders == set(VERDICTS)
    page = (EXAMPLES / "README.md").read_text()
    assert all(f"[{name}]({name}/system.rcl)" in page for name in folders)


@pytest.mark.slow
def test_the_draft_has_a_conflict_and_the_rest_no_fault() -> None:
    done = avow("sanity", "docs/examples/ventilator/conflict.rcl", cwd=ROOT)
    assert done.returncode == 1
    assert "no output meets relief and off" in " ".join(done.stdout.split())
    found = avow("check", *(f"docs/examples/{name}/plan.yaml" for name in VERDICTS), cwd=ROOT)
    assert (found.returncode, "warning" in found.stderr + found.stdout) == (0, False), found.stderr


@pytest.mark.slow
def test_the_examples_verify(tmp_path: Path) -> None:
    assert avow("init", "robot", cwd=tmp_path).returncode == 0
    place = tmp_path / "robot"
    for name in VERDICTS:
        shutil.copytree(EXAMPLES / name, place / "contracts" / name)
    done = avow("verify", cwd=place)
    assert done.returncode == 0, done.stdout + done.stderr
    for name, verdict in VERDICTS.items():
        case = json.loads((place / "reports" / name / "report.json").read_text())
        assert case["answers"]["verdict"] == verdict, name
        checked = avow("report", "--check", name, cwd=place)
        assert checked.returncode == 0, checked.stdout
        if shutil.which("chromium"):
            report = place / "reports" / name
            assert departures(read_case(report), (report / "index.html").read_text(), tmp_path) == [], name
    if all(map(shutil.which, TOOLS)):
        same(
            "examples",
            (line for name in sorted(VERDICTS) for line in verdicts(place / "reports" / name / "report.json")),
        )


def test_examples_and_what_init_makes_are_in_the_layout_that_the_hook_asks_for() -> None:
    files = [*EXAMPLES.glob("*/*.rcl"), *(ROOT / "avow/cli/template").rglob("*.rcl")]
    assert len(files) >= 5
    assert avow("fmt", "--check", *map(str, files), cwd=ROOT).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("template", some(["plain", "ros1", "ros2"], 1))
def test_what_init_makes_has_nothing_to_remark(template: str, tmp_path: Path) -> None:
    assert avow("init", "robot", "--template", template, cwd=tmp_path).returncode == 0
    place = tmp_path / "robot"
    found = avow("check", "thermostat", "--json", cwd=place)
    told = {d["code"] for d in json.loads(found.stdout)["diagnostics"]}
    assert (found.returncode, told - {"MON107"}) == (0, set()), "but for what the monitor says that it reads"
    assert avow("simulate", "thermostat", cwd=place).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("template", ["plain", "ros1", "ros2"])
def test_what_init_makes_verifies_and_warns_of_nothing(template: str, tmp_path: Path) -> None:
    assert avow("init", "robot", "--template", template, cwd=tmp_path).returncode == 0
    done = avow("verify", cwd=tmp_path / "robot")
    assert (done.returncode, "warning" in done.stdout + done.stderr) == (0, False), done.stdout + done.stderr
    (command,) = tool_commands(tmp_path / "robot", "thermometer", "hypothesis")
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    again = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path / "robot", env=environment, capture_output=True, text=True, check=False
    )
    assert again.returncode == 0, again.stdout + again.stderr


def tool_commands(place: Path, node: str, method: str) -> set[str]:
    """The commands that the report prints for asking a tool again."""
    from avow.assurance.codec import read_case
    from avow.report.wording import tool_command

    case = read_case(place / "reports/thermostat")
    entries = [item.entry for view in case.obligations if view.obligation.node == node for item in view.evidence]
    return {tool_command(entry.evidence) for entry in entries if entry.evidence.method == method} - {""}


@pytest.mark.slow
@pytest.mark.parametrize("template", some(["ros1", "ros2"], 1))
def test_a_package_for_ros_has_a_test_and_a_monitor(template: str, tmp_path: Path) -> None:
    from xml.etree import ElementTree

    assert avow("init", "robot", "--template", template, cwd=tmp_path).returncode == 0
    place = tmp_path / "robot"
    assert ElementTree.parse(place / "package.xml").findtext("name") == "robot_contracts"
    for name in ("package.xml", "CMakeLists.txt"):
        assert (place / name).read_text() == (ROOT / "docs/adoption/ros" / name).read_text()
    plan = (place / "contracts/thermostat/plan.yaml").read_text()
    assert f"ros_version: {template}" in plan
    found = avow("check", "thermostat", cwd=place)
    assert found.returncode == 0, found.stderr + found.stdout


def test_the_files_for_other_tools_are_well_formed() -> None:
    import yaml

    kit = ROOT / "docs/adoption"
    for name in ("github.yaml", "gitlab.yaml"):
        assert "avow" in str(yaml.safe_load((kit / name).read_text()))
    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    for hook in hooks:
        words = hook["entry"].split()
        assert avow(words[1], "--help", cwd=ROOT).returncode == 0
    for path in (kit / "vscode").rglob("*.json"):
        json.loads(path.read_text())
