"""A requirement as readers see it: its status, how it comes to hold, and its weakest evidence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from avow.assurance.answers import Assumption, Level, Tone, WeakestEvidence
from avow.assurance.closure import Closed
from avow.assurance.first_screen import tone_of, weakest_of
from avow.assurance.model import ObligationView, RequirementView
from avow.assurance.naming import requirement_claim, short
from avow.assurance.rates import rate_of, short_of
from avow.assurance.relied import Relied, looked_at, seen, weakness
from avow.assurance.summary import worst_first
from avow.assurance.support import Names, requirement_support
from avow.base.plain import count, listed
from avow.base.verdict import Object
from avow.evidence.claims import Standing
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.system.plan import Requirement


def requirement_view(
    requirement: Requirement, names: Names, standings: Mapping[str, Standing], statuses: Mapping[str, Status]
) -> RequirementView:
    standing = standings[requirement_claim(requirement.id)]
    rests, unknown = requirement_support(requirement, names)
    weakest, weakest_status = standing.weakest
    return RequirementView(
        id=requirement.id,
        text=requirement.text,
        formula=requirement.formula or "",
        temporal=requirement.temporal or "",
        supported_by=requirement.supported_by,
        rests_on=rests,
        unknown_names=unknown,
        status=standing.status,
        weakest=weakest,
        weakest_status=weakest_status,
        below=worst_first(standing.below, statuses),
        hypotheses=standing.hypotheses,
        link=standing.link,
        obligations=tuple(names.own.get(requirement.id, ())),
        answer=_answer(requirement, standing, unknown, statuses, names.own.get(requirement.id, ())),
        span=requirement.span,
        validation=requirement.validation,
        validated=requirement.validated,
        outdated=requirement.outdated,
        linked=requirement.linked,
        source=requirement.source,
        probability=requirement.probability,
    )


def held(
    view: RequirementView,
    closed: Closed,
    views: Mapping[str, ObligationView],
    relied: Mapping[str, Relied],
    supposed: Sequence[Assumption],
    titles: Mapping[str, str],
) -> RequirementView:
    """A requirement with its level, its colour, weakest evidence and assumptions; `titles` are the nodes'."""
    mine = [s for s in supposed if view.id in s.needed_by]
    expired = any(s.expired for s in mine)
    rate = rate_of(view.obligations, closed.claims, views)
    too_often = short_of(view.probability, rate) if view.probability and rate else ""
    fails = not view.status.supports or closed.failing or view.unknown_names or expired or too_often
    level = level_of(closed.claims, views, relied) if view.formal else Level.ARGUED
    level = Level.NOT_SHOWN if fails or not view.validated else level
    if view.status.refuted:
        level = Level.REFUTED
    bounded = any(views[n].status is not Status.PROVED for n in view.obligations) or is_bounded(closed.claims, relied)
    awaits = level is Level.NOT_SHOWN and not fails
    weakest = weakest_of(closed.claims, views, relied, titles)
    return replace(
        view,
        level=level,
        bounded=bounded,
        expired=expired,
        tone=Tone.AMBER if awaits else tone_of(level, mine, bounded=bounded),
        closure=closed.claims,
        failing=closed.failing,
        weakest_evidence=(failing_of(view.obligations, closed.failing, views, titles) if fails else None) or weakest,
        supposes=tuple(s.key for s in mine),
        rate=rate,
        too_often=too_often,
        searched=_searched(view.obligations, closed.claims, relied),
        answer=_with_level(view, level, too_often or (rate.words if rate else ""), weakest, len(mine), awaits=awaits),
    )


def _with_level(
    view: RequirementView,
    level: Level,
    rate: str,
    weakest: WeakestEvidence | None,
    assumed: int,
    *,
    awaits: bool,
) -> str:
    if not view.status.supports:
        return view.answer
    parts = [f"{level.capitalize()}.", "Nobody has validated its sentence." if awaits else ""]
    parts += [
        f"The weakest evidence below it: {weakest.brief}." if weakest else "",
        view.answer,
    ]
    parts += [
        f"It needs {count(assumed, 'assumption')}." if assumed else "",
        f"{rate[0].upper()}{rate[1:]}." if rate else "",
    ]
    return " ".join(part for part in parts if part)


def _searched(own: Sequence[str], claims: Iterable[str], relied: Mapping[str, Relied]) -> str:
    """What bounds a requirement, and how far that was searched: its own formula, else the weakest claim below it."""
    short_of = [name for name in own if name in relied and relied[name].status is not Status.PROVED]
    if short_of:
        return seen(relied[short_of[0]])
    bounded = [name for name in claims if name in relied and relied[name].bounded]
    name = min(bounded, key=lambda n: (*weakness(relied[n]), n), default="")
    if not name or relied[name].status is Status.PROVED:
        return f"within the bounds that {'it' if name in own else short(name)} assumes" if name else ""
    return f"within the bounds of {short(name)}, {seen(relied[name])}"


def is_bounded(claims: Iterable[str], relied: Mapping[str, Relied]) -> bool:
    """Whether some claim is shown only within a finite scenario or model."""
    return any(relied[name].bounded for name in claims if name in relied)


def level_of(claims: Iterable[str], views: Mapping[str, ObligationView], relied: Mapping[str, Relied]) -> Level:
    """The lowest level of claims that hold. Samples and models are two weaknesses, of whichever claims; without a
    guarantee below, the claims are about the wiring, which is a model. Conditions of the composition that a person
    answers for are among the assumptions; agreement of a program with its model counts under the model."""
    below = [(views[name].obligation.kind, relied[name]) for name in claims if name in relied]
    leaves = [found for kind, found in below if kind in (Kind.GUARANTEE, Kind.REQUIREMENT)]
    statuses, sampled = {found.status for found in leaves}, {Status.TESTED, Status.MONITORED}
    if statuses & {Status.REVIEWED, Status.JUSTIFIED}:
        return Level.ARGUED
    objects = {looked_at(found) for kind, found in below if kind is Kind.GUARANTEE} or {Object.MODEL}
    if statuses & sampled:
        return Level.TESTED_MODELS if Object.MODEL in objects else Level.TESTS
    return Level.MODELS if Object.MODEL in objects else Level.SHOWN


def failing_of(
    own: Iterable[str], failing: Iterable[str], views: Mapping[str, ObligationView], titles: Mapping[str, str]
) -> WeakestEvidence | None:
    """The failing claim below an open requirement or hazard, in place of the weakest evidence: what refutes one of its
    `own` claims; else of several a guarantee first, then the worst."""
    statuses = {name: views[name].status for name in failing if name in views}
    own = [name for name in own if name in statuses and statuses[name].refuted]
    own = own or [name for name in statuses if views[name].obligation.kind is Kind.GUARANTEE]
    for name in worst_first(own or statuses, statuses)[:1]:
        o, status = views[name].obligation, statuses[name].value
        return WeakestEvidence(name, o.node, titles.get(o.node, "the whole"), status, o.claim.rstrip("."), status)
    return None


def _answer(
    requirement: Requirement,
    standing: Standing,
    unknown: tuple[str, ...],
    statuses: Mapping[str, Status],
    own_obligations: Sequence[str],
) -> str:
    if unknown:
        return f"Not shown: {', '.join(unknown)} under supported_by stands for nothing."
    if requirement.outdated and requirement.validation:
        said = f"{requirement.validation.who} validated it on {requirement.validation.date}"
        return f"Not validated: the sentence, the formula or what supports it was changed since {said}."
    if standing.circle:
        return f"Refused: it would support itself ({' → '.join(short(name) for name in standing.circle)})."
    if standing.status.supports:
        name, status = standing.weakest
        return f"Assumed for a person's reason: {short(name)}." if status is Status.JUSTIFIED else ""
    if standing.direct and standing.status is not Status.MISSING:
        own = [name for name in own_obligations if name in standing.below]
        where = ", ".join(short(name) for name in own or standing.below) or "its evidence"
        return f"{standing.status.value.capitalize()}: see {where}."
    if standing.below:
        below = worst_first(standing.below, statuses)
        causes = [f"{short(name)} is {statuses.get(name, 'not shown')}" for name in below]
        return f"Not shown: {listed(causes, 3)}."
    if not standing.direct:
        return "Not shown."
    formal = requirement.formula or requirement.temporal
    return "Not shown: nobody has tried." if formal else "Not shown: nothing is named that would support it."
