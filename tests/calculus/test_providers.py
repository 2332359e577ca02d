"""An assumption that no provider can meet."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from avow.base.verdict import Verdict
from avow.calculus.providers import provider_claims, settle
from avow.calculus.variables import frame
from avow.cli.sanity import command
from avow.sanity.results import Bounds, SanityResult
from avow.system.plan import System

from .make import make, node

PLANT = node("plant", "", "level : REAL, flow : REAL", "G low: out.level <= 10", "G open: out.flow >= 0")


def found(system: System, name: str) -> dict[str, SanityResult]:
    of = system.contract.node(name)
    return {r.name: r for r in settle(provider_claims(frame(system), of), of, Bounds())}


@pytest.mark.parametrize(
    ("assumption", "verdict", "core"),
    [
        ("in.level > 10", Verdict.REFUTED, {"pump.A", "plant.low"}),
        ("in.level > 10 and in.own > 0", Verdict.REFUTED, {"pump.A", "plant.low"}),
        ("in.level + in.flow < 0 and in.level > in.own and in.own > 0", Verdict.REFUTED, {"pump.A", "plant.open"}),
        ("in.level == 10", Verdict.PROVED, set()),
        ("in.level > in.own", Verdict.PROVED, set()),
    ],
)
def test_what_providers_exclude(tmp_path: Path, assumption: str, verdict: Verdict, core: set[str]) -> None:
    pump = node("pump", "level : REAL, flow : REAL, own : REAL", "on : BOOL", f"A A: {assumption}")
    result = found(make(tmp_path, PLANT + pump), "pump")["meetable-A"]
    assert result.verdict is verdict, result.explanation
    assert set(result.clauses) == core


def test_what_comes_from_no_node_is_not_asked_about(tmp_path: Path) -> None:
    pump = node("pump", "own : REAL", "on : BOOL", "A A: in.own > 10")
    assert not found(make(tmp_path, PLANT + pump), "pump")


def test_a_delayed_edge_brings_what_was_guaranteed_one_step_before(tmp_path: Path) -> None:
    counter = node("counter", "n : NATURAL", "n : NATURAL", "A A: in.n > 100", "G G: out.n < 50")
    plan = "connections:\n  - {from: counter.n, to: counter.n, delayed: true, initial: '200'}\n"
    result = found(make(tmp_path, counter, plan), "counter")["meetable-A"]
    assert result.verdict is Verdict.REFUTED
    assert set(result.clauses) == {"counter.A", "counter.G one step before"}


def test_providers_that_cannot_hold_themselves_are_to_blame(tmp_path: Path) -> None:
    plant = node("plant", "", "level : REAL", "G low: out.level <= 10", "G high: out.level > 11")
    pump = node("pump", "level : REAL", "on : BOOL", "A A: in.level > 0")
    result = found(make(tmp_path, plant + pump), "pump")["meetable-A"]
    assert result.verdict is Verdict.REFUTED
    assert result.because == "plant/consistent"


def test_the_command_lists_it(tmp_path: Path) -> None:
    pump = node("pump", "level : REAL", "on : BOOL", "A hot: in.level > 10")
    make(tmp_path, PLANT + pump)
    run = CliRunner().invoke(command, [str(tmp_path), "--json"])
    results = {r["name"]: r for r in json.loads(run.output)["results"]}
    assert results["meetable-hot"]["verdict"] == "refuted"
    assert "no provider can meet it: plant.low excludes it" in CliRunner().invoke(command, [str(tmp_path)]).output
