"""A job in a process of its own: ``python -m avow.pipeline.worker FOLDER``, or a fork that does the same
(`avow.pipeline.processes`).

A solver that crashes, exhausts the memory or never returns ends only this process, and the pipeline records that as a
verdict. Two workers use two cores despite Python's global lock.
"""

from __future__ import annotations

import json
import platform
import sys
import tempfile
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from avow.backend_kit import one_step
from avow.backend_kit.protocol import Job, Limits, Report
from avow.backend_kit.registry import trust_plugins
from avow.base import process
from avow.base.codec import from_json, to_json
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.verdict import Outcome, Verdict
from avow.calculus import providers
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.entailment import keeping
from avow.calculus.obligations import settle_each
from avow.evidence.obligation import Obligation
from avow.evidence.record import REMARKS, RETRY
from avow.pipeline import recheck
from avow.pipeline.blobs import Garbled, decode
from avow.pipeline.dispatch import ANSWERS, CHANGED, read_answers, write_answers
from avow.pipeline.methods import tool_identities
from avow.pipeline.requests import (
    Request,
    Response,
    Tools,
    lay_out,
    read_request,
    request_digest,
    response_bytes,
)
from avow.pipeline.slices import ComposeSlice, MethodSlice, SanitySlice, Slice
from avow.pipeline.work import COMPOSE, SANITY, Work, compose_work, method_work, sanity_claims
from avow.sanity import results
from avow.sanity.analysis import outcomes
from avow.solving.checking import z3_version
from avow.solving.limits import effort_told, from_seconds


class Refused(Exception):  # noqa: N818 - it names what happened
    """The request does not match its keys; the text says why."""


def entry(place: Path) -> int:
    """Execute the job whose request lies in the folder, and write its response there; the process' exit code."""
    process.adopt_orphans()
    trust_plugins()
    try:
        (place / "response").write_bytes(answer((place / "request").read_bytes()))
    except Exception:
        traceback.print_exc()
        return 1
    return 0


def answer(asked: bytes) -> bytes:
    """Execute the job in this process. Raises whatever an engine raises."""
    request, digest = read_request(asked), request_digest(asked)
    with tempfile.TemporaryDirectory(prefix="avow-work-") as place:
        root = Path(request.root) if request.root else Path(place, request.home)
        try:
            lay_out(request.files, root)
            report = _execute(request, root)
        except Refused as refused:
            return response_bytes(Response(digest, failure=str(refused), worker=platform.node()))
        if process.ended_by_others() or request.limits.asked:
            report = replace(report, outcomes=tuple(map(_asked_again, report.outcomes)))
        process.end_orphans()  # no process of a tool or program under test outlives the answer
        told = json.dumps(to_json(report), default=str).replace(f"{place}/", "")
    report = from_json(Report, json.loads(told))
    return response_bytes(Response(digest, report, worker=platform.node()))


def _asked_again(outcome: Outcome) -> Outcome:
    """An answer left open by a kill from outside, or by this run's own time limit, is for the next run."""
    if outcome.verdict not in (Verdict.ERROR, Verdict.UNKNOWN):
        return outcome
    return replace(outcome, details={**outcome.details, RETRY: True})


def _execute(request: Request, root: Path) -> Report:
    """Raises Refused."""
    try:
        cut = decode(request.cut, root)
    except Garbled as error:
        raise Refused(f"the work came garbled: {error}") from error
    match cut:
        case SanitySlice() if request.engine == SANITY:
            claims = _claims(request, sanity_claims(cut)[0], keys_of(cut))
            return discharge_sanity(cut, claims, request.limits)
        case ComposeSlice() if request.engine == COMPOSE:
            composition = compose(cut.system)
            work = compose_work(composition)
            claims = _claims(request, work.obligations, work.keys)
            answers = read_answers(request.earlier)
            with keeping(answers):
                bounds = Bounds(from_seconds(request.limits.seconds), request.limits.seed)
                outcomes = tuple(settle_each(composition, claims, bounds))
            kept = {recheck.FILE: recheck.written(composition.certificates)} if composition.certificates.made else {}
            kept |= {ANSWERS: write_answers(answers)} if answers.now else {}
            return Report(outcomes, "z3", z3_version(), logs=kept)
        case MethodSlice():
            return _discharge(request, cut)
        case _:
            raise Refused("the work came with another engine's slice")


def keys_of(cut: Slice) -> Mapping[str, str]:
    """Obligation → the key that a slice gives it. Raises Refused for a slice that lacks its subject."""
    try:
        match cut:
            case SanitySlice(linked=linked):
                if not all(asked.is_whole for asked in linked):
                    raise Refused("what came is not what its digest is of")
                return sanity_claims(cut)[1]
            case ComposeSlice(system=system):
                return compose_work(compose(system)).keys
            case MethodSlice():
                return _method_work(cut).keys
    except (KeyError, Rejected) as error:
        raise Refused(f"what came is not what its keys are of: {error}") from error


def _method_work(cut: MethodSlice) -> Work:
    planned = [m for m in cut.system.plan.node(cut.node).methods if m.id == cut.method]
    if not planned:
        raise Refused("the work came without its method")
    return method_work(cut.system, cut.system.contract.node(cut.node), planned[0], cut=cut)


def _shown(tools: Tools) -> str:
    return ", ".join(f"{name} {version or 'missing'}" for name, version, *_ in tools) or "none"


def _claims(request: Request, obligations: Sequence[Obligation], keys: Mapping[str, str]) -> tuple[Obligation, ...]:
    """The requested obligations. Raises Refused if a key does not match the slice: the answer would be recorded under a
    wrong key."""
    if any(keys.get(name) != key for name, key in request.keys.items()):
        raise Refused(CHANGED if request.root else "what came is not what its keys are of")
    return tuple(o for o in obligations if o.id in request.keys)


def _discharge(request: Request, cut: MethodSlice) -> Report:
    work = _method_work(cut)
    assert work.planned is not None
    tool, job = work.planned
    here = tool_identities(tool)
    if here != request.tools:
        raise Refused(f"the tools are not those of the key: {_shown(here)} here, {_shown(request.tools)} wanted")
    claims = _claims(request, work.obligations, work.keys)
    wanted = {o.id for o in claims}
    job = replace(
        job,
        obligations=tuple(o for o in job.obligations if o.id in wanted),
        claims=tuple(o for o in job.claims if o.id in wanted),
        kept=request.kept,
    )
    report = one_step.discharge(tool, job, Path(request.folder), request.limits)
    if request.root:  # tools read the plan's files themselves, at any time until now
        again = _method_work(cut)
        _claims(request, again.obligations, again.keys)
    return remarked(report, one_step.check(tool, job), job)


def discharge_sanity(cut: SanitySlice, obligations: Sequence[Obligation], limits: Limits) -> Report:
    """Discharge sanity claims of one node by the solver."""
    bounds = results.Bounds(seed=limits.seed)
    if limits.asked:
        bounds = replace(bounds, effort=from_seconds(limits.seconds))
    linked = {asked.claim.name: asked for asked in cut.linked}
    own = {o.id: o.name for o in obligations if o.name not in linked}
    found = outcomes(cut.node, own, scenario=cut.given, bounds=bounds)
    found += providers.outcomes(cut.node, {o.id: linked[o.name] for o in obligations if o.name in linked}, bounds)
    found = tuple(replace(o, details={**o.details, **effort_told(bounds.effort)}) for o in found)
    return Report(found, "z3", z3_version())


def remarked(report: Report, found: Iterable[Diagnostic], job: Job) -> Report:
    """The report with the warnings among `found`, but for those that the plan switches off: an assessor reads a
    method's remarks on plan and files beside its answers."""
    told = [
        {"code": d.code, "place": _place(d.span, job.root), "message": d.message}
        for d in dict.fromkeys(found)
        if d.severity is Severity.WARNING and d.code not in job.system.plan.lints_off
    ]
    if not told:
        return report
    return replace(report, outcomes=tuple(replace(o, details={**o.details, REMARKS: told}) for o in report.outcomes))


def _place(span: Span | None, root: Path) -> str:
    """``models/p.imp:2``: the same on any machine; empty for an option, whose place in the plan a job does not know."""
    if span is None or not span.file:
        return ""
    path = Path(span.file)
    return f"{path.relative_to(root).as_posix() if path.is_relative_to(root) else path.name}:{span.line}"


if __name__ == "__main__":
    process.guard(tied=True)
    sys.exit(entry(Path(sys.argv[1])))
