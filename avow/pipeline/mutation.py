"""Hunting hollow evidence: would a method that supports a guarantee notice if the guarantee said something else?

For each guarantee that a method supports, near misses of it (`avow.logic.mutants`) are put in its place, and the
method is run on them. A mutant that the method does not support is *killed*. Evidence that no mutant disturbs supports
nothing: it is recorded as vacuous. The score is appended to the ledger with the evidence that it is about; methods that
a person's judgement guides (reviews, measurements) do not read the formula and have no score.
"""

from __future__ import annotations

import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from avow.evidence.obligation import Obligation
from avow.evidence.record import Evidence
from avow.pipeline import worker
from avow.pipeline.altered import Altered, chosen
from avow.pipeline.discharge import ledger_of
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work, method_backend, planned_method
from avow.verdict import Link
from avow.workspace import Workspace

_Task = tuple[Work, Obligation, Evidence]


@dataclass(frozen=True, slots=True)
class Score:
    """How many near misses of a guarantee a method noticed. `survivors` says what was changed in the others."""

    obligation: str
    method: str
    mutants: int
    survivors: tuple[str, ...]

    @property
    def killed(self) -> int:
        return self.mutants - len(self.survivors)

    @property
    def hollow(self) -> bool:
        """Not one of several mutants was noticed."""
        return self.mutants > 0 and self.killed == 0


def hunt(workspace: Workspace, works: tuple[Work, ...], run: Run, limit: int, jobs: int) -> tuple[Score, ...]:
    """Score every piece of current, supporting evidence of these works, `jobs` mutants at once."""
    tasks = [task for work in works if _reads_formulas(work) for task in _tasks(workspace, work)]
    with ThreadPoolExecutor(jobs) as pool:
        return tuple(pool.map(lambda task: _score(workspace, task, run, limit), tasks))


def _reads_formulas(work: Work) -> bool:
    if work.is_engine:
        return False
    method = planned_method(work)
    return method_backend(work.system, method).link is not Link.GUIDED


def _tasks(workspace: Workspace, work: Work) -> list[_Task]:
    ledger = ledger_of(workspace.ledger(work.system.name))
    found = []
    for obligation in work.obligations:
        records = [e.evidence for e in ledger.current(obligation.id, work.keys[obligation.id])]
        if records and records[-1].verdict.supports and not records[-1].vacuous:
            found.append((work, obligation, records[-1]))
    return found


def _score(workspace: Workspace, task: _Task, run: Run, limit: int) -> Score:
    work, obligation, record = task
    node = work.system.contract.node(work.node)
    mutants = chosen(node, node.clause(obligation.name), limit)
    survivors = []
    for number, mutant in enumerate(mutants):
        folder = Path(tempfile.mkdtemp(prefix="avow-mutant-"))
        try:
            report = worker.run(workspace, work, (obligation,), folder, Altered(obligation.name, number, limit))
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        if report.outcomes[0].verdict.supports and not report.outcomes[0].vacuous:
            survivors.append(mutant.change)
    score = Score(obligation.id, work.method, len(mutants), tuple(survivors))
    ledger_of(workspace.ledger(work.system.name)).append(_scored(record, score, run))
    return score


def _scored(record: Evidence, score: Score, run: Run) -> Evidence:
    details = {"killed": score.killed, "mutants": score.mutants, "survivors": list(score.survivors)}
    return replace(
        record,
        details={**record.details, "mutation": details},
        vacuous=score.hollow,
        summary=f"{record.summary}; but it accepts every mutant of the guarantee" if score.hollow else record.summary,
        started=datetime.now(UTC).isoformat(timespec="milliseconds"),
        run=run.id,
    )
