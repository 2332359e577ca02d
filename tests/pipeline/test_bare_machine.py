"""A machine with Python and git alone: what can be shown is shown, and what a missing tool leaves open is visible."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import edit

from avow.backend_kit.registry import backend, names
from avow.base.tools import works
from avow.pipeline import doctor

METHODS = "      - hoare: {program: models/thermostat.imp}\n"
ACCEPTS = "policy: {profile: default, programs: [proved, checked, tested, not-run]}\n"


def _run(folder: Path, path: Path, *command: str) -> subprocess.CompletedProcess[str]:
    bare = {name: value for name, value in os.environ.items() if not name.startswith("A")}  # AJPF_HOME, AVOW_…
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
        env={**bare, "PATH": str(path), "PYTHONPATH": str(path)},
        check=False,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """All that is on the PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "python3").symlink_to(os.path.realpath(sys.executable))
    git = shutil.which("git")
    if git is not None:
        (folder / "git").symlink_to(git)
    # The extra `cpp` may be installed: a module in place of its package hides the compiler of the wheel.
    (folder / "ziglang.py").touch()
    return folder


@pytest.mark.slow
def test_what_a_missing_tool_leaves_open_is_visible_and_named(path: Path, tmp_path: Path) -> None:
    """A node in C++ without clang: its claims are `not-run` in every format, with the command. The exit code is 0 if
    the policy accepts that, and 3 if it does not."""
    made = _run(tmp_path, path, "avow", "init", "robot")
    assert made.returncode == 0, made.stderr
    robot = tmp_path / "robot"
    system = robot / "contracts" / "thermostat"
    (system / "models" / "thermostat_avow.hpp").write_text("struct AvowNode {};\n")
    plan = system / "plan.yaml"
    source = "    source: {cpp: models/thermostat_avow.hpp}\n    methods:\n"
    more = "      - fuzz: {}\n      - dafny: {implementation: models/thermostat_impl.dfy}\n"
    edit(plan, (f"    methods:\n{METHODS}", f"{source}{METHODS}{more}"), ("policy: default\n", ACCEPTS))
    skeleton = _run(robot, path, "avow", "translate", "--to", "dafny", "thermostat", "-o", "made")
    assert skeleton.returncode == 0, skeleton.stderr
    (robot / "made" / "thermostat" / "thermostat_impl.dfy").rename(system / "models" / "thermostat_impl.dfy")

    done = _run(robot, path, "doit", "verify")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 claims about programs not run" in " ".join(done.stdout.split())
    report = json.loads((robot / "reports" / "thermostat" / "report.json").read_text())
    statuses = {o["obligation"]["name"]: o["status"] for o in report["obligations"]}
    assert statuses["runs-without-fault"] == statuses["agrees-with-model"] == "not-run"
    assert statuses["warms"] == "proved"
    text = (robot / "reports" / "thermostat" / "report.md").read_text()
    assert "2 claims about programs not run" in text.split("##")[0]
    assert "2 not run, which the policy accepts" in text
    assert (
        "A tool is missing, failed or gave no verdict. Install: sudo apt install clang; sudo apt install dafny." in text
    )
    assert "nothing is known of these claims. Install: sudo apt install clang." in text

    edit(plan, (ACCEPTS, "policy: default\n"))
    done = _run(robot, path, "doit", "verify")
    assert done.returncode == 3, done.stdout + done.stderr
    assert "install what `fuzz` needs: sudo apt install clang" in done.stdout


@pytest.mark.slow
def test_doctor_names_what_is_missing(path: Path, tmp_path: Path) -> None:
    done = _run(tmp_path, path, "avow", "doctor", "--json")
    assert done.returncode == 3, done.stdout + done.stderr
    tools = {(t["used_by"], t["tool"]): t for t in json.loads(done.stdout)["tools"]}
    assert tools["fuzz", "clang++"]["version"] is None
    assert tools["fuzz", "clang++"]["install"] == "sudo apt install clang"
    assert tools["dafny", "dafny"]["install"] == "sudo apt install dafny"
    assert tools["logic", "z3"]["version"]
    assert not tools["logic", "z3"]["fault"]


def test_every_tool_has_a_job_that_tries_it() -> None:
    tools = [tool for name in names() for tool in backend(name).tools() if tool.present]
    assert [tool.name for tool in tools if tool.trial is None] == []
    assert "No module named 'no_such_module'" in works("import no_such_module")
    assert works("print('an error is mentioned')") == ""


@pytest.mark.slow
def test_the_job_of_a_package_fails_with_a_package_that_does_nothing(path: Path) -> None:
    for _, name, _, line in doctor._PACKAGES:
        (path / f"{name}.py").touch()
        environment = {**os.environ, "PYTHONPATH": str(path)}
        done = subprocess.run([sys.executable, "-c", line], env=environment, capture_output=True, check=False)
        assert done.returncode == 1, name
