"""From the enclosures to the verdict of each guarantee."""

from __future__ import annotations

import time
from collections.abc import Mapping

from avow.backend_kit.protocol import Job, Limits
from avow.base.files import sha256
from avow.base.plain import listed
from avow.base.tuning.effort import JUDGE_EFFORT
from avow.base.verdict import Hypothesis, HypothesisKind, Outcome, Verdict, bound
from avow.evidence.obligation import Obligation
from avow.formulas.cases import TooManyCases, lifted
from avow.formulas.conditions import conditions
from avow.solving.questions import solve

from . import odes, runs
from .answers import Found, Question
from .options import Given
from .picture import picture, table
from .series import Undefined
from .truth import box_of, holds


def settle(job: Job, given: Given, allowed: Limits) -> tuple[tuple[Outcome, ...], Mapping[str, str]]:
    """One outcome for each obligation, and the enclosures as files."""
    end = time.monotonic() + allowed.seconds
    assumed = [clause.formula for clause in job.node.assumptions]
    box = box_of(assumed)
    if missing := [name for name in given.inputs.values() if name not in box]:
        return _open(job, f"{listed(missing)} has no bounds: assume some, such as abs({missing[0]}) <= 1"), {}
    if solve(assumed, effort=JUDGE_EFFORT, values="unused").status == "unsat":
        return _open(job, "no input meets the assumptions"), {}
    question = Question(job, given, box, "s" if given.map is None else "steps", end)
    try:
        if given.map is None:
            tube = odes.enclosed(question)
            pieces, found = tube.pieces, [odes.judged(question, job.clause(o), tube) for o in job.obligations]
        else:
            pieces = runs.enclosed(question, given.map)
            found = [runs.judged(question, job.clause(o), given.map, pieces) for o in job.obligations]
    except (Undefined, TooManyCases) as why:
        return _open(job, str(why) or "a guarantee has too many cases"), {}
    unit = question.unit
    files = {"enclosure.csv": table(pieces, unit), "enclosure.svg": picture(pieces, unit)} if pieces else {}
    for obligation, each in zip(job.obligations, found, strict=True):
        if each.verdict is Verdict.PROVED and each.pieces is not pieces:
            files[f"{obligation.name}-induction.csv"] = table(each.pieces, unit)
    return tuple(_outcome(question, o, each) for o, each in zip(job.obligations, found, strict=True)), files


def _open(job: Job, why: str) -> tuple[Outcome, ...]:
    return tuple(Outcome(o.id, Verdict.UNKNOWN, why) for o in job.obligations)


def _outcome(question: Question, obligation: Obligation, found: Found) -> Outcome:
    if not found.verdict.supports:
        return Outcome(obligation.id, found.verdict, found.summary, found.counterexample)
    job, given = question.job, question.given
    whens = [lifted(each.formula) for each in conditions(job.clause(obligation).formula)]
    vacuous = bool(whens) and all(
        holds(when, {**question.box, **piece.outputs}) is False for when in whens for piece in found.pieces
    )
    text = f"the motion begins with {given.initial_text}"
    first = Hypothesis(HypothesisKind.ASSUMPTION, f"{job.node.name}/assumption/initial", sha256(text), text)
    return Outcome(
        obligation.id,
        found.verdict,
        found.summary,
        hypotheses=("inputs change at any time within the bounds that the assumptions give",),
        bound={"steps": len(found.pieces)},
        vacuous=vacuous,
        rests_on=(first, *((bound("horizon", found.bounded),) if found.bounded else ())),
    )
