"""What a method's check remarks of plan and files, kept beside its answers: an assessor reads the two together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from avow.backend_kit.protocol import Job, Report
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.evidence.record import REMARKS


def remarked(report: Report, found: Iterable[Diagnostic], job: Job) -> Report:
    """The report with the warnings among `found`, but for those that the plan switches off."""
    told = [
        {"code": d.code, "place": _place(d.span, job.root), "message": d.message}
        for d in dict.fromkeys(found)
        if d.severity is Severity.WARNING and d.code not in job.system.plan.lints_off
    ]
    if not told:
        return report
    return replace(report, outcomes=tuple(replace(o, details={**o.details, REMARKS: told}) for o in report.outcomes))


def _place(span: Span | None, root: Path) -> str:
    """``models/p.imp:2``: the same on any machine."""
    if span is None:
        return ""
    path = Path(span.file)
    return f"{path.relative_to(root).as_posix() if path.is_relative_to(root) else path.name}:{span.line}"
