"""The lattice: what a set of unlike evidence says of one claim.

A claim's evidence is weighed item by item into a `Weight`; weights are joined by taking the greatest of each part, so
joining is associative, commutative and idempotent: order and duplication cannot matter, and nothing that is joined can
take a refutation away. `Weight.status` reads the one word off it. Everything here is pure and small on purpose.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from functools import cache, reduce

from avow.base.records import dataclass
from avow.base.verdict import Hypothesis, Link, Verdict
from avow.evidence.record import Evidence


class Status(StrEnum):
    """Where a claim stands. A verdict has the status of its name; the other words are only ever computed."""

    PROVED = "proved"
    CHECKED = "checked"
    TESTED = "tested"
    MONITORED = "monitored"
    REVIEWED = "reviewed"
    JUSTIFIED = "justified"
    ARGUED = "argued"
    """A claim in prose: a person says that what stands below it, which holds, amounts to it."""
    PARTIAL = "partial"
    """Proved of every run that ends; that the runs end is not shown, and nobody has taken it upon himself."""
    UNWRITTEN = "unwritten"
    """A draft's placeholder: what the node promises is still to be written. Whatever else is open is told first."""
    VACUOUS = "vacuous"
    """Evidence whose trigger was never met: it supports nothing."""
    UNKNOWN = "unknown"
    NOT_RUN = "not-run"
    ERROR = "error"
    STALE = "stale"
    """There was evidence, but what it was about has changed since."""
    MISSING = "missing"
    """Nobody has tried."""
    UNSUPPORTED = "unsupported"
    """Nothing speaks against the claim itself, but something that it rests on fails."""
    CIRCULAR = "circular"
    """The claim would support itself: refused."""
    REFUTED = "refuted"
    CONTRADICTORY = "contradictory"
    """A proof and a refutation of the same claim: one of the tools is wrong."""

    @property
    def supports(self) -> bool:
        """Whether a claim of this status may be relied upon at all (how far, the policy says)."""
        return self in _SUPPORTING

    @property
    def rank(self) -> int:
        """Greater is better; a total order, used to find the weakest and for nothing that needs commensurability."""
        return _RANK[self]


_BEST_FIRST = tuple(Status)
_RANK = {status: len(_BEST_FIRST) - at for at, status in enumerate(_BEST_FIRST)}
_SUPPORTING = frozenset(_BEST_FIRST[: _BEST_FIRST.index(Status.ARGUED) + 1])
_LINK_RANK = {Link.GENERATED: 3, Link.MAPPED: 2, Link.GUIDED: 1}


def weakest(statuses: Iterable[Status]) -> Status | None:
    """The worst of them; None of none."""
    return min(statuses, key=lambda status: status.rank, default=None)


def link_rank(link: Link) -> int:
    """Greater is more mechanical."""
    return _LINK_RANK[link]


def weakest_link(links: Iterable[Link]) -> Link | None:
    """The least mechanical link between contract and artifact; None of none."""
    return min(links, key=_LINK_RANK.__getitem__, default=None)


def best_link(links: Iterable[Link]) -> Link | None:
    return max(links, key=_LINK_RANK.__getitem__, default=None)


@dataclass(frozen=True, slots=True)
class Weight:
    """What evidence amounts to: an element of the lattice."""

    support: Status | None = None
    """The best status that some item gives, if any supports."""
    refuted: bool = False
    idle: Status | None = None
    """The most telling of the items that neither support nor refute."""

    def join(self, other: Weight) -> Weight:
        return Weight(
            _greater(self.support, other.support),
            self.refuted or other.refuted,
            _greater(self.idle, other.idle),
        )

    @property
    def status(self) -> Status:
        if self.refuted:
            return Status.CONTRADICTORY if self.support is Status.PROVED else Status.REFUTED
        return self.support or self.idle or Status.MISSING


NOTHING = Weight()
"""No evidence at all."""
OUTDATED = Weight(idle=Status.STALE)
"""What evidence amounts to once its claim, its inputs or its method have moved on."""


def effective(evidence: Evidence) -> Verdict:
    """The verdict that counts. What a record says beyond the strength of its method is cut down to that strength, so
    that no bounded method gives a proof, whatever its record claims; support from a method of no strength is none."""
    return _effective(evidence.verdict, evidence.strength)


def weigh(evidence: Evidence) -> Weight:
    """One current record."""
    return _weight(evidence.verdict, evidence.strength, evidence.vacuous)


@cache
def _effective(verdict: Verdict, strength: Verdict) -> Verdict:
    if not verdict.supports:
        return verdict
    if not strength.supports:
        return Verdict.UNKNOWN
    return strength if Status(verdict).rank > Status(strength).rank else verdict


@cache
def _weight(told: Verdict, strength: Verdict, vacuous: bool) -> Weight:
    verdict = _effective(told, strength)
    if verdict is Verdict.REFUTED:
        return Weight(refuted=True)
    if not verdict.supports:
        return Weight(idle=Status(verdict))
    if vacuous:
        return Weight(idle=Status.VACUOUS)
    return Weight(support=Status(verdict))


def join(weights: Iterable[Weight]) -> Weight:
    return reduce(Weight.join, weights, NOTHING)


def roll_up(current: Iterable[Evidence], *, outdated: bool = False) -> Status:
    """The status of one claim from all its current evidence; `outdated` says that there is history besides."""
    weight = join(weigh(evidence) for evidence in current)
    return (weight.join(OUTDATED) if outdated else weight).status


def behind(current: Iterable[Evidence]) -> tuple[tuple[Hypothesis, ...], tuple[str, ...]]:
    """What the status rests on, and supposes in words: of the item among those that give it that supposes least."""
    items = tuple(current)
    if not any(e.rests_on or e.hypotheses for e in items):
        return ((), ())
    support = join(map(weigh, items)).support
    found = [
        (tuple(sorted(set(e.rests_on), key=lambda h: (h.kind, h.name, h.digest))), tuple(sorted(set(e.hypotheses))))
        for e in items
        if support and weigh(e).support is support
    ]
    return min(found, key=lambda pair: (sum(map(len, pair)), pair[1], repr(pair[0])), default=((), ()))


def _greater(one: Status | None, other: Status | None) -> Status | None:
    if one is None or other is None:
        return one or other
    return one if one.rank >= other.rank else other
