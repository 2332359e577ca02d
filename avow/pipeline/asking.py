"""A work is asked of a worker (`avow.pipeline.worker`), and what comes back is judged.

A worker that crashes, hangs, answers something else or too little becomes a verdict. Only what is asked here and
answered whole is handed on. What the calculus proved before goes with it, from run to run.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow import __version__
from avow.backend_kit.protocol import Report
from avow.base.codec import Unreadable, from_text
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import is_intact, read_regular
from avow.base.plain import one_line
from avow.base.tuning.running import WORKER_GRACE
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.calculus.kept_answers import KeptAnswers
from avow.evidence.currency import differing
from avow.evidence.ledger import ledger_of
from avow.evidence.obligation import Obligation
from avow.evidence.record import RETRY
from avow.isolation.observed import Observed, Seen
from avow.pipeline.executors import Asked, Came, Desk, Elsewhere, Executor, answered
from avow.pipeline.requests import Altered, Request, Unanswered, read_response
from avow.pipeline.run_info import Run
from avow.pipeline.work import (
    COMPOSE,
    Work,
    engine_identity,
    is_portable,
    method_backend,
    planned_method,
    tool_identities,
)

CHANGED = "contract, plan or a model changed while it was being verified; run it again"


def settle(
    workspace: Workspace,
    work: Work,
    obligations: tuple[Obligation, ...],
    folder: Path,
    run: Run,
    altered: Altered | None = None,
    kept: Mapping[str, tuple[Any, ...]] | None = None,
) -> Report:
    """Settle the obligations in a process of their own, here or elsewhere, with what its engine kept for itself; `kept`
    are cases that refuted them once. Never raises for what that process does."""
    if lacking := _lacking(work, run):
        return _failed(obligations, work, Verdict.NOT_RUN, f"no worker of the cluster offers {', '.join(lacking)}", {})
    try:
        request = replace(
            request_of(workspace, work, obligations, folder, altered),
            kept=kept or {},
            earlier=_earlier(workspace, work, run),
        )
    except OSError as error:
        return _failed(obligations, work, Verdict.ERROR, f"{type(error).__name__}: {error}", {})
    if run.elsewhere is None or request.root:
        return _here(workspace, work, obligations, request, run)
    asked, came = run.elsewhere.desk.ask(request)
    report = _told(work, obligations, asked, came)
    others = unlike_here(report.observed, workspace.root)
    if not others:
        return report
    worker = one_line(read_response(came.data, asked.data).worker)[:64]
    if not _has_its_tools(work):
        return _undeclared(report, others, worker)
    what = f"{work.engine} used {_on(worker, others[0])}, which {_UNLIKE}"
    run.elsewhere.tell(f"{what}: what depends on the like is done again here")
    with run.elsewhere.again:
        return _here(workspace, work, obligations, request, run)


_UNLIKE = "is not so on this machine, or cannot be recorded"


def elsewhere(executor: Executor) -> Elsewhere:
    """What an executor offers. Raises Rejected where no worker is there."""
    offers = executor.offers()
    if not offers:
        raise Rejected(Diagnostic("CLUSTER004", "the cluster has no workers", hint="start one: avow worker --on …"))
    chosen: dict[str, tuple[str, str]] = {}
    for tools in offers.values():
        for name, version, program in sorted(tools):
            chosen[name] = max(chosen.get(name, ("", "")), (version, program))
    return Elsewhere(Desk(executor, _said), chosen)


def unlike_here(observed: Iterable[Observed], root: Path) -> tuple[Observed, ...]:
    """What a worker saw that is not so on this machine, or that none can record. A record is held against this
    machine: of what lies on another it could not tell later that it changed."""
    rows = tuple(observed)
    recorded = (o for o in rows if o.kind is not Seen.OUTSIDE)
    return (*(o for o in rows if o.kind is Seen.OUTSIDE), *differing(recorded, root))


def _here(workspace: Workspace, work: Work, obligations: tuple[Obligation, ...], request: Request, run: Run) -> Report:
    """Settle them in a process of their own on this machine."""
    asked = Asked.of(request)
    try:
        came = answered(run.forks, asked.data, asked.key, request.seconds + WORKER_GRACE, workspace.root)
    except OSError as error:
        came = Came(asked.key, failure=f"{type(error).__name__}: {error}")
    report = _told(work, obligations, asked, came)
    return replace(report, outcomes=tuple(_declared(outcome, report) for outcome in report.outcomes))


def _told(work: Work, obligations: tuple[Obligation, ...], asked: Asked, came: Came) -> Report:
    log = {"worker.log": came.log} if came.log.strip() else {}
    if came.data is None:
        return _failed(obligations, work, Verdict.UNKNOWN if came.timed_out else Verdict.ERROR, came.failure, log)
    return judged(work, obligations, asked.data, came.data, log)


def _has_its_tools(work: Work) -> bool:
    """Whether this machine has the tools of its keys."""
    return not work.is_engine and tool_identities(method_backend(work.system, planned_method(work))) == work.tools


def _lacking(work: Work, run: Run) -> tuple[str, ...]:
    """The tools of a work, where the machines that there are have none of them."""
    if run.offered is None or work.is_engine or not work.tools:
        return ()
    if not is_portable(method_backend(work.system, planned_method(work))):
        return ()
    wanted = [name for name, *_ in work.tools]
    return () if any(name in run.offered for name in wanted) else tuple(wanted)


def _said(asked: Asked, came: Came) -> object:
    """What an answer says, without what differs from run to run."""
    try:
        report = read_response(came.data, asked.data).report
    except Unanswered:
        return None
    return sorted((o.obligation, o.verdict) for o in report.outcomes) if report else None


def request_of(
    workspace: Workspace, work: Work, obligations: Sequence[Obligation], folder: Path, altered: Altered | None = None
) -> Request:
    """What a worker is asked. Raises OSError for a file of the plan that cannot be read."""
    from avow.pipeline.blobs import encode

    assert work.cut is not None
    root = work.system.plan.root.absolute()
    tool = None if work.is_engine else method_backend(work.system, planned_method(work))
    portable = tool is None or is_portable(tool)
    files = {path.absolute().relative_to(root).as_posix(): read_regular(path) for path in work.files if path.is_file()}
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
        work.tools,
        "" if portable else str(root),
        workspace.relative(folder),
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
                outcomes.append(outcome)
            case []:
                outcomes.append(Outcome(obligation.id, Verdict.ERROR, "the engine gave no answer for this obligation"))
            case _:  # more than one
                outcomes.append(
                    Outcome(obligation.id, Verdict.ERROR, "the engine gave several answers for this obligation")
                )
    return replace(report, outcomes=tuple(outcomes))


def _declared(outcome: Outcome, report: Report, why: str = "that cannot be recorded") -> Outcome:
    """What was answered from something that cannot be recorded could come out otherwise tomorrow, unnoticed."""
    outside = [o.path for o in report.observed if o.kind is Seen.OUTSIDE]
    if not outside or not outcome.verdict.supports or outcome.vacuous:  # what is vacuous supports nothing
        return outcome
    summary = f"undeclared input: it used {', '.join(outside[:3])}; {why}"
    return replace(outcome, verdict=Verdict.UNKNOWN, summary=f"{summary} (else: {outcome.summary})")


def _undeclared(report: Report, others: Sequence[Observed], worker: str) -> Report:
    """What a tool that is not here answered where something is not as here. The next run asks again."""
    rows = dict.fromkeys(Observed(Seen.OUTSIDE, _on(worker, o)) for o in others)
    told = replace(report, observed=(*(o for o in report.observed if o not in others), *rows))
    why = f"that {_UNLIKE}; have the same packages there as here, or the tool here"
    outcomes = (_declared(outcome, told, why) for outcome in report.outcomes)
    return replace(told, outcomes=tuple(replace(o, details={**o.details, RETRY: True}) for o in outcomes))


def _on(worker: str, row: Observed) -> str:
    return f"{one_line(row.path)} (on {worker})"


def _failed(
    obligations: tuple[Obligation, ...], work: Work, verdict: Verdict, why: str, logs: dict[str, str]
) -> Report:
    outcomes = tuple(Outcome(o.id, verdict, why, details={RETRY: True}) for o in obligations)
    return Report(outcomes, work.engine, __version__, logs=logs)


ANSWERS = "answers.json"
"""What the calculus proved before, carried from run to run beside the evidence; a run that believes no earlier one gets
none of it."""


def _earlier(workspace: Workspace, work: Work, run: Run) -> str:
    """The text that the newest record of a work keeps, if it is what was kept."""
    if run.fresh or work.engine != COMPOSE:
        return ""
    for entry in reversed(ledger_of(workspace.ledger(work.system.name)).records()):
        record = entry.evidence
        path = next((path for path in record.outputs if path.endswith(f"/{ANSWERS}")), None)
        if record.method == COMPOSE and path is not None:
            try:
                whole = is_intact(workspace.root / path, record.outputs[path])
                return read_regular(workspace.root / path).decode() if whole else ""
            except (OSError, UnicodeDecodeError):
                return ""
    return ""


def read_answers(text: str) -> KeptAnswers:
    """Those of this engine and solver."""
    try:
        said = from_text(dict[str, str], text)
    except Unreadable:
        return KeptAnswers()
    return KeptAnswers.read(said.get("answers", "") if said.get("engine") == engine_identity() else "")


def write_answers(answers: KeptAnswers) -> str:
    return json.dumps({"engine": engine_identity(), "answers": answers.written()})
