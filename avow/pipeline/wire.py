"""Outcomes and reports as JSON: what a worker process hands back."""

from __future__ import annotations

from typing import Any

from avow.backend import Report
from avow.verdict import Counterexample, Link, Outcome, Verdict


def report_to_json(report: Report) -> dict[str, Any]:
    return {
        "tool": report.tool,
        "tool_version": report.tool_version,
        "command": list(report.command),
        "logs": dict(report.logs),
        "outcomes": [outcome_to_json(o) for o in report.outcomes],
    }


def report_from_json(data: dict[str, Any]) -> Report:
    return Report(
        tuple(outcome_from_json(o) for o in data["outcomes"]),
        data["tool"],
        data["tool_version"],
        tuple(data["command"]),
        data["logs"],
    )


def outcome_to_json(outcome: Outcome) -> dict[str, Any]:
    return {
        "obligation": outcome.obligation,
        "verdict": outcome.verdict.value,
        "summary": outcome.summary,
        "counterexample": _counterexample_to_json(outcome.counterexample),
        "hypotheses": list(outcome.hypotheses),
        "bound": outcome.bound,
        "details": outcome.details,
        "link": outcome.link.value if outcome.link else None,
        "vacuous": outcome.vacuous,
    }


def outcome_from_json(data: dict[str, Any]) -> Outcome:
    return Outcome(
        data["obligation"],
        Verdict(data["verdict"]),
        data["summary"],
        _counterexample_from_json(data["counterexample"]),
        tuple(data["hypotheses"]),
        data["bound"],
        data["details"],
        Link(data["link"]) if data["link"] else None,
        data["vacuous"],
    )


def _counterexample_to_json(example: Counterexample | None) -> dict[str, Any] | None:
    if example is None:
        return None
    return {
        "values": [list(pair) for pair in example.values],
        "explanation": example.explanation,
        "trace": [[list(pair) for pair in step] for step in example.trace],
        "loop": example.loop,
    }


def _counterexample_from_json(data: dict[str, Any] | None) -> Counterexample | None:
    if data is None:
        return None
    return Counterexample(
        tuple((name, value) for name, value in data["values"]),
        data["explanation"],
        tuple(tuple((name, value) for name, value in step) for step in data["trace"]),
        data["loop"],
    )
