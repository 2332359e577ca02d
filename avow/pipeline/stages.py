"""The stages as doit tasks, one for each system, node and method.

Whether a task is up to date is decided by the content that it depends on, never by time stamps or by doit's own
memory: by the keys in the ledger, and by the digests of what stands on disk. So an interrupted run loses only the
attempts in flight, and a run with nothing to do does nothing.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from doit.exceptions import TaskError

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.workspace import Workspace
from avow.evidence.heads import index_path, read_index
from avow.evidence.ledger import ledger_of, readable
from avow.pipeline import check as checking
from avow.pipeline import export as exporting
from avow.pipeline.assess import Assessment, certify, gate, report
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.state import State, task_name
from avow.pipeline.work import LANGUAGE, Work
from avow.pipeline.workload import Survey, survey, write_obligations

Task = dict[str, Any]

STAGES = {
    "check": "parse and check the contract and the plan",
    "sanity": "is each node's contract worth verifying?",
    "compose": "derive system-level properties and prove their side conditions",
    "obligations": "write every proof obligation",
    "export": "generate each method's input from the contract",
    "discharge": "run each method's tool and record the evidence",
    "certify": "the kernel establishes again what the calculus proved",
    "report": "render the assurance reports from the ledger",
    "verify": "everything, and the policy's gates",
}

_OF_A_SYSTEM = ("check", "obligations", "certify", "report", "verify")
"""Those of which each system has one task."""


def stages(state: State) -> Iterator[Task]:
    """All tasks for all systems of a workspace."""
    state.read = True
    for stage, doc in STAGES.items():
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
        if path.resolve() not in taken_in:  # where a system cannot be read, it may be the one that takes it in
            name = path.parent.relative_to(state.workspace.root).as_posix()
            yield from _rejected(name, Rejected(checking.not_verified(path)))


def _mixed_up(name: str, folders: Sequence[Path]) -> Rejected:
    """Two systems of one name, or a link to a system's folder."""
    plans = [Span(str(folder / "plan.yaml"), 1, 1, 1, 1) for folder in folders]
    others = tuple(("here, too", place) for place in plans[1:])
    return Rejected(Diagnostic("CLI020", f"{len(folders)} folders hold a system '{name}'", plans[0], notes=others))


def _with_ledger(state: State, surveyed: Survey | Rejected) -> Survey | Rejected:
    """The system, if its ledger is a file that can be read or is to begin."""
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
        yield {"basename": stage, "name": task_name(name), "actions": [action], "uptodate": [False]}


def _system(state: State, surveyed: Survey) -> Iterator[Task]:
    name, workspace, plan = surveyed.system.name, state.workspace, surveyed.system.plan
    shown = cache(workspace.relative)  # most tasks name the same few files
    texts = map(shown, (plan.path, *plan.contract_files, *plan.included))
    said, ledger = _Said(shown, tuple(texts)), (workspace.ledger(name),)
    check = f"check:{name}"
    done = []
    yield {
        "basename": "check",
        "name": name,
        "actions": [
            partial(_act, partial(checking.check, workspace, surveyed)),
            _discharge(state, surveyed.work(LANGUAGE)),
        ],
        "uptodate": [
            _Asked("the check is of contract and plan as they are", partial(checking.is_current, workspace, surveyed)),
            _settled(state, surveyed.work(LANGUAGE)),
        ],
        **said((), (workspace.artifacts / name / "check.json",)),
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
                    "actions": [partial(_act, partial(exporting.export, workspace, work, key, state.run.beside))],
                    "task_dep": [check],
                    "uptodate": [
                        _Asked(
                            "the files are what the slice gives", partial(exporting.is_current, workspace, work, key)
                        )
                    ],
                    "clean": [_Cleaned("what was generated", partial(exporting.clean, workspace, work))],
                    **said(work.files, (exporting.folder(workspace, work),)),
                }
        yield {
            "basename": basename,
            "name": title,
            "actions": [_discharge(state, work)],
            "task_dep": [f"export:{title}"] if basename == "discharge" else [check],
            "uptodate": [_settled(state, work)],
            "clean": [_Cleaned("nothing", partial(_clean_nothing, title))],
            **said(work.files, ledger),
        }
        done.append(f"{basename}:{title}")
    yield {
        "basename": "obligations",
        "name": name,
        "actions": [partial(_act, partial(write_obligations, workspace, surveyed))],
        "task_dep": [check],
        "uptodate": [
            _Asked("every obligation is listed", partial(write_obligations, workspace, surveyed, dry=True)),
        ],
        **said((), (workspace.artifacts / name / "obligations.json",)),
    }
    reports = workspace.report(name)
    assessment = Assessment(state, surveyed)
    state.assessments.append(assessment)
    yield {
        "basename": "report",
        "name": name,
        "actions": [partial(_act, partial(report, assessment))],
        "task_dep": [check],
        # of the ledger as it stands: `doit report` runs no tool; `verify` renders once all evidence is in
        "uptodate": [_NEVER],
        "clean": [_Cleaned("its reports", partial(_clean_reports, workspace, name))],
        **said(ledger, (reports,)),
    }
    yield {
        "basename": "certify",
        "name": name,
        "actions": [partial(_act, partial(certify, assessment))],
        "task_dep": [*done, f"obligations:{name}"],
        # whoever asks is told what was established in this run, not in an earlier one
        "uptodate": [_NEVER],
        **said(ledger, ()),
    }
    yield {
        "basename": "verify",
        "name": name,
        "doc": surveyed.system.plan.title,
        "actions": [partial(gate, assessment)],
        "task_dep": [f"certify:{name}"],
        "uptodate": [_NEVER],
        "clean": [_Cleaned("its reports", partial(_clean_reports, workspace, name))],
        **said(ledger, (reports,)),
    }


@dataclass(frozen=True, slots=True)
class _Asked:
    """Is it up to date? With words for `doit info`."""

    words: str
    ask: Callable[[], bool]

    def __call__(self) -> bool:
        return self.ask()

    def __repr__(self) -> str:
        return self.words


_NEVER = _Asked("it is done in every run that finds something to do", lambda: False)


@dataclass(frozen=True, slots=True)
class _Cleaned:
    """What `doit clean` does, with words for its line."""

    words: str
    act: Callable[[bool], None]

    def __call__(self, dryrun: bool) -> None:
        self.act(dryrun)

    def __repr__(self) -> str:
        return f" {self.words}"  # doit leaves out the first character


def _clean_nothing(title: str, dryrun: bool) -> None:
    print(f"{title}: evidence is appended to the ledger and never removed")


@dataclass(frozen=True, slots=True)
class _Said:
    """For `doit info`: inputs and targets. What is up to date is decided by content, not by these."""

    shown: Callable[[Path], str]
    """The path, relative to the workspace."""
    texts: Sequence[str]
    """Of contract and plan."""

    def __call__(self, inputs: Iterable[Path], targets: Iterable[Path]) -> dict[str, Any]:
        more, made = ([self.shown(path) for path in paths] for paths in (inputs, targets))
        return {"meta": {"inputs": [*self.texts, *more], "targets": made}}


def _clean_reports(workspace: Workspace, name: str, dryrun: bool) -> None:
    place = workspace.report(name)
    print(
        f"{workspace.relative(place)}: removed; the ledger and what it refers to stay, `doit report` renders it again"
    )
    if not dryrun:
        shutil.rmtree(place, ignore_errors=True)


def _discharge(state: State, work: Work) -> Callable[[], TaskError | bool]:
    return partial(_act, partial(discharge, state.workspace, work, state.run))


def _settled(state: State, work: Work) -> _Asked:
    return _Asked(
        "every obligation has current evidence", lambda: not open_obligations(state.workspace, work, state.run)
    )


def _act(action: Callable[[], object]) -> TaskError | bool:
    """Bad input and a fault of ours become a failed task with a message; what a stage returns is not for doit."""
    try:
        action()
    except Rejected as rejected:
        return checking.refuse(rejected)
    except OSError as error:
        return TaskError(f"{type(error).__name__}: {error}")
    return True
