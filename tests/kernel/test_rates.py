"""Rates: the tail against exact fractions, bounds against the definition, and the union bound against enumeration."""

from __future__ import annotations

import itertools
import math
import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from avow.kernel.check import Refused
from avow.kernel.rates import Leaf, Stratum, Trial, composed, shows, tail

PERCENT = st.integers(1, 99).map(lambda n: Fraction(n, 100))


def exact(failures: int, trials: int, p: Fraction) -> Fraction:
    return sum((math.comb(trials, k) * p**k * (1 - p) ** (trials - k) for k in range(failures + 1)), Fraction(0))


@given(st.integers(0, 40), st.integers(0, 40), PERCENT)
def test_tail_is_the_exact_one_rounded_up(failures: int, trials: int, p: Fraction) -> None:
    true = exact(min(failures, trials), trials, p)
    assert true <= tail(failures, trials, p) <= true * (1 + Fraction(1, 10**40))


@given(st.integers(1, 60), st.integers(0, 5), PERCENT, st.sampled_from([Fraction(9, 10), Fraction(95, 100)]))
def test_a_bound_is_shown_exactly_where_so_few_failures_would_be_rare(
    trials: int, failures: int, bound: Fraction, confidence: Fraction
) -> None:
    rare = failures <= trials and exact(failures, trials, bound) <= 1 - confidence
    assert shows(failures, trials, bound, confidence) == rare


def leaf(name: str, *strata: tuple[int, int, str, str]) -> Leaf:
    return Leaf(name, tuple(Stratum("", n, k, bound, confidence) for n, k, bound, confidence in strata))


def test_three_nodes_at_8_6_percent() -> None:
    rate = composed([leaf(name, (34, 0, "0.086", "0.95")) for name in "abc"], at_once=True)
    assert (rate.bound, rate.confidence) == (Fraction("0.258"), Fraction("0.85"))


def test_the_worst_stratum_counts_and_its_doubts_add_up() -> None:
    rate = composed([leaf("a", (200, 0, "0.03", "0.975"), (20, 0, "0.2", "0.975"))], at_once=True)
    assert (rate.bound, rate.confidence) == (Fraction("0.2"), Fraction("0.95"))


def test_where_doubts_add_up_to_one_nothing_is_known() -> None:
    rate = composed([leaf(str(i), (1000, 0, "0.01", "0.95")) for i in range(20)], at_once=True)
    assert (rate.bound, rate.confidence) == (1, 0)


@pytest.mark.parametrize(
    "wrong",
    [
        leaf("a", (34, 0, "0.084", "0.95")),  # too small a bound
        leaf("a", (34, 1, "0.086", "0.95")),
        leaf("a", (33, 0, "0.086", "0.95")),
        leaf("a", (34, 0, "0.086", "0.96")),
        leaf("a", (5, 6, "1", "0.95")),  # more failures than trials
        leaf("a", (5, -1, "1", "0.95")),
        leaf("a", (5, 0, "1", "1.5")),  # no confidence: it would take from the doubts of others
        leaf("a", (34, 0, "0.086", "0.95"), (0, 0, "0.5", "0.95")),
        leaf("a"),
    ],
)
def test_a_bound_that_its_sample_does_not_show_is_refused(wrong: Leaf) -> None:
    composed([leaf("b", (34, 0, "0.086", "0.95"))], at_once=True)
    with pytest.raises(Refused):
        composed([leaf("b", (34, 0, "0.086", "0.95")), wrong], at_once=True)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("at_once", [True, False])
def test_a_rate_holds_of_the_trials_that_it_names(seed: int, at_once: bool) -> None:
    """Random runs of several steps, all known, in which leaves fail at some steps: a claim fails at a step where one of
    them does then (`at_once`) or did before. What `composed` says from the leaves' true rates is no less than the
    claim's, and trials of two kinds are never added."""
    source = random.Random(seed)
    lengths = [source.randint(1, 6) for _ in range(source.randint(2, 5))]
    fails = [[[source.random() < 0.15 for _ in range(n)] for n in lengths] for _ in range(source.randint(1, 3))]

    def claim(run: int, step: int) -> bool:
        since = step if at_once else 0
        return any(any(leaf[run][since : step + 1]) for leaf in fails)

    of_claim = [[claim(run, step) for step in range(n)] for run, n in enumerate(lengths)]

    def rate(found: list[list[bool]], trial: Trial) -> Fraction:
        trials = [any(run) for run in found] if trial is Trial.RUN else [each for run in found for each in run]
        return Fraction(sum(trials), len(trials))

    def known(of: list[list[bool]], trial: Trial) -> Leaf:
        bound = Fraction(math.ceil(rate(of, trial) * 1000) + 1, 1000)
        return Leaf("l", (Stratum("", 100_000, 0, str(float(min(bound, Fraction(1)))), "0.99", trial),))

    for trial in Trial:
        leaves = [known(leaf, trial) for leaf in fails]
        if trial is Trial.STEP and not at_once:
            with pytest.raises(Refused, match="single step"):
                composed(leaves, at_once=False)
        else:
            found = composed(leaves, at_once=at_once)
            assert found.bound >= rate(of_claim, trial)
    with pytest.raises(Refused, match="whole run"):
        composed([known(fails[0], Trial.STEP), known(fails[-1], Trial.RUN)], at_once=at_once)


@pytest.mark.parametrize("seed", range(20))
def test_the_union_bound_holds_of_any_joint_distribution(seed: int) -> None:
    """A claim that fails only where some leaf fails, with random dependence among leaves: all outcomes enumerated."""
    source = random.Random(seed)
    leaves = source.randint(1, 4)
    outcomes = list(itertools.product((False, True), repeat=leaves))
    weights = [source.randint(0, 9) ** 2 for _ in outcomes]
    weights[0] += 1
    total = sum(weights)
    fails = [any(o) and source.random() < 0.8 for o in outcomes]  # a claim may hold though a leaf fails
    truth = Fraction(sum(w for w, f in zip(weights, fails, strict=True) if f), total)
    rates = [Fraction(sum(w for w, o in zip(weights, outcomes, strict=True) if o[i]), total) for i in range(leaves)]
    bounds = [Fraction(math.ceil(r * 1000) + 1, 1000) for r in rates]
    sampled = [leaf(str(i), (100_000, 0, str(float(b)), "0.99")) for i, b in enumerate(bounds)]
    assert composed(sampled, at_once=True).bound >= truth


def least_bound(failures: int, trials: int, confidence: Fraction) -> Fraction:
    return next(
        p for n in range(1, 201) if shows(failures, trials, p := Fraction(n, 200), confidence)
    )  # bounds on a grid, rounded up


@pytest.mark.parametrize("seed", range(8))
def test_the_composed_bound_covers_as_often_as_its_confidence_says(seed: int) -> None:
    """Over all samples that independent leaves may give, weighed exactly by true rates, the bound is too small no
    oftener than the joint confidence allows."""
    source = random.Random(seed)
    confidence = Fraction(9, 10)
    true = [Fraction(source.randint(1, 60), 100) for _ in range(source.randint(1, 3))]
    trials = [source.randint(3, 7) for _ in true]
    union = 1 - math.prod((1 - p for p in true), start=Fraction(1))
    bounds = [[least_bound(k, n, confidence) for k in range(n + 1)] for n in trials]
    covered = joint = Fraction(0)
    for sample in itertools.product(*(range(n + 1) for n in trials)):
        chance = math.prod(
            (math.comb(n, k) * p**k * (1 - p) ** (n - k) for k, n, p in zip(sample, trials, true, strict=True)),
            start=Fraction(1),
        )
        leaves = [
            leaf(str(i), (n, k, str(float(bounds[i][k])), "0.9"))
            for i, (k, n) in enumerate(zip(sample, trials, strict=True))
        ]
        rate = composed(leaves, at_once=True)
        joint = rate.confidence
        covered += chance if rate.bound >= union else 0
    assert covered >= joint == 1 - len(true) * (1 - confidence)
