"""What is kept to save time changes nothing but time: a report after edits, by a user who has run before and by one who
has not, is the same to the byte, but for times and what is chained to them."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .made import programs

ROOT = Path(__file__).parents[2]
OF_TIME = re.compile(
    r"[0-9a-f]{12,64}|\d{8}T\d{6}\.\d+-\d+"
    r"|\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(\+00:00|Z)?"
    r"|record \d+"  # works may end in another order
    r'|"seconds": [\d.]+|\d+(\.\d+)? (s|seconds|ms)\b|time="[\d.]+"'
)


def verify(root: Path, home: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "doit", "-n", "1", "verify"],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=200,
        env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(home)},
    )
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    assert "stages run" in done.stdout


def reports(root: Path) -> dict[str, str]:
    """Every report but the PDF's pictures, without what tells the time."""
    files = sorted(f for f in (root / "reports").rglob("*") if f.is_file() and f.suffix != ".pdf")
    return {str(f.relative_to(root)): OF_TIME.sub("TIME", f.read_text()) for f in files}


def edit(root: Path, rng: random.Random) -> None:
    contract, plan = (root / "contracts" / "made" / name for name in ("system.rcl", "plan.yaml"))
    text = contract.read_text()
    match rng.randrange(6):
        case 0 | 1:  # a clause
            found = rng.choice(list(re.finditer(r"> (\d+) ->", text)))
            text = f"{text[: found.start()]}> {rng.randrange(4)} ->{text[found.end() :]}"
        case 2:  # where everything stands
            text = "// a comment\n" + text
        case 3:  # a clause that its program does not keep
            text = text.replace(">= in.x0", ">= 5 + in.x0", 1) if "5 + in.x0" not in text else text.replace("5 + ", "")
        case 4:
            other = ("high", "low") if "high" in plan.read_text() else ("low", "high")
            plan.write_text(plan.read_text().replace(*other, 1))
        case _:
            program = root / "contracts" / "made" / "models" / f"n{rng.randrange(2)}.imp"
            program.write_text(program.read_text().replace("> 10", f"> {rng.randrange(8, 12)}"))
    contract.write_text(text)


def walk(tmp_path: Path, seed: int, steps: int) -> None:
    rng, warm, home = random.Random(seed), tmp_path / "warm" / "made", tmp_path / "home"
    programs(warm / "contracts" / "made", 2, 2)
    shutil.copy(ROOT / "dodo.py", warm)
    verify(warm, home)
    for step in range(steps):
        for _ in range(rng.randrange(1, 3)):
            edit(warm, rng)
        (warm / "contracts" / "made" / "system.rcl").open("a").write(f"// {step}\n")
        cold = shutil.copytree(warm, tmp_path / str(step) / "made")
        verify(warm, home)
        verify(cold, tmp_path / f"home{step}")
        found, wanted = reports(warm), reports(cold)
        assert found.keys() == wanted.keys()
        for name in found:
            assert found[name] == wanted[name], (seed, step, name)


@pytest.mark.nightly
def test_an_edit_says_the_same_to_who_has_run_before_and_to_who_has_not(tmp_path: Path) -> None:
    walk(tmp_path, 0, 1)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(1, 5))
def test_random_edits_say_the_same_to_who_has_run_before_and_to_who_has_not(tmp_path: Path, seed: int) -> None:
    walk(tmp_path, seed, 4)
