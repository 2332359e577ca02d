"""Every command and every file of the tutorial, run in order."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

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
            command, _, comment = line.partition("#")
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


def exit_code(arguments: list[str]) -> int:
    try:
        main(arguments)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


@pytest.mark.slow
def test_the_tutorial_runs(tmp_path: Path) -> None:
    folder = tmp_path
    env = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    ran = 0
    for kind, body in blocks(TUTORIAL.read_text(encoding="utf-8")):
        if kind != "sh":
            name = kind.split()[1]
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(body, encoding="utf-8")
            continue
        for line in body.splitlines():
            command, _, comment = line.partition("#")
            if command.startswith("cd "):
                folder /= command[3:].strip()
                continue
            expected = int(comment.rsplit("exits ", 1)[1]) if "exits " in comment else 0
            done = subprocess.run(
                ["bash", "-c", command], cwd=folder, env=env, capture_output=True, text=True, timeout=200, check=False
            )
            assert done.returncode == expected, f"{line}\n{done.stdout}\n{done.stderr}"
            assert "Traceback" not in done.stdout + done.stderr
            ran += 1
    assert ran >= 12
