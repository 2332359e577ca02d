"""Every verdict of the shipped systems, the worked examples, random systems and each diagnostic's example, as recorded.

A change that is not meant to change verdicts leaves the recorded files as they are. After a change that is meant to,
`AVOW_REFRESH=1 .venv/bin/pytest -q -m slow tests/golden` records the new verdicts; read `git diff tests/golden`.
"""

from __future__ import annotations

import difflib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from calculus.make import Limits, all_obligations, make, settle_all
from calculus.test_random_groups import random_groups
from calculus.test_random_runs import random_system as random_tables
from calculus.test_random_systems import random_system as random_flags
from logic.test_oracle import small_node
from temporal.test_viability import drawn, node_of

from avow.base.codes import CODES
from avow.calculus.composition import compose
from avow.language.contract import Node
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.system.plan import System

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent


def same(name: str, found: Iterable[str]) -> None:
    """The lines found are those recorded, or are recorded now (AVOW_REFRESH=1)."""
    path, text = HERE / f"{name}.txt", "".join(f"{line}\n" for line in found)
    recorded = path.read_text("utf-8") if path.exists() else ""
    changed = list(
        difflib.unified_diff(recorded.splitlines(), text.splitlines(), "recorded", "found", n=0, lineterm="")
    )
    if os.environ.get("AVOW_REFRESH"):
        path.write_text(text, "utf-8")
    else:
        assert not changed, "\n".join(changed)


# -- shipped systems and worked examples -------------------------------------------------------------------------------


SYSTEMS = sorted([*ROOT.glob("contracts/*/plan.yaml"), *ROOT.glob("docs/examples/*/plan.yaml")])


@pytest.mark.needs_dafny
@pytest.mark.skipif(not all(map(shutil.which, ("clang", "strace"))), reason="verdicts of fuzz and Dafny need them")
def test_shipped_systems_and_worked_examples(tmp_path: Path) -> None:
    """Statuses of all claims, and the verdict of each method that counts. AJPF, which few machines have, is hidden."""
    for plan in SYSTEMS:
        shutil.copytree(plan.parent, tmp_path / "contracts" / plan.parent.name)
    shutil.copy(ROOT / "dodo.py", tmp_path)
    environment = {name: value for name, value in os.environ.items() if name != "AJPF_HOME"}
    command = [sys.executable, "-m", "avow", "verify"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    reports = sorted(tmp_path.glob("reports/*/report.json"))
    assert len(reports) == len(SYSTEMS), done.stdout + done.stderr
    same("systems", (line for report in reports for line in verdicts(report)))


def verdicts(report: Path) -> Iterator[str]:
    case = json.loads(report.read_text("utf-8"))
    yield f"{case['system']}: {case['answers']['verdict']} [exit code {case['exit_code']}]"
    for view in case["obligations"]:
        asked = view["obligation"]
        counting = [each["entry"]["evidence"] for each in view["evidence"] if each["counts"]]
        methods = sorted(f"{record['method']} {record['verdict']}" for record in counting)
        place = "/".join(asked[part] for part in ("node", "kind", "name"))
        changed = "" if view["standing"] == view["status"] else f" (all considered: {view['standing']})"
        yield f"  {place}: {view['status']}{changed} <- {', '.join(methods) or 'nothing'}"


# -- random systems ----------------------------------------------------------------------------------------------------


def test_random_systems(tmp_path: Path) -> None:
    """The calculus' answers: of systems of truth values, some of them with subsystems, and of tables and sequences."""
    same("calculus", (f"{name}: {answers(system)}" for name, system in random_systems(tmp_path)))


def random_systems(folder: Path) -> Iterator[tuple[str, System]]:
    for seed in range(90):
        text, plan = random_flags(seed)
        if seed % 3 == 2 and (groups := random_groups(seed, [f"n{k}" for k in range(text.count("node "))])):
            plan = f"{plan}subsystems:\n{groups}"
        yield f"flags {seed}", make(folder / f"flags-{seed}", text, plan)
    for seed in range(60):
        yield f"tables {seed}", make(folder / f"tables-{seed}", *random_tables(seed)[:2])


def answers(system: System) -> str:
    composition = compose(system)
    obligations = all_obligations(composition)
    outcomes = settle_all(composition, obligations, Limits())
    return ", ".join(f"{o.name} {outcome.verdict}" for o, outcome in zip(obligations, outcomes, strict=True))


def test_random_contracts() -> None:
    """Sanity's answers: of nodes with ports of nearly every type, and of nodes whose clauses speak of other steps."""
    same("sanity", (f"{name}: {sanity(node)}" for name, node in random_nodes()))


def random_nodes() -> Iterator[tuple[str, Node]]:
    for seed in range(90):
        if (small := small_node(seed)) is not None:
            yield f"small {seed}", small
    for seed in range(60):
        yield f"steps {seed}", replace(node_of(*drawn(seed)), name="n")


def sanity(node: Node) -> str:
    return ", ".join(f"{result.name} {result.verdict}" for result in analyse(node))


# -- diagnostics -------------------------------------------------------------------------------------------------------


def test_diagnostics() -> None:
    """Which diagnostics each diagnostic's example brings about, and where."""
    same("diagnostics", (f"{code.code}: {told(code.text)}" for code in CODES.values() if code.example))


def told(text: str) -> str:
    _, found = check_text(text, "f")
    return ", ".join(f"{d.code} {d.severity} {d.span.line}:{d.span.column}" if d.span else d.code for d in found)
