"""Several publishers of one topic: what a listener assumes has to follow from each of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.system.load import load_system

from .make import settled

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
