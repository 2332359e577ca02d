"""Every command and every file of the tutorial, run in order."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from helpers import warehouse_bag

from avow.backends.fuzz.clang_tool import clang
from avow.base.diagnostics import Rejected
from avow.cli import main
from avow.pipeline.workload import survey

TUTORIAL = Path(__file__).parent.parent.parent / "docs" / "tutorial.md"


def blocks(text: str) -> list[tuple[str, str]]:
    return [(m[1], m[2]) for m in re.finditer(r"^```(.+?)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)]


def test_the_tutorials_contract_and_plan_are_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but the runs of `doit` and what is read after them, which take a while."""
    monkeypatch.chdir(tmp_path)
    asked = 0
    for kind, body in blocks(TUTORIAL.read_text(encoding="utf-8")):
        if kind != "sh":
            place = Path(kind.split()[1])
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(body, encoding="utf-8")
            continue
        for line in body.splitlines():
            command, _, comment = line.partition("  #")
            match shlex.split(command):
                case ["cd", folder]:
                    monkeypatch.chdir(folder)
                case ["avow", "check" | "sanity" | "init", *_] as words:
                    expected = int(comment.rsplit("exits ", 1)[1]) if "exits " in comment else 0
                    assert exit_code(words[1:]) == expected, line
                    asked += 1
                case ["sed" | "mkdir", *_]:
                    subprocess.run(["bash", "-c", command], check=True)
    assert asked >= 4
    for system in ("thermostat", "gripper"):
        assert not isinstance(survey(Path("contracts") / system), Rejected)


@pytest.mark.parametrize("page", ["tutorial.md", "own-ros2-robot.md", "../README.md"])
def test_a_page_that_types_avow_says_where_the_shell_finds_it(page: str) -> None:
    """Before the first command of that name; the README's own commands name their place."""
    text = (TUTORIAL.parent / page).read_text(encoding="utf-8")
    typed = re.search(r"^(avow|doit) ", text, re.MULTILINE)
    assert "source .venv/bin/activate" in (text[: typed.start()] if typed else text)


def exit_code(arguments: list[str]) -> int:
    try:
        main(arguments)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def run(page: Path, folder: Path) -> str:
    """Run a page's commands word for word, and write its files; what was printed. Commands that want a running robot
    are left out, and those that want DDS or clang where it is not installed."""
    env = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    skipped = {"sh robot"}
    skipped |= {"sh dds"} if find_spec("cyclonedds") is None else set()
    skipped |= {"sh clang"} if not clang().present else set()
    told = ""
    for kind, body in blocks(page.read_text(encoding="utf-8")):
        if not kind.startswith("sh"):
            name = kind.split()[1]
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(body, encoding="utf-8")
        for line in body.splitlines() if kind.startswith("sh") and kind not in skipped else ():
            command, _, comment = line.partition("  #")
            if command.startswith("cd "):
                folder /= command[3:].strip()
                continue
            expected = int(comment.rsplit("exits ", 1)[1]) if "exits " in comment else 0
            done = subprocess.run(
                ["bash", "-c", command], cwd=folder, env=env, capture_output=True, text=True, timeout=200, check=False
            )
            assert done.returncode == expected, f"{line}\n{done.stdout}\n{done.stderr}"
            assert "Traceback" not in done.stdout + done.stderr
            told += f"$ {command.strip()}\n{done.stdout}\n"
    return told


@pytest.mark.slow
def test_the_tutorial_runs(tmp_path: Path) -> None:
    assert run(TUTORIAL, tmp_path).count("$ ") >= 12


@pytest.mark.slow
def test_the_page_on_an_own_ros2_robot_runs(tmp_path: Path) -> None:
    warehouse_bag(tmp_path / "run")
    told = run(TUTORIAL.with_name("own-ros2-robot.md"), tmp_path)
    assert "✘ warehouse: Not shown: 1 gate fails" in told  # the composition waits for what is unwritten
    assert "message outside its mapping" not in told
    contract = (tmp_path / "warehouse/contracts/warehouse/system.rcl").read_text(encoding="utf-8")
    assert "left out for want of a reading: charge (400 × NaN), capacity (400 × NaN), cell_voltage (400 × empty)" in (
        contract
    )
    assert "the recording has the same" in told
    assert "publications differ, of 400" in told  # the replay went on
    case = json.loads((tmp_path / "warehouse/reports/warehouse/report.json").read_text(encoding="utf-8"))
    guarantees = [view for view in case["obligations"] if view["obligation"]["kind"] == "guarantee"]
    found = {f"{view['obligation']['node']}.{view['obligation']['name']}": view for view in guarantees}
    assert {name: view["status"] for name, view in found.items()} == {
        "battery.to_write": "unwritten",
        "lifter.weak": "refuted" if clang().present else "unwritten",
        "scanner.to_write": "unwritten",
        "speed_limiter.near": "tested",
    }
    near = found["speed_limiter.near"]["evidence"]
    assert {item["entry"]["evidence"]["verdict"] for item in near if item["counts"]} == {"tested", "monitored"}
