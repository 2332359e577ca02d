"""The case as a Markdown summary: for pull requests, and for readers without a browser."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from avow.assurance.model import Case, ObligationView
from avow.assurance.naming import short
from avow.assurance.remarks import REMARK
from avow.base.tuning.shown import SUMMARY_ROWS, SUMMARY_SOURCE
from avow.evidence.record import Evidence
from avow.evidence.status import Status
from avow.report.short import escaped, markdown_head
from avow.report.source import plain_lines
from avow.report.wording import (
    NO_HAZARD,
    NOT_SHOWN,
    bound_text,
    clean,
    gate_line,
    hazard_rows,
    mutation,
    not_shown,
    open_line,
    remark_line,
    where,
    worth,
)

_BOUNDED = (Status.CHECKED, Status.TESTED, Status.MONITORED)
"""The statuses that are shown with their bounds."""


def render_markdown(case: Case) -> str:
    """The summary: the five answers, the gates, failures and gaps, remarks, the table, and what is not shown."""
    remarks = sorted((i for i in case.open_items if i.advice), key=lambda i: i.kind != REMARK)
    parts = [
        f"# {escaped(case.title)}: assurance report",
        *markdown_head(case),
        _origin(case),
        _table(("file", "SHA-256"), ((escaped(path), f"`{mark}`") for path, mark in case.digests)),
        "## Gates",
        _table(
            ("gate", "", "why"),
            (
                (escaped(g.title), f"**{g.state}**" if g.state == "fails" else g.state, escaped(gate_line(g.reason)))
                for g in case.gates
            ),
        ),
        "## Failures and gaps",
        _table(
            ("", "claim", "why", "what was found", "next"),
            (
                (
                    i.kind,
                    f"{escaped(i.title)} ({escaped(short(i.claim))})",
                    escaped(i.reason),
                    escaped(i.text),
                    escaped(i.suggestion),
                )
                for i in case.open_items
                if not i.advice
            ),
        ),
        escaped(open_line(case)),
        "## Open remarks",
        remark_line(case),
        "\n".join(f"- {escaped(i.title or short(i.claim))} ({escaped(i.text)})" for i in remarks[:SUMMARY_ROWS]),
        "## Hazards",
        _table(
            ("hazard", "what may happen", "severity", "how far it is mitigated"),
            (tuple(map(escaped, row)) for row in hazard_rows(case)),
        )
        if case.hazards
        else NO_HAZARD,
        "## Guarantees",
        _table(("guarantee", "criticality", "status", "evidence", "at"), (_row(view) for view in case.guarantees)),
        "## Environment",
        _table(
            ("environment input", "assumed", "because"),
            ((escaped(e.port), escaped(e.assume) or "nothing", escaped(e.because)) for e in case.environment),
        )
        if case.environment
        else "The plan assumes nothing of the environment's inputs.",
        "## Trusted base",
        f"Proofs {case.grade.word}: {escaped(case.grade_reason)}.",
        _table(
            ("proof", "grade", "by"),
            ((escaped(short(p.obligation)), p.grade, escaped(", ".join(p.tools))) for p in case.proofs),
        ),
        _table(("what", "which"), ((escaped(t.what), escaped(t.which)) for t in case.trusted)),
        "## What is not shown",
        "\n".join(f"- {escaped(line)}" for line in (*map(not_shown, case.deficits), *NOT_SHOWN)),
        *_contracts(case),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _contracts(case: Case) -> Iterable[str]:
    """The contracts' texts between fences that are longer than any fence within."""
    room = SUMMARY_SOURCE
    for source in case.sources:
        if not source.is_contract:
            continue
        text = "\n".join(plain_lines(source)).rstrip("\n")
        yield f"## {escaped(source.path)}, as written"
        room -= len(text)
        if room < 0:
            yield "Too long for a summary: see index.html or report.json."
            continue
        fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
        yield f"{fence}rcl\n{text}\n{fence}"


def _origin(case: Case) -> str:
    run = f"run `{_code(case.run.id)}`, ledger `{case.ledger_head}`"
    proofs = f"{case.grade.word} ({escaped(case.grade_reason)})"
    return f"Proofs: {proofs}. System `{_code(case.system)}`, policy {escaped(case.policy.name)}, {case.today}, {run}."


def _row(view: ObligationView) -> tuple[str, ...]:
    methods = ", ".join(_answer(r) for r in view.records)
    return (
        escaped(short(view.id)),
        escaped(view.criticality),
        view.standing.value,
        escaped(methods),
        escaped(where(view)),
    )


def _answer(evidence: Evidence) -> str:
    status = worth(evidence)
    bound = bound_text(evidence.bound) if status in _BOUNDED else ""
    remarks = "; ".join(part for part in (bound, mutation(evidence)) if part)
    return f"{evidence.method} {status.value}{f' ({remarks})' if remarks else ''}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    if not lines:
        return "None." if len(head) > 2 else ""
    more = f"\n\nand {len(lines) - SUMMARY_ROWS} more: see report.json" if len(lines) > SUMMARY_ROWS else ""
    return "\n".join(["| " + " | ".join(head) + " |", "|" + " --- |" * len(head), *lines[:SUMMARY_ROWS]]) + more


def _code(text: str) -> str:
    return " ".join(clean(text).split()).replace("`", "'")
