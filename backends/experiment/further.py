"""What a table breaks besides the guarantees that the plan names it for (`avow.backend_kit.further`)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from avow.backend_kit.further import assumption, contradicted
from avow.backend_kit.protocol import Job
from avow.base.verdict import Outcome, Verdict
from avow.language.contract import Clause, ClauseKind
from avow.language.subterms import ports_of

from .judging import Claim, claim, judged
from .options import Experiment, everything
from .verdict import counterexample, settle


def contradictions(job: Job, experiment: Experiment) -> Iterator[Outcome]:
    """The claims that the table refutes. A row that breaks an assumption of the node refutes no promise of it; without
    columns for all ports of a claim, the table says nothing about it."""
    runs, meanings, known = everything(job)
    named = job.options.get("outside", {})
    apart = {v.name for c in job.node.assumptions if c.name in named for v in ports_of(c.formula)}
    apart |= {key.removeprefix("in.") for key in named}
    planned = [f for f in job.further if f.clause.kind is ClauseKind.ASSUMPTION]
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
    for other in (f for f in job.further if f.clause.kind is ClauseKind.GUARANTEE):
        one = ready(other.clause, (*job.node.assumptions, *excused))
        if one is not None:
            about = replace(experiment, runs=runs, claims={other.clause.name: one})
            outcome, _ = settle(other.clause.name, about, ())
            if outcome.verdict is Verdict.REFUTED and outcome.counterexample is not None:
                yield contradicted(other.claim, outcome.summary, outcome.counterexample)
