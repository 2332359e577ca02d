"""The page over all systems."""

from __future__ import annotations

from collections.abc import Sequence

from avow.base.files import digest_file
from avow.base.notes import write_note
from avow.pipeline.assess import OVERVIEW, Assessment, case_of


def write_overview(assessments: Sequence[Assessment]) -> None:
    """Write reports/index.html over every system that has evidence."""
    from avow.report import write_index

    cases = [case_of(a) for a in assessments if a.workspace.ledger(a.system).is_file()]
    if cases:
        workspace = assessments[0].workspace
        write_index(cases, workspace.reports)
        page = digest_file(workspace.reports / "index.html")
        write_note(workspace.artifacts / OVERVIEW, {"sha256": page})
