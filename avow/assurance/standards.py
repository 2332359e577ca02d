"""Objectives of standards, and the part of a case that serves each: DO-178C with DO-333, ISO 26262, UL 4600, IEC 61508,
ECSS.

The data are in `standards.yaml`. A policy that names a standard asks for the objectives that a case can serve. The
others are listed as outside of Avow, with their needs. Serving an objective is no statement of compliance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

from avow.assurance.relied import agrees
from avow.base.codec import LATER
from avow.base.packaged import packaged
from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.verdict import Object
from avow.evidence.obligation import Kind, ProgramClaim
from avow.evidence.status import Status, weigh

if TYPE_CHECKING:
    from avow.assurance.answers import Assumption
    from avow.assurance.hazards import HazardView
    from avow.assurance.model import Gate, ObligationView, RequirementView


class State(StrEnum):
    SERVED = "served"
    PARTLY = "partly served"
    """What a case can serve of it is served; the rest has to be shown elsewhere."""
    OPEN = "open"
    OUTSIDE = "outside"
    """Nothing in a case of Avow serves it."""


@dataclass(frozen=True, slots=True)
class Objective:
    id: str
    text: str
    serves: tuple[str, ...]
    levels: tuple[str, ...]
    remark: str


@dataclass(frozen=True, slots=True)
class ObjectiveView:
    """An objective and its state in the case; `why`: what is missing, or what it needs from elsewhere."""

    id: str
    text: str
    state: State
    why: str
    next: str = field(default="", metadata=LATER)
    """The next step, if it is open."""


@dataclass(frozen=True, slots=True)
class StandardView:
    """A standard at a level, objective by objective."""

    title: str
    level: str
    objectives: tuple[ObjectiveView, ...]
    selection: str = field(default="", metadata=LATER)
    """What of the standard the objectives are, and what was left out."""

    @property
    def counts(self) -> str:
        """``12 served, 3 partly served, 2 open, 5 outside``."""
        found = {state: sum(o.state is state for o in self.objectives) for state in State}
        return ", ".join(f"{many} {state}" for state, many in found.items())


def standard_view(
    name: str,
    level: str,
    gates: Sequence[Gate],
    requirements: Sequence[RequirementView],
    views: Sequence[ObligationView],
    hazards: Sequence[HazardView],
    assumptions: Sequence[Assumption],
) -> StandardView:
    """The objectives of a standard at a level, compared with a case. `gates`: all except that of the standard
    itself."""
    title, selection, objectives = standards()[name]
    queries = Queries(gates, requirements, views, hazards, assumptions)

    def view(o: Objective) -> ObjectiveView:
        if not o.serves:
            return ObjectiveView(o.id, o.text, State.OUTSIDE, f"needs: {o.remark}")
        missing = {query: reason for query in o.serves if (reason := queries.missing(query))}
        if missing:
            return ObjectiveView(
                o.id, o.text, State.OPEN, "; ".join(missing.values()), queries.next(next(iter(missing)))
            )
        by = "served by: " + ", ".join(query + queries.but(query) for query in o.serves)
        state, rest = (State.PARTLY, f"; needs also: {o.remark}") if o.remark else (State.SERVED, "")
        return ObjectiveView(o.id, o.text, state, by + rest)

    asked = (o for o in objectives if not o.levels or level in o.levels)
    return StandardView(title, level, tuple(map(view, asked)), selection)


_PROGRAMS = (Object.SOURCE, Object.BINARY, Object.RECORDING)
_REQUIREMENTS: Mapping[str, tuple[str, Callable[[RequirementView], bool]]] = {
    "validated": ("not validated", lambda r: r.validated),
    "formal": ("without a formula", lambda r: bool(r.formal)),
    "says-something": ("vacuous", lambda r: r.status is not Status.VACUOUS),
    "sources": ("without a source", lambda r: bool(r.source)),
}
_GUARANTEES: Mapping[str, tuple[str, Callable[[ObligationView], bool]]] = {
    "source": ("not shown of source or binary", lambda v: _of(v, Object.SOURCE, Object.BINARY)),
    "tests": ("not tested of the program", lambda v: _by(v, Status.TESTED, _PROGRAMS)),
    "reviews": ("not reviewed", lambda v: _by(v, Status.REVIEWED)),
}
_OF_HIGH: Mapping[str, tuple[str, Callable[[ObligationView], bool]]] = {
    "formal-methods": ("not verified formally", lambda v: v.status in (Status.PROVED, Status.CHECKED)),
    "mutants": ("without a score of mutants", lambda v: any("mutation" in r.details for r in v.records)),
}
_GATES: Mapping[str, tuple[tuple[str, ...], Kind | None]] = {
    "sanity": (("sanity", "well-formed"), Kind.SANITY),
    "composition": (("composition",), Kind.COMPOSITION),
    "guarantees": (("guarantees-",), Kind.GUARANTEE),
    "requirements": (("requirements",), None),
    "hazards": (("hazards",), None),
    "integrity": (("integrity",), None),
    "nothing-refuted": (("refuted",), None),
}


@dataclass(frozen=True, slots=True)
class Queries:
    """The questions to a case by which objectives are served; docs/standards.md has the meaning of each."""

    NAMES: ClassVar = frozenset(
        {*_REQUIREMENTS, *_GUARANTEES, *_OF_HIGH, *_GATES, "trace", "programs", "models-linked", "assumptions"}
    )

    gates: Sequence[Gate]
    requirements: Sequence[RequirementView]
    views: Sequence[ObligationView]
    hazards: Sequence[HazardView]
    assumptions: Sequence[Assumption]

    @property
    def guarantees(self) -> list[ObligationView]:
        return [v for v in self.views if v.obligation.kind is Kind.GUARANTEE]

    def missing(self, query: str) -> str:
        """What is missing for the answer yes; empty if nothing is. Nothing is served by what is not there."""
        high = [v for v in self.guarantees if v.criticality == "high"]
        if (query in _REQUIREMENTS or query in ("requirements", "trace")) and not self.requirements:
            return "no requirement is named"
        if query in _OF_HIGH and not high:
            return "no node of high criticality has a guarantee"
        if (query in _GUARANTEES or query in ("models-linked", "programs")) and not self.guarantees:
            return "no guarantee is there"
        if query in _REQUIREMENTS:
            return self.of_requirements(*_REQUIREMENTS[query])
        if query in _GUARANTEES or query in _OF_HIGH:
            what, good = {**_GUARANTEES, **_OF_HIGH}[query]
            return _claims(
                f"claims {what}", [v for v in (high if query in _OF_HIGH else self.guarantees) if not good(v)]
            )
        if query in _GATES:
            return self.gate(query)
        match query:
            case "trace":
                reached = {name for r in self.requirements for name in r.closure}
                lost = self.of_requirements("without evidence", lambda r: bool(r.closure))
                return lost or _claims(
                    "guarantees that serve no requirement", [v for v in self.guarantees if v.id not in reached]
                )
            case "programs":
                sound = {
                    v.obligation.node
                    for v in self.views
                    if v.obligation.name == ProgramClaim.FAULTLESS and v.standing.supports
                }
                bare = {v.obligation.node for v in self.guarantees} - sound
                return _named("no evidence that the program runs without fault", sorted(bare))
            case "models-linked":
                models = [v for v in self.guarantees if v.standing.supports and not _of(v, *_PROGRAMS)]
                alone = {v.obligation.node for v in models if not self.compared(v)}
                return _named("models that no program was compared with", sorted(alone))
            case _:  # assumptions, the last of NAMES
                bad = [a.number for a in self.assumptions if a.expired or not (a.owned and a.because)]
                return _named("assumptions without a reason, an owner or a last day that is to come", bad)

    def of_requirements(self, what: str, good: Callable[[RequirementView], bool]) -> str:
        return _named(f"requirements {what}", [r.id for r in self.requirements if not good(r)])

    def gate(self, query: str) -> str:
        """Why one of the gates does not pass, in its words."""
        if query == "hazards" and not self.hazards:
            return "no hazard is listed"
        kind = _GATES[query][1]
        if kind and not any(v.obligation.kind is kind for v in self.views):
            return f"no claim of the kind {kind.value} is there"
        failing = [g for g in self.asked(query) if g.idle or not g.passed]
        return "; ".join(f"gate “{g.title}”: {g.reason if g.idle else f'fails: {g.reason}'}" for g in failing)

    def asked(self, query: str) -> list[Gate]:
        return [gate for gate in self.gates if query in _GATES and gate.id.startswith(_GATES[query][0])]

    def but(self, query: str) -> str:
        """The exceptions of a gate that passes only since the plan excuses findings."""
        return " (but for findings that the plan excuses)" if any(g.excused for g in self.asked(query)) else ""

    def next(self, query: str) -> str:
        """The next step for a query that something is missing for: that of its gate, if it has one."""
        steps = (s.text for gate in self.asked(query) if not gate.passed for s in gate.suggestions)
        return next(steps, packaged("avow.assurance", "standards.yaml")["next"][query])

    def compared(self, view: ObligationView) -> bool:
        """Whether the node's program agrees with one of the models that support a guarantee."""
        found = (agrees(self.views, view.obligation, r.method) for r in view.records if weigh(r).support)
        return any(status is not None and status.supports for status in found)


def _of(view: ObligationView, *objects: Object) -> bool:
    return any(weigh(r).support is not None and r.of in objects for r in view.records)


def _by(view: ObligationView, status: Status, objects: Sequence[Object] = tuple(Object)) -> bool:
    return any(weigh(r).support is status and r.of in objects for r in view.records)


def _claims(what: str, views: Iterable[ObligationView]) -> str:
    return _named(what, [v.obligation.local_id for v in views])


def _named(what: str, names: Sequence[str]) -> str:
    return f"{what}: {listed(names, 4)}" if names else ""


@cache
def standards() -> Mapping[str, tuple[str, str, tuple[Objective, ...]]]:
    """Name of a standard → its title, what of it was selected, and its objectives."""

    def objective(raw: Mapping[str, Any]) -> Objective:
        return Objective(**{"remark": "", **raw, **{key: tuple(raw.get(key, ())) for key in ("serves", "levels")}})

    data = packaged("avow.assurance", "standards.yaml")["standards"]
    return {
        name: (raw["title"], raw["selection"], tuple(map(objective, raw["objectives"]))) for name, raw in data.items()
    }
