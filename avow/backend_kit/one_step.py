"""Calls a backend with the clauses that it understands. Clauses about other steps reach only a backend that declares
`Backend.remembers`, and only if it can express them (`Backend.unsaid`). Other guarantees are refused by name, and the
backend sees a contract without them.

An assumption about other steps applies to the whole node, so then none of its guarantees can be checked.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from avow.backend_kit.parameters import ALONE, jobs, missing, place, together
from avow.backend_kit.protocol import Backend, Job, Limits, Report, Translated
from avow.base.diagnostics import Diagnostic, Severity
from avow.base.verdict import Outcome, Verdict
from avow.formulas.temporal.cell import Unsaid
from avow.formulas.temporal.cells import Records
from avow.language.contract import Clause, Node
from avow.language.subterms import histories
from avow.language.terms import History
from avow.system.plan import System


def discharge(tool: Backend, job: Job, folder: Path, limits: Limits) -> Report:
    """`Backend.discharge`; a refused guarantee is `unknown`, with the reason."""
    each = jobs(tool, job)
    if not each:
        return Report.alike(job, Verdict.UNKNOWN, missing(tool, job), tool.name, tool.version)
    if ALONE in each:
        return _discharge(tool, each[ALONE], folder, limits)
    reports = {
        values: _discharge(tool, one, folder / place(k), limits) for k, (values, one) in enumerate(each.items(), 1)
    }
    first = next(iter(reports.values()))
    found = {o.id: {values: _of(report, o.id) for values, report in reports.items()} for o in job.every}
    observed = tuple(dict.fromkeys(seen for report in reports.values() for seen in report.observed))
    isolation = min((report.isolation for report in reports.values()), key=lambda level: level.rank)
    outcomes = tuple(together(some) for some in found.values())
    return replace(first, outcomes=outcomes, observed=observed, isolation=isolation)


def _of(report: Report, name: str) -> Outcome:
    """Its outcome for an obligation."""
    alone = [outcome for outcome in report.outcomes if outcome.obligation == name]
    return alone[0] if len(alone) == 1 else Outcome(name, Verdict.ERROR, f"{report.tool} gave {len(alone)} answers")


def _discharge(tool: Backend, job: Job, folder: Path, limits: Limits) -> Report:
    asked, refused = _sayable(tool, job)
    outcomes = tuple(Outcome(o.id, Verdict.UNKNOWN, refused[o.id]) for o in job.obligations if o.id in refused)
    if job.obligations and not asked.obligations:
        outcomes = (*outcomes, *(Outcome(c.id, Verdict.UNKNOWN, next(iter(refused.values()))) for c in job.claims))
        return Report(outcomes, tool.name, tool.version)
    report = tool.discharge(asked, folder, limits)
    return replace(report, outcomes=(*report.outcomes, *outcomes)) if outcomes else report


def export(tool: Backend, job: Job) -> Mapping[str, str]:
    """`Backend.export`, for the clauses that the backend can express; with several values of parameters, in a folder
    for each."""
    found: dict[str, str] = {}
    for k, (values, one) in enumerate(jobs(tool, job).items(), 1):
        asked, refused = _sayable(tool, one)
        files = {} if refused and not asked.obligations else tool.export(asked)
        found |= {f"{place(k)}/{name}" if values else name: text for name, text in files.items()}
    return found


def check(tool: Backend, job: Job) -> Iterator[Diagnostic]:
    """`Backend.check`, and a warning for each guarantee that is refused."""
    each = jobs(tool, job)
    if not each:
        yield Diagnostic("BACKEND009", missing(tool, job), job.method.options.span, Severity.WARNING)
        return
    job = next(iter(each.values()))
    asked, refused = _sayable(tool, job)
    for obligation in job.obligations:
        if obligation.id in refused:
            yield Diagnostic("BACKEND006", refused[obligation.id], job.clause(obligation).span, Severity.WARNING)
    if not refused or asked.obligations:
        yield from tool.check(asked)


def translate(tool: Backend, notation: str, system: System, node: Node) -> Translated:
    """`Backend.translate`, for the clauses that the backend can express. Raises Rejected if the input is at fault."""
    reasons = {clause.name: _refusal(tool, node, clause) for clause in node.guarantees}
    missing = tuple(
        Diagnostic("BACKEND006", why, node.clause(name).span, Severity.WARNING)
        for name, why in reasons.items()
        if why is not None
    )
    if missing and len(missing) == len(node.guarantees):
        return Translated({}, missing)
    system = _one_step(system) if missing and not tool.remembers else system
    others = tuple(c for c in node.guarantees if c.chance is None)
    if len(others) < len(node.guarantees):
        nodes = (replace(n, guarantees=others) if n.name == node.name else n for n in system.contract.nodes)
        system = replace(system, contract=replace(system.contract, nodes=tuple(nodes)))
    made = tool.translate(notation, system, system.contract.node(node.name) if missing else node)
    return replace(made, missing=(*made.missing, *missing))


def _sayable(tool: Backend, job: Job) -> tuple[Job, Mapping[str, str]]:
    """The job without the guarantees that the backend cannot express, and the reasons, by obligation."""
    own = tool.remembers and tool.answers_itself(job)
    why = _no_chance if own else _refusal
    reasons = {o.id: why(tool, job.node, job.clause(o)) for o in job.obligations}
    refused = {name: why for name, why in reasons.items() if why is not None}
    left = tuple(o for o in job.obligations if o.id not in refused)
    if tool.remembers or not any(histories(c.formula) for node in job.contract.nodes for c in node.clauses):
        return (replace(job, obligations=left) if refused else job), refused
    return replace(job, system=_one_step(job.system), node=_without(job.node), obligations=left), refused


def refusal(judge: str, node: Node, clause: Clause) -> str | None:
    """Why a method that judges single steps cannot check a guarantee; None if it can."""
    first = next(((c, found[0]) for c in (clause, *node.assumptions) if (found := histories(c.formula))), None)
    if first is None:
        return None
    where, record = first
    about = f"{node.name}.{clause.name}" if where is clause else f"{node.name}'s assumption {where.name}"
    return f"{judge} judges single steps and has no `{_shown(record)}`, of which {about} speaks"


def _no_chance(tool: Backend, node: Node, clause: Clause) -> str | None:
    """Why a method cannot check a guarantee with a probability; None if it can, or there is none."""
    if clause.chance is None or tool.chances:
        return None
    about = f"{node.name}.{clause.name}"
    return f"{tool.name} shows no probability, as {about} has it: recorded steps (experiment) or a model (storm) do"


def _refusal(tool: Backend, node: Node, clause: Clause) -> str | None:
    if why := _no_chance(tool, node, clause):
        return why
    return tool.unsaid(node, clause) if tool.remembers else refusal(tool.name, node, clause)


def _shown(record: History) -> str:
    return f"{record.operator}[…]" if record.limit is not None else str(record.operator)


def _one_step(system: System) -> System:
    return replace(system, contract=replace(system.contract, nodes=tuple(map(_without, system.contract.nodes))))


def _without(node: Node) -> Node:
    """The node's clauses that are about one step."""

    def kept(clauses: tuple[Clause, ...]) -> tuple[Clause, ...]:
        return tuple(clause for clause in clauses if not histories(clause.formula))

    return replace(node, assumptions=kept(node.assumptions), guarantees=kept(node.guarantees))


def unsaid(judge: str, node: Node, clause: Clause, *, functions: bool = False) -> str | None:
    """Why a method that judges runs by state variables (`avow.formulas.temporal`) cannot check a guarantee; None if it
    can. It cannot if the guarantee, or an assumption of the node, has no state variables, or has one for each value of
    a quantified variable (unless `functions` is set)."""
    for each in (clause, *node.assumptions):
        reason = _reason(each, functions)
        if reason is not None:
            about = f"{node.name}.{each.name}" if each is clause else f"{node.name}'s assumption {each.name}"
            return f"{judge} judges runs of steps and has no {reason}, of which {about} speaks"
    return None


def _reason(clause: Clause, functions: bool) -> str | None:
    for record in histories(clause.formula):
        if record.limit is not None and not record.limit.steps:
            return f"`{record.operator}` with a limit in seconds"
    records = Records()
    try:
        records.clause(clause.formula)
    except Unsaid as unsaid:
        return unsaid.reason
    for cell in records.cells:
        if cell.parameters and not functions:
            return f"record of each value of {cell.parameters[0].name}"
    return None
