"""Outputs that hang together: whether one is determined, and whether a plan that an assumption names is found."""

from __future__ import annotations

import pytest

from avow.base.verdict import Verdict
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds


def verdict(text: str, claim: str) -> Verdict:
    contract, found = check_text(text, "t.rcl")
    assert contract is not None, found
    [result] = analyse(contract.nodes[0], bounds=Bounds(seed=0), wanted={claim})
    return result.verdict


CHAIN = """
node n {{
  inputs( a : REAL ) outputs( x : REAL, y : REAL ) topics()
  guarantee( {} )
  guarantee( out.y == out.x + 1 )
}}
"""


def test_an_output_is_determined_through_another() -> None:
    assert verdict(CHAIN.format("out.x == in.a"), "determined-y") is Verdict.PROVED


@pytest.mark.slow
def test_and_is_not_where_the_other_is_not() -> None:
    assert verdict(CHAIN.format("out.x >= in.a"), "determined-y") is Verdict.REFUTED


WAYS = """
node planner {{
  inputs( start : NATURAL, goal : NATURAL, length : NATURAL, way : NATURAL x NATURAL x NATURAL --> NATURAL,
          step : NATURAL x NATURAL --> BOOL )
  outputs( plan : NATURAL --> NATURAL )
  topics()
  assume( in.way(in.start, in.goal, 0) == in.start and in.way(in.start, in.goal, in.length) == in.goal
    and forall(k in NATURAL | k < in.length ->
      in.step(in.way(in.start, in.goal, k), in.way(in.start, in.goal, k + 1))) )
  guarantee( out.plan(0) == in.start )
  guarantee( out.plan(in.length) == in.goal )
  guarantee( forall(k in NATURAL | k < in.length -> in.step(out.plan(k), out.plan(k + 1))) )
}}
"""


def test_a_plan_may_be_what_an_assumption_names() -> None:
    assert verdict(WAYS.format(), "realizable") is Verdict.PROVED


@pytest.mark.nightly
def test_but_not_where_the_plan_has_to_end_early() -> None:
    early = WAYS.format().replace("out.plan(in.length)", "out.plan(0)")
    assert verdict(early, "realizable") is Verdict.REFUTED
