"""How often a claim may fail, where it rests on samples: the union bound over its sampled leaves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction
from typing import TYPE_CHECKING

from avow.assurance.naming import short
from avow.base.codec import Unreadable, from_json
from avow.base.plain import count, decimal, listed
from avow.base.records import dataclass
from avow.evidence.record import RATE, Evidence
from avow.evidence.status import Status, weigh
from avow.kernel.check import Refused
from avow.kernel.rates import Leaf, Stratum, composed

if TYPE_CHECKING:
    from avow.assurance.model import ObligationView

LEAST_CONFIDENCE = Fraction(9, 10)
"""Below it, a rate is no evidence that a policy's limit is kept."""

_SAMPLED = (Status.TESTED, Status.MONITORED)


@dataclass(frozen=True, slots=True)
class RateView:
    """How often a claim may fail, per trial of the data's operational profile. `leaves`, with their samples, are the
    certificate: `avow.kernel.rates` establishes `bound` and `confidence` from them."""

    bound: str
    """An exact decimal; empty: no rate can be given."""
    confidence: str
    """Of all leaves together."""
    leaves: tuple[Leaf, ...]
    """Sampled claims, by id, that have a rate."""
    unrated: tuple[str, ...] = ()
    """Sampled claims without one: property tests, monitored runs."""

    @property
    def brief(self) -> str:
        """Beside the word for how far something is shown. A bound is rounded up, a confidence down."""
        if not self.bound or Fraction(self.bound) >= 1:
            return "with no bound on failures"
        sure = percent(self.confidence, ROUND_FLOOR)
        return f"at most {percent(self.bound, ROUND_CEILING)} of trials fail, at {sure} confidence"

    @property
    def words(self) -> str:
        """One line, without a full stop."""
        if not self.bound:
            names = listed([short(name) for name in self.unrated], 3)
            return f"failure rate: none can be given; shown by tests without a rate: {names}"
        if Fraction(self.bound) >= 1:
            return f"failure rate: none below 100 % is shown by {count(len(self.leaves), 'sampled claim')} together"
        each = "a trial is one that the sampled claims below count, not a mission, and its rate says nothing of others"
        if len(self.leaves) < 2:
            return f"failure rate: {self.brief} ({each})"
        how = f"union bound over {len(self.leaves)} sampled claims, joint confidence by Bonferroni"
        return f"failure rate: {self.brief} ({how}; {each})"


def rate_of(claims: Iterable[str], views: Mapping[str, ObligationView]) -> RateView | None:
    """The rate of what rests on these claims; None where none of them is sampled."""
    leaves, unrated = [], []
    for name in claims:
        if (view := views.get(name)) is None:
            continue
        samples = [s for record in view.records if weigh(record).support is not None and (s := sample(record))]
        failed = [s for s in samples if any(stratum.failures for stratum in s)]
        if view.status in _SAMPLED or failed:
            if samples:
                leaves.append(Leaf(name, max(samples, key=_worst)))
            else:
                unrated.append(name)
    if unrated:
        return RateView("", "", tuple(leaves), tuple(unrated))
    if not leaves:
        return None
    try:
        rate = composed(leaves)
    except Refused:  # a record says more than its sample shows: it gives no rate
        return RateView("", "", (), tuple(leaf.claim for leaf in leaves))
    return RateView(_decimal(rate.bound), _decimal(rate.confidence), tuple(leaves))


def misstated(rate: RateView) -> str:
    """Why a rate does not follow from the samples that it names; empty where it does."""
    if not rate.bound:
        return ""
    try:
        true = composed(rate.leaves)
    except Refused as why:
        return str(why)
    told = (Fraction(rate.bound), Fraction(rate.confidence))
    return "" if told == (true.bound, true.confidence) else f"its samples give {float(true.bound):g}, not {rate.bound}"


def exceeds(rate: RateView, most: str) -> str:
    """Why a rate is not known to stay within a limit; empty where it is."""
    if not rate.bound:
        return rate.words
    if Fraction(rate.bound) > Fraction(most):
        return f"{rate.words}; at most {percent(most)} is allowed"
    if Fraction(rate.confidence) < LEAST_CONFIDENCE:
        return f"{rate.words}; a confidence of {percent(str(float(LEAST_CONFIDENCE)))} is asked of all samples together"
    return ""


def sample(record: Evidence) -> tuple[Stratum, ...]:
    """The strata that a record counts, each with its bound; none where it does not say."""
    try:
        strata = from_json(tuple[Stratum, ...], record.details.get(RATE, []))
        return strata if all(0 <= Fraction(s.bound) <= 1 and Fraction(s.confidence) < 1 for s in strata) else ()
    except (Unreadable, ValueError, ZeroDivisionError):
        return ()


def percent(part: str, rounding: str = ROUND_HALF_EVEN) -> str:
    """``25.8 %`` of ``0.258``, to three digits."""
    value = Context(prec=3, rounding=rounding).create_decimal(Decimal(part) * 100)
    return f"{value.normalize():f} %"


def _worst(strata: Sequence[Stratum]) -> Fraction:
    return max(Fraction(stratum.bound) for stratum in strata)


def _decimal(value: Fraction) -> str:
    """Bounds and confidences are decimals, and so are their sums; another number is a fraction, as exact."""
    return decimal(value) or str(value)
