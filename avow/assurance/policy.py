"""The policy: what each kind of claim needs before it may be relied upon (plan.yaml, section ``policy``).

    policy: sil3                                            a profile's name
    policy:
      profile: default                                      where to start from (``default`` if left out)
      guarantees: {high: {one_of: [proved], methods: 2, independent: true}}        replaces that criticality's demand
      sanity: [proved]        composition: […]        requirements: […]        programs: […]
      reviewers: [A. Person]  who may review; without it, anybody
      certified: true         every answer must be of this run, every digest verified
      proved: certified       a proof of the calculus or of a requirement needs a certificate that the kernel checked
      max_failure_rate: {high: 0.01}     how often a requirement that rests on samples may fail

Profiles are data (`profiles.yaml`, beside this module). The plan's schema has the form of the rules.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from decimal import Decimal
from functools import cache
from typing import Any

from avow.base import codec
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.packaged import packaged
from avow.base.records import dataclass
from avow.base.suggestions import suggest
from avow.base.verdict import Isolation, Link, Object
from avow.evidence.status import Status
from avow.system.plan import Located, Numbers

CRITICALITIES = ("high", "medium", "low")
_GIVEN = tuple(s.value for s in Status if s.supports)


@dataclass(frozen=True, slots=True)
class Demand:
    """What a guarantee of one criticality needs. Empty `one_of`: any status, even none at all."""

    one_of: tuple[Status, ...] = ()
    methods: int = 1
    independent: bool = False
    max_age_days: tuple[tuple[str, int], ...] = ()
    """(status word or ``all``, days)."""
    reviewers: int = 1
    links: tuple[Link, ...] = ()
    """Empty: any."""
    unconditional: bool = False
    isolation: Isolation = Isolation.NONE
    """The isolation that a program under test needs from its oracle; evidence for which nothing was run has no
    level."""
    of: tuple[Object, ...] = ()
    """The objects that may have been verified; empty: any."""
    numbers: tuple[Numbers, ...] = ()
    """The semantics of REAL that may have been used; empty: any."""
    cases: int = field(default=0, metadata=codec.LATER)
    """The least number of cases or runs that met the guarantee's condition in a test."""

    def max_age(self, status: Status) -> int | None:
        ages = dict(self.max_age_days)
        return ages.get(status.value, ages.get("all"))

    def text(self) -> str:
        """The demand as a phrase: ``proved or checked, supported by 2 independent methods``."""
        if not self.one_of:
            return "nothing is asked"
        parts = {
            asked_of(self): True,
            f"supported by {self.methods} {'independent ' if self.independent else ''}methods": self.methods > 1,
            f"tie {' or '.join(self.links)}": self.links,
            f"of a {' or '.join(self.of)}": self.of,
            f"in {' or '.join(self.numbers)} numbers": self.numbers,
            "without hypotheses": self.unconditional,
            f"isolation {self.isolation} or better": self.isolation is not Isolation.NONE,
            f"reviews by {self.reviewers} persons": self.reviewers > 1,
            **{f"{word} not older than {days} days": True for word, days in self.max_age_days},
            f"tests of {self.cases} cases or more": self.cases,
        }
        return ", ".join(part for part, asked in parts.items() if asked)


@dataclass(frozen=True, slots=True)
class Policy:
    """A whole policy. The tuples of statuses name the accepted ones; an empty one demands nothing."""

    name: str
    title: str
    about: str
    guarantees: tuple[tuple[str, Demand], ...]
    sanity: tuple[Status, ...]
    composition: tuple[Status, ...]
    requirements: tuple[Status, ...]
    programs: tuple[Status, ...] = ()
    """For the claims about a node's program besides its guarantees."""
    reviewers: tuple[str, ...] = ()
    certified: bool = False
    proved: bool = False
    """Whether a proof of the calculus or of a requirement needs a certificate (``proved: certified``)."""
    max_failure_rate: tuple[tuple[str, str], ...] = field(default=(), metadata=codec.LATER)
    """(criticality, decimal): how often a requirement that rests on samples may fail."""
    standard: str = field(default="", metadata=codec.LATER)
    """The standard whose objectives are demanded (a key of `standards.yaml`); empty: none."""
    level: str = field(default="", metadata=codec.LATER)
    """Its level, in the standard's terms."""

    def demand(self, criticality: str) -> Demand:
        """The demand for a criticality; an unknown one is treated as the highest."""
        demands = dict(self.guarantees)
        return demands.get(criticality, demands[CRITICALITIES[0]])


def profile(name: str) -> Policy:
    """A ready policy. Raises KeyError."""
    return _data()[0][name]


def profile_names() -> tuple[str, ...]:
    return tuple(_data()[0])


def costs() -> Mapping[str, int]:
    """The cost of a method by the verdict that it can give: an order, not an amount."""
    return _data()[1]


def read_policy(located: Located) -> Policy:
    """The policy of a plan's ``policy:`` section, which has the form of the plan's schema; ``default`` if there is
    none. Raises Rejected (``POLICY001``) for a profile that does not exist."""
    rules = {"profile": located.data} if isinstance(located.data, str) else dict(located.data or {})
    name = rules.pop("profile", "default")
    if name not in profile_names():
        hint = suggest(name, profile_names())
        raise Rejected(
            Diagnostic("POLICY001", f"there is no policy profile '{name}'", located.at("profile"), hint=hint)
        )
    base = profile(name)
    own = {key: _rule(key, value, base) for key, value in rules.items()}
    return replace(base, name=f"{name}, with the plan's own rules" if own else name, **own)


def _rule(key: str, data: Any, base: Policy) -> Any:
    """The plan's value of a policy's key, in the form of `Policy`."""
    match key:
        case "guarantees":
            return tuple({**dict(base.guarantees), **{c: _demand(rules) for c, rules in data.items()}}.items())
        case "reviewers":
            return _listed(data)
        case "certified":
            return data
        case "proved":
            return True
        case "max_failure_rate":
            return tuple((c, str(Decimal(str(data[c])))) for c in CRITICALITIES if c in data)
        case _:  # the others name statuses
            return tuple(map(Status, _listed(data)))


def _demand(data: Mapping[str, Any]) -> Demand:
    ages = data.get("max_age_days", {})
    return Demand(
        # any other demand also demands support, of any status
        one_of=tuple(map(Status, _listed(data.get("one_of") or (_GIVEN if {*data} - {"one_of"} else ())))),
        methods=data.get("methods", 1),
        independent=data.get("independent", False),
        max_age_days=tuple(ages.items()) if isinstance(ages, Mapping) else (("all", ages),),
        reviewers=data.get("reviewers", 1),
        cases=data.get("cases", 0),
        links=tuple(map(Link, _listed(data.get("ties", ())))),
        unconditional=data.get("unconditional", False),
        isolation=Isolation(data.get("isolation", Isolation.NONE)),
        of=tuple(map(Object, _listed(data.get("of", ())))),
        numbers=tuple(map(Numbers, _listed(data.get("numbers", ())))),
    )


def _listed(data: Any) -> tuple[str, ...]:
    return (data,) if isinstance(data, str) else tuple(data)


def asked_of(demand: Demand) -> str:
    """The accepted statuses, in words."""
    return " or ".join(status.value for status in demand.one_of)


@cache
def _data() -> tuple[dict[str, Policy], dict[str, int]]:
    data = packaged("avow.assurance", "profiles.yaml")
    policies = {
        name: Policy(
            name=name,
            title=raw["title"],
            about=raw["about"].strip(),
            guarantees=tuple((c, _demand(raw["guarantees"][c])) for c in CRITICALITIES),
            sanity=tuple(map(Status, raw["sanity"])),
            composition=tuple(map(Status, raw["composition"])),
            requirements=tuple(map(Status, raw["requirements"])),
            programs=tuple(map(Status, raw["programs"])),
            certified=raw.get("certified", False),
            standard=raw.get("standard", ""),
            level=str(raw.get("level", "")),
        )
        for name, raw in data["profiles"].items()
    }
    return policies, data["cost"]
