"""The public face, by itself: the page's program runs, and imports nothing of Avow but `avow.api`."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import avow.api
from avow.cli import command

PAGE = Path(__file__).parents[2] / "docs" / "developers" / "api.md"


@pytest.mark.slow
def test_the_pages_program_runs(tmp_path: Path) -> None:
    program = re.search(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert program is not None
    assert set(re.findall(r"\bavow\.\w+", program[1])) == {"avow.api"}
    command("init").main([str(tmp_path / "robot")], standalone_mode=False)
    done = subprocess.run(
        [sys.executable, "-c", program[1]],
        cwd=tmp_path / "robot",
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "['thermometer', 'thermostat']" in done.stdout
    assert done.stdout.rstrip().endswith("RCL002")


def test_the_page_names_all_of_it() -> None:
    functions = {name for name in avow.api.__all__ if name.islower()}
    assert functions == set(re.findall(r"^\| `(\w+)\(", PAGE.read_text(encoding="utf-8"), re.MULTILINE))


def test_it_is_light() -> None:
    code = "import sys, avow.api; print([m for m in ('z3', 'lark', 'doit', 'hypothesis') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
