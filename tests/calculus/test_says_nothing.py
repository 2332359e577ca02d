"""A formula that every design meets shows nothing, whoever proves it; one that says something is not called empty."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Outcome, Verdict
from calculus.make import make, outcomes

RCL = """
node sensor { inputs( r : REAL ) outputs( level : NATURAL ) topics()
  assume counts ( 0 <= in.r )
  guarantee low ( in.r < 10 -> out.level == 0 )
  guarantee high ( in.r >= 10 -> out.level == 1 ) }
node brake { inputs( level : NATURAL ) outputs( on : BOOL ) topics()
  guarantee pulls ( in.level == 1 -> out.on )
  guarantee idle ( in.level == 0 -> not out.on ) }
"""
PLAN = """
environment: {{sensor.r: {{assume: "0 <= in.r", because: it counts}}}}
scenario: {{domains: {{sensor.r: [0, 10, 20]}}, steps: 3}}
requirements:
  R: {{text: The robot brakes, {0}}}
"""


def asked(folder: Path, what: str) -> Outcome:
    return outcomes(make(folder, RCL, PLAN.format(what)))["R"]


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ('formula: "TRUE"', "tautology"),
        ('formula: "brake.on or not brake.on"', "tautology"),
        ('formula: "sensor.r >= 10 -> sensor.r >= 5"', "tautology"),
        ('formula: "0 <= sensor.r"', "follows from the assumptions alone"),
        ('formula: "sensor.r < 0 -> brake.on"', "follows from the assumptions alone"),
        ('formula: "previous(0 <= sensor.r, TRUE) and 0 <= sensor.r"', "follows from the assumptions alone"),
        ('formula: "once(sensor.r > 5) -> once(sensor.r > 4)"', "tautology over steps"),
        ('formula: "not once(1 / sensor.r == 0)"', "tautology over steps"),
        ('formula: "rose(brake.on) -> within[2 steps](brake.on)", supported_by: [brake]', "tautology over steps"),
        ('formula: "sensor.level == 2 and sensor.r < 10 -> brake.on"', "its condition never comes about"),
        ('formula: "(sensor.r >= 10 -> brake.on) and (sensor.level > 3 -> brake.on)"', "condition never comes about"),
        ('formula: "sensor.level == 2 -> within[2 steps](brake.on)"', "its condition never comes about"),
        ('formula: "rose(sensor.level == 2) -> within[0 steps](brake.on)"', "its condition never comes about"),
        ('formula: "previous(sensor.level, 0) == 2 -> brake.on"', "its condition never comes about"),
        ('formula: "not (sensor.level > 1) or brake.on"', "its condition never comes about"),
        ('formula: "sensor.r >= 10 -> brake.on", supported_by: [brake.idle]', "needs none of the guarantees"),
        ('temporal: "always (brake.on or not brake.on)"', "holds of every run, whatever the nodes do"),
        ('temporal: "eventually (0 <= sensor.r)"', "holds of every run, whatever the nodes do"),
        ('temporal: "always (sensor.r <= 20)"', "speaks of the environment alone"),
        ('temporal: "(eventually brake.on) or always not brake.on"', "holds of every run, whatever the nodes do"),
        ('temporal: "always (sensor.level == 2 -> eventually brake.on)"', "never comes about on any run"),
        ('temporal: "always (sensor.level == 2 -> brake.on)"', "never comes about on any run"),
    ],
)  # fmt: skip
def test_what_every_design_meets_is_no_requirement(tmp_path: Path, what: str, why: str) -> None:
    outcome = asked(tmp_path, what)
    assert outcome.vacuous
    assert outcome.summary.startswith("says nothing: ")
    assert why in outcome.summary


@pytest.mark.parametrize(
    "what",
    [
        'formula: "sensor.r >= 10 -> brake.on"',
        'formula: "sensor.r >= 10 <=> brake.on"',
        'formula: "not (brake.on and sensor.r < 10)"',
        'formula: "sensor.level <= 1"',
        'formula: "sensor.level == brake.in.level"',
        'formula: "once(sensor.level == 7) -> once(brake.in.level == 7)"',
        'formula: "sensor.r >= 10 -> brake.on", supported_by: [sensor.high, brake.pulls]',
        'formula: "sensor.r >= 10 -> brake.on", supported_by: [brake]',
        'formula: "previous(sensor.r >= 10, FALSE) -> sensor.r >= 10 or not brake.on"',
        'formula: "sensor.level == 1 -> within[2 steps](brake.on)"',
        'formula: "previous(sensor.level, 0) == 1 -> brake.on or not brake.on and sensor.r < 10"',
        'temporal: "always (sensor.r >= 10 -> brake.on)"',
        'temporal: "always not (brake.on and sensor.r < 10)"',
        'temporal: "always (sensor.level == 1 -> brake.on)"',
        'temporal: "always (brake.in.level <= 1)"',
    ],
)
def test_what_some_design_would_break_is_one(tmp_path: Path, what: str) -> None:
    outcome = asked(tmp_path, what)
    assert outcome.verdict in (Verdict.PROVED, Verdict.CHECKED), outcome.summary
    assert not outcome.vacuous, outcome.summary


@pytest.mark.parametrize(
    ("support", "told"),
    [
        ("[brake]", "`supported_by` does not name sensor.high: add what it rests on"),
        ("[sensor.high]", "`supported_by` does not name brake.pulls: add what it rests on"),
        ("[sensor.high, brake.pulls]", ""),
        ("[]", ""),
    ],
)
def test_a_proof_names_the_guarantees_that_it_uses_beyond_the_plans(tmp_path: Path, support: str, told: str) -> None:
    outcome = asked(tmp_path, f'formula: "sensor.r >= 10 -> brake.on", supported_by: {support}')
    assert (outcome.verdict, outcome.vacuous) == (Verdict.PROVED, False)
    assert outcome.summary.partition("; ")[2] == told


def test_a_property_of_a_delayed_value_is_about_the_node_that_gave_it(tmp_path: Path) -> None:
    wiring = "connections: [{{from: sensor.level, to: brake.level, delayed: true, initial: out.level == 0}}]\n"
    what = 'temporal: "always (brake.in.level <= 1)"'
    outcome = outcomes(make(tmp_path, RCL, (wiring + PLAN).format(what)))["R"]
    assert (outcome.verdict, outcome.vacuous) == (Verdict.CHECKED, False), outcome.summary
