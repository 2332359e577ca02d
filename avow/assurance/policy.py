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

Profiles are data (`profiles.yaml`, beside this module). Errors are located diagnostics with codes POLICY001 to 005.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from decimal import Decimal
from functools import cache
from typing import Any

from avow.base import codec
from avow.base.diagnostics import Diagnostic, Rejected, Span
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
    """The policy of a plan's ``policy:`` section; ``default`` if there is none. Raises Rejected with all faults."""
    match located.data:
        case None | {} if not located.data:
            return profile("default")
        case str(name):
            found, faults = _profile(name, located.at())
        case Mapping():
            found, faults = _rules(located)
        case _:  # a number or a list
            fault = "policy is a profile's name or a mapping of rules"
            found, faults = profile("default"), [Diagnostic("POLICY002", fault, located.at())]
    if faults:
        raise Rejected(*faults)
    return found


def _profile(name: str, span: Span) -> tuple[Policy, list[Diagnostic]]:
    if name in _data()[0]:
        return profile(name), []
    fault = Diagnostic("POLICY001", f"there is no policy profile '{name}'", span, hint=suggest(name, profile_names()))
    return profile("default"), [fault]


_KEYS = (
    *("profile", "guarantees", "sanity", "composition", "requirements", "programs"),
    *("reviewers", "certified", "proved", "max_failure_rate"),
)
_DEMAND_KEYS = (
    *("one_of", "methods", "independent", "max_age_days", "reviewers", "ties", "unconditional", "isolation"),
    *("of", "numbers", "cases"),
)


def _rules(located: Located) -> tuple[Policy, list[Diagnostic]]:
    data: Mapping[str, Any] = located.data
    faults = _unknown(data, _KEYS, located, ())
    base, wrong = (
        _profile(str(data["profile"]), located.at("profile")) if "profile" in data else (profile("default"), [])
    )
    faults += wrong
    reader = _PolicyReader(located, faults)
    rules = {key: reader.rule(key, value, base) for key, value in data.items() if key in _KEYS and key != "profile"}
    name = f"{base.name}, with the plan's own rules" if set(data) - {"profile"} else base.name
    return replace(base, name=name, **rules), faults


def _demands(base: Policy, data: object, reader: _PolicyReader) -> tuple[tuple[str, Demand], ...]:
    demands = dict(base.guarantees)
    if not isinstance(data, Mapping):
        reader.fault("guarantees maps a criticality to what it needs", ("guarantees",))
        return base.guarantees
    reader.faults += _unknown(data, CRITICALITIES, reader.located, ("guarantees",))
    for criticality in CRITICALITIES:
        if criticality in data:
            demands[criticality] = reader.demand(data[criticality], ("guarantees", criticality))
    return tuple(demands.items())


class _PolicyReader:
    """Reads plain data, collecting located faults."""

    def __init__(self, located: Located, faults: list[Diagnostic]) -> None:
        self.located = located
        self.faults = faults

    def fault(self, message: str, path: tuple[str | int, ...], hint: str | None = None) -> None:
        where = ".".join(map(str, ("policy", *path)))
        self.faults.append(Diagnostic("POLICY002", f"{where}: {message}", self.located.at(*path), hint=hint))

    def rule(self, key: str, data: object, base: Policy) -> Any:
        """The plan's value of a policy key, in the form of `Policy`."""
        match key:
            case "guarantees":
                return _demands(base, data, self)
            case "reviewers":
                return self.texts(data, (key,))
            case "certified":
                return self.flag(data, (key,))
            case "proved":
                if data != "certified":
                    self.fault(f"'{data}' is not what may be asked: certified", (key,))
                return True
            case "max_failure_rate":
                return self.rates(data, (key,))
            case "programs":  # `not-run` accepts that a program's claims stay open if its tool is missing
                return self.statuses(data, (key,), (*_GIVEN, Status.NOT_RUN.value))
            case _:  # the others name statuses
                return self.statuses(data, (key,))

    def demand(self, data: object, path: tuple[str | int, ...]) -> Demand:
        if not isinstance(data, Mapping):
            self.fault(f"a demand is a mapping with keys out of {', '.join(_DEMAND_KEYS)}", path)
            return Demand()
        self.faults += _unknown(data, _DEMAND_KEYS, self.located, path)
        return Demand(
            # any other demand also demands support, of any status
            one_of=self.statuses(data.get("one_of") or (_GIVEN if {*data} - {"one_of"} else ()), (*path, "one_of")),
            methods=self.count(data.get("methods", 1), (*path, "methods")),
            independent=self.flag(data.get("independent", False), (*path, "independent")),
            max_age_days=self.ages(data.get("max_age_days", {}), (*path, "max_age_days")),
            reviewers=self.count(data.get("reviewers", 1), (*path, "reviewers")),
            cases=self.count(data.get("cases", 0), (*path, "cases")),
            links=tuple(Link(word) for word in self.words(data.get("ties", ()), tuple(Link), (*path, "ties"))),
            unconditional=self.flag(data.get("unconditional", False), (*path, "unconditional")),
            isolation=self.level(data.get("isolation", Isolation.NONE.value), (*path, "isolation")),
            of=tuple(Object(word) for word in self.words(data.get("of", ()), tuple(Object), (*path, "of"))),
            numbers=tuple(
                Numbers(word) for word in self.words(data.get("numbers", ()), tuple(Numbers), (*path, "numbers"))
            ),
        )

    def level(self, data: object, path: tuple[str | int, ...]) -> Isolation:
        if not isinstance(data, str):
            self.fault(f"isolation is one of {', '.join(Isolation)}", path)
        given = self.words(data, tuple(Isolation), path) if isinstance(data, str) else ()
        return Isolation(given[0]) if given else Isolation.NONE

    def statuses(
        self, data: object, path: tuple[str | int, ...], allowed: tuple[str, ...] = _GIVEN
    ) -> tuple[Status, ...]:
        return tuple(Status(word) for word in self.words(data, allowed, path))

    def words(self, data: object, allowed: tuple[str, ...], path: tuple[str | int, ...]) -> tuple[str, ...]:
        found = self.texts(data, path)
        for at, word in enumerate(found):
            if word not in allowed:
                self.fault(f"'{word}' is none of {', '.join(allowed)}", (*path, at), suggest(word, allowed))
        return tuple(word for word in found if word in allowed)

    def texts(self, data: object, path: tuple[str | int, ...]) -> tuple[str, ...]:
        items = [data] if isinstance(data, str) else data
        if not isinstance(items, list | tuple) or not all(isinstance(item, str) for item in items):
            self.fault("a list of words is wanted", path)
            return ()
        return tuple(items)

    def count(self, data: object, path: tuple[str | int, ...]) -> int:
        if isinstance(data, bool) or not isinstance(data, int) or not 0 <= data <= 100_000:
            self.fault("a whole number, 0 or more, is wanted", path)
            return 1
        return data

    def flag(self, data: object, path: tuple[str | int, ...]) -> bool:
        if not isinstance(data, bool):
            self.fault("true or false is wanted", path)
            return False
        return data

    def rates(self, data: object, path: tuple[str | int, ...]) -> tuple[tuple[str, str], ...]:
        if not isinstance(data, Mapping):
            self.fault("a mapping of criticalities to greatest rates of failure is wanted, such as {high: 0.01}", path)
            return ()
        self.faults += _unknown(data, CRITICALITIES, self.located, path)
        for criticality, rate in data.items():
            if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0 < rate < 1:
                self.fault("a number between 0 and 1 is wanted", (*path, criticality))
                return ()
        return tuple((c, str(Decimal(str(data[c])))) for c in CRITICALITIES if c in data)

    def ages(self, data: object, path: tuple[str | int, ...]) -> tuple[tuple[str, int], ...]:
        if not isinstance(data, Mapping):
            return (("all", self.count(data, path)),)
        named = {str(word): self.count(days, (*path, word)) for word, days in data.items()}
        self.faults += _unknown(named, (*_GIVEN, "all"), self.located, path)
        return tuple(named.items())


def asked_of(demand: Demand) -> str:
    """The accepted statuses, in words."""
    return " or ".join(status.value for status in demand.one_of)


def _unknown(
    data: Mapping[Any, Any], allowed: Iterable[str], located: Located, path: tuple[str | int, ...]
) -> list[Diagnostic]:
    known = tuple(allowed)
    return [
        Diagnostic(
            "POLICY003",
            f"{'.'.join(map(str, ('policy', *path)))}: unknown key '{key}'; known: {', '.join(known)}",
            located.key(*path, key),
            hint=suggest(str(key), known),
        )
        for key in data
        if key not in known
    ]


@cache
def _data() -> tuple[dict[str, Policy], dict[str, int]]:
    data = packaged("avow.assurance", "profiles.yaml")
    faults: list[Diagnostic] = []
    policies = {}
    for name, raw in data["profiles"].items():
        reader = _PolicyReader(Located(raw, Span("profiles.yaml", 1, 1, 1, 1)), faults)
        policies[name] = Policy(
            name=name,
            title=raw["title"],
            about=raw["about"].strip(),
            guarantees=tuple((c, reader.demand(raw["guarantees"][c], ("guarantees", c))) for c in CRITICALITIES),
            sanity=reader.statuses(raw["sanity"], ("sanity",)),
            composition=reader.statuses(raw["composition"], ("composition",)),
            requirements=reader.statuses(raw["requirements"], ("requirements",)),
            programs=reader.statuses(raw["programs"], ("programs",)),
            certified=raw.get("certified", False),
            standard=raw.get("standard", ""),
            level=str(raw.get("level", "")),
        )
    if faults:
        raise Rejected(*faults)
    return policies, data["cost"]
