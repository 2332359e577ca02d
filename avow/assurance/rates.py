"""How often a claim may fail, if it rests on samples: the union bound over its sampled leaves."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import field
from fractions import Fraction
from typing import TYPE_CHECKING

from avow.assurance.naming import short
from avow.base.codec import LATER, Unreadable, from_json
from avow.base.percent import at_least, at_most, percent
from avow.base.plain import decimal, listed
from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.evidence.record import COMPOSES, LIKELY, LIKELY_LEAVES, RATE, Evidence
from avow.evidence.status import Status, weigh
from avow.kernel.check import Refused
from avow.kernel.rates import Leaf, Likely, Stratum, Trial, composed

if TYPE_CHECKING:
    from avow.assurance.model import ObligationView
    from avow.system.probability import Probability

LEAST_CONFIDENCE = Fraction(9, 10)
"""Below it, a rate is no evidence that a policy's limit is met."""

NO_RATE = "failure rate in use unknown"
_SAMPLED = (Status.TESTED, Status.MONITORED)

_TRIALS = {
    Trial.STEP: "of steps that meet the conditions of the sampled claims: nothing is said of others, or of missions",
    Trial.RUN: "of whole runs, as long as those in the data and made as they were: nothing is said of others",
}


@dataclass(frozen=True, slots=True)
class RateView:
    """How often a claim may fail, per trial of the data's operational profile. `leaves`, with their samples, are the
    certificate: `avow.kernel.rates` establishes `bound` and `confidence` from them."""

    bound: str
    """An exact decimal; empty: no rate can be given."""
    confidence: str
    """The joint confidence of all leaves."""
    leaves: tuple[Leaf, ...]
    """Sampled claims, by id, that have a rate."""
    why: str = field(default="", metadata=LATER)
    """The reason why no rate can be given."""

    @property
    def trial(self) -> Trial:
        """The unit that is counted, if there is a rate: all leaves have the same."""
        first = self.leaves[0]
        return first.strata[0].trial if first.strata else first.trial

    @property
    def brief(self) -> str:
        """The text beside the level. A bound is rounded up, a confidence down."""
        if not self.bound or Fraction(self.bound) >= 1:
            return NO_RATE
        sure = f", at {at_least(self.confidence)} confidence" if Fraction(self.confidence) < 1 else ""
        return f"at most {at_most(self.bound)} of {self.trial}s fail{sure}"

    @property
    def lacks(self) -> str:
        """Why there is no rate below 100 %; empty if there is one."""
        return self.why or "the sampled claims together show no bound" * (self.brief == NO_RATE)

    @property
    def words(self) -> str:
        """One line, without a full stop."""
        if self.lacks:
            return f"{NO_RATE}, as {self.lacks}"
        if len(self.leaves) < 2:
            return f"failure rate: {self.brief} ({_TRIALS[self.trial]})"
        drawn = sum(bool(leaf.strata) for leaf in self.leaves)
        how = f"union bound over {len(self.leaves)} claims, {drawn} of them sampled"
        how += ", joint confidence by Bonferroni" if drawn > 1 else ""
        return f"failure rate: {self.brief} ({how}; {_TRIALS[self.trial]})"


@dataclass(frozen=True, slots=True)
class _Composes:
    """The form in which `avow.calculus.trials.composes` writes it."""

    at_once: bool
    beyond: tuple[str, ...]


def rate_of(own: Iterable[str], claims: Iterable[str], views: Mapping[str, ObligationView]) -> RateView | None:
    """The rate of a requirement by its own claims and everything that it rests on; None if none of that is sampled."""
    leaves, unrated = [], []
    stated = {leaf.claim: leaf for name in own for record in views[name].records for leaf in _stated(record)}
    for name in claims:
        if (view := views.get(name)) is None:
            continue
        samples = [s for record in view.records if weigh(record).support is not None and (s := sample(record))]
        failed = any(stratum.failures for strata in samples for stratum in strata)
        if not (failed or view.status in _SAMPLED) and (leaf := stated.get(short(name))) is not None:
            leaves.append(Leaf(name, (), _decimal(1 - Fraction(leaf.least)), leaf.trial))  # checked, say, of a model
        elif failed or view.status in _SAMPLED or any(LIKELY in record.details for record in view.records):
            if samples:
                leaves.append(Leaf(name, max(samples, key=lambda strata: max(Fraction(s.bound) for s in strata))))
            else:
                unrated.append(name)
    if not leaves and not unrated:
        return None
    proof = next((found for name in own for record in views[name].records if (found := _composes(record))), None)
    why = ""
    if unrated:
        others = ", among others" * (len(unrated) > 1)
        why = f"no experiment counts trials of the robot's use for {short(unrated[0])}{others}"
    elif proof is None:
        why = "no proof of a formula composes one from the samples"
    elif beyond := [short(leaf.claim) for leaf in leaves if short(leaf.claim) in proof.beyond]:
        why = f"trials of {listed(beyond, 3)} need not meet its condition: a guarantee under that condition is wanted"
    else:
        try:
            rate = composed(leaves, at_once=proof.at_once)
            return RateView(_decimal(rate.bound), _decimal(rate.confidence), tuple(leaves))
        except Refused as refused:
            why = functools.reduce(lambda text, leaf: text.replace(leaf.claim, short(leaf.claim)), leaves, str(refused))
    return RateView("", "", tuple(leaves), why)


def _stated(record: Evidence) -> tuple[Likely, ...]:
    try:
        return from_json(tuple[Likely, ...], record.details.get(LIKELY_LEAVES, []))
    except Unreadable:
        return ()


def _composes(record: Evidence) -> _Composes | None:
    try:
        return from_json(_Composes, record.details[COMPOSES]) if record.verdict is Verdict.PROVED else None
    except (KeyError, Unreadable):
        return None


def misstated(rate: RateView) -> str:
    """The reason why a rate does not follow from the samples that it names; empty if it does."""
    if not rate.bound:
        return ""
    try:
        true = composed(rate.leaves, at_once=True)
    except Refused as why:
        return str(why)
    told = (Fraction(rate.bound), Fraction(rate.confidence))
    return "" if told == (true.bound, true.confidence) else f"its samples give {float(true.bound):g}, not {rate.bound}"


def short_of(asked: Probability, rate: RateView) -> str:
    """The reason why samples do not show a probability; empty if they do. Over several steps, each may fail (union
    bound). Runs have the length that they have in the data: their rate bounds no other number of steps."""
    of_runs = bool(rate.bound) and rate.trial is Trial.RUN
    if rate.bound and of_runs is not asked.per_run and (asked.per_run or asked.steps > 1):
        return f"a rate of {'whole runs' if asked.per_run else 'steps'} is asked; {rate.words}"
    return exceeds(rate, (1 - Fraction(asked.at_least)) / (1 if of_runs else asked.steps))


def exceeds(rate: RateView, most: Fraction | str) -> str:
    """The reason why a rate is not known to be within a limit; empty if it is."""
    if not rate.bound:
        return rate.words
    if Fraction(rate.bound) > Fraction(most):
        return f"at most {percent(most)} is allowed; {rate.words}"
    if Fraction(rate.confidence) < LEAST_CONFIDENCE:
        least = percent(LEAST_CONFIDENCE)
        return f"a confidence of {least} is asked of all samples together; {rate.words}"
    return ""


def sample(record: Evidence) -> tuple[Stratum, ...]:
    """The strata that a record counts, each with its bound; empty if it names none."""
    try:
        strata = from_json(tuple[Stratum, ...], record.details.get(RATE, []))
        return strata if all(0 <= Fraction(s.bound) <= 1 and Fraction(s.confidence) < 1 for s in strata) else ()
    except (Unreadable, ValueError, ZeroDivisionError):
        return ()


def _decimal(value: Fraction) -> str:
    """Bounds and confidences are decimals, and so are their sums; any other number is written as an exact fraction."""
    return decimal(value) or str(value)
