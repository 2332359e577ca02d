"""Several publishers of one topic: what a listener assumes has to follow from each of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.system.graph import dataflow
from avow.system.load import load_system
from avow.system.wiring import wiring

from .make import make, settled

TEXT = """
node joy {{ inputs() outputs( v : REAL ) topics( float64 cmd matches(out.v) ) guarantee slow ( out.v <= 1 ) }}
node auto {{ inputs() outputs( w : REAL ) topics( float64 /cmd matches(out.w) ) guarantee slow ( {second} ) }}
node wheels {{
  inputs( u : REAL )
  outputs( turn : REAL )
  topics( float64 cmd matches(in.u) )
  assume slow ( in.u <= 1 )
  guarantee follows ( out.turn == in.u )
}}
"""


@pytest.mark.parametrize(
    ("second", "verdict"), [("out.w <= 0", Verdict.PROVED), ("out.w <= 2", Verdict.REFUTED), ("TRUE", Verdict.REFUTED)]
)
def test_the_assumption_has_to_hold_for_each(tmp_path: Path, second: str, verdict: Verdict) -> None:
    (tmp_path / "system.rcl").write_text(TEXT.format(second=second), encoding="utf-8")
    (tmp_path / "plan.yaml").write_text("{}", encoding="utf-8")
    _, answers = settled(load_system(tmp_path))
    assert answers.verdict is verdict


def test_a_remap_takes_a_publisher_away(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(TEXT.format(second="TRUE"), encoding="utf-8")
    (tmp_path / "plan.yaml").write_text("ros: {nodes: {auto: {remap: {/cmd: /unused}}}}", encoding="utf-8")
    _, answers = settled(load_system(tmp_path))
    assert answers.verdict is Verdict.PROVED


BRANCH = (
    "node {0} {{ inputs( raw : REAL ) outputs( {0} : BOOL ) topics( {1} ) guarantee g ( out.{0} <=> in.raw > 5 ) }}\n"
)
JOINED = """
node c { inputs( a : BOOL, b : BOOL ) outputs( z : BOOL ) topics()
  assume agree ( in.a <=> in.b ) guarantee g ( out.z ) }
"""


@pytest.mark.parametrize(
    ("topics", "plan", "verdict"),
    [
        (("/scan", "/scan"), "{}", Verdict.PROVED),
        (("/front/scan", "/rear/scan"), "{}", Verdict.REFUTED),
        (("scan", "scan"), "ros: {nodes: {b: {name: /rear/b}}}", Verdict.REFUTED),
        (("scan", "scan"), "ros: {nodes: {b: {remap: {scan: /rear/scan}}}}", Verdict.REFUTED),
        (("/front/scan", ""), "{}", Verdict.PROVED),
        (("/front/scan", "/rear/scan"), "subsystems: {both: {nodes: [a, b]}}", Verdict.REFUTED),
    ],
)
def test_the_environment_has_one_value_for_each_topic(
    tmp_path: Path, topics: tuple[str, str], plan: str, verdict: Verdict
) -> None:
    carried = [topic and f"float64 {topic} matches(in.raw)" for topic in topics]
    text = "".join(map(BRANCH.format, "ab", carried)) + JOINED
    assert settled(make(tmp_path, text, plan))[1].verdict is verdict


def test_a_topic_that_no_node_publishes_is_heard_from_the_environment(tmp_path: Path) -> None:
    both = TEXT.format(second="TRUE").replace("float64 /cmd", "float64 /auto")
    alone = make(tmp_path / "one", both)
    listening = make(
        tmp_path / "two", both.replace("cmd matches(in.u)", "cmd matches(in.u), float64 keys matches(in.u)")
    )
    assert settled(alone)[1].verdict is Verdict.PROVED
    assert settled(listening)[1].verdict is Verdict.REFUTED
    topics = {topic.name: topic.environment for topic in wiring(listening, dataflow(listening)).topics}
    assert topics["/keys"]
    assert not topics["/cmd"]
