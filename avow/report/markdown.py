"""The case as a Markdown summary: for pull requests, and for readers without a browser."""

from __future__ import annotations

import re
from collections.abc import Iterable

from markupsafe import Markup

from avow.assurance.answers import ABOUT
from avow.assurance.model import Case
from avow.assurance.remarks import REMARK
from avow.base.tuning.shown import SUMMARY_ROWS, SUMMARY_SOURCE
from avow.evidence.record import Evidence
from avow.evidence.status import Status
from avow.report.page import fill
from avow.report.short import escaped, weakest_words
from avow.report.source import plain_lines
from avow.report.wording import bound_text, clean, hazard_rows, mutation, open_line, remark_line, weakest, where, worth

_BOUNDED = (Status.CHECKED, Status.TESTED, Status.MONITORED)
"""The statuses that are shown with their bounds."""


def render_markdown(case: Case) -> str:
    """The summary: the five answers, the gates, failures and gaps, remarks, the table, and what is not shown."""
    return fill(
        "report.md.j2",
        case=case,
        about=ABOUT,
        answers=lambda view: ", ".join(map(_answer, view.records)),
        code=lambda text: Markup(" ".join(clean(text).split()).replace("`", "'")),
        contracts=list(_contracts(case)),
        hazards=hazard_rows(case),
        md=lambda text: Markup(escaped(text)),
        most=SUMMARY_ROWS,
        open_items=[i for i in case.open_items if not i.advice],
        open_line=open_line(case),
        remark_line=remark_line(case),
        remarks=sorted((i for i in case.open_items if i.advice), key=lambda i: i.kind != REMARK),
        weakest=weakest,
        weakest_words=weakest_words(case),
        where=where,
    )


def _contracts(case: Case) -> Iterable[tuple[str, str, Markup]]:
    """Path, fence and text of each contract: the fence is longer than any within, and empty if there is no room."""
    room = SUMMARY_SOURCE
    for source in (source for source in case.sources if source.is_contract):
        text = "\n".join(plain_lines(source)).rstrip("\n")
        room -= len(text)
        fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
        yield source.path, fence if room >= 0 else "", Markup(text)


def _answer(evidence: Evidence) -> str:
    status = worth(evidence)
    bound = bound_text(evidence.bound) if status in _BOUNDED else ""
    remarks = "; ".join(part for part in (bound, mutation(evidence)) if part)
    return f"{evidence.method} {status.value}{f' ({remarks})' if remarks else ''}"
