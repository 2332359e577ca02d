"""Finds non-discriminating evidence: would a method that supports a guarantee detect a changed guarantee?

For each guarantee that a method supports, mutants (`avow.sanity.mutants`) replace it, and the method is run on them. A
mutant that it refutes is *killed*, and so is one that a prover, run in the same way, no longer proves. A mutant that
could not be judged (no row of a table matches it, its trigger was not met, the tool failed) is neither killed nor a
survivor. Evidence that no judged mutant changes supports nothing: it is recorded as vacuous. The score is appended to
the ledger with its evidence; methods that rest on a person's judgement (reviews, measurements) do not read the formula
and have no score. Each survivor is reported with an input and answer at which it differs from the contract
(`avow.sanity.mutants`).
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from avow.base.diagnostics import Rejected
from avow.base.files import write
from avow.base.verdict import Link, Outcome, Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of
from avow.evidence.obligation import Kind, Obligation
from avow.evidence.record import RETRY, Evidence
from avow.pipeline import dispatch
from avow.pipeline.export import generated
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work, method_work
from avow.sanity.mutants import Difference, Mutant, difference, telling

_Task = tuple[Work, Obligation, Evidence]


@dataclass(frozen=True, slots=True)
class Score:
    """How many mutants of a guarantee a method killed. `survivors` and `unjudged` name the change of the others."""

    obligation: str
    method: str
    killed: int
    survivors: tuple[str, ...]
    unjudged: tuple[str, ...]
    differences: tuple[Difference, ...] = ()
    """For each survivor, in their order."""
    reasons: tuple[str, ...] = ()
    """For each mutant that was not judged, in their order, what the method said."""
    mapped: bool = False
    """Whether the method reads a person's table in place of the formula."""

    def blind(self, difference: Difference) -> str:
        """The mutants that the method did not detect, and an input that shows the difference."""
        table = (
            ", or what the plan gives it (a table, instances, a property for a ban) leaves that out"
            if self.mapped
            else ""
        )
        if difference.forced:
            return f"`{self.method}` has not looked there{table}; it would notice, given such a case"
        if not difference.answer:
            return f"nothing that `{self.method}` looks at tells it from the guarantee{table}"
        return f"`{self.method}` met no such answer{table}; a program that never gives it does more than it must"

    @property
    def mutants(self) -> int:
        """How many were judged."""
        return self.killed + len(self.survivors)

    @property
    def hollow(self) -> bool:
        """Mutants were judged, and none was killed."""
        return self.mutants > 0 and self.killed == 0


def hunt(workspace: Workspace, works: tuple[Work, ...], run: Run, limit: int, jobs: int) -> Iterator[Score]:
    """Score every piece of current, supporting evidence of these jobs, `jobs` mutants at once; yields each score in
    order as soon as it is known."""
    tasks = [task for work in works if _reads_formulas(work) for task in _tasks(workspace, work)]
    run.processes.prepare(workspace.root)  # needs a single thread
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(lambda task: _score(workspace, task, run, limit), tasks)


def _reads_formulas(work: Work) -> bool:
    return work.planned is not None and work.planned[0].link is not Link.GUIDED


def _tasks(workspace: Workspace, work: Work) -> list[_Task]:
    ledger = ledger_of(workspace.ledger(work.system.name))
    found = []
    for obligation in (o for o in work.obligations if o.kind is Kind.GUARANTEE):
        records = [e.evidence for e in ledger.current(obligation.id, work.keys[obligation.id])]
        likely = work.system.contract.node(work.node).clause(obligation.name).chance is not None
        if records and records[-1].verdict.supports and not records[-1].vacuous and not likely:
            found.append((work, obligation, records[-1]))
    return found


def _score(workspace: Workspace, task: _Task, run: Run, limit: int) -> Score:
    work, obligation, record = task
    node = work.system.contract.node(work.node)
    clause = node.clause(obligation.name)
    others = tuple(g.formula for g in node.guarantees if g.name != clause.name)
    mutants = telling(clause.formula, tuple(a.formula for a in node.assumptions), limit, others=others)
    killed, survivors, unjudged = 0, list[Mutant](), list[tuple[str, str]]()
    for mutant in mutants:
        changed = _with_mutant(work, clause.name, mutant)
        folder = Path(tempfile.mkdtemp(prefix="avow-mutant-"))
        try:
            with contextlib.suppress(Rejected):  # without its files the method reports the fault
                for name, text in generated(changed).items():
                    write(folder / name, text)
            report = dispatch.settle(workspace, changed, (obligation,), folder, run)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        match _noticed(report.outcomes[0], record):
            case True:
                killed += 1
            case False:
                survivors.append(mutant)
            case None:
                unjudged.append((mutant.change, report.outcomes[0].summary))
    score = Score(
        obligation.id,
        work.method,
        killed,
        tuple(mutant.change for mutant in survivors),
        tuple(change for change, _ in unjudged),
        tuple(difference(node, mutant) for mutant in survivors),
        tuple(reason for _, reason in unjudged),
        record.link is Link.MAPPED,
    )
    ledger_of(workspace.ledger(work.system.name)).append(_scored(record, score, run))
    return score


def _with_mutant(work: Work, name: str, mutant: Mutant) -> Work:
    """The job for the system with the mutant in place of a guarantee."""
    assert work.planned is not None
    job, contract = work.planned[1], work.system.contract
    guarantees = tuple(replace(c, formula=mutant.formula) if c.name == name else c for c in job.node.guarantees)
    node = replace(job.node, guarantees=guarantees)
    nodes = tuple(node if n.name == node.name else n for n in contract.nodes)
    system = replace(work.system, contract=replace(contract, nodes=nodes))
    return replace(method_work(system, node, job.method), limits=work.limits, texts=work.texts)


def _noticed(outcome: Outcome, record: Evidence) -> bool | None:
    """Whether the method killed a mutant; None if it did not judge it."""
    if outcome.verdict is Verdict.REFUTED:
        return True
    if outcome.verdict.supports:
        return None if outcome.vacuous else False
    # a prover need not refute: it proved the guarantee, and does not prove the mutant
    is_prover = record.verdict is Verdict.PROVED and record.strength is Verdict.PROVED
    return True if is_prover and outcome.verdict is Verdict.UNKNOWN and not outcome.details.get(RETRY) else None


def _scored(record: Evidence, score: Score, run: Run) -> Evidence:
    details: dict[str, object] = {"killed": score.killed, "mutants": score.mutants, "survivors": list(score.survivors)}
    if score.differences:
        details["differences"] = [
            {
                "change": d.change,
                "mutant": d.formula,
                "at": [list(pair) for pair in d.at],
                "answer": [list(pair) for pair in d.answer],
                "forced": d.forced,
                "why": f"{d.why}; {score.blind(d)}",
            }
            for d in score.differences
        ]
    if score.unjudged:
        details["unjudged"] = list(score.unjudged)
        details["unjudged_because"] = list(score.reasons)
    return replace(
        record,
        details={**record.details, "mutation": details},
        vacuous=score.hollow,
        summary=f"{record.summary}; but it accepts every mutant of the guarantee" if score.hollow else record.summary,
        started=datetime.now(UTC).isoformat(timespec="milliseconds"),
        run=run.id,
    )
