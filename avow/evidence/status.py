"""The lattice: the status that different kinds of evidence together give one claim.

Each item of evidence has a `Weight`; weights are joined by taking the greatest of each part, so joining is associative,
commutative and idempotent: order and duplication do not matter, and no join can remove a refutation. `Weight.status`
computes the status from it. Everything here is pure and small on purpose.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from functools import cache, reduce

from avow.base.records import dataclass
from avow.base.verdict import Hypothesis, Link, Verdict
from avow.evidence.record import Evidence


class Status(StrEnum):
    """The status of a claim. A verdict has the status of its name; the other statuses are only ever computed."""

    PROVED = "proved"
    CHECKED = "checked"
    TESTED = "tested"
    MONITORED = "monitored"
    REVIEWED = "reviewed"
    JUSTIFIED = "justified"
    ARGUED = "argued"
    """A claim in prose: a person states that the claims below it, which hold, amount to it."""
    PARTIAL = "partial"
    """Proved of every run that ends; termination is not shown, and no person has accepted it."""
    UNWRITTEN = "unwritten"
    """A draft's placeholder: the node's guarantee is still to be written. Every other open status is reported first."""
    VACUOUS = "vacuous"
    """Evidence whose trigger was never met: it supports nothing."""
    UNKNOWN = "unknown"
    NOT_RUN = "not-run"
    ERROR = "error"
    STALE = "stale"
    """There was evidence, but its claim, inputs or method have changed since."""
    MISSING = "missing"
    """No attempt was made."""
    UNSUPPORTED = "unsupported"
    """No evidence is against the claim itself, but something that it rests on fails."""
    CIRCULAR = "circular"
    """The claim would support itself: refused."""
    REFUTED = "refuted"
    CONTRADICTORY = "contradictory"
    """A proof and a refutation of the same claim: one of the tools is wrong."""

    @property
    def supports(self) -> bool:
        """Whether a claim of this status may be relied upon at all (the policy says how far)."""
        return self in _SUPPORTING

    @property
    def refuted(self) -> bool:
        """Whether something refutes the claim."""
        return self in (Status.REFUTED, Status.CONTRADICTORY)

    @property
    def rank(self) -> int:
        """Greater is better; a total order, used to find the weakest and for nothing that needs commensurability."""
        return _RANK[self]


_BEST_FIRST = tuple(Status)
_RANK = {status: len(_BEST_FIRST) - at for at, status in enumerate(_BEST_FIRST)}
_SUPPORTING = frozenset(_BEST_FIRST[: _BEST_FIRST.index(Status.ARGUED) + 1])
_LINK_RANK = {Link.GENERATED: 3, Link.MAPPED: 2, Link.GUIDED: 1}


def weakest(statuses: Iterable[Status]) -> Status | None:
    """The worst of them; None if there are none."""
    return min(statuses, key=lambda status: status.rank, default=None)


def link_rank(link: Link) -> int:
    """Greater is more mechanical."""
    return _LINK_RANK[link]


def weakest_link(links: Iterable[Link]) -> Link | None:
    """The least mechanical link between contract and artifact; None if there are none."""
    return min(links, key=_LINK_RANK.__getitem__, default=None)


def best_link(links: Iterable[Link]) -> Link | None:
    return max(links, key=_LINK_RANK.__getitem__, default=None)


@dataclass(frozen=True, slots=True)
class Weight:
    """The value of a set of evidence: an element of the lattice."""

    support: Status | None = None
    """The best status that an item gives, if any supports."""
    refuted: bool = False
    idle: Status | None = None
    """The highest-ranked status of the items that neither support nor refute."""

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
"""The weight of evidence whose claim, inputs or method have changed."""


def effective(evidence: Evidence) -> Verdict:
    """The verdict that counts. A verdict beyond the strength of its method is reduced to that strength, so that no
    bounded method gives a proof, whatever its record says; a method of no strength gives no support."""
    return _effective(evidence.verdict, evidence.strength)


def weigh(evidence: Evidence) -> Weight:
    """The weight of one current record."""
    return _weight(evidence.verdict, evidence.strength, evidence.vacuous)


@cache
def _effective(verdict: Verdict, strength: Verdict) -> Verdict:
    if not verdict.supports:
        return verdict
    if not strength.supports:
        return Verdict.UNKNOWN
    return strength if Status(verdict).rank > Status(strength).rank else verdict


@cache
def _weight(reported: Verdict, strength: Verdict, vacuous: bool) -> Weight:
    verdict = _effective(reported, strength)
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
    """The status of one claim from all its current evidence; `outdated`: there are outdated records besides."""
    weight = join(weigh(evidence) for evidence in current)
    return (weight.join(OUTDATED) if outdated else weight).status


def behind(current: Iterable[Evidence]) -> tuple[tuple[Hypothesis, ...], tuple[str, ...]]:
    """What the status rests on, and its assumptions in words: those of the item that assumes least among those that
    give the status."""
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
