"""Compares a verified model with the program that it stands for: both get the same steps, drawn by the program's own
method or taken from the recordings that the plan names.

A difference refutes the *link* between the two, a claim of its own (`ProgramClaim.LINKED`): each may still meet the
guarantee. A backend whose models can be run declares `Backend.runs_models`; a backend that runs the program calls this
module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from avow.backend_kit.parameters import ALONE, jobs
from avow.backend_kit.protocol import Backend, Job, NoModel, wired
from avow.backend_kit.registry import backend, judge_of_runs
from avow.base.diagnostics import Rejected
from avow.base.records import dataclass
from avow.base.tuning.bounds import RECORDED_STEPS, ROUNDED_PART
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evaluation.evaluate import evaluate
from avow.evidence.obligation import Obligation, ProgramClaim
from avow.evidence.record import AGREES
from avow.formulas.values import Element, SequenceValue, Value, show
from avow.language.subterms import ports_of
from avow.system.plan import Method, System

Step = Mapping[str, Value]
"""A step's inputs and outputs by qualified name."""


def models(system: System, node: str) -> tuple[Method, ...]:
    """The node's methods whose models can be run."""
    return _methods(system, node, lambda tool: tool.runs_models)


def unrun(system: System, node: str) -> tuple[Method, ...]:
    """The node's methods whose models cannot be run."""
    return _methods(system, node, lambda tool: bool(tool.not_run))


def recordings(system: System, node: str) -> tuple[Method, ...]:
    """The node's methods to which the plan names recordings."""
    return _methods(system, node, lambda tool: tool.records)


def _methods(system: System, node: str, wanted: Callable[[Backend], bool]) -> tuple[Method, ...]:
    plan = system.plan
    found = (m for m in plan.node(node).methods if wanted(backend(m.backend, plan.plugins)))
    return tuple(sorted(found, key=lambda m: m.id))


def beside(tool: Backend, job: Job) -> tuple[Method, ...]:
    """The other methods that the job's answer depends on: models that its program is compared with, recordings, and the
    monitors of a campaign."""
    system, node = job.system, job.node.name
    if not any(claim.name == ProgramClaim.LINKED for claim in job.claims):
        return recordings(system, node) if tool.campaigns in job.options else ()
    return (*models(system, node), *recordings(system, node), *unrun(system, node))


def reads_recordings(tool: Backend, job: Job) -> bool:
    """Whether the job reads recordings as monitors do: what they mean depends on topics, connections and scenario."""
    return any(backend(m.backend, job.system.plan.plugins).records for m in beside(tool, job))


def connected(tool: Backend, job: Job) -> bool:
    """Whether the job's answer may depend on topics, connections and other nodes."""
    return wired(tool, job.source) or reads_recordings(tool, job)


def sees_all(tool: Backend, method: Method) -> bool:
    """Whether the answer may depend on the contracts of all nodes: a recording has the messages of any node."""
    options = method.options.data
    return tool.uses_upstream or (isinstance(options, Mapping) and tool.campaigns in options)


def told_too(tool: Backend, job: Job) -> frozenset[str]:
    """The backends whose options for other nodes the job's answer may depend on: its own, and those that read its
    messages."""
    judge = judge_of_runs() if wired(tool, job.source) and not tool.uses_wiring else None
    reading = [m.backend for m in beside(tool, job) if backend(m.backend, job.system.plan.plugins).records]
    return frozenset((tool.name, *reading, *([judge.name] if judge is not None else [])))


@dataclass(frozen=True, slots=True)
class Recorded:
    """The recorded inputs of a node's program."""

    runs: tuple[tuple[Mapping[str, Any], ...], ...] = ()
    """For each recording the inputs of its steps, in the program's form: port → float, int, bool, text, list."""
    without: int = 0
    """The number of steps that lack an input, or have one that is no machine value."""
    wrong: str = ""
    """The reason why a recording cannot be read."""


def recorded(job: Job, ports: Sequence[str]) -> Recorded:
    """The recorded steps on which the job's program can be run: those with all of these inputs, the first few
    thousand."""
    runs: list[tuple[Mapping[str, Any], ...]] = []
    without = left = 0
    if not any(claim.name == ProgramClaim.LINKED for claim in job.claims):
        return Recorded()
    for method in recordings(job.system, job.node.name):
        other = replace(job, method=method, obligations=(), claims=())
        try:
            for run in backend(method.backend, job.system.plan.plugins).steps(other):
                asked = [_asked(step, ports) for step in run[: RECORDED_STEPS - left]]
                without += asked.count(None)
                left += len(asked)
                runs.append(tuple(step for step in asked if step is not None))
        except (Rejected, OSError) as error:
            return Recorded((), without, f"the recordings of {method.id} cannot be read: {error}"[:300])
    return Recorded(tuple(run for run in runs if run), without)


def _asked(step: Step, ports: Sequence[str]) -> Mapping[str, Any] | None:
    try:
        return {name: _machine(step[f"in.{name}"]) for name in ports}
    except (KeyError, OverflowError, TypeError):
        return None


def _machine(value: Value) -> Any:
    """A value in the program's form. Raises TypeError, OverflowError."""
    match value:
        case bool() | int():
            return value
        case Fraction():
            return float(value)
        case Element(name=name):
            return name
        case SequenceValue(items=items):
            return [_machine(item) for item in items]
    raise TypeError(value)


def settled(
    job: Job, steps: Sequence[Step], why: str = "", of_recordings: Recorded | None = None, kept: int = 0
) -> tuple[Outcome, ...]:
    """The outcome of the job's claim that model and program agree, if it has one. `steps` are the program's steps
    within its assumptions, `kept` those among them from recordings; if there are none, `why` gives the reason."""
    found = of_recordings or Recorded()
    claims = [claim for claim in job.claims if claim.name == ProgramClaim.LINKED]
    if found.wrong:
        return tuple(Outcome(claim.id, Verdict.UNKNOWN, found.wrong) for claim in claims)
    return tuple(_told(_held(job, claim, steps, why), found, kept) for claim in claims)


def _told(outcome: Outcome, found: Recorded, kept: int) -> Outcome:
    """The outcome with the recordings that it rests on."""
    asked = sum(map(len, found.runs))
    if not asked and not found.without:
        return outcome
    bound = {**outcome.bound, "recorded": kept}
    summary = f"{outcome.summary}; {kept} of these steps were recorded" if outcome.verdict.supports else outcome.summary
    return replace(outcome, bound={**bound, "recorded_unasked": asked - kept + found.without}, summary=summary)


def _held(job: Job, claim: Obligation, steps: Sequence[Step], why: str) -> Outcome:
    plugins = job.system.plan.plugins
    others = tuple(
        f"the model of {m.id} is not held against the program: {backend(m.backend, plugins).not_run}"
        for m in unrun(job.system, job.node.name)
    )
    unknown = Outcome(
        claim.id, Verdict.UNKNOWN, why or "the program has answered nothing that the model could be held to"
    )
    if not models(job.system, job.node.name):
        return replace(unknown, summary="; ".join(others))
    if not steps:
        return unknown
    compared_with, rounded, unsaid = [], 0, 0
    agrees: dict[str, list[str]] = {}
    for method in models(job.system, job.node.name):
        try:
            tool, of = backend(method.backend, plugins), replace(job, method=method, obligations=(), claims=())
            asked = jobs(tool, of).get(ALONE, of)
            given = {p.variable.qualified: evaluate(p.value, {}) for p in job.node.fixed if p.value is not None}
            given = {} if asked.node.fixed else given  # parameters that are inputs of the model
            run = tool.model(asked)
        except (Rejected, NoModel) as error:
            return replace(unknown, summary=f"the model of {method.id} cannot be run: {error}"[:300])
        compared, outputs = 0, set[str]()
        for step in steps:
            answers = _said(run, {**given, **step})
            both = [name for name in answers or () if name in step]
            if answers is None or not both:
                unsaid += 1
                continue
            compared += 1
            outputs.update(both)
            differing = [name for name in both if not _same(answers[name], step[name])]
            if differing:
                return _differs(claim, method, step, answers, differing)
            rounded += any(answers[name] != step[name] for name in both)
        if not compared:
            return replace(unknown, summary=f"the model of {method.id} answers none of {len(steps)} steps")
        compared_with.append(f"{method.id} on {compared}")
        about = {c.name: {v.qualified for v in ports_of(c.formula)} for c in job.node.guarantees}
        agrees[method.id] = [name for name, ports in about.items() if {p for p in ports if p[:4] == "out."} <= outputs]
    text = f"the program answers as the model of {', '.join(compared_with)} steps"
    but = (f"in {rounded} of them but for rounding",) if rounded else ()
    bound: dict[str, object] = {"cases": len(steps), "rounded": rounded, "unanswered": unsaid}
    return Outcome(claim.id, Verdict.TESTED, "; ".join((text, *but)), None, (*but, *others), bound, {AGREES: agrees})


def _said(run: Callable[[Step], Step], step: Step) -> Step | None:
    try:
        return run({name: value for name, value in step.items() if name.startswith("in.")})
    except NoModel:
        return None


def _same(one: Value, other: Value) -> bool:
    """Whether two values are equal; for a REAL, up to the rounding of a few operations."""
    match one, other:
        case SequenceValue(items=left), SequenceValue(items=right):
            return len(left) == len(right) and all(map(_same, left, right))
        case Fraction(), Fraction():
            return abs(one - other) <= max(abs(one), abs(other)) * ROUNDED_PART
    return one == other


def _differs(claim: Obligation, method: Method, step: Step, answers: Step, names: Iterable[str]) -> Outcome:
    model = tuple((f"model's {name}", show(answers[name])) for name in names)
    why = f"the program and the model of {method.id} differ: what is verified of the model is not verified of it"
    shown = Counterexample((*((n, show(v)) for n, v in step.items()), *model), why)
    return Outcome(claim.id, Verdict.REFUTED, shown.text(), shown)
