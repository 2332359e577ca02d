"""A third party's backend passes the suite in an environment of its own kind, and one that lies fails it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from helpers import some

PLUGIN = "avow.conformance.plugin"
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *arguments]
    if not any(point.value == PLUGIN for point in entry_points(group="pytest11")):  # a checkout installed before it was
        command += ["-p", PLUGIN]
    environment = {**os.environ, "PYTHONPATH": str(folder / "site")}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.fixture
def place(tmp_path: Path) -> Path:
    for name in ("rows_backend.py", "test_rows_backend.py"):
        (tmp_path / name).write_text((EXAMPLES / name).read_text())
    return tmp_path


@pytest.mark.slow
def test_the_examples_pass(place: Path) -> None:
    """The one in the folder, and the one on the page."""
    page = (EXAMPLES.parent / "developers" / "adding-a-backend.md").read_text()
    (found,) = re.findall(r"^```python conformance\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (place / "test_page.py").write_text(found)
    done = run(place)
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    some(
        [
            ("return (path,) if path is not None else ()", "return ()", "test_its_files_are_named"),
            ('Verdict.TESTED, f"{len', 'Verdict.PROVED, f"{len', "test_seeded_verdicts"),
            ("Counterexample(tuple(", "None and Counterexample(tuple(", "test_seeded_verdicts"),
            ("for o in job.obligations)", "for o in job.obligations[:1])", "test_seeded_verdicts"),
            ("Verdict.ERROR, summarized(", "Verdict.TESTED, summarized(", "test_files_that_are_missing"),
            ('    version = "1"\n', "", "test_it_keeps_the_promise"),
            ("uses_scenario = False", "uses_scenario = 0", "test_it_keeps_the_promise"),
            ('"additionalProperties": False', '"additionalProperties": "no"', "test_the_schema_is_one"),
            (
                '        return Report(outcomes, "rows"',
                '        (job.root / "x").touch()\n        return Report(outcomes, "rows"',
                "test_seeded_verdicts",
            ),
        ],
        0,
        slow=5,
    ),
)
def test_a_seeded_fault_is_told(place: Path, old: str, new: str, told: str) -> None:
    path = place / "rows_backend.py"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    done = run(place, "-k", told)
    assert done.returncode == 1, done.stdout[-3000:]


def test_pytest_loads_the_plugin() -> None:
    declared = tomllib.loads((EXAMPLES.parents[1] / "pyproject.toml").read_text())["project"]["entry-points"]
    assert declared["pytest11"] == {"avow": PLUGIN}


@pytest.mark.slow
def test_by_name_in_an_environment_where_it_is_installed(place: Path) -> None:
    """The backend as an installed package of its own; its suite, and no other test, runs."""
    made = place / "site" / "rows_backend-1.dist-info"
    made.mkdir(parents=True)
    (place / "rows_backend.py").rename(place / "site" / "rows_backend.py")
    (made / "METADATA").write_text("Metadata-Version: 2.1\nName: rows-backend\nVersion: 1\n")
    (made / "entry_points.txt").write_text("[avow.backends]\nrows = rows_backend:BACKEND\n")
    (place / "test_other.py").write_text("def test_nothing():\n    assert False\n")
    done = run(place, "--avow-backend", "rows", "-v")
    assert done.returncode == 0, done.stdout[-3000:]
    assert "avow backend rows: rows_backend:BACKEND" in done.stdout
    assert "1 deselected" in done.stdout
    done = run(place, "--avow-backend", "coin")
    assert done.returncode == 4
    assert "no conformance suite here for coin" in done.stderr + done.stdout
