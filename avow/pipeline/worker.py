"""One unit of work in a process of its own: ``python -m avow.pipeline.worker REQUEST RESPONSE``, or a fork that does
the same (`avow.pipeline.forks`).

A solver that crashes, eats the memory or never returns takes this process with it and nothing else: the pipeline turns
that into a verdict. Two workers use two cores, whatever Python's lock says.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from avow import __version__
from avow.backend_kit.protocol import Limits, Report
from avow.base import process
from avow.base.diagnostics import Rejected
from avow.base.files import write
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.calculus.composition import compose
from avow.calculus.variables import frame
from avow.evidence.encoding import Unreadable
from avow.evidence.obligation import Obligation
from avow.evidence.record import RETRY
from avow.isolation.observed import Seen
from avow.pipeline import forks
from avow.pipeline.mutant_systems import Altered, alter
from avow.pipeline.remarks import remarked
from avow.pipeline.wire import report_from_json, report_to_json
from avow.pipeline.work import Work, compose_work, method_backend, method_job, method_work, planned_method, sanity_work
from avow.system.load import load_system
from avow.system.plan import System

GRACE = 90.0
"""Seconds above the tool's own limits that a worker gets to load, translate and write."""

CHANGED = 75
"""Exit code: what was to be verified is not what stands on the disk any more, so that the answer is of neither."""


def run(
    workspace: Workspace, work: Work, obligations: tuple[Obligation, ...], folder: Path, altered: Altered | None = None
) -> Report:
    """Settle the obligations in a process of their own. Never raises for what that process does."""
    request, response = folder / ".request.json", folder / ".response.json"
    response.unlink(missing_ok=True)
    write(
        request,
        json.dumps(
            {
                "system": str(work.system.plan.root),
                "node": work.node,
                "method": work.method,
                "engine": work.engine,
                "keys": {o.id: work.keys[o.id] for o in obligations},
                "folder": str(folder),
                "limits": asdict(work.limits),
                "altered": asdict(altered) if altered else None,
            }
        ),
    )
    limit = work.limits.seconds * max(2, len(obligations)) + GRACE
    done = forks.run([str(request), str(response)], cwd=workspace.root, seconds=limit)
    log = {"worker.log": done.stderr} if done.stderr.strip() else {}
    try:
        if done.timed_out:
            return _failed(obligations, work, Verdict.UNKNOWN, f"no answer within {limit:.0f} s", log)
        if done.code == CHANGED:
            why = "contract, plan or a model changed while it was being verified; run it again"
            return _failed(obligations, work, Verdict.ERROR, why, log)
        if done.code != 0 or not response.is_file():
            last = done.stderr.strip().splitlines()[-1:] or [f"the worker ended with code {done.code}"]
            return _failed(obligations, work, Verdict.ERROR, f"the engine crashed: {last[0][:300]}", log)
        report = report_from_json(json.loads(response.read_text()))
    except (Unreadable, ValueError, TypeError, LookupError) as error:
        return _failed(obligations, work, Verdict.ERROR, f"the engine's answer is not one: {error}"[:300], log)
    finally:
        request.unlink(missing_ok=True)
        response.unlink(missing_ok=True)
    return _complete(report, obligations)


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
            case _:
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


class Changed(Exception):  # noqa: N818 - it names what happened
    """The files are no longer those that the keys are of."""


def entry(arguments: Sequence[str]) -> int:
    """The whole work of the process; its exit code."""
    process.adopt_orphans()
    try:
        _main(arguments)
    except Changed:
        return CHANGED
    except Exception:
        traceback.print_exc()
        return 1
    return 0


def _main(arguments: Sequence[str]) -> None:
    request = json.loads(Path(arguments[0]).read_text())
    system, work = _asked(request)
    report = _execute(request, system, work)
    if process.ended_by_others():
        report = replace(report, outcomes=tuple(map(_asked_again, report.outcomes)))
    process.end_orphans()  # nothing that a tool or a subject left running outlives its answer
    _asked(request)  # tools read the plan's files by themselves, at any time until now
    write(Path(arguments[1]), json.dumps(report_to_json(report), default=str))


def _asked_again(outcome: Outcome) -> Outcome:
    """What is open after a tool was killed from outside is for the next run to ask again."""
    if outcome.verdict not in (Verdict.ERROR, Verdict.UNKNOWN):
        return outcome
    return replace(outcome, details={**outcome.details, RETRY: True})


def _asked(request: dict[str, Any]) -> tuple[System, Work]:
    """The work as the disk has it now. Raises Changed where that is not the work that was asked for: its answer would
    be recorded under a key that it does not answer."""
    try:
        system = load_system(Path(request["system"]))
        work = _work(request, system)
    except (Rejected, KeyError) as problem:
        raise Changed from problem
    if any(work.keys.get(name) != key for name, key in request["keys"].items()):
        raise Changed
    return system, work


def _work(request: dict[str, Any], system: System) -> Work:
    """Raises KeyError for a node or method that there is not any more."""
    match request["engine"]:
        case "sanity":
            return sanity_work(frame(system), system.contract.node(request["node"]))
        case "compose":
            return compose_work(compose(system))
        case _:
            node = system.contract.node(request["node"])
            for method in system.plan.node(node.name).methods:
                if method.id == request["method"]:
                    return method_work(system, node, method)
            raise KeyError(request["method"])


def _execute(request: dict[str, Any], system: System, work: Work) -> Report:
    limits = Limits(**request["limits"])
    claims = tuple(o for o in work.obligations if o.id in request["keys"])
    match request["engine"]:
        case "sanity":
            from avow.pipeline.engines import discharge_sanity

            return discharge_sanity(system, system.contract.node(work.node), claims, limits)
        case "compose":
            from avow.pipeline.engines import discharge_composition

            return discharge_composition(system, claims, limits)
        case _:
            return _discharge(request, system, work, limits)


def _discharge(request: dict[str, Any], system: System, work: Work, limits: Limits) -> Report:
    folder = Path(request["folder"])
    node = system.contract.node(work.node)
    method = planned_method(work)
    tool = method_backend(system, method)
    if request["altered"]:
        system = alter(system, node, Altered(**request["altered"]))
        node = system.contract.node(node.name)
        for name, text in tool.export(method_job(system, node, method)).items():
            write(folder / name, text)
    job = method_job(system, node, method)
    job = replace(job, obligations=tuple(o for o in job.obligations if o.id in request["keys"]))
    report = tool.discharge(job, folder, limits)
    return report if request["altered"] else remarked(report, tool.check(job), job)


if __name__ == "__main__":
    sys.exit(entry(sys.argv[1:]))
