"""The discharge stage: run what has no current evidence, and record every answer. The only stage that runs a tool."""

from __future__ import annotations

import contextlib
import functools
import os
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Any

from avow import __version__
from avow.backend_kit.protocol import Report
from avow.base.codec import canonical, to_json
from avow.base.files import digest_file, is_intact, sha256, write
from avow.base.tuning.bounds import CASES_KEPT
from avow.base.verdict import Isolation, Link, Object, Outcome, Verdict
from avow.base.workspace import Workspace
from avow.evidence.currency import outlived
from avow.evidence.ledger import Entry, ledger_of
from avow.evidence.obligation import Obligation
from avow.evidence.record import AGAINST, CASE, CONTRADICTS, ISOLATION, OBSERVED, RETRY, Evidence
from avow.pipeline import dispatch
from avow.pipeline.export import folder
from avow.pipeline.recheck import still_counts
from avow.pipeline.run_info import Run
from avow.pipeline.state import State
from avow.pipeline.work import LANGUAGE, Work

Intact = Callable[[str, str], bool]


def open_obligations(workspace: Workspace, work: Work, run: Run) -> tuple[Obligation, ...]:
    """The obligations without a current and intact record; in a fresh run, those without a record of this run. A method
    discharges all its obligations together, so that an answer does not depend on which others were open."""
    ledger = ledger_of(workspace.ledger(work.system.name))
    intact = functools.cache(lambda path, sha: is_intact(workspace.root / path, sha))
    with ledger.still():
        known = [
            (o, ledger.refutations(o.id, o.digest, work.engine), ledger.current(o.id, work.keys[o.id]))
            for o in work.obligations
        ]
        contradicted = {claim for *_, entries in known for claim in _contradicts(entries[-1:])}
        others = [o for claim in contradicted for o in work.others.get(claim, ())]
        unsaid = any(not ledger.current(o.id, work.key_of(o)) for o in others)
    if unsaid:  # the composition has got other conditions since
        return work.obligations
    found = tuple(o for o, refuted, entries in known if not _is_settled(workspace, work, refuted, entries, run, intact))
    return work.obligations if found and not work.is_engine else found


def _contradicts(entries: Sequence[Entry]) -> list[str]:
    return [claim for entry in entries for claim in entry.evidence.details.get(CONTRADICTS, ())]


def _is_settled(
    workspace: Workspace, work: Work, refuted: Sequence[Entry], entries: Sequence[Entry], run: Run, intact: Intact
) -> bool:
    found = [e for e in entries if not outlived(e, refuted)]
    records = [e.evidence for e in found if still_counts(e.evidence, workspace.root, work.system, run)]
    if not records or (run.fresh and records[-1].run != run.id):
        return False
    last = records[-1]
    if last.details.get(RETRY) and last.run != run.id:
        return False
    return all(intact(path, sha) for path, sha in last.outputs.items())


def prepare(state: State) -> None:
    """If jobs are open, fork the server of their processes now, while the run has one thread."""
    works = [w for s in state.surveyed for w in s.catalogue.works if w.engine != LANGUAGE]
    with contextlib.suppress(OSError):  # the stage reports it
        if any(open_obligations(state.workspace, work, state.run) for work in works):
            state.run.processes.prepare(state.workspace.root)


def discharge(workspace: Workspace, work: Work, run: Run) -> tuple[Outcome, ...]:
    """Discharge what is open, append the evidence, and report the result."""
    todo = open_obligations(workspace, work, run)
    if not todo:
        return ()
    place = folder(workspace, work)
    place.mkdir(parents=True, exist_ok=True)
    started = datetime.now(UTC).isoformat(timespec="milliseconds")
    clock = time.monotonic()
    report = (
        _language(todo)
        if work.engine == LANGUAGE
        else dispatch.settle(workspace, work, todo, place, run, kept=_kept(workspace, work, todo))
    )
    seconds = time.monotonic() - clock
    outputs = _keep_logs(workspace, work, todo, report)
    tool = work.planned[0] if work.planned is not None else None
    promised = (tool.strength, tool.link, tool.of) if tool else (Verdict.PROVED, Link.GENERATED, Object.MODEL)
    strength, link, of = promised
    inputs = _inputs(workspace, work)
    by_id = {o.id: o for o in todo}
    contradicts = {CONTRADICTS: [o.obligation for o in report.contradicted]} if report.contradicted else {}
    answers = [(by_id[outcome.obligation], outcome, False) for outcome in report.outcomes]
    answers += [(o, each, True) for each in report.contradicted for o in work.others.get(each.obligation, ())]
    records = []
    for obligation, outcome, beside in answers:
        said = {AGAINST: work.name} if beside else contradicts
        records.append(
            Evidence(
                obligation=obligation.id,
                obligation_digest=obligation.digest,
                key=work.key_of(obligation) if beside else work.keys[obligation.id],
                method=work.name if beside else work.method,
                backend=work.engine,
                tool=report.tool,
                tool_version=report.tool_version,
                command=report.command,
                verdict=outcome.verdict,
                strength=strength,
                link=outcome.link or link,
                summary=outcome.summary,
                started=started,
                seconds=round(seconds, 3),
                inputs=inputs,
                outputs=outputs,
                counterexample=outcome.counterexample,
                hypotheses=outcome.hypotheses,
                bound=outcome.bound,
                details={**outcome.details, **said, **_circumstances(workspace, report)},
                vacuous=outcome.vacuous,
                run=run.id,
                rests_on=outcome.rests_on,
                of=outcome.of or of,
                numbers=outcome.numbers,
            )
        )
    ledger_of(workspace.ledger(work.system.name)).append_all(records)
    return report.outcomes


def _kept(workspace: Workspace, work: Work, obligations: tuple[Obligation, ...]) -> dict[str, tuple[Any, ...]]:
    """Obligation → the cases that refuted it once, newest first, for any program and options."""
    ledger, found = ledger_of(workspace.ledger(work.system.name)), dict[str, tuple[Any, ...]]()
    for o in obligations:
        cases = [e.evidence.details[CASE] for e in reversed(ledger.refutations(o.id, o.digest, work.engine))]
        if cases:
            found[o.id] = tuple({canonical(case): case for case in cases}.values())[:CASES_KEPT]
    return found


def _circumstances(workspace: Workspace, report: Report) -> dict[str, object]:
    """What the program under test read, with paths relative to the workspace where they lie within, and how it was
    isolated."""
    root = str(workspace.root.resolve()) + os.sep
    seen = to_json(tuple(o._replace(path=o.path.removeprefix(root)) for o in report.observed))
    if report.isolation is Isolation.NONE:
        return {OBSERVED: seen} if seen else {}
    return {ISOLATION: report.isolation.value, OBSERVED: seen}


def _language(obligations: tuple[Obligation, ...]) -> Report:
    outcomes = tuple(Outcome(o.id, Verdict.PROVED, "parsed and type-checked") for o in obligations)
    return Report(outcomes, "avow", __version__)


def _inputs(workspace: Workspace, work: Work) -> dict[str, str]:
    """The files written by a person that the answer rests on. The contract itself enters by the obligation's digest."""
    if work.planned is None:
        return {}
    tool, job = work.planned
    files = tool.files(job)
    return {workspace.relative(path): digest_file(path) for path in files if path.is_file()}


def _keep_logs(workspace: Workspace, work: Work, todo: tuple[Obligation, ...], report: Report) -> dict[str, str]:
    """Logs have a name of their own for every attempt, so that later attempts leave older evidence intact."""
    if not report.logs:
        return {}
    stamp = sha256("".join(sorted(work.keys[o.id] for o in todo)) + "".join(report.logs.values()))[:12]
    kept = {}
    for name, text in report.logs.items():
        path = folder(workspace, work) / "logs" / stamp / name.replace("/", "_")
        write(path, text)
        kept[workspace.relative(path)] = sha256(text)
    return kept
