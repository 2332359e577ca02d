"""Shapes of graphs that a reader may try: hairs, forks, loops of every kind, and a ROS graph of fifty nodes."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from avow.base.verdict import Outcome, Verdict
from avow.calculus.composition import compose
from avow.calculus.derivation import Rule
from avow.cli.compose import command
from avow.system.graph import dataflow
from avow.system.graph_svg import sheet
from avow.system.load import load_system
from avow.system.rosgraph import account

from .make import make, node, outcomes
from .test_commands import invoke


def value(outcome: Outcome, name: str) -> Fraction:
    assert outcome.counterexample is not None
    return Fraction(dict(outcome.counterexample.values)[name])


# -- a provider a hair too weak ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sort", "given", "wanted", "low", "high"),
    [
        ("REAL", "out.x <= 10", "in.x < 10", "10", "10"),
        ("REAL", "out.x <= 10.0000001", "in.x <= 10", "10", "10.0000001"),
        ("INTEGER", "out.x <= 10", "in.x < 10", "10", "10"),
        ("INTEGER", "out.x < 11", "in.x < 10", "10", "10"),
        ("NATURAL", "out.x <= 10", "in.x < 10", "10", "10"),
        ("NATURAL", "TRUE", "in.x > 0", "0", "0"),
        ("REAL", "3 * out.x <= 1", "in.x < 1 / 3", "1/3", "1/3"),
        ("REAL", "out.x > 0", "in.x >= 0.001", "0", "0.001"),
    ],
)
def test_the_counterexample_is_at_the_hair(
    tmp_path: Path, sort: str, given: str, wanted: str, low: str, high: str
) -> None:
    both = node("p", "", f"x : {sort}", f"G: {given}") + node("c", f"x : {sort}", "", f"A: {wanted}")
    found = outcomes(make(tmp_path, both))["whole.c.A1"]
    assert found.verdict is Verdict.REFUTED
    assert Fraction(low) <= value(found, "p.x") <= Fraction(high)


@pytest.mark.parametrize(
    ("sort", "given", "wanted"),
    [
        ("REAL", "out.x < 10", "in.x < 10"),
        ("REAL", "out.x <= 10", "in.x <= 10"),
        ("REAL", "3 * out.x <= 1", "in.x <= 1 / 3"),
        ("INTEGER", "out.x < 11", "in.x <= 10"),
        ("INTEGER", "out.x <= 10", "in.x < 11"),
        ("INTEGER", "2 * out.x <= 21", "in.x <= 10"),
        ("NATURAL", "TRUE", "in.x >= 0"),
    ],
)
def test_a_provider_that_is_just_strong_enough(tmp_path: Path, sort: str, given: str, wanted: str) -> None:
    both = node("p", "", f"x : {sort}", f"G: {given}") + node("c", f"x : {sort}", "", f"A: {wanted}")
    assert outcomes(make(tmp_path, both))["whole.c.A1"].verdict is Verdict.PROVED


def test_one_node_for_two_with_different_wishes(tmp_path: Path) -> None:
    fork = (
        node("p", "", "x : INTEGER", "G: out.x >= 1")
        + node("c", "x : INTEGER", "", "A: in.x >= 0")
        + node("d", "x : INTEGER", "", "A: in.x >= 2")
    )
    system = make(tmp_path, fork)
    assert compose(system).whole.root.rule is Rule.R2
    found = outcomes(system)
    assert found["whole.c.A1"].verdict is Verdict.PROVED
    assert found["whole.d.A1"].verdict is Verdict.REFUTED
    assert value(found["whole.d.A1"], "p.x") == 1


def test_a_nodes_assumption_about_the_environment_serves_its_others(tmp_path: Path) -> None:
    """That f is bounded stays assumed; that x and f are near one another is shown with it."""
    near = node("p", "", "x : INTEGER", "G: out.x == 2") + node(
        "c", "x : INTEGER, f : INTEGER", "", "A bounded: in.f >= 0", "A near: in.x - in.f <= 2"
    )
    found = outcomes(make(tmp_path / "assumed", near))
    assert found["whole.c.near"].verdict is Verdict.PROVED
    assert found["whole.c.near"].details["needed"] == ["p.G1", "c.bounded"]
    loose = outcomes(make(tmp_path / "loose", near.replace("in.f >= 0", "in.f >= -1")))["whole.c.near"]
    assert loose.verdict is Verdict.REFUTED
    assert value(loose, "in.f") == -1


# -- loops -------------------------------------------------------------------------------------------------------------

SELF = node("a", "x : INTEGER", "y : INTEGER", "A: in.x >= 0", "G: out.y >= %s")


@pytest.mark.parametrize(
    ("guarantee", "edge", "verdict", "words"),
    [
        ("in.x", "", Verdict.REFUTED, "may leave"),
        ("0", "", Verdict.REFUTED, "circular"),
        ("in.x", ", delayed: true, initial: 0", Verdict.PROVED, "at the first step and"),
        ("in.x", ", delayed: true, initial: -1", Verdict.REFUTED, "at first step"),
        ("in.x", ", delayed: true", Verdict.REFUTED, "at first step"),
        ("in.x - 1", ", delayed: true, initial: 0", Verdict.REFUTED, "at step 2"),
    ],
)
def test_a_node_that_feeds_itself(tmp_path: Path, guarantee: str, edge: str, verdict: Verdict, words: str) -> None:
    system = make(tmp_path, SELF % guarantee, f"connections: [{{from: a.y, to: a.x{edge}}}]")
    found = outcomes(system)
    assert found["whole.a.A1"].verdict is verdict
    assert words in found["whole.a.A1"].summary
    assert (found["start.a"].verdict is Verdict.PROVED) is ("initial" in edge)
    if words == "circular":
        assert found["whole.loop.a"].verdict is Verdict.REFUTED
        assert found["whole.a.A1"].details["circle"] == ["a"]


def test_two_disjoint_loops_are_judged_apart(tmp_path: Path) -> None:
    def loop(k: int) -> str:
        one = node(f"a{k}", f"y{k} : INTEGER", f"x{k} : INTEGER", f"A: in.y{k} >= 0", f"G: out.x{k} >= in.y{k}")
        return one + node(f"b{k}", f"x{k} : INTEGER", f"y{k} : INTEGER", f"A: in.x{k} >= 0", f"G: out.y{k} >= in.x{k}")

    edges = [f"{{from: b{k}.y{k}, to: a{k}.y{k}, delayed: true, initial: {first}}}" for k, first in ((1, 0), (2, -1))]
    system = make(tmp_path, loop(1) + loop(2), f"connections: [{', '.join(edges)}]")
    whole = compose(system).whole.root
    assert whole.rule is Rule.ALL
    assert sorted(part.nodes for part in whole.walk() if part.rule is Rule.R4) == [("a1", "b1"), ("a2", "b2")]
    found = outcomes(system)
    assert found["whole.loop.a1-b1"].verdict is Verdict.PROVED
    assert found["whole.loop.a2-b2"].verdict is Verdict.UNKNOWN
    assert found["whole.a2.A1"].verdict is Verdict.REFUTED
    assert found["whole.a1.A1"].verdict is Verdict.PROVED


# -- wide and large ----------------------------------------------------------------------------------------------------


def test_outputs_that_feed_nothing_are_named(tmp_path: Path) -> None:
    system = make(tmp_path, node("a", "", "x : INTEGER, u : INTEGER") + node("b", "x : INTEGER", "y : INTEGER"))
    graph = dataflow(system)
    assert [str(endpoint) for endpoint in graph.dangling] == ["a.u", "b.y"]
    assert invoke(command, str(tmp_path))[0] == 0


def test_a_ros_graph_of_fifty_nodes(tmp_path: Path) -> None:
    """As rqt_graph writes it: two left out, two taken together; what is forgotten is named."""
    lines = [f'"n_/n{k}" [label="/n{k}", shape=ellipse]; "t_/x{k}" [label="/x{k}", shape=box];' for k in range(50)]
    lines += [f'"n_/n{k}" -> "t_/x{k}";' for k in range(50)] + [f'"t_/x{k - 1}" -> "n_/n{k}";' for k in range(1, 50)]
    contract = node("n0", "", "x0 : INTEGER", "G: out.x0 >= 0")
    for k in range(1, 46):
        contract += node(f"n{k}", f"x{k - 1} : INTEGER", f"x{k} : INTEGER", f"A: in.x{k - 1} >= 0", f"G: out.x{k} >= 0")
    contract += node("tail", "x45 : INTEGER", "x47 : INTEGER", "A: in.x45 >= 0")
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / "ros.dot").write_text("digraph graphname {\n" + "\n".join(lines) + "\n}\n")
    plan = "model: {graph: ros.dot, compound: {tail: [n46, n47]}, dropped: {n48: log%s}}"
    system = make(tmp_path, contract, plan % ", n49: screen")
    found = account(system, dataflow(system))
    assert not found.findings
    goal = compose(system).whole
    assert (goal.root.rule, len(goal.root.nodes)) == (Rule.R1, 47)
    assert sheet([("", dataflow(system))]).count("<rect") == 47
    (tmp_path / "plan.yaml").write_text(plan % "")
    system = load_system(tmp_path)
    (finding,) = account(system, dataflow(system)).findings
    assert (finding.code, "n49" in finding.message) == ("PLAN127", True)
