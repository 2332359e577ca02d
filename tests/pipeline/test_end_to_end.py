"""The main job through the real command line and doit, on the workspace that `avow init` makes."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import avow


def run(folder: Path, *command: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, **(env or {})},
        check=False,
    )


def verify(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return run(folder, "doit", *(more or ("verify",)))


def case(folder: Path, system: str = "thermostat") -> dict[str, object]:
    loaded: dict[str, object] = json.loads((folder / "reports" / system / "report.json").read_text())
    return loaded


def ledger(folder: Path, system: str = "thermostat") -> list[dict[str, object]]:
    lines = (folder / "artifacts" / "ledger" / f"{system}.jsonl").read_text().splitlines()
    return [json.loads(line)["evidence"] for line in lines]


def ran(done: subprocess.CompletedProcess[str]) -> set[str]:
    """The stages that were executed, as ``stage subject``."""
    found = re.findall(r"^  (check|sanity|compose|obligations|export|discharge) +(\S+)", done.stdout, re.MULTILINE)
    return {f"{stage} {subject}" for stage, subject in found}


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace from `avow init`. Tests that change it work on a copy."""
    folder = tmp_path_factory.mktemp("begun") / "robot"
    done = run(folder.parent, "avow", "init", "robot")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def made(begun: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """It, verified once."""
    folder = Path(shutil.copytree(begun, tmp_path_factory.mktemp("made") / "robot"))
    done = verify(folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture
def robot(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path / "robot")
    return tmp_path / "robot"


def edit(folder: Path, old: str, new: str, name: str = "system.rcl") -> None:
    path = folder / "contracts" / "thermostat" / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_the_new_workspace_verifies(made: Path) -> None:
    verdicts = {(e["obligation"], e["method"]): e["verdict"] for e in ledger(made)}
    assert verdicts["thermostat/thermostat/guarantee/warms", "hoare"] == "proved"
    assert verdicts["thermostat/thermostat/guarantee/warms", "hypothesis"] == "tested"
    assert verdicts["thermostat/thermometer/guarantee/calibrated", "hypothesis"] == "tested"
    for name in ("index.html", "report.json", "report.md"):
        assert (made / "reports" / "thermostat" / name).stat().st_size > 500
    assert (made / "reports" / "index.html").is_file()


def test_a_node_s_index_lists_what_can_be_checked_without_avow(made: Path) -> None:
    page = (made / "artifacts/thermostat/thermostat/index.md").read_text()
    assert "## warms: proved" in page
    smt = "artifacts/thermostat/thermostat/hoare/warms.pre.smt2"
    rows = [line for line in page.splitlines() if f"`z3 {smt}`" in line]
    assert rows
    assert "| hoare | proved | " in rows[0]
    assert "it prints `unsat`" in rows[0]
    assert (made / smt).is_file()
    for target in re.findall(r"\]\(([^)]+)\)", page):
        assert (made / "artifacts/thermostat/thermostat" / target).exists(), target


def test_the_obligations_are_listed_those_of_sanity_apart(made: Path) -> None:
    told = avow("obligations", "thermostat/thermostat", cwd=made)
    assert told.returncode == 0, told.stderr
    claims, _, sanity = told.stdout.partition("thermostat: whether the contract is worth verifying")
    assert "thermostat/guarantee/warms" in claims
    assert "hoare, hypothesis" in " ".join(claims.split())
    assert "/sanity/" in sanity
    assert "/sanity/" not in claims
    assert "thermometer/" not in told.stdout
    data = json.loads(avow("obligations", "--json", cwd=made).stdout)
    (listed,) = data["systems"]
    assert listed == json.loads((made / "artifacts/thermostat/obligations.json").read_text())
    assert "thermometer/guarantee/calibrated" in avow("obligations", "thermometer", cwd=made).stdout
    for wrong in ("nothing", "thermostat/nothing", "nothing/thermostat"):
        refused = avow("obligations", wrong, cwd=made)
        assert (refused.returncode, "CLI00" in refused.stderr) == (2, True), refused.stderr


def test_a_node_is_explained_by_its_system_and_name(made: Path) -> None:
    told = avow("explain", "thermostat/thermometer", cwd=made)
    assert told.returncode == 0, told.stderr
    assert "node thermometer" in told.stdout
    assert "guarantees calibrated" in told.stdout


def test_doit_lists_every_task_with_words(made: Path) -> None:
    lines = run(made, "doit", "list", "--all").stdout.splitlines()
    assert any(line.startswith("discharge:thermostat:thermostat:hoare ") for line in lines)
    assert [line for line in lines if len(line.split()) < 4] == []


@pytest.mark.slow
def test_again_nothing_is_run(robot: Path) -> None:
    before = (robot / "reports" / "thermostat" / "index.html").stat().st_mtime_ns
    done = verify(robot)
    assert done.returncode == 0, done.stdout + done.stderr
    assert ran(done) == set()
    assert "nothing to do" in done.stdout
    assert (robot / "reports" / "thermostat" / "index.html").stat().st_mtime_ns == before


@pytest.mark.nightly
def test_deleted_outputs_come_back(robot: Path) -> None:
    shutil.rmtree(robot / "artifacts")
    shutil.rmtree(robot / "reports")
    done = verify(robot)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (robot / "reports" / "thermostat" / "index.html").is_file()
    assert ledger(robot)


@pytest.mark.nightly
def test_two_runs_at_once_do_the_work_once(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "twice"
    shutil.copytree(made / "contracts", folder / "contracts")
    shutil.copy(made / "dodo.py", folder)
    runs = [
        subprocess.Popen([sys.executable, "-m", "doit", "verify"], cwd=folder, stdout=subprocess.DEVNULL)
        for _ in range(2)
    ]
    assert [r.wait(timeout=200) for r in runs] == [0, 0]
    every = [(e["obligation"], e["method"], e["key"]) for e in ledger(folder)]
    assert len(every) == len(set(every))


@pytest.mark.nightly
def test_fresh_settles_everything_anew(robot: Path) -> None:
    before = len(ledger(robot))
    done = run(robot, "avow", "verify", "--fresh")
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(ledger(robot)) == 2 * before
    assert case(robot)["fresh"]


def test_bad_input_is_located_and_ends_with_2(begun: Path, tmp_path: Path) -> None:
    robot = Path(shutil.copytree(begun, tmp_path / "robot"))
    edit(robot, "models/thermostat.imp", "models/thermostatt.imp", "plan.yaml")
    done = verify(robot)
    text = done.stdout + done.stderr
    assert done.returncode == 2, text
    assert "Traceback" not in text
    assert re.search(r"plan\.yaml:\d+:\d+", text), text
    assert "thermostatt.imp" in text, text


def test_a_system_in_the_place_of_a_task_is_named(begun: Path) -> None:
    done = run(begun, "doit", "verify", "thermostat")
    assert done.returncode == 2
    assert "write `doit verify:thermostat`" in done.stderr


@pytest.mark.parametrize("how", ["a copy", pytest.param("a link", marks=pytest.mark.slow)])
def test_two_systems_of_one_name_are_mixed_up_by_nobody(begun: Path, tmp_path: Path, how: str) -> None:
    robot = Path(shutil.copytree(begun, tmp_path / "robot"))
    contracts, name = robot / "contracts", "thermostat"
    if how == "a copy":
        shutil.copytree(contracts / name, contracts / "another")
    else:
        (contracts / "another").symlink_to(name)
    done = verify(robot)
    text = done.stdout + done.stderr
    assert done.returncode == 2, text
    assert "CLI020" in text, text
    assert all(f"contracts/{folder}/plan.yaml" in text for folder in ("another", name)), text


@pytest.mark.slow
def test_a_plan_below_another_is_told(begun: Path, tmp_path: Path) -> None:
    """Nothing is green by omission: what no run looks at is named, with its place."""
    robot = Path(shutil.copytree(begun, tmp_path / "robot"))
    around, deep = robot / "contracts/thermostat", "contracts/thermostat/spare/plan.yaml"
    shutil.copytree(around, robot / "contracts/thermostat/spare")
    known = json.loads(run(robot, "avow", "check", "thermostat", "--json").stdout)["diagnostics"]
    assert [(d["code"], d["severity"]) for d in known if d["code"] == "CLI021"] == [("CLI021", "warning")]
    done = verify(robot, "check")
    assert done.returncode == 0, done.stderr
    assert f"warning[CLI021]: {deep}:1: this plan is not verified: 'thermostat' does not take it in" in done.stderr
    for _ in range(3):  # the last of them has nothing to do
        assert f"{deep}: this plan is not verified: 'thermostat' does not take it in" in verify(robot).stdout
    assert "CLI021" in verify(robot).stdout
    edit(robot, "policy:", "lints_off: [CLI021]\npolicy:", "plan.yaml")
    assert "CLI021" not in verify(robot, "check").stderr
    edit(robot, "lints_off: [CLI021]", "subsystems: {spare: {system: spare}}", "plan.yaml")
    assert "CLI021" not in verify(robot, "check").stderr


def test_a_contract_without_a_plan_is_no_green_run(robot: Path) -> None:
    (robot / "contracts" / "thermostat" / "plan.yaml").unlink()
    for done in (verify(robot), avow("verify", "thermostat", cwd=robot)):
        assert done.returncode == 2, done.stdout
        assert "plan.yaml" in done.stderr


@pytest.mark.slow
def test_a_plan_in_no_systems_folder_is_an_error(begun: Path, tmp_path: Path) -> None:
    robot = Path(shutil.copytree(begun, tmp_path / "robot"))
    contracts = robot / "contracts"
    shutil.copytree(contracts / "thermostat", contracts / "heating=hot/spare")
    done = verify(robot, "check")
    assert done.returncode == 2, done.stderr
    assert "contracts/heating=hot/spare/plan.yaml:1:1" in done.stderr
    assert "this plan is not verified" in done.stderr
    edit(robot, "policy:", "subsystems: {spare: {system: ../heating=hot/spare}}\npolicy:", "plan.yaml")
    assert "CLI021" not in verify(robot, "check").stderr
    (contracts / "plan.yaml").write_text("{}")
    done = verify(robot, "check")
    assert (done.returncode, "contracts/plan.yaml:1:1" in done.stderr) == (2, True), done.stderr


@pytest.mark.nightly
def test_a_broken_system_does_not_stop_the_others(robot: Path) -> None:
    (robot / "contracts" / "broken").mkdir()
    (robot / "contracts" / "broken" / "plan.yaml").write_bytes(b"\x00\xff\xfe: [")
    edit(robot, "// the control law", "// the law of control", "models/thermostat.imp")
    done = verify(robot)
    text = done.stdout + done.stderr
    assert done.returncode == 2, text
    assert "Traceback" not in text
    # of the other one, what its changed program stales is run again, and nothing else
    assert {s for s in ran(done) if s.startswith("discharge")} == {"discharge thermostat:thermostat:hoare"}
    assert case(robot)["exit_code"] == 0


def test_init_overwrites_nothing(made: Path) -> None:
    done = run(made.parent, "avow", "init", "robot")
    assert done.returncode == 2
    assert "not empty" in done.stderr


def test_a_system_without_a_report_is_said_to_have_none(robot: Path) -> None:
    (robot / "contracts" / "kettle").mkdir()
    (robot / "contracts" / "kettle" / "plan.yaml").write_text("node: {}")
    done = run(robot, "avow", "explain", "kettle/boiler/guarantee/boils")
    assert done.returncode == 2
    assert "there is no report of kettle yet" in done.stderr
    assert "avow verify kettle" in done.stderr


def test_outside_a_workspace_the_message_says_what_to_do(tmp_path: Path) -> None:
    done = run(tmp_path, "avow", "verify")
    assert done.returncode == 2
    assert "avow init" in done.stderr
