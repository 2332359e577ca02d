"""The page over all systems, and reports that are of an earlier state."""

from __future__ import annotations

from pathlib import Path

from avow.base.diagnostics import Rejected
from avow.base.files import digest_file, is_intact, read_text, write
from avow.base.notes import read_note, write_note
from avow.base.records import dataclass
from avow.pipeline.assess import case_of
from avow.pipeline.run_info import signing_key
from avow.pipeline.state import State

OVERVIEW = ".overview.json"
"""Beside the artifacts: the digest of the page over all systems, as it was written, and whose reports are old."""


def earlier(state: State) -> tuple[str, ...]:
    """The systems that have a report and could not be read in this run: what their reports say is of an earlier state.
    Of a run that read nothing, none is known."""
    if not state.read:
        return ()
    reports, read = state.workspace.reports, {a.system for a in state.assessments}
    return tuple(sorted(p.parent.name for p in reports.glob("*/report.json") if p.parent.name not in read))


@dataclass(frozen=True, slots=True)
class _Overview:
    """Of the page as it was written: its digest, and the systems that it says are of an earlier state."""

    sha256: str
    earlier: tuple[str, ...]


def index_is_due(state: State) -> bool:
    """Whether the page over all systems no longer shows what its systems' reports show."""
    known = read_note(_Overview, state.workspace.artifacts / OVERVIEW) or _Overview("", ())
    if state.changed or earlier(state) != known.earlier:
        return True
    page = state.workspace.reports / "index.html"
    return bool(state.assessments and state.results.all and not is_intact(page, known.sha256))


def write_overview(state: State) -> None:
    """Write reports/index.html over every system that has evidence. Raises OSError."""
    from avow.report import write_index

    workspace, old = state.workspace, earlier(state)
    cases = [case_of(a) for a in state.assessments if workspace.ledger(a.system).is_file()]
    if cases or old:
        write_index(cases, workspace.reports, old)
        page = digest_file(workspace.reports / "index.html")
        write_note(workspace.artifacts / OVERVIEW, _Overview(page, old))


def mark_earlier(state: State) -> None:
    """Say in reports of an earlier state, in every format, that they are. Once the system can be read again they are
    not as they were written, and therefore written anew. Raises OSError."""
    from avow.assurance.case import as_of_earlier
    from avow.assurance.codec import read_case
    from avow.report import render_all

    for name in earlier(state):
        place = state.workspace.reports / name
        try:
            case = as_of_earlier(read_case(place))
        except (Rejected, ValueError, KeyError, OverflowError):
            _mark_pages(place)
        else:
            render_all(case, place, signing_key())


def _mark_pages(folder: Path) -> None:
    """Where report.json was damaged: what a person opens is marked, as it stands."""
    from avow.report.page import environment

    mark = environment().get_template("earlier.html.j2").render()
    for page in sorted(folder.glob("*.html")):
        before, body, after = read_text(page, "utf-8", errors="replace").partition("<body>")
        if body and not after.lstrip().startswith(mark):
            write(page, before + body + mark + after)
