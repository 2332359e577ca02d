"""Objectives of standards, and the part of a case that serves each: DO-178C with DO-333, ISO 26262, UL 4600, IEC 61508,
ECSS.

The data are in `standards.yaml`. A policy that names a standard asks for the objectives that a case can serve. The
others are listed as outside of Avow, with their needs. Serving an objective is no statement of compliance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Any

from avow.assurance.relied import agrees
from avow.base.packaged import packaged
from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.verdict import Object
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh

if TYPE_CHECKING:
    from avow.assurance.hazards import HazardView
    from avow.assurance.model import Gate, ObligationView, RequirementView


class Query(StrEnum):
    """The parts of a case that may serve an objective."""

    VALIDATED = "validated"
    """A person has read each requirement's sentence against its formula or support."""
    FORMAL = "formal"
    """Each requirement has a formula or a temporal property."""
    SAYS_SOMETHING = "says-something"
    """No requirement is vacuous."""
    SOURCES = "sources"
    """Each requirement names the document that it comes from."""
    REQUIREMENTS = "requirements"
    """Each requirement holds, on any evidence that the policy accepts."""
    TRACE = "trace"
    """Each requirement leads to evidence, and each guarantee serves a requirement."""
    SANITY = "sanity"
    """The contracts pass the gate *sanity*."""
    COMPOSITION = "composition"
    """The composition passes its gate."""
    GUARANTEES = "guarantees"
    """Each guarantee meets the policy's demand."""
    SOURCE = "source"
    """Each guarantee of high criticality is shown of the source or the binary."""
    PROGRAMS = "programs"
    """The claims about programs pass their gate, and none is left unanswered."""
    MODELS_LINKED = "models-linked"
    """Each model that is relied upon agrees with the program."""
    FORMAL_METHODS = "formal-methods"
    """Each guarantee of high criticality is proved, or checked exhaustively."""
    TESTS = "tests"
    """Each guarantee of high criticality is tested or monitored too."""
    REVIEWS = "reviews"
    """Each node has a guarantee that a person reviewed."""
    MUTANTS = "mutants"
    """A mutation score is recorded for some method of each node of high criticality."""
    MONITORS = "monitors"
    """Recorded runs were judged by monitors."""
    HAZARDS = "hazards"
    """Hazards are listed, and each is mitigated."""
    INTEGRITY = "integrity"
    """The audit finds the ledger as it was written."""
    NOTHING_REFUTED = "nothing-refuted"
    """No claim is refuted, contradictory or vacuous."""


class State(StrEnum):
    SERVED = "served"
    OPEN = "open"
    OUTSIDE = "outside"
    """Nothing in a case of Avow serves it."""


@dataclass(frozen=True, slots=True)
class Objective:
    id: str
    text: str
    serves: tuple[Query, ...]
    levels: tuple[str, ...]
    remark: str


@dataclass(frozen=True, slots=True)
class ObjectiveView:
    """An objective and its state in the case; `why`: what is missing, or what it needs from elsewhere."""

    id: str
    text: str
    state: State
    why: str


@dataclass(frozen=True, slots=True)
class StandardView:
    """A standard at a level, objective by objective."""

    title: str
    level: str
    objectives: tuple[ObjectiveView, ...]

    @property
    def counts(self) -> str:
        """``12 served, 2 open, 5 outside``."""
        found = {state: sum(o.state is state for o in self.objectives) for state in State}
        return ", ".join(f"{many} {state}" for state, many in found.items())


def standard_view(
    name: str,
    level: str,
    gates: Sequence[Gate],
    requirements: Sequence[RequirementView],
    views: Sequence[ObligationView],
    hazards: Sequence[HazardView],
) -> StandardView:
    """The objectives of a standard at a level, compared with a case. `gates`: all except that of the standard
    itself."""
    title, objectives = standards()[name]
    queries = _Queries(gates, requirements, views, hazards)
    found = []
    for objective in objectives:
        if objective.levels and level not in objective.levels:
            continue
        if not objective.serves:
            found.append(ObjectiveView(objective.id, objective.text, State.OUTSIDE, f"needs: {objective.remark}"))
            continue
        missing = [reason for query in objective.serves if (reason := queries.missing(query))]
        state = State.OPEN if missing else State.SERVED
        by = "served by: " + ", ".join(objective.serves)
        found.append(ObjectiveView(objective.id, objective.text, state, "; ".join(missing) or by))
    return StandardView(title, level, tuple(found))


class _Queries:
    def __init__(
        self,
        gates: Sequence[Gate],
        requirements: Sequence[RequirementView],
        views: Sequence[ObligationView],
        hazards: Sequence[HazardView],
    ) -> None:
        self.gates = gates
        self.requirements = requirements
        self.hazards = hazards
        self.views = views
        self.guarantees = [v for v in views if v.obligation.kind is Kind.GUARANTEE]
        self.high = [v for v in self.guarantees if v.criticality == "high"]

    def missing(self, query: Query) -> str:
        """What is missing for the answer yes; empty if nothing is."""
        match query:
            case Query.VALIDATED:
                return self.of_requirements("not validated", lambda r: r.validated)
            case Query.FORMAL:
                return self.of_requirements("without a formula", lambda r: bool(r.formal))
            case Query.SAYS_SOMETHING:
                return self.of_requirements("vacuous", lambda r: r.status is not Status.VACUOUS)
            case Query.SOURCES:
                return self.of_requirements("without a source", lambda r: bool(r.source))
            case Query.REQUIREMENTS:
                return self.of_requirements("not shown", lambda r: r.level.holds)
            case Query.TRACE:
                reached = {name for r in self.requirements for name in r.closure}
                idle = [v.obligation.local_id for v in self.guarantees if v.id not in reached]
                lost = self.of_requirements("without evidence", lambda r: bool(r.closure))
                return lost or _named("guarantees that serve no requirement", idle)
            case Query.SANITY:
                return self.of_gates("sanity", "well-formed")
            case Query.COMPOSITION:
                return self.of_gates("composition")
            case Query.GUARANTEES:
                return self.of_gates("guarantees-")
            case Query.PROGRAMS:
                claims = [v for v in self.views if v.obligation.kind is Kind.PROGRAM]
                open_ones = [v for v in claims if not v.standing.supports]
                failing = self.of_gates("program") or _claims("not shown of a program", open_ones)
                return failing if claims else "no method makes a claim about a program"
            case Query.SOURCE:
                return self.of_high("not shown of source or binary", lambda v: _of(v, Object.SOURCE, Object.BINARY))
            case Query.MODELS_LINKED:
                return self.models_linked()
            case Query.FORMAL_METHODS:
                return self.of_high("not verified formally", lambda v: v.status in (Status.PROVED, Status.CHECKED))
            case Query.TESTS:
                return self.of_high("not tested", lambda v: _by(v, Status.TESTED, Status.MONITORED))
            case Query.REVIEWS:
                nodes = {v.obligation.node for v in self.guarantees}
                read = {v.obligation.node for v in self.guarantees if _by(v, Status.REVIEWED)}
                return _named("nodes without a review", sorted(nodes - read))
            case Query.MUTANTS if not self.high:
                return _NONE_HIGH
            case Query.MUTANTS:
                nodes = {v.obligation.node for v in self.high}
                scored = {v.obligation.node for v in self.high if any("mutation" in r.details for r in v.records)}
                return _named("nodes without a score of mutants (`avow mutate`)", sorted(nodes - scored))
            case Query.MONITORS:
                return "" if any(_by(v, Status.MONITORED) for v in self.guarantees) else "no recorded run was judged"
            case Query.HAZARDS:
                return self.of_gates("hazards") if self.hazards else "no hazard is listed"
            case Query.INTEGRITY:
                return self.of_gates("integrity")
            case Query.NOTHING_REFUTED:
                return self.of_gates("refuted")

    def of_requirements(self, what: str, good: Callable[[RequirementView], bool]) -> str:
        if not self.requirements:
            return "no requirement is named"
        return _named(f"requirements {what}", [r.id for r in self.requirements if not good(r)])

    def of_high(self, what: str, good: Callable[[ObligationView], bool]) -> str:
        return _claims(what, [v for v in self.high if not good(v)]) if self.high else _NONE_HIGH

    def of_gates(self, *names: str) -> str:
        failing = [gate.id for gate in self.gates if gate.id.startswith(names) and not gate.passed]
        return _named("gates that fail", failing)

    def models_linked(self) -> str:
        if not self.guarantees:
            return "no guarantee is there"
        models = [v for v in self.guarantees if v.standing.supports and not _of(v, *_PROGRAMS)]
        alone = {v.obligation.node for v in models if not self.compared(v)}
        return _named("models that no program was compared with", sorted(alone))

    def compared(self, view: ObligationView) -> bool:
        """Whether the node's program agrees with one of the models that support a guarantee."""
        found = (agrees(self.views, view.obligation, r.method) for r in view.records if weigh(r).support)
        return any(status is not None and status.supports for status in found)


_NONE_HIGH = "no node of high criticality has a guarantee"
_PROGRAMS = (Object.SOURCE, Object.BINARY, Object.RECORDING)


def _of(view: ObligationView, *objects: Object) -> bool:
    return any(weigh(r).support is not None and r.of in objects for r in view.records)


def _by(view: ObligationView, *statuses: Status) -> bool:
    return any(weigh(r).support in statuses for r in view.records)


def _claims(what: str, views: Sequence[ObligationView]) -> str:
    return _named(f"claims {what}", [v.obligation.local_id for v in views])


def _named(what: str, names: Sequence[str]) -> str:
    return f"{what}: {listed(names, 4)}" if names else ""


@cache
def standards() -> Mapping[str, tuple[str, tuple[Objective, ...]]]:
    """Name of a standard → its title and its objectives."""

    def objective(raw: Mapping[str, Any]) -> Objective:
        lists = {"serves": tuple(map(Query, raw.get("serves", ()))), "levels": tuple(raw.get("levels", ()))}
        return Objective(**{"remark": "", **raw, **lists})

    data = packaged("avow.assurance", "standards.yaml")
    return {name: (raw["title"], tuple(map(objective, raw["objectives"]))) for name, raw in data.items()}
