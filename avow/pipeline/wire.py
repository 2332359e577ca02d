"""Outcomes and reports as JSON: what a worker process hands back."""

from __future__ import annotations

from typing import Any

from avow.backend_kit.protocol import Report
from avow.base.verdict import Link, Outcome, Verdict
from avow.evidence.encoding import (
    decode_counterexample,
    decode_hypotheses,
    encode_counterexample,
    encode_hypotheses,
)
from avow.isolation import observed
from avow.isolation.level import Isolation


def report_to_json(report: Report) -> dict[str, Any]:
    return {
        "tool": report.tool,
        "tool_version": report.tool_version,
        "command": list(report.command),
        "logs": dict(report.logs),
        "outcomes": [outcome_to_json(o) for o in report.outcomes],
        "observed": observed.to_json(report.observed),
        "isolation": report.isolation.value,
    }


def report_from_json(data: dict[str, Any]) -> Report:
    return Report(
        tuple(outcome_from_json(o) for o in data["outcomes"]),
        data["tool"],
        data["tool_version"],
        tuple(data["command"]),
        data["logs"],
        observed.from_json(data["observed"]),
        Isolation(data["isolation"]),
    )


def outcome_to_json(outcome: Outcome) -> dict[str, Any]:
    return {
        "obligation": outcome.obligation,
        "verdict": outcome.verdict.value,
        "summary": outcome.summary,
        "counterexample": encode_counterexample(outcome.counterexample),
        "hypotheses": list(outcome.hypotheses),
        "bound": outcome.bound,
        "details": outcome.details,
        "link": outcome.link.value if outcome.link else None,
        "vacuous": outcome.vacuous,
        "rests_on": encode_hypotheses(outcome.rests_on),
    }


def outcome_from_json(data: dict[str, Any]) -> Outcome:
    return Outcome(
        data["obligation"],
        Verdict(data["verdict"]),
        data["summary"],
        decode_counterexample(data["counterexample"]),
        tuple(data["hypotheses"]),
        data["bound"],
        data["details"],
        Link(data["link"]) if data["link"] else None,
        data["vacuous"],
        decode_hypotheses(data["rests_on"]),
    )
