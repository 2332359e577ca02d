"""The `index.md` in each node's folder of artifacts: claims, files, the outside commands that check them, and verdicts.

It is written with each report, from the same case, so that it shows what the ledger says now.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from avow.assurance.model import Case, ObligationView
from avow.backend_kit.protocol import OutsideCheck
from avow.base.diagnostics import Rejected
from avow.base.files import write
from avow.base.workspace import Workspace
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.language.contract import Node
from avow.language.definitions import show_clause
from avow.pipeline.export import folder, key, read_stamp
from avow.pipeline.work import Work
from avow.report.parts import Parts
from avow.report.short import escaped
from avow.report.wording import of_nodes

INDEX = "index.md"
_INTRODUCTION = (
    "Avow writes this page with every report. It lists the node's guarantees, their verdicts in the ledger, and the "
    "commands that check the files without Avow. Run them in the workspace's folder. `avow obligations {}` lists the "
    "node's other proof obligations."
)
_HEAD = ("method", "verdict", "recorded", "file", "outside command", "passes if")


def write_indexes(workspace: Workspace, works: Iterable[Work], case: Case, parts: Parts) -> tuple[Path, ...]:
    """Write the page of each node that has a method; their paths. Raises OSError."""
    methods: dict[str, list[Work]] = {}
    for work in works:
        if not work.is_engine:
            methods.setdefault(work.node, []).append(work)
    written = []
    for name, of in methods.items():
        path = workspace.artifacts / case.system / name / INDEX
        places = [(key(work), folder(workspace, work)) for work in of]
        made_of = [(asked, place.is_dir(), read_stamp(place)) for asked, place in places]

        def page(views: Sequence[ObligationView], *_: object, name: str = name, of: Sequence[Work] = of) -> str:
            claims = [view for view in views if view.obligation.kind is Kind.GUARANTEE]
            return _page(workspace, of[0].system.contract.node(name), of, claims)

        if (text := parts.file(name, str(path), page, of_nodes(case).get(name, ()), made_of)) is not None:
            write(path, text)
        written.append(path)
    return tuple(written)


def _page(workspace: Workspace, node: Node, works: Sequence[Work], claims: Sequence[ObligationView]) -> str:
    system = works[0].system.name
    checks = {work.method: _checks(workspace, work) for work in works}
    parts = [f"# {escaped(node.name)} of {escaped(system)}", _INTRODUCTION.format(shlex.quote(f"{system}/{node.name}"))]
    for view in claims:
        name = view.obligation.name
        parts += [f"## {escaped(name)}: {view.standing.value}", escaped(view.obligation.claim)]
        parts += [f"```rcl\n{show_clause(node.clause(name), node, 'rcl')}\n```"]
        rows = [
            row
            for w in works
            if name in {o.name for o in w.obligations}
            for row in _rows(workspace, view, w, checks[w.method])
        ]
        head = ["| " + " | ".join(_HEAD) + " |", "|" + " --- |" * len(_HEAD)]
        parts.append("\n".join([*head, *rows]) if rows else "The plan has no method for it.")
    return "\n\n".join(parts) + "\n"


def _checks(workspace: Workspace, work: Work) -> tuple[OutsideCheck, ...] | str:
    """How the method's files are checked without Avow, or why there are none."""
    stamp = read_stamp(folder(workspace, work))
    if stamp is None:
        return "nothing was generated"
    assert work.planned is not None
    tool, job = work.planned
    try:
        return tuple(tool.outside_checks(job, folder(workspace, work).resolve(), tuple(stamp.files)))
    except Rejected as wrong:  # the verdict reports a fault of the method's input
        return escaped(wrong.diagnostics[0].message)


def _rows(
    workspace: Workspace, view: ObligationView, work: Work, checks: tuple[OutsideCheck, ...] | str
) -> Iterator[str]:
    counting = [e.entry for e in view.counting if e.entry.evidence.method == work.method]
    record = counting[-1].evidence if counting else None
    vacuous = " (vacuous)" if record is not None and record.vacuous else ""
    verdict = f"{Status(record.verdict).value}{vacuous}" if record is not None else "none that counts"
    recorded = f"{record.started[:16]} (record {counting[-1].number})" if record is not None else ""
    found = () if isinstance(checks, str) else checks
    mine = [check for check in found if view.obligation.name in check.guarantees]
    here = workspace.artifacts / work.system.name / work.node
    for check in mine:
        link = f"[{escaped(check.file.name)}]({quote(os.path.relpath(check.file, here.resolve()))})"
        passes = f"it prints `{check.prints}`" if check.prints else "it exits with 0"
        yield _row(work.method, verdict, recorded, link, f"`{_shown(workspace, check)}`", passes)
    if not mine:
        own = f"[files]({quote(work.method)}/)" if folder(workspace, work).is_dir() else ""
        why = checks if isinstance(checks, str) else "only Avow judges it"
        yield _row(work.method, verdict, recorded, own, f"none: {why}", "")


def _row(method: str, *cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in (escaped(method), *cells)) + " |"


def _shown(workspace: Workspace, check: OutsideCheck) -> str:
    """The command, as it is typed in the workspace's folder."""
    return " ".join(shlex.quote(workspace.relative(w)) if isinstance(w, Path) else w for w in check.command)
