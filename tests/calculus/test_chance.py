"""Requirements with a probability: never more than the worst joint distribution allows, by enumeration."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from helpers import avow

from avow.base.diagnostics import Rejected
from avow.base.verdict import HypothesisKind, Outcome, Verdict
from avow.calculus.composition import compose
from avow.calculus.export import derived_contract
from avow.calculus.required import unshown
from avow.evidence.record import LIKELY_LEAVES
from avow.kernel.check import Refused
from avow.kernel.rates import Leaf, Likely, Trial, composed, together
from avow.language.load import check_text
from avow.language.translate import to_rcl
from avow.system.plan import System
from calculus.make import make, outcomes

RCL = """
node eye { inputs( near : BOOL, dark : BOOL ) outputs( seen : BOOL, sure : BOOL ) topics()
  guarantee sees with probability >= 0.99 given ( near ) ( out.seen )
  guarantee knows with probability >= 0.95 given ( near ) ( out.sure )
  guarantee lasts with probability >= 0.9 per run ( near -> out.sure ) }
node brake { inputs( seen : BOOL ) outputs( stop : BOOL ) topics()
  guarantee stops ( in.seen -> out.stop ) }
"""
REST = """
environment: {in.near: {because: any}, in.dark: {because: any}}
connections: [{from: eye.seen, to: brake.seen}]
compose: {whole: {persistence: &said {because: latched}, one_output: *said}}
"""
STOPS, SURE = "eye.near -> brake.stop", "eye.near -> brake.stop and eye.sure"
NAMED = {"sees": "eye.sees", "knows": "eye.knows", "lasts": "eye.lasts"}


def made(folder: Path, formula: str, asked: str, *support: str) -> System:
    names = ", ".join(NAMED.get(name, name) for name in (*support, "brake.stops"))
    plan = f"R: {{text: It stops, formula: '{formula}', probability: {asked}, supported_by: [{names}]}}"
    return make(folder, RCL, f"requirements: {{{plan}}}{REST}")


def answer(folder: Path, formula: str, asked: str, *support: str) -> Outcome:
    return outcomes(made(folder, formula, asked, *support))["R"]


@pytest.mark.parametrize(
    ("formula", "asked", "support", "proved"),
    [
        (STOPS, "0.99", ["sees"], True),
        (STOPS, "0.991", ["sees"], False),  # more than the guarantee has
        (STOPS, "{at_least: 0.99, given: eye.near}", ["sees"], True),
        (STOPS, "{at_least: 0.9, given: eye.near and eye.dark}", ["sees"], False),  # it may fail in the dark only
        (STOPS, "{at_least: 0.9, given: eye.dark}", ["sees"], False),
        (SURE, "0.94", ["sees", "knows"], True),
        (SURE, "0.9401", ["sees", "knows"], False),
        (SURE, "{at_least: 0.9405, independent: two lenses}", ["sees", "knows"], True),
        (SURE, "{at_least: 0.9406, independent: two lenses}", ["sees", "knows"], False),
        (SURE, "{at_least: 0.87, steps: 3}", ["sees", "lasts"], True),
        (SURE, "{at_least: 0.88, steps: 3}", ["sees", "lasts"], False),
        (SURE, "0.5", ["sees"], False),  # `sure` is not promised by it
        ("eye.near -> eye.sure", "{at_least: 0.9, per_run: true}", ["lasts"], True),
    ],
)
def test_the_probability_that_is_shown(
    tmp_path: Path, formula: str, asked: str, support: list[str], proved: bool
) -> None:
    outcome = answer(tmp_path, formula, asked, *support)
    assert (outcome.verdict is Verdict.PROVED) == proved, outcome.summary
    if proved:
        claims = {h.name for h in outcome.rests_on if h.kind is HypothesisKind.CLAIM}
        assert {f"eye/guarantee/{name}" for name in support} <= claims
        assert ("system/composition/independent.R" in claims) == ("independent" in asked)
        assert len(outcome.details[LIKELY_LEAVES]) == len(support)
        assert not outcome.vacuous


def test_the_kernel_decides_again(tmp_path: Path) -> None:
    """`unshown` is asked whenever a recorded proof is established again: an edited probability no longer counts."""
    system = made(tmp_path, STOPS, "0.99", "sees")
    (asked,) = system.plan.requirements
    frame = compose(system).frame
    assert asked.probability is not None
    assert not unshown(frame, asked)
    assert unshown(frame, replace(asked, probability=replace(asked.probability, at_least="0.999")))


@pytest.mark.parametrize(
    ("asked", "support", "code"),
    [
        ("0.9", [], "PLAN142"),  # no guarantee with a probability
        ("0.9", ["lasts"], "PLAN142"),  # of a run, for each step
        ("{at_least: 0.9, per_run: true}", ["sees"], "PLAN142"),
        ("{at_least: 0.9, steps: 2, per_run: true}", ["sees"], "PLAN142"),
        ("1.5", ["sees"], "PLAN105"),
    ],
)
def test_what_cannot_be_composed_is_an_error(tmp_path: Path, asked: str, support: list[str], code: str) -> None:
    with pytest.raises(Rejected) as found:
        made(tmp_path, STOPS, asked, *support)
    assert code in {d.code for d in found.value.diagnostics}


def test_a_failure_at_an_earlier_step_refutes_no_probability(tmp_path: Path) -> None:
    """The brake sees what the eye saw a step before: the requirement holds with 0.9, but not by this argument."""
    rcl = """node eye { inputs() outputs( seen : BOOL ) topics() guarantee sees with probability >= 0.9 ( out.seen ) }
node brake { inputs( seen : BOOL ) outputs( last : BOOL ) topics() guarantee is ( out.last == in.seen ) }"""
    plan = """connections: [{from: eye.seen, to: brake.seen, delayed: true, initial: "TRUE"}]
compose: {whole: {persistence: &said {because: latched}, one_output: *said}}
requirements: {R: {text: t, formula: brake.last, probability: 0.9, supported_by: [eye.sees, brake.is]}}
"""
    assert outcomes(make(tmp_path, rcl, plan))["R"].verdict is Verdict.UNKNOWN


def test_a_formula_may_look_back_but_not_ahead(tmp_path: Path) -> None:
    back = answer(tmp_path / "back", "historically(eye.dark) and eye.near -> brake.stop", "0.99", "sees")
    assert back.verdict is Verdict.PROVED, back.summary
    with pytest.raises(Rejected) as found:
        compose(made(tmp_path / "ahead", "eye.near -> within[2 steps](brake.stop)", "0.99", "sees"))
    assert [d.code for d in found.value.diagnostics] == ["PLAN142"]


def test_it_discharges_no_assumption(tmp_path: Path) -> None:
    rcl = RCL.replace("guarantee stops", "assume told ( in.seen )  guarantee stops")
    plan = f"requirements: {{R: {{text: t, formula: {STOPS}, probability: 0.9, supported_by: [eye.sees]}}}}{REST}"
    assert outcomes(make(tmp_path, rcl, plan))["R"].verdict is not Verdict.PROVED
    assert check_text(rcl, "x.rcl")[0] is not None


@pytest.mark.parametrize("seed", range(40))
def test_together_is_no_more_than_any_joint_distribution_allows(seed: int) -> None:
    """A random distribution over which of some claims fail at each of a few steps: the first claims fail by the step,
    the last one in the run. Each keeps its bound given what happened before; `together` never exceeds the truth."""
    rng = random.Random(seed)
    claims, steps = rng.randint(1, 3), rng.randint(1, 3)
    sets = list(itertools.product((False, True), repeat=claims))

    def drawn() -> list[Fraction]:
        weights = [Fraction(rng.choice((0, 1, 1, 5, 40)) if any(s) else 100) for s in sets]
        return [w / sum(weights) for w in weights]

    def fails(weights: list[Fraction], k: int) -> Fraction:
        return sum((w for w, s in zip(weights, sets, strict=True) if s[k]), Fraction(0))

    def kept(depth: int) -> tuple[Fraction, list[Fraction]]:
        """The probability that nothing fails from here on, and the greatest of each claim's failures at a step."""
        weights = drawn()
        worst = [fails(weights, k) for k in range(claims)]
        good = weights[0]
        if depth > 1:
            later, more = kept(depth - 1)
            good, worst = good * later, list(map(max, worst, more))
        return good, worst

    true, worst = kept(steps)
    leaves = [Likely(str(k), str(1 - w), Trial.STEP) for k, w in enumerate(worst) if w]
    assert together(leaves, steps) <= true
    run = Likely("run", "9/10", Trial.RUN)
    assert together([*leaves, run], max(steps, 2)) <= together(leaves, max(steps, 2)) * Fraction(9, 10) + Fraction(
        1, 10
    )
    with pytest.raises(Refused):
        together([*leaves, run], 1)


def test_a_claim_without_a_sample_has_its_stated_bound() -> None:
    rate = composed([Leaf("a", (), "0.01"), Leaf("b", (), "0.02")], at_once=True)
    assert (rate.bound, rate.confidence) == (Fraction("0.03"), 1)
    with pytest.raises(Refused):
        composed([Leaf("a", (), "0.01"), Leaf("b", (), "0.02", Trial.RUN)], at_once=True)
    with pytest.raises(Refused):
        composed([Leaf("a", (), "-0.01")], at_once=True)


def test_the_derived_contract_has_the_probabilities(tmp_path: Path) -> None:
    """As a node has them, over the ports of the whole; a subsystem's contract in words leaves them to the node."""
    system = made(tmp_path / "one", STOPS, "0.99", "sees")
    composition = compose(system)
    (whole,) = derived_contract(composition, composition.whole).nodes
    found = {clause.name: clause for clause in whole.guarantees}
    text = " ".join(to_rcl(derived_contract(composition, composition.whole)).split())
    assert "guarantee eye_sees with probability >= 0.99 given ( in.near ) ( out.seen )" in text
    assert "guarantee eye_lasts with probability >= 0.9 per run ( in.near -> out.sure )" in text
    assert found["brake_stops"].chance is None
    plan = f"subsystems: {{front: {{nodes: [eye, brake], persistence: {{because: latched}}}}}}{REST}"
    make(tmp_path / "two", RCL, plan)
    told = avow("compose", "two", cwd=tmp_path).stdout
    assert "guarantees brake.stops: out.seen → out.stop" in told
    assert "eye.sees" not in told
