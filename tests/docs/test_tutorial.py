"""Every command and every file of the tutorial, run in order."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

TUTORIAL = Path(__file__).parent.parent.parent / "docs" / "tutorial.md"


def blocks(text: str) -> list[tuple[str, str]]:
    return [(m[1], m[2]) for m in re.finditer(r"^```(.+?)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)]


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
