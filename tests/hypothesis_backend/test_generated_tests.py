"""The generated test stands alone: pytest and Hypothesis run it as Avow does, and it says what the contract says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hoare.systems import make_job

from avow.backend_kit.protocol import Job
from avow.backends.hypothesis import BACKEND

from . import test_runs as runs
from . import test_sequences as classes
from .test_hypothesis_backend import GOLDEN, STEP, job


def by_pytest(wanted: Job, tmp_path: Path) -> str:
    """What pytest prints of the exported test, in a folder beside the system's, without Avow."""
    folder = tmp_path / "artifacts" / "made"
    folder.mkdir(parents=True)
    for name, text in BACKEND.export(wanted).items():
        (folder / name).write_text(text, encoding="utf-8")
        assert "avow." not in text
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(folder), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=folder, check=False)
    return done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (STEP, "1 passed"),
        (STEP.replace("r < 250", "r < 260"), "AssertionError: high"),
        (STEP.replace("done = ", "assert r < 130\n    done = "), "assert r < 130"),
    ],
    ids=["right", "broken", "raises"],
)
def test_a_function(text: str, said: str, tmp_path: Path) -> None:
    printed = by_pytest(job(tmp_path / "contracts" / "sensors", text), tmp_path)
    assert said in printed, printed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "said"),
    [
        ("r", "1 passed"),
        ("r + (self.n > 2)", "AssertionError: g"),
        ("r + 0 / (self.n < 3)", "Zero"),
    ],
)
def test_the_nodes_own_class(step: str, said: str, tmp_path: Path) -> None:
    folder = tmp_path / "contracts" / "made"
    folder.mkdir(parents=True)
    text = f"r):\n        self.n += 1\n        return {step}\n"
    printed = by_pytest(classes.job(folder, classes.REAL, classes.SAME, text), tmp_path)
    assert said in printed, printed


@pytest.mark.slow
def test_runs_with_memory(tmp_path: Path) -> None:
    """The gate lets a request begin anew at once: `later` says that it must not."""
    printed = by_pytest(runs.job(tmp_path / "contracts" / "gates", runs.STEPS, cases=1500), tmp_path)
    assert "AssertionError: later" in printed, printed


def test_export_is_pure_and_golden(tmp_path: Path) -> None:
    wanted = job(tmp_path / "sensors")
    made = BACKEND.export(wanted)
    assert made == BACKEND.export(wanted)
    (text,) = made.values()
    golden = GOLDEN / "test_sensor.py.txt"
    if os.environ.get("AVOW_REFRESH"):
        golden.write_text(text)
    assert text == golden.read_text(), f"{golden} differs: refresh it if the change is meant"


HARD = """
context {{ At : REAL x REAL --> BOOL; }}
node n {{
  inputs( at : At, x : REAL ) outputs( y : REAL ) topics()
  guarantee g {sentence} ( {formula} )
}}
"""
NEAR = "exists(a in REAL | forall(x', y' in REAL | in.at(x', y') -> a - 1 <= x' <= a + 1))"


def test_what_no_plain_python_says_is_left_to_avow(tmp_path: Path) -> None:
    contract = HARD.format(sentence="", formula=f"({NEAR}) or out.y == 0")
    wanted = make_job(tmp_path, contract, "n", {"subject": "s.py:f"}, {"s.py": "def f(at, x): return 0"}, "hypothesis")
    (text,) = BACKEND.export(wanted).values()
    assert "left to `avow verify`: nothing that it says names the values of a" in text
    assert "assert " not in text


@pytest.mark.parametrize(
    "text", ["''' \"\"\" \\", "{}{0}%s", "*/ -->", "); import os #", "ünïcode \U0001f916", "$(x) `y`"]
)
def test_a_contracts_text_stays_data(text: str, tmp_path: Path) -> None:
    """In comments and messages; the test that is made of any text compiles."""
    quoted = '"' + text.replace("\\", "").replace('"', "'") + '"'
    contract = HARD.format(sentence=quoted, formula="out.y == in.x")
    wanted = make_job(tmp_path, contract, "n", {"subject": "s.py:f"}, {"s.py": "def f(x): return x"}, "hypothesis")
    (made,) = BACKEND.export(wanted).values()
    compile(made, "made", "exec")
