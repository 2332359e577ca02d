"""What runs break besides the guarantees that the plan names them for (`avow.backend_kit.further`)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

from avow.backend_kit.further import Further, assumption, contradicted
from avow.backend_kit.protocol import Job
from avow.base.plain import exact
from avow.base.verdict import Outcome, Verdict
from avow.language.contract import Clause, ClauseKind
from avow.language.subterms import ports_of

from .campaign import monitored, rows_of
from .judging import Claim, claim, judged
from .options import Experiment, everything
from .profile import Campaign
from .statistics import upper_bound
from .verdict import counterexample, settle


def contradictions(job: Job, experiment: Experiment) -> Iterator[Outcome]:
    """The claims that the table refutes. A row that breaks an assumption of the node refutes no promise of it; without
    columns for all ports of a claim, the table says nothing about it."""
    runs, meanings, known = everything(job)
    named = job.options.get("outside", {})
    apart = {v.name for c in job.node.assumptions if c.name in named for v in ports_of(c.formula)}
    apart |= {key.removeprefix("in.") for key in named}
    planned = [f for f in job.further or () if f.clause.kind is ClauseKind.ASSUMPTION]
    assumed = [*((assumption(job.node.name, c.name), c) for c in job.node.assumptions)]
    assumed += [(f.claim, f.clause) for f in planned]

    def ready(clause: Clause, given: tuple[Clause, ...] = ()) -> Claim | None:
        made = claim(clause, given, meanings, known)
        return None if made.missing or (made.remembers and not job.options.get("steps")) else made

    for name, clause in assumed:
        one = None if apart & {v.name for v in ports_of(clause.formula)} else ready(clause)
        tried = [(run, judged(one, run.steps)) for run in runs] if one is not None else []
        broken = [(run, found) for run, found in tried if found.broken is not None]
        if one is not None and broken:
            shown = replace(counterexample(one, broken), explanation=f"run {broken[0][0].name} breaks it")
            yield contradicted(name, f"{len(broken)} of {len(runs)} runs break the assumption {clause.name}", shown)
    excused = tuple(f.clause for f in planned if apart & {v.name for v in ports_of(f.clause.formula)})
    others = [f for f in job.further or () if f.clause.kind is ClauseKind.GUARANTEE]
    own = {f.clause.name: f.clause for f in others if f.at_least} | {o.name: job.clause(o) for o in job.obligations}
    known_own = {name: one for name, clause in own.items() if (one := ready(clause, job.node.assumptions)) is not None}
    failing = {
        name: {run.name for run in runs if judged(one, run.steps).broken is not None} for name, one in known_own.items()
    }
    for other in others:
        one = ready(other.clause, (*job.node.assumptions, *excused))
        if one is not None:
            rated = _rated(job, experiment, other, failing)
            left = tuple(run for run in runs if run.name not in rated)
            at_least = _claimed(other)
            about = replace(experiment, runs=left, claims={other.clause.name: one}, at_least=at_least)
            outcome, _ = settle(other.clause.name, about, ())
            if outcome.verdict is Verdict.REFUTED and outcome.counterexample is not None:
                yield contradicted(other.claim, outcome.summary, outcome.counterexample)


def of_campaign(job: Job, campaign: Campaign, experiment: Experiment) -> Iterator[Outcome]:
    """The claims, of any node, that recordings of the campaign refute."""
    rows = rows_of(campaign)
    tool, asked = monitored(job, campaign)
    broken: dict[str, dict[str, Outcome]] = {}
    for row in rows:
        path = campaign.recording(row.run.name)
        for outcome in tool.contradictions(asked, path, job.options.get("outside", {})) if path.exists() else ():
            shown = outcome.counterexample
            if shown is not None:
                about = (("run", row.run.name), *row.cells.items(), *shown.values)
                shown = replace(shown, values=about)
            broken.setdefault(outcome.obligation, {})[row.run.name] = replace(outcome, counterexample=shown)
    further = {f.claim: f for f in job.further or ()}
    runs = (*experiment.runs, *(experiment.replayed or ()))
    failing = {o.name: {r.name for r in runs if r.verdicts[o.name].broken is not None} for o in job.obligations}
    for name, found in broken.items():
        rated, at_least = set[str](), None
        if (other := further.get(name)) is not None:
            rated, at_least = _rated(job, experiment, other, failing), _claimed(other)
        left = [one for run, one in found.items() if run not in rated]
        if not left or left[0].counterexample is None:
            continue
        if at_least is None or upper_bound(len(left), len(rows), experiment.confidence) > 1 - at_least:
            text = f"{len(left)} of {len(rows)} simulated runs break it, first: {left[0].summary}"
            yield contradicted(name, text, left[0].counterexample)


def _claimed(other: Further) -> Fraction | None:
    return exact(other.at_least) if other.at_least else None


def _rated(job: Job, experiment: Experiment, other: Further, failing: Mapping[str, Collection[str]]) -> set[str]:
    """The runs that a claimed rate covers: in them, a requirement is broken together with a guarantee that the plan
    names as its support, whose failures the requirement's rate counts."""
    rates = {f.clause.name for f in job.further or () if f.at_least}
    rates |= {o.name for o in job.obligations if experiment.at_least is not None}
    return {run for name in rates.intersection(other.supports) for run in failing.get(name, ())}
