"""The stages as doit tasks, one for each system, node and method.

The keys in the ledger and the digests of files on disk decide whether a task is up to date, never time stamps or doit's
own memory. So an interrupted run loses only the attempts in flight, and a run with nothing to do does nothing.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from doit.exceptions import TaskError

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.workspace import Workspace
from avow.evidence.heads import index_path, read_index
from avow.evidence.ledger import ledger_of, readable
from avow.pipeline import check as checking
from avow.pipeline import export as exporting
from avow.pipeline.assess import certify, gate, report
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.node_index import INDEX
from avow.pipeline.plan_check import not_verified
from avow.pipeline.state import State, task_name
from avow.pipeline.work import LANGUAGE, Work
from avow.pipeline.workload import Survey, survey, write_obligations

Task = dict[str, Any]

STAGES = {
    "check": ("read contracts and plans, and report what is wrong in them", "read contract and plan of {0}"),
    "sanity": ("check that contracts are worth verifying", "check that the contract of {1} is worth verifying"),
    "compose": (
        "derive properties of systems from their nodes' contracts, and discharge the side conditions",
        "derive properties of {0} from its nodes' contracts, and discharge the side conditions",
    ),
    "obligations": ("write the list of proof obligations", "write the list of proof obligations of {0}"),
    "export": ("generate each method's files from the contract", "generate the files of method {2} for {1}"),
    "discharge": ("run each method and record the evidence", "run method {2} on {1} and record the evidence"),
    "certify": ("have the kernel check the calculus' proofs", "have the kernel check the proofs about {0}"),
    "report": ("render the reports from the ledger; no tool runs", "render the reports of {0} from the ledger"),
    "verify": ("run all stages, then check the policy's gates", "run all stages for {0}, then check the gates"),
}
"""The descriptions that `doit list --all` shows for a stage and for a task (system, node, method)."""

_OF_A_SYSTEM = ("check", "obligations", "certify", "report", "verify")
"""The stages with one task for each system."""


def stages(state: State) -> Iterator[Task]:
    """All tasks for all systems of a workspace."""
    state.read = True
    for task in _tasks(state):
        parts = (*str(task["name"]).split(":"), "", "")
        yield {"doc": STAGES[task["basename"]][1].format(*parts), **task}


def _tasks(state: State) -> Iterator[Task]:
    for stage, (doc, _) in STAGES.items():
        yield {"basename": stage, "name": None, "doc": doc}
    found = {
        folder: _with_ledger(state, survey(folder, state.run.offered, state.run.fresh))
        for folder in state.workspace.systems()
    }
    folders: dict[str, list[Path]] = {}
    for folder, surveyed in found.items():
        folders.setdefault(folder.name if isinstance(surveyed, Rejected) else surveyed.system.name, []).append(folder)
    for name, same in folders.items():
        surveyed = found[same[0]]
        if len(same) > 1:
            yield from _rejected(name, _mixed_up(name, same))
        elif isinstance(surveyed, Rejected):
            yield from _rejected(name, surveyed)
        else:
            yield from _system(state, surveyed)
            called = task_name(same[0].name)
            for stage in _OF_A_SYSTEM if called not in map(task_name, folders) else ():  # by its folder, too
                yield {"basename": stage, "name": called, "actions": None, "task_dep": [f"{stage}:{name}"]}
    systems = [surveyed.system for surveyed in found.values() if not isinstance(surveyed, Rejected)]
    taken_in = {path.resolve() for system in systems for path in system.plan.included}
    for path in state.workspace.stray_plans() if len(systems) == len(found) else ():
        if path.resolve() not in taken_in:  # a system that cannot be read may include it
            name = path.parent.relative_to(state.workspace.root).as_posix()
            yield from _rejected(name, Rejected(not_verified(path)))


def _mixed_up(name: str, folders: Sequence[Path]) -> Rejected:
    """Two systems of one name, or a link to a system's folder."""
    plans = [Span(str(folder / "plan.yaml"), 1, 1, 1, 1) for folder in folders]
    others = tuple(("here, too", place) for place in plans[1:])
    return Rejected(Diagnostic("CLI020", f"{len(folders)} folders hold a system '{name}'", plans[0], notes=others))


def _with_ledger(state: State, surveyed: Survey | Rejected) -> Survey | Rejected:
    """The system, if its ledger can be read or does not exist yet."""
    if isinstance(surveyed, Rejected):
        return surveyed
    path = state.workspace.ledger(surveyed.system.name)
    try:
        with readable(path):
            if state.run.fresh:
                ledger_of(path).check()
            ledger_of(path).records()
            read_index(index_path(path.parent))
    except Rejected as rejected:
        return rejected
    return surveyed


def _rejected(name: str, rejected: Rejected) -> Iterator[Task]:
    """A system that cannot be read: its stages say so, the other systems go on."""
    for stage in STAGES:
        action = (
            partial(checking.refuse, rejected)
            if stage in ("check", "report", "verify")
            else partial(checking.refuse_quietly, name)
        )
        told = f"report why {name} cannot be read"
        yield {"basename": stage, "name": task_name(name), "doc": told, "actions": [action], "uptodate": [False]}


def _system(state: State, surveyed: Survey) -> Iterator[Task]:
    name, workspace = surveyed.system.name, state.workspace
    check, language = f"check:{name}", surveyed.work(LANGUAGE)
    done = []
    yield {
        "basename": "check",
        "name": name,
        "actions": [partial(_act, partial(checking.check, workspace, surveyed)), _discharge(state, language)],
        "uptodate": [partial(checking.is_current, workspace, surveyed), _settled(state, language)],
    }
    for work in surveyed.catalogue.works:
        match work.engine:
            case "language":
                continue
            case "sanity":
                basename, title = "sanity", f"{name}:{work.node}"
            case "compose":
                basename, title = "compose", name
            case _:  # the method of a backend
                basename, title = "discharge", f"{name}:{work.node}:{work.method}"
                key = exporting.key(work)
                yield {
                    "basename": "export",
                    "name": title,
                    "actions": [partial(_act, partial(exporting.export, workspace, work, key))],
                    "task_dep": [check],
                    "uptodate": [partial(exporting.is_current, workspace, work, key)],
                    "clean": [partial(exporting.clean, workspace, work)],
                }
        yield {
            "basename": basename,
            "name": title,
            "actions": [_discharge(state, work)],
            "task_dep": [f"export:{title}"] if basename == "discharge" else [check],
            "uptodate": [_settled(state, work)],
        }
        done.append(f"{basename}:{title}")
    yield {
        "basename": "obligations",
        "name": name,
        "actions": [partial(_act, partial(write_obligations, workspace, surveyed))],
        "task_dep": [check],
        "uptodate": [partial(write_obligations, workspace, surveyed, dry=True)],
    }
    state.surveyed.append(surveyed)
    clean = [partial(_clean_reports, workspace, name)]
    # `report` renders the ledger as it is and runs no tool; `verify` renders once all evidence is in. Like `certify`,
    # whose answer is of this run, they are done in every run that finds something to do.
    for basename, needed, action in (
        ("report", [check], partial(_act, partial(report, state, surveyed))),
        ("certify", [*done, f"obligations:{name}"], partial(_act, partial(certify, state, surveyed))),
        ("verify", [f"certify:{name}"], partial(gate, state, surveyed)),
    ):
        yield {
            "basename": basename,
            "name": name,
            "actions": [action],
            "task_dep": needed,
            "uptodate": [False],
            "clean": clean if basename != "certify" else [],
        }


def _clean_reports(workspace: Workspace, name: str, dryrun: bool) -> None:
    place = workspace.report(name)
    print(
        f"{workspace.relative(place)}: removed; the ledger and what it refers to stay, `doit report` renders it again"
    )
    if not dryrun:
        shutil.rmtree(place, ignore_errors=True)
        for page in (workspace.artifacts / name).glob(f"*/{INDEX}"):
            page.unlink()


def _discharge(state: State, work: Work) -> Callable[[], TaskError | bool]:
    return partial(_act, partial(discharge, state.workspace, work, state.run))


def _settled(state: State, work: Work) -> Callable[[], bool]:
    """Whether every obligation has current evidence."""
    return lambda: not open_obligations(state.workspace, work, state.run)


def _act(action: Callable[[], object]) -> TaskError | bool:
    """Bad input and an internal error become a failed task with a message; doit ignores what a stage returns."""
    try:
        action()
    except Rejected as rejected:
        return checking.refuse(rejected)
    except OSError as error:
        return TaskError(f"{type(error).__name__}: {error}")
    return True
