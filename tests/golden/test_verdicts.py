"""Every verdict of the shipped systems, the worked examples, random systems and each diagnostic's example, as recorded.

A change that is not meant to change verdicts leaves the recorded files as they are. This records those of one that
is, to be read in `git diff tests/golden` before it is committed:

    AVOW_REFRESH=1 .venv/bin/pytest -q -m 'slow or nightly' tests/golden tests/docs/test_examples.py
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from calculus.make import Limits, all_obligations, make, settle_all
from calculus.test_random_groups import random_groups
from calculus.test_random_runs import random_system as random_tables
from calculus.test_random_systems import random_system as random_flags
from logic.test_oracle import small_node
from temporal.test_viability import drawn, node_of

from avow.base.codes import LANGUAGE, sections
from avow.calculus.composition import compose
from avow.language.contract import Node
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.system.plan import System
from golden.recorded import same, verdicts

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
STEPS = [4, pytest.param(1, marks=pytest.mark.nightly)]
"""Every how many seeds are asked: a sample in CI, all of them in a nightly run and before a large cut."""


# -- shipped systems and worked examples -------------------------------------------------------------------------------


@pytest.mark.needs_dafny
@pytest.mark.needs_perception
@pytest.mark.needs_chance
@pytest.mark.needs_motion
@pytest.mark.skipif(not all(map(shutil.which, ("clang", "strace"))), reason="verdicts of fuzz and Dafny need them")
def test_shipped_systems(tmp_path: Path) -> None:
    """Statuses of all claims, and the verdict of each method that counts. AJPF, which few machines have, is hidden.

    CI names its own reports of the same contracts in AVOW_REPORTS. The worked examples are compared in
    tests/docs/test_examples.py, which verifies them.
    """
    place = Path(os.environ.get("AVOW_REPORTS") or tmp_path / "reports")
    if not place.is_relative_to(ROOT):
        shutil.copytree(ROOT / "contracts", tmp_path / "contracts")
        shutil.copy(ROOT / "dodo.py", tmp_path)
        environment = {name: value for name, value in os.environ.items() if name != "AJPF_HOME"}
        command = [sys.executable, "-m", "avow", "verify"]
        subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    reports = sorted(place.glob("*/report.json"))
    assert len(reports) == len(list(ROOT.glob("contracts/*/plan.yaml")))
    same("systems", (line for report in reports for line in verdicts(report)))


# -- random systems ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", STEPS)
def test_random_systems(step: int, tmp_path: Path) -> None:
    """The calculus' answers: of systems of truth values, some of them with subsystems, and of tables and sequences."""
    found = (f"{name}: {answers(system)}" for name, system in random_systems(tmp_path, step))
    same("calculus", found, sampled=step > 1)


def random_systems(folder: Path, step: int) -> Iterator[tuple[str, System]]:
    for seed in range(0, 90, step):
        text, plan = random_flags(seed)
        if seed % 3 == 2 and (groups := random_groups(seed, [f"n{k}" for k in range(text.count("node "))])):
            plan = f"{plan}subsystems:\n{groups}"
        yield f"flags {seed}", make(folder / f"flags-{seed}", text, plan)
    for seed in range(0, 60, step):
        yield f"tables {seed}", make(folder / f"tables-{seed}", *random_tables(seed)[:2])


def answers(system: System) -> str:
    composition = compose(system)
    obligations = all_obligations(composition)
    outcomes = settle_all(composition, obligations, Limits())
    return ", ".join(f"{o.name} {outcome.verdict}" for o, outcome in zip(obligations, outcomes, strict=True))


@pytest.mark.parametrize("step", STEPS)
def test_random_contracts(step: int) -> None:
    """Sanity's answers: of nodes with ports of nearly every type, and of nodes whose clauses speak of other steps."""
    same("sanity", (f"{name}: {sanity(node)}" for name, node in random_nodes(step)), sampled=step > 1)


def random_nodes(step: int) -> Iterator[tuple[str, Node]]:
    for seed in range(0, 90, step):
        if (small := small_node(seed)) is not None:
            yield f"small {seed}", small
    for seed in range(0, 60, step):
        yield f"steps {seed}", replace(node_of(*drawn(seed)), name="n")


def sanity(node: Node) -> str:
    return ", ".join(f"{result.name} {result.verdict}" for result in analyse(node))


# -- diagnostics -------------------------------------------------------------------------------------------------------


def test_diagnostics() -> None:
    """Which diagnostics each diagnostic's example brings about, and where."""
    same("diagnostics", (f"{code.code}: {told(code.text)}" for code in sections()[LANGUAGE].values() if code.example))


def told(text: str) -> str:
    _, found = check_text(text, "f")
    return ", ".join(f"{d.code} {d.severity} {d.span.line}:{d.span.column}" if d.span else d.code for d in found)
