"""Of which samples a requirement's failure rate may be composed: on random conditions, against all of their values."""

from __future__ import annotations

import itertools
import random
from pathlib import Path
from typing import Any

import pytest

from avow.base.verdict import Verdict
from avow.evidence.record import COMPOSES
from calculus.make import make, outcomes

NODE = """
node n {{ inputs( s : INTEGER, b : BOOL ) outputs( y : REAL ) topics()
  assume given ( {given} )
  guarantee g ( {condition} -> out.y > 0 ) }}
"""
PLAN = """
environment: {{n.s: {{because: any}}, n.b: {{because: any}}}}
requirements: {{R: {{text: It is positive, formula: "{formula}"}}}}
"""
ATOMS = [*(f"in.s >= {k}" for k in range(4)), *(f"in.s < {k}" for k in range(1, 5)), "in.b", "not in.b"]
POINTS = tuple(itertools.product(range(-1, 6), (False, True)))


def holds(text: str, s: int, b: bool) -> bool:
    return bool(eval(text.replace("in.s", str(s)).replace("in.b", str(b)), {}))


def composed(folder: Path, rcl: str, plan: str) -> dict[str, Any]:
    outcome = outcomes(make(folder, rcl, plan))["R"]
    assert outcome.verdict is Verdict.PROVED, outcome.summary
    found = outcome.details[COMPOSES]
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("seed", range(12))
def test_a_guarantee_is_beyond_where_some_trial_of_it_is_none_of_the_requirement(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    while True:
        given = " and ".join(rng.sample(ATOMS, 1))
        condition = " and ".join(own := rng.sample(ATOMS, rng.randint(1, 2)))
        narrower = rng.sample(ATOMS, rng.randint(0, 1))
        asked = " and ".join(part.replace("in.", "n.") for part in (*own, *narrower))
        trials = [p for p in POINTS if holds(given, *p) and holds(condition, *p)]
        met = [p for p in trials if all(holds(part, *p) for part in narrower)]
        if met:
            break
    found = composed(
        tmp_path, NODE.format(given=given, condition=condition), PLAN.format(formula=f"{asked} -> n.y > 0")
    )
    assert found["beyond"] == ([] if len(met) == len(trials) else ["n.g"])
    assert found["at_once"]


LINE = """
node a { inputs( raw : REAL, mode : BOOL ) outputs( x : REAL ) topics()
  guarantee keeps ( in.raw > 0 -> out.x > 0 )  guarantee busy ( in.mode and in.raw > 0 -> out.x > 0 ) }
node b { inputs( x : REAL ) outputs( y : REAL ) topics()
  guarantee keeps ( in.x > 0 -> out.y > 0 )  guarantee same ( out.y == in.x ) }
"""
WORLD = """
environment: {in.raw: {because: any}, in.mode: {because: any}}
compose: {whole: {persistence: &said {because: latched}, one_output: *said}}
"""


ALL = ["a.keeps", "a.busy", "b.keeps", "b.same"]


@pytest.mark.parametrize(
    ("formula", "at_once", "beyond"),
    [
        ("a.raw > 0 -> b.y > 0", True, ["b.same"]),  # b.same is tried where x is not above 0, too
        ("a.raw > 0 -> a.x > 0", True, ["b.same"]),
        ("a.raw > 0 and a.mode -> b.y > 0", True, ["a.keeps", "b.same"]),
        ("a.raw > 9 -> b.y > 0", True, ["a.keeps", "a.busy", "b.same"]),
        ("(a.raw > 0 -> b.y > 0) and (a.mode and a.raw > 0 -> b.y > 0)", True, ["a.keeps", "b.same"]),
        ("a.raw > 0 and a.x < 9 -> b.y > 0", True, ALL),
        ("a.x > 5 -> b.y > 1", True, ALL),
        ("b.y == a.x", True, []),
        ("historically(a.raw > 0 -> a.x > 0)", False, ["b.same"]),
        ("previous(a.raw > 0, FALSE) -> previous(b.y > 0, TRUE)", False, ALL),
    ],
)
def test_conditions_count_as_far_as_a_nodes_ports_show_them(
    tmp_path: Path, formula: str, at_once: bool, beyond: list[str]
) -> None:
    plan = f'{WORLD}requirements: {{R: {{text: Well, formula: "{formula}"}}}}\n'
    assert composed(tmp_path, LINE, plan) == {"at_once": at_once, "beyond": beyond}


EXACT = """
node a { inputs( raw : REAL ) outputs( x : REAL ) topics() guarantee near ( in.raw >= 100 -> out.x == in.raw ) }
node b { inputs( x : REAL ) outputs( stop : BOOL ) topics() guarantee stops ( in.x >= 5 -> out.stop ) }
"""


@pytest.mark.parametrize(("limit", "beyond"), [("100", ["b.stops"]), ("5", [])])
def test_trials_at_inputs_that_the_condition_excludes_do_not_count(
    tmp_path: Path, limit: str, beyond: list[str]
) -> None:
    """A sensor that reports what it measures passes only 100 and more on where the requirement asks something."""
    plan = WORLD.replace(", in.mode: {because: any}", "")
    plan += f'requirements: {{R: {{text: Well, formula: "a.raw >= {limit} -> b.stop"}}}}\n'
    assert composed(tmp_path, EXACT.replace("100", limit), plan)["beyond"] == beyond


RELAY = """
node a { inputs( raw : REAL ) outputs( x : REAL ) topics() guarantee keeps ( out.x > 0 ) }
node b { inputs( x : REAL ) outputs( y : REAL ) topics()
  assume good ( in.x > 0 ) guarantee keeps ( WHAT ) }
"""


@pytest.mark.parametrize("delayed", [False, True])
@pytest.mark.parametrize("remembers", [False, True])
def test_what_fails_at_an_earlier_step_may_count(tmp_path: Path, delayed: bool, remembers: bool) -> None:
    """Over a delay, and where a node remembers: it keeps its guarantees only while its assumptions have always held."""
    what = "historically(in.x > 0) -> out.y > 0" if remembers else "out.y > 0"
    edge = "connections: [{from: a.x, to: b.x, delayed: true, initial: 1}]\n" if delayed else ""
    plan = (
        f"{WORLD.replace(', in.mode: {because: any}', '')}{edge}requirements: {{R: {{text: Well, formula: b.y > 0}}}}\n"
    )
    found = composed(tmp_path, RELAY.replace("WHAT", what), plan)
    assert found["at_once"] == (not delayed and not remembers)
