"""A work is asked of a worker (`avow.pipeline.worker`), and what comes back is judged.

A worker that crashes, hangs, answers something else or too little becomes a verdict. Only what is asked here and
answered whole is handed on.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow import __version__
from avow.backend_kit.protocol import Report
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.evidence.obligation import Obligation
from avow.evidence.record import RETRY
from avow.isolation.observed import Seen
from avow.pipeline import forks
from avow.pipeline.mutant_systems import Altered
from avow.pipeline.requests import Request, Unanswered, read_response, request_bytes
from avow.pipeline.work import Work, method_backend, planned_method, tool_identities

CHANGED = "contract, plan or a model changed while it was being verified; run it again"

GRACE = 90.0
"""Seconds above the tool's own limits that a worker gets to load, translate and write."""


def run(
    workspace: Workspace,
    work: Work,
    obligations: tuple[Obligation, ...],
    folder: Path,
    altered: Altered | None = None,
    kept: Mapping[str, Sequence[Any]] | None = None,
) -> Report:
    """Settle the obligations in a process of their own; `kept` are cases that refuted them once. Never raises for what
    that process does."""
    try:
        request = replace(request_of(workspace, work, obligations, folder, altered), kept=kept or {})
    except OSError as error:
        return _failed(obligations, work, Verdict.ERROR, f"{type(error).__name__}: {error}", {})
    asked = request_bytes(request)
    limit = request.seconds + GRACE
    with tempfile.TemporaryDirectory(prefix="avow-work-") as place:
        question, answer = Path(place, "request"), Path(place, "response")
        question.write_bytes(asked)
        done = forks.run([str(question), str(answer)], cwd=workspace.root, seconds=limit)
        log = {"worker.log": done.stderr} if done.stderr.strip() else {}
        if done.timed_out:
            return _failed(obligations, work, Verdict.UNKNOWN, f"no answer within {limit:.0f} s", log)
        if done.code != 0 or not answer.is_file():
            last = done.stderr.strip().splitlines()[-1:] or [f"the worker ended with code {done.code}"]
            return _failed(obligations, work, Verdict.ERROR, f"the engine crashed: {last[0][:300]}", log)
        said = answer.read_bytes()
    return judged(work, obligations, asked, said, log)


def request_of(
    workspace: Workspace, work: Work, obligations: Sequence[Obligation], folder: Path, altered: Altered | None = None
) -> Request:
    """What a worker is asked. Raises OSError for a file of the plan that cannot be read."""
    from avow.pipeline.blobs import encode

    assert work.cut is not None
    root = work.system.plan.root.absolute()
    tool = None if work.is_engine else method_backend(work.system, planned_method(work))
    portable = tool is None or tool.portable
    files = {path.absolute().relative_to(root).as_posix(): path.read_bytes() for path in work.files if path.is_file()}
    return Request(
        work.system.name,
        work.node,
        work.method,
        work.engine,
        {o.id: work.keys[o.id] for o in obligations},
        work.limits,
        encode(work.cut(), root),
        workspace.relative(root),
        files if portable else {},
        tool_identities(tool) if tool else (),
        "" if portable else str(root),
        str(folder),
        altered,
    )


def judged(work: Work, obligations: tuple[Obligation, ...], asked: bytes, said: object, logs: dict[str, str]) -> Report:
    """The report that an answer holds, or why it is none. What was asked has to stand still."""
    try:
        response = read_response(said, asked)
    except Unanswered as error:
        return _failed(obligations, work, Verdict.ERROR, f"the engine's answer is not one: {error}"[:300], logs)
    if response.report is None:
        return _failed(obligations, work, Verdict.ERROR, response.refused, logs)
    if work.changed():
        return _failed(obligations, work, Verdict.ERROR, CHANGED, logs)
    return _complete(response.report, obligations)


def _complete(report: Report, obligations: tuple[Obligation, ...]) -> Report:
    """An obligation without an outcome, or with two, must not pass for settled."""
    answers: dict[str, list[Outcome]] = {}
    for outcome in report.outcomes:
        answers.setdefault(outcome.obligation, []).append(outcome)
    outcomes = []
    for obligation in obligations:
        match answers.get(obligation.id, []):
            case [outcome]:
                outcomes.append(_declared(outcome, report))
            case []:
                outcomes.append(Outcome(obligation.id, Verdict.ERROR, "the engine gave no answer for this obligation"))
            case _:  # more than one
                outcomes.append(
                    Outcome(obligation.id, Verdict.ERROR, "the engine gave several answers for this obligation")
                )
    return replace(report, outcomes=tuple(outcomes))


def _declared(outcome: Outcome, report: Report) -> Outcome:
    """What was answered from something that cannot be recorded could come out otherwise tomorrow, unnoticed."""
    outside = [o.path for o in report.observed if o.kind is Seen.OUTSIDE]
    if not outside or not outcome.verdict.supports:
        return outcome
    summary = f"undeclared input: the subject used {', '.join(outside[:3])}, which cannot be recorded"
    return replace(outcome, verdict=Verdict.UNKNOWN, summary=f"{summary} (else: {outcome.summary})")


def _failed(
    obligations: tuple[Obligation, ...], work: Work, verdict: Verdict, why: str, logs: dict[str, str]
) -> Report:
    outcomes = tuple(Outcome(o.id, verdict, why, details={RETRY: True}) for o in obligations)
    return Report(outcomes, work.engine, __version__, logs=logs)
