"""Exit codes of slips on the command line: 2 and a sentence, never 0 for nothing done, never a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import avow


def run(folder: Path, *command: str) -> tuple[int, str]:
    if command[0] == "avow":
        done = avow(*command[1:], cwd=folder)
    else:
        done = subprocess.run(
            [sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True, timeout=60, env=os.environ
        )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(
    "command",
    [
        ("avow", "verify", "-n", "-3"),
        ("doit", "-n", "-3", "verify"),
        ("avow", "report", "nope"),
        ("avow", "verify", "nope"),
        ("avow", "init", "/proc/nowhere/at/all"),
    ],
)
def test_a_slip_ends_with_2(workspace: Path, command: tuple[str, ...]) -> None:
    system = workspace / "contracts" / "s"
    system.mkdir()
    (system / "plan.yaml").write_text("system: s\n")
    (system / "system.rcl").write_text("node n { inputs() outputs(b : BOOL) topics() guarantee(out.b) }")
    code, text = run(workspace, *command)
    assert code == 2, text
    assert text.strip()
    assert "Traceback" not in text
