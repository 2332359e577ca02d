"""Temporal verdicts of small counters against enumeration: runs that never close, and domains that cut runs off."""

from __future__ import annotations

import random
from itertools import product
from pathlib import Path

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.calculus.ltl import refuted_at
from avow.calculus.replaying import holds
from avow.system.temporal import Property, State

from .make import make, node, outcomes
from .test_ltl import P, Q, random_property

_DEEP = 14


def outcome(folder: Path, guarantee: str, property_: str, scenario: str) -> tuple[Verdict, str]:
    plan = (
        "connections: [{from: n.y, to: n.p, delayed: true, initial: 0}]\n"
        f'requirements: {{R: {{text: R, temporal: "{property_}"}}}}\nscenario: {{{scenario}}}\n'
    )
    text = node("n", "p : INTEGER", "y : INTEGER", f"G g: {guarantee}")
    found = outcomes(make(folder, text, plan))["R"]
    return found.verdict, found.summary


@pytest.mark.parametrize("property_", ["always n.y < 5", "always n.y < 1", "not eventually n.y == 3", "next n.y == 1"])
@pytest.mark.parametrize("scenario", ["steps: 40", "steps: 40, domains: {out.y: 0..3}", "domains: {INTEGER: 0..3}"])
def test_a_run_that_never_closes_is_refuted_by_its_beginning(tmp_path: Path, property_: str, scenario: str) -> None:
    verdict, told = outcome(tmp_path, "out.y == in.p + 1", property_, scenario)
    assert verdict is Verdict.REFUTED, told


def test_what_no_beginning_refutes_is_said(tmp_path: Path) -> None:
    verdict, told = outcome(tmp_path, "out.y == in.p + 1", "eventually n.y < 0", "steps: 20")
    assert verdict is Verdict.TESTED
    assert "can only be shown by a run that repeats or stops" in told


@pytest.mark.parametrize(
    ("guarantee", "verdict"),
    [
        ("out.y == in.p + 1 or out.y == 0", Verdict.TESTED),
        ("out.y > in.p and out.y < in.p + 2 or in.p > 3", Verdict.TESTED),
        ("(out.y == in.p + 1 or out.y == 0) and out.y <= 3", Verdict.CHECKED),
    ],
)
@pytest.mark.parametrize("domain", ["n.y: [0, 1, 2, 3]", "out.y: 0..3", "INTEGER: 0..3"])
def test_a_domain_that_cuts_runs_off_is_not_exhaustive(
    tmp_path: Path, guarantee: str, verdict: Verdict, domain: str
) -> None:
    found, told = outcome(tmp_path, guarantee, "always n.y <= 3", f"domains: {{{domain}}}")
    assert found is verdict, told
    assert found is Verdict.CHECKED or "the scenario's values cut runs off at the step with in.p = 3" in told


@pytest.mark.parametrize("seed", some(range(24), 8, slow=16))
def test_counters_against_enumeration(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    moves = {p: chance.sample(range(7), chance.choice([1, 1, 2])) for p in range(7)}
    cases = [
        " or ".join(f"out.y == {y}" for y in ys) if chance.random() < 0.8 or len(ys) > 1 else f"out.y == in.p + {ys[0]}"
        for ys in moves.values()
    ]
    guarantee = " and ".join(f"(in.p == {p} -> ({case}))" for p, case in enumerate(cases))
    guarantee += " and ((in.p < 0 or in.p > 6) -> out.y == in.p + 1)"

    def after(p: int) -> list[int]:
        if p not in moves:
            return [p + 1]
        return [p + moves[p][0]] if "in.p" in cases[p] else moves[p]

    reached, level = set[int](), {0}
    for _ in range(_DEEP):
        level = {y for p in level for y in after(p)}
        reached |= level
    limit = chance.randint(1, 8)
    domain = chance.choice(["", ", domains: {out.y: 0..3}", ", domains: {INTEGER: 0..6}", ", domains: {out.y: 0..6}"])
    verdict, told = outcome(tmp_path, guarantee, f"always n.y < {limit}", f"steps: {_DEEP}{domain}")
    if max(reached) >= limit:
        assert verdict in (Verdict.REFUTED, Verdict.TESTED, Verdict.UNKNOWN), told
        if "INTEGER: 0..6" in domain and max(reached) <= 6:
            assert verdict is Verdict.REFUTED, told
    else:
        assert verdict is not Verdict.REFUTED, told


@pytest.mark.parametrize("seed", some(range(150), 50, slow=100))
def test_a_bad_prefix_has_no_continuation_that_has_the_property(seed: int) -> None:
    chance = random.Random(seed)
    formula: Property = random_property(chance, 2)
    letters: list[dict[State, bool]] = [{P: p, Q: q} for p, q in product([False, True], repeat=2)]
    run = [chance.choice(letters) for _ in range(3)]
    at = refuted_at(formula, run)
    for k in range(len(run)):
        some = any(
            holds(formula, [*run[: k + 1], *tail], back)
            for tail in product(letters, repeat=3)
            for back in range(k + 1, k + 4)
        )
        assert some is (at is None or k < at)
