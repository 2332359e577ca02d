"""The page over all systems."""

from __future__ import annotations

from collections.abc import Sequence

from avow.pipeline.assess import Assessment, build


def write_overview(assessments: Sequence[Assessment]) -> None:
    """Write reports/index.html over every system that has evidence."""
    from avow.report import write_index

    cases = [build(a) for a in assessments if a.workspace.ledger(a.system).is_file()]
    if cases:
        write_index(cases, assessments[0].workspace.reports)
