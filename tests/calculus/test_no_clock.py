"""No clock decides a verdict: the rooms that search and ask count steps, and read a clock only to tell how long it took
or to end what hangs."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("avow/sanity", "avow/solving", "avow/calculus", "avow/formulas", "avow/evaluation", "backends/hoare")

TOLD = {
    "avow/solving/apart.py",  # the nets under other processes
    "avow/solving/checking.py",  # how long an answer took, for people
    "avow/solving/questions.py",
    "avow/sanity/analysis.py",
}


def clocks(path: Path) -> bool:
    tree = ast.parse(path.read_text("utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    return bool(names & {"time", "datetime"})


def limits_by_the_clock(path: Path) -> list[str]:
    """Z3's own time-outs, set with a number of milliseconds."""
    return [line.strip() for line in path.read_text("utf-8").splitlines() if '"timeout"' in line and ".set(" in line]


@pytest.mark.slow
def test_none_reads_a_clock() -> None:
    found = {p.relative_to(ROOT).as_posix() for room in ROOMS for p in (ROOT / room).rglob("*.py") if clocks(p)}
    assert found - {"backends/hoare/backend.py"} <= TOLD  # that one reads the day of a person's word
    assert "import time" not in (ROOT / "backends/hoare/backend.py").read_text("utf-8")


def test_none_gives_z3_a_time() -> None:
    found = {line for room in ROOMS for path in (ROOT / room).rglob("*.py") for line in limits_by_the_clock(path)}
    assert found == {'solver.set("timeout", CERTIFICATE_NET_MS)'}, "a net, far beyond the steps allowed"
