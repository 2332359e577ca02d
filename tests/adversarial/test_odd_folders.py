"""Folders of other people: what is odd in them is a message, and commands that only read execute nothing of them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

AVOW = str(Path(sys.executable).with_name("avow"))
DOIT = str(Path(sys.executable).with_name("doit"))
RCL = "node n { inputs() outputs(b : BOOL) topics() guarantee g (out.b or not out.b) }\n"
EVIL = "from pathlib import Path\nPath(__file__).with_name('executed').touch()\n"


def run(root: Path, *command: str) -> tuple[int, str]:
    env = {**os.environ, "PYTHONPATH": f"{root}{os.pathsep}.{os.pathsep}"} if command[-1] == "path" else os.environ
    words = [word for word in command if word != "path"]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=120, check=False, env=env)
    text = done.stdout + done.stderr
    assert "Traceback" not in text, text
    return done.returncode, text


@pytest.fixture
def place(tmp_path: Path) -> Path:
    root = tmp_path / "work"
    assert run(tmp_path, AVOW, "init", "work")[0] == 0
    folder = root / "contracts" / "s"
    folder.mkdir()
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text("system: s\nnodes: {n: {criticality: low, methods: []}}\n")
    return root


@pytest.mark.nightly
def test_commands_that_read_load_no_plug_in(place: Path) -> None:
    (place / "evil.py").write_text(EVIL)
    plan = place / "contracts" / "s" / "plan.yaml"
    plan.write_text("system: s\nplugins: [evil]\nnodes: {n: {criticality: low, methods: [evil]}}\n")
    for command in (["check", str(plan)], ["report"], ["audit"], ["check", str(place / "contracts" / "s" / "s.rcl")]):
        _, text = run(place, AVOW, *command, "path")
        assert not (place / "executed").exists(), command
    assert "not loaded" in text or "BACKEND005" in run(place, AVOW, "check", str(plan), "path")[1]


@pytest.mark.nightly
def test_no_module_of_the_folder_stands_in_for_another(place: Path) -> None:
    for name in ("z3.py", "json.py", "avow/__init__.py", "hypothesis.py", "lark.py"):
        (place / name).parent.mkdir(exist_ok=True)
        (place / name).write_text(EVIL)
    for command in ([AVOW, "verify", "s"], [DOIT, "verify:s"]):
        code, text = run(place, *command)
        assert code in (0, 1), text
    (place / "json.py").unlink()  # doit itself needs that, before it looks at dodo.py
    assert run(place, sys.executable, "-m", "doit", "verify:s")[0] in (0, 1)
    assert not list(place.glob("**/executed"))


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["artifacts/ledger/s.jsonl", "artifacts/ledger/index"])
def test_a_pipe_where_the_ledger_should_be(place: Path, name: str) -> None:
    (place / "artifacts" / "ledger").mkdir(parents=True)
    os.mkfifo(place / name)
    for command in ("verify", "report"):
        code, text = run(place, AVOW, command, "s")
        assert "not a regular file" in text or code == 0, text
    assert run(place, AVOW, "verify", "s")[0] != 0


@pytest.mark.nightly
def test_a_pipe_in_the_plan_s_place_is_not_waited_for(place: Path) -> None:
    (place / "contracts/s/plan.yaml").unlink()
    os.mkfifo(place / "contracts/s/plan.yaml")
    assert run(place, AVOW, "verify", "s")[0] == 2


@pytest.mark.slow
def test_pipes_in_place_of_all_that_avow_wrote_are_replaced_and_not_waited_for(place: Path) -> None:
    first = run(place, AVOW, "verify", "thermostat")[0]
    ours = [
        path
        for folder in ("artifacts", "reports")
        for path in (place / folder).rglob("*")
        if path.is_file() and path.parent.name != "ledger" and path.name != "README.md"
    ]
    assert len(ours) > 30
    for path in ours:
        path.unlink()
        os.mkfifo(path)
    for command in (["report", "--check", "reports/thermostat"], ["audit"], ["explain", "thermostat.warms"]):
        run(place, AVOW, *command)
    code, text = run(place, AVOW, "verify", "thermostat")
    assert code == first, text
    assert [path for path in ours if path.exists() and not path.is_file()] == []


@pytest.mark.slow
def test_a_contract_that_is_a_link_out_of_the_folder(place: Path) -> None:
    (place / "outside.rcl").write_text(RCL)
    contract = place / "contracts" / "s" / "s.rcl"
    contract.unlink()
    contract.symlink_to(place / "outside.rcl")
    code, text = run(place, AVOW, "verify", "s")
    assert code != 0
    assert "leads out of the system's folder" in text
