"""How often a claim that depends on samples may fail: each bound is checked against its sample, then bounds are added.

A sample has one or more strata (conditions under which trials were made). In a stratum with `failures` in `trials`,
"the probability of failure is at most p" holds at confidence c if so few failures have probability 1 - c or less where
the true probability is p (C. J. Clopper and E. S. Pearson, 1934). For several strata the greatest bound counts. A claim
that depends on several sampled claims fails at most as often as these together (the union bound, for any dependence),
and the doubts 1 - c add up as well (Bonferroni). A trial is a step, or a whole run of any number of steps: neither rate
bounds the other, so all trials have to be of one kind. A claim that may fail because of a failure at an earlier step
has a rate of whole runs only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, Context, Decimal
from enum import StrEnum
from fractions import Fraction
from math import prod

from avow.base import codec
from avow.kernel.check import Refused

Trial = StrEnum("Trial", {"STEP": "step", "RUN": "run"})
_UP = Context(prec=50, rounding=ROUND_CEILING, Emin=-(10**15), Emax=10**15)
"""All numbers of `tail` are positive and rounded up, so that its result is never too small."""


@dataclass(frozen=True, slots=True)
class Stratum:
    """Trials under one condition. `bound` and `confidence` are exact decimals."""

    name: str
    trials: int
    failures: int
    bound: str
    confidence: str
    trial: Trial = field(default=Trial.STEP, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Leaf:
    """A claim by its name, and its sample; or, without one, a claim that is shown to fail with a probability of at most
    `stated` (an exact decimal) in a trial."""

    claim: str
    strata: tuple[Stratum, ...]
    stated: str = field(default="", metadata=codec.LATER)
    trial: Trial = field(default=Trial.STEP, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Likely:
    """A claim, by its name, that holds with a probability of at least `least` (an exact decimal): at a step, whatever
    happened before, or at all steps of a run."""

    claim: str
    least: str
    trial: Trial


@dataclass(frozen=True, slots=True)
class Rate:
    """A claim fails with a probability of at most `bound`, at `confidence`."""

    bound: Fraction
    confidence: Fraction


def tail(failures: int, trials: int, probability: Fraction) -> Fraction:
    """P(X <= failures) for X binomial(trials, probability); never too small, and too large by 1 part in 10^40 at most.
    `probability` lies between 0 and 1."""
    if failures >= trials or probability <= 0:
        return Fraction(1)
    if probability >= 1:
        return Fraction(0)
    up = _UP
    a, b = Decimal(probability.numerator), Decimal(probability.denominator - probability.numerator)
    term, square, power = Decimal(1), up.divide(b, Decimal(probability.denominator)), trials
    while power:  # (1 - p) ^ trials
        if power % 2:
            term = up.multiply(term, square)
        square, power = up.multiply(square, square), power // 2
    total = term
    for k in range(failures):
        term = up.divide(up.multiply(up.multiply(term, Decimal(trials - k)), a), up.multiply(b, Decimal(k + 1)))
        total = up.add(total, term)
    return Fraction(total)


def shows(failures: int, trials: int, bound: Fraction, confidence: Fraction) -> bool:
    """Whether so many failures show, at that confidence, that a trial fails with a probability of at most `bound`."""
    sensible = 0 <= failures <= trials and 0 < confidence < 1
    return sensible and (bound >= 1 or tail(failures, trials, bound) <= 1 - confidence)


def together(leaves: Sequence[Likely], steps: int | None, *, independent: bool = False) -> Fraction:
    """The least probability that all of the claims hold: at each step (1), at all of the first `steps` steps, or in a
    run (None). At a step, claims fail together at most as often as their failures add up (the union bound), and so do
    steps. `independent`: claims fail independently of each other, given what happened before; then probabilities are
    multiplied. Raises Refused if a claim's trials cannot be counted so."""
    wrong = {1: Trial.RUN, None: Trial.STEP}.get(steps)
    for leaf in leaves:
        if leaf.trial is wrong or not 0 < Fraction(leaf.least) < 1:
            raise Refused(f"{leaf.claim}: {leaf.least} in a {leaf.trial} does not compose")
    times = {Trial.STEP: steps or 0, Trial.RUN: 1}
    if independent:
        return prod((Fraction(leaf.least) ** times[leaf.trial] for leaf in leaves), start=Fraction(1))
    return max(1 - sum((times[leaf.trial] * (1 - Fraction(leaf.least)) for leaf in leaves), Fraction(0)), Fraction(0))


def composed(leaves: Sequence[Leaf], *, at_once: bool) -> Rate:
    """The rate of a claim that fails in a run only if a leaf does (`at_once`: at a step only if one does then). Raises
    Refused if a sample does not show its bound, or if trials do not add up. If the doubts add up to 1 or more, nothing
    is known: the bound is 1."""
    bound = doubt = Fraction(0)
    trials = {leaf.trial: leaf.claim for leaf in leaves if leaf.stated}
    trials |= {each.trial: leaf.claim for leaf in leaves for each in leaf.strata}
    if Trial.STEP in trials and (Trial.RUN in trials or not at_once):
        why = "others are whole runs" if Trial.RUN in trials else "what fails at an earlier step may count"
        raise Refused(f"a trial of {trials[Trial.STEP]} is a single step, and {why}")
    for leaf in leaves:
        if leaf.stated and not leaf.strata and 0 <= Fraction(leaf.stated) <= 1:
            bound += Fraction(leaf.stated)
            continue
        if not leaf.strata:
            raise Refused(f"{leaf.claim} has no sample")
        for each in leaf.strata:
            if not shows(each.failures, each.trials, Fraction(each.bound), Fraction(each.confidence)):
                raise Refused(f"{leaf.claim}: {each.failures} of {each.trials} do not show at most {each.bound}")
            doubt += 1 - Fraction(each.confidence)
        bound += max(Fraction(each.bound) for each in leaf.strata)
    return Rate(min(bound, Fraction(1)), 1 - doubt) if doubt < 1 else Rate(Fraction(1), Fraction(0))
