"""Makes a request from a job, has a process here or a remote executor answer it, and judges the response.

A worker that crashes, hangs, or omits answers yields a verdict. The request carries what the calculus proved in earlier
runs.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow import __version__
from avow.backend_kit.protocol import Report
from avow.base.codec import Unreadable, from_text
from avow.base.files import is_intact, read_regular
from avow.base.plain import listed, one_line
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.calculus.entailment import KeptAnswers
from avow.evidence.currency import differing
from avow.evidence.ledger import ledger_of
from avow.evidence.obligation import Obligation
from avow.evidence.record import RETRY
from avow.isolation.observed import Observed, Seen
from avow.pipeline.blobs import encode
from avow.pipeline.methods import tool_identities
from avow.pipeline.requests import Request, Response
from avow.pipeline.run_info import Run
from avow.pipeline.work import COMPOSE, Work, engine_identity

_ENVIRONMENT = re.compile(rb"\b(environb?|getenvb?)\b")
CHANGED = "contract, plan or a model changed while it was being verified; run it again"


def settle(
    workspace: Workspace,
    work: Work,
    obligations: tuple[Obligation, ...],
    folder: Path,
    run: Run,
    kept: Mapping[str, tuple[Any, ...]] | None = None,
) -> Report:
    """Discharge the obligations in a process of their own, here or remotely; `kept` are cases that refuted them
    earlier. Never raises for a fault of that process."""
    if lacking := _lacking(work, run):
        return _failed(obligations, work, Verdict.NOT_RUN, f"no worker of the cluster offers {', '.join(lacking)}", {})
    try:
        request = replace(
            request_of(workspace, work, obligations, folder),
            kept=kept or {},
            earlier=_earlier(workspace, work, run),
        )
    except OSError as error:
        return _failed(obligations, work, Verdict.ERROR, f"{type(error).__name__}: {error}", {})
    if run.remote is None or request.root:
        return _here(workspace, work, obligations, request, run)
    response = run.remote.executor.run(request)
    report = judged(work, obligations, response)
    others = unlike_here(report.observed, workspace.root)
    if not others:
        return _with_environment(report, workspace.root)
    worker = one_line(response.worker)[:64]
    if work.planned is not None and tool_identities(work.planned[0]) != work.tools:
        return _undeclared(report, others, worker)
    what = f"{work.engine} used {_on(worker, others[0])}, which is not so on this machine, or cannot be recorded"
    run.remote.warn(f"{what}: what depends on the like is done again here")
    with run.remote.again:
        return _here(workspace, work, obligations, request, run)


def unlike_here(observed: Iterable[Observed], root: Path) -> tuple[Observed, ...]:
    """What a worker observed that differs on this machine, or that cannot be recorded. A record is compared with this
    machine: no later run could detect a change on another machine."""
    rows = tuple(observed)
    recorded = (o for o in rows if o.kind is not Seen.OUTSIDE)
    return (*(o for o in rows if o.kind is Seen.OUTSIDE), *differing(recorded, root))


def _here(workspace: Workspace, work: Work, obligations: tuple[Obligation, ...], request: Request, run: Run) -> Report:
    """Discharge them in a process of their own on this machine."""
    try:
        response = run.processes.run(request, workspace.root)
    except OSError as error:
        response = Response("", failure=f"{type(error).__name__}: {error}")
    report = _with_environment(judged(work, obligations, response), workspace.root)
    return replace(report, outcomes=tuple(_rerun(outcome, report.observed) for outcome in report.outcomes))


def _with_environment(report: Report, root: Path) -> Report:
    """The report, resting on the assumption that the robot sets no environment variable that a Python file of the
    workspace reads: a program under test gets none of them."""
    read = {root / o.path for o in report.observed if o.kind is Seen.READ and o.path.endswith(".py")}
    own = sorted(path for path in read if path.is_relative_to(root) and not path.is_relative_to(sys.prefix))
    asks = [p.relative_to(root).as_posix() for p in own if p.is_file() and _ENVIRONMENT.search(read_regular(p))]
    if not asks:
        return report
    text = f"the robot sets no environment variable that {listed(asks, 3)} reads: in tests none is set"
    outcomes = (replace(o, hypotheses=(*o.hypotheses, text)) if o.verdict.supports else o for o in report.outcomes)
    return replace(report, outcomes=tuple(outcomes))


def _lacking(work: Work, run: Run) -> tuple[str, ...]:
    """The tools of a job, as if the remote executor had none."""
    if run.offered is None or not work.tools or not work.is_portable:
        return ()
    wanted = [name for name, *_ in work.tools]
    return () if any(name in run.offered for name in wanted) else tuple(wanted)


def request_of(workspace: Workspace, work: Work, obligations: Sequence[Obligation], folder: Path) -> Request:
    """Raises OSError for a file of the plan that cannot be read."""
    assert work.cut is not None
    root = work.system.plan.root.absolute()
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
        files if work.is_portable else {},
        work.tools,
        "" if work.is_portable else str(root),
        workspace.relative(folder),
    )


def judged(work: Work, obligations: tuple[Obligation, ...], response: Response) -> Report:
    """The report in a response, with one outcome for each obligation. Contract and plan must not have changed since the
    request was made."""
    log = {"worker.log": response.log} if response.log.strip() else {}
    if response.report is None:
        verdict = Verdict.UNKNOWN if response.timed_out else Verdict.ERROR
        return _failed(obligations, work, verdict, response.failure, log)
    if work.changed():
        return _failed(obligations, work, Verdict.ERROR, CHANGED, log)
    answers: dict[str, list[Outcome]] = {}
    for outcome in response.report.outcomes:
        answers.setdefault(outcome.obligation, []).append(outcome)
    outcomes = tuple(_only(obligation, answers.get(obligation.id, [])) for obligation in obligations)
    return replace(response.report, outcomes=outcomes)


def _only(obligation: Obligation, answers: list[Outcome]) -> Outcome:
    """An obligation without an outcome, or with two, must not count as discharged."""
    if len(answers) == 1:
        return answers[0]
    how = "several answers" if answers else "no answer"
    return Outcome(obligation.id, Verdict.ERROR, f"the engine gave {how} for this obligation")


def _rerun(outcome: Outcome, observed: Iterable[Observed]) -> Outcome:
    """An answer that rests on something that cannot be recorded may differ tomorrow: every run repeats it."""
    outside = [o.path for o in observed if o.kind is Seen.OUTSIDE]
    if not outside:
        return outcome
    why = f"re-run in every run, as it rests on what cannot be recorded: {', '.join(outside[:3])}"
    return replace(outcome, summary=f"{outcome.summary}; {why}", details={**outcome.details, RETRY: True})


def _undeclared(report: Report, others: Sequence[Observed], worker: str) -> Report:
    """The report for a tool that is missing on this machine and used inputs that no later run can compare."""
    rows = dict.fromkeys(Observed(Seen.OUTSIDE, _on(worker, o)) for o in others)
    observed = (*(o for o in report.observed if o not in others), *rows)
    return replace(report, observed=observed, outcomes=tuple(_rerun(o, observed) for o in report.outcomes))


def _on(worker: str, row: Observed) -> str:
    return f"{one_line(row.path)} (on {worker})"


def _failed(
    obligations: tuple[Obligation, ...], work: Work, verdict: Verdict, why: str, logs: dict[str, str]
) -> Report:
    outcomes = tuple(Outcome(o.id, verdict, why, details={RETRY: True}) for o in obligations)
    return Report(outcomes, work.engine, __version__, logs=logs)


ANSWERS = "answers.json"
"""What the calculus proved before, kept beside the evidence from run to run; a fresh run uses none of it."""


def _earlier(workspace: Workspace, work: Work, run: Run) -> str:
    """The text that the newest record of the calculus keeps, if it is intact."""
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
