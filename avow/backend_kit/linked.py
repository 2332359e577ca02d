"""A model that was verified in the place of a program, held against the program: both are given the same steps.

A difference refutes the *link* between the two, a claim of its own (`ProgramClaim.LINKED`): the guarantee may well hold
of either. A backend whose models can be run says so (`Backend.runs_models`); one that runs the program asks here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from avow.backend_kit.protocol import Job, NoModel
from avow.backend_kit.registry import backend
from avow.base.diagnostics import Rejected
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.obligation import Obligation, ProgramClaim
from avow.formulas.values import Sequence as SequenceValue
from avow.formulas.values import Value, show
from avow.system.plan import Method, System
from avow.tuning.bounds import ROUNDED_PART

Step = Mapping[str, Value]
"""A step's inputs and outputs by qualified name."""


def models(system: System, node: str) -> tuple[Method, ...]:
    """The node's methods whose models can be run."""
    plan = system.plan
    found = (m for m in plan.node(node).methods if backend(m.backend, plan.plugins).runs_models)
    return tuple(sorted(found, key=lambda m: m.id))


def settled(job: Job, steps: Sequence[Step], why: str = "") -> tuple[Outcome, ...]:
    """The outcome of the job's claim that model and program agree, where it has one. `steps` are what the program did
    within its assumptions; where there are none, `why` says it."""
    return tuple(_held(job, claim, steps, why) for claim in job.claims if claim.name == ProgramClaim.LINKED)


def _held(job: Job, claim: Obligation, steps: Sequence[Step], why: str) -> Outcome:
    unknown = Outcome(
        claim.id, Verdict.UNKNOWN, why or "the program has answered nothing that the model could be held to"
    )
    if not steps:
        return unknown
    told, rounded, unsaid = [], 0, 0
    for method in models(job.system, job.node.name):
        try:
            run = backend(method.backend, job.system.plan.plugins).model(
                replace(job, method=method, obligations=(), claims=())
            )
        except (Rejected, NoModel) as error:
            return replace(unknown, summary=f"the model of {method.id} cannot be run: {error}"[:300])
        compared = 0
        for step in steps:
            said = _said(run, step)
            if said is None:
                unsaid += 1
                continue
            compared += 1
            differing = [name for name, value in said.items() if name in step and not _same(value, step[name])]
            if differing:
                return _differs(claim, method, step, said, differing)
            rounded += any(name in step and value != step[name] for name, value in said.items())
        if not compared:
            return replace(unknown, summary=f"the model of {method.id} answers none of {len(steps)} steps")
        told.append(f"{method.id} on {compared}")
    about = f"the program answers as the model of {', '.join(told)} steps"
    remarks = (f"in {rounded} of them but for rounding",) if rounded else ()
    bound: dict[str, object] = {"cases": len(steps), "rounded": rounded, "unanswered": unsaid}
    return Outcome(claim.id, Verdict.TESTED, "; ".join((about, *remarks)), hypotheses=remarks, bound=bound)


def _said(run: Callable[[Step], Step], step: Step) -> Step | None:
    try:
        return run({name: value for name, value in step.items() if name.startswith("in.")})
    except NoModel:
        return None


def _same(one: Value, other: Value) -> bool:
    """The same value; a REAL as nearly as rounding a few times lets a program be."""
    match one, other:
        case SequenceValue(items=left), SequenceValue(items=right):
            return len(left) == len(right) and all(map(_same, left, right))
        case Fraction(), Fraction():
            return abs(one - other) <= max(abs(one), abs(other)) * ROUNDED_PART
    return one == other


def _differs(claim: Obligation, method: Method, step: Step, said: Step, names: Iterable[str]) -> Outcome:
    model = tuple((f"model's {name}", show(said[name])) for name in names)
    why = f"the program and the model of {method.id} differ: what is verified of the model is not verified of it"
    shown = Counterexample((*((n, show(v)) for n, v in step.items()), *model), why)
    return Outcome(claim.id, Verdict.REFUTED, shown.text(), shown)


__all__ = ["models", "settled"]
