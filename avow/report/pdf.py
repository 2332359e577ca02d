"""The case as PDF, set by Typst (extra ``avow[pdf]``): offline, with its own fonts, same bytes every time."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

from avow.assurance.argument import build_argument
from avow.assurance.model import Case, ObligationView, SourceView
from avow.assurance.naming import short
from avow.assurance.remarks import REMARK
from avow.base.verdict import Counterexample
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.report import argument_svg, example
from avow.report.maps import map_picture
from avow.report.source import plain_lines
from avow.report.wording import MARKS, banner_tone, bound_text, clean, in_lines, protocol, tone, verdict_line, worth

_MOST = 500
"""Obligations in the PDF: nobody turns more pages; all are in report.json, and the PDF says so."""

_LINES = 1200
"""Lines of a contract in the PDF, which then says so."""

_MOST_COLUMNS = 9
"""Columns of a run that fit on a page; a wider one is told by its reason alone."""
_MOST_IN_A_PICTURE = 90
_GATE = {
    "passes": {"word": "passes", "tone": "good"},
    "fails": {"word": "fails", "tone": "bad"},
    "not asked": {"word": "not asked", "tone": "plain"},
}


class NoTypst(Exception):  # noqa: N818 - it says what is missing
    """The extra is not installed."""


def render_pdf(case: Case) -> bytes:
    """Raises NoTypst where the extra is missing, RuntimeError where Typst fails."""
    try:
        import typst
    except ImportError as error:
        raise NoTypst("typst is not installed: pip install 'avow[pdf]'") from error
    source = resources.files("avow.report").joinpath("templates/report.typ").read_bytes()
    data: bytes = typst.compile(
        source, format="pdf", sys_inputs={"case": json.dumps(_data(case))}, ignore_system_fonts=True, timestamp=0
    )
    return data


def _data(case: Case) -> dict[str, Any]:
    views = case.obligations[:_MOST]
    levels = {node.name: node.criticality for node in case.nodes}
    nodes = dict.fromkeys(v.obligation.node for v in views if v.obligation.kind is Kind.GUARANTEE)
    facts = [("system", case.system), ("grade", f"{case.grade}: {case.grade_reason}"), ("policy", case.policy.name)]
    facts += [("date", case.today), ("run", case.run.id), ("ledger", case.ledger_head)]
    left_out = len(case.obligations) - len(views)
    more = [f"{left_out} obligations are left out of this document: see report.json."] if left_out else []
    found: dict[str, Any] = {
        "title": case.title,
        "tone": banner_tone(case),
        "grade": str(case.grade),
        "line": verdict_line(case),
        "facts": [*facts, *case.digests],
        "requirements": [
            {"id": r.id, "text": r.text or r.formula or r.temporal, "answer": r.answer, "status": _chip(r.status)}
            for r in case.requirements
        ],
        "gates": [
            {
                "title": g.title,
                "reason": g.reason,
                "status": _GATE["not asked" if g.idle else "passes" if g.passed else "fails"],
            }
            for g in case.gates
        ],
        "open": [
            {
                "claim": short(i.claim),
                "title": i.title,
                "reason": i.reason,
                "text": i.text,
                "next": i.suggestion,
                "status": _word(i.kind),
            }
            for i in case.open_items[:_MOST]
            if not i.advice
        ],
        "remarks": [f"{i.title} ({i.text})" for i in case.open_items if i.kind == REMARK][:_MOST],
        "matrix": [
            {
                "name": node,
                "criticality": f"{levels.get(node, '')} criticality",
                "rows": [_row(v) for v in views if v.obligation.node == node and v.obligation.kind is Kind.GUARANTEE],
            }
            for node in nodes
        ],
        "pictures": _pictures(case),
        "derivations": [
            {
                "name": d.derivation.name,
                "rule": d.derivation.rule,
                "text": d.derivation.text,
                "conclusion": d.derivation.conclusion,
                "conditions": "; ".join(c.text for c in d.derivation.side_conditions),
                "status": _chip(d.status),
            }
            for d in case.derivations
        ],
        "obligations": [_obligation(case, view) for view in views],
        "hypotheses": [f"{h.text} ({', '.join(map(short, h.claims[:6]))})" for h in case.hypotheses],
        "environment": [(e.port, e.assume or "nothing is assumed", e.because) for e in case.environment],
        "findings": [
            f"{f.how}: {f.pattern} {f.verdict}. {f.reason} {f.who} {f.date}".strip()
            + (" (expired)" if f.expired else "")
            for f in case.findings
        ],
        "single": [short(name) for name in case.single_method],
        "limits": [*case.limits[:400]],
        "not_shown": [*more, *case.not_shown],
        "sources": [_source(source) for source in case.sources if source.is_contract],
    }
    plain: dict[str, Any] = _clean(found)
    return plain


def _source(source: SourceView) -> dict[str, Any]:
    lines = list(plain_lines(source))
    more = f"and {len(lines) - _LINES} more lines: see report.json" if len(lines) > _LINES else ""
    return {"path": source.path, "lines": [[str(at), line] for at, line in enumerate(lines[:_LINES], 1)], "more": more}


def _pictures(case: Case) -> list[dict[str, str]]:
    """The arguments that fit on a page."""
    argument = build_argument(case)
    drawn = []
    for name, start in argument.goals:
        if len(argument.below(start)) <= _MOST_IN_A_PICTURE:
            svg = argument_svg.draw(argument, start, lambda _: None, name, alone=True)
            drawn.append({"name": name, "svg": svg.replace("font:12px system-ui,", "font:12px 'Libertinus Serif',")})
    return drawn


def _obligation(case: Case, view: ObligationView) -> dict[str, Any]:
    said = case.said(view.id)
    evidence = [item.entry.evidence for item in view.counting]
    return {
        "name": short(view.id),
        "claim": view.obligation.claim,
        "formula": in_lines(view.obligation.formula),
        "reason": f"{said.how.capitalize()}: {said.reason}" if said and said.reason else "",
        "status": _chip(view.standing),
        "evidence": [
            {
                "status": _chip(worth(e)),
                "method": e.method,
                "tool": f"{e.tool} {e.tool_version}",
                "summary": f"{e.summary}. How it was measured: {protocol(e)}" if protocol(e) else e.summary,
                "bound": bound_text(e.bound),
                "counter": _counter(case, e.counterexample) if e.counterexample else None,
            }
            for e in evidence
        ],
    }


def _counter(case: Case, shown: Counterexample) -> dict[str, Any]:
    """The contract's values and the run as on the page, without the tool's own words and the middle of long runs."""
    told, found = example.values(shown), example.run(shown)
    rows = [row for row in found.rows if not row.middle]
    notes = [f"{found.left_out + found.beyond} rows in the middle are left out"] if found.left_out else []
    if shown.loop is not None:
        notes.append(f"after the last step the run returns to step {shown.loop}, and goes on like this for ever")
    pictures = [map_picture(view, shown, alone=True) for view in case.maps]
    return {
        "why": shown.explanation or "what the contract leaves open",
        "values": [[v.name, v.value, v.other] for v in told],
        "other": any(v.other for v in told),
        "columns": list(found.columns) if found.columns and len(found.columns) <= _MOST_COLUMNS else [],
        "rows": [[row.label + (" ↺" if row.returns else ""), *([c.text, c.new] for c in row.cells)] for row in rows],
        "note": "; ".join(notes),
        "maps": [{"svg": svg, "told": words} for svg, words in pictures if svg],
    }


def _row(view: ObligationView) -> dict[str, Any]:
    methods = [
        {
            "word": f"{i.entry.evidence.method}: {worth(i.entry.evidence)}",
            "tone": tone(worth(i.entry.evidence)),
        }
        for i in view.counting
    ]
    return {"name": view.obligation.name, "status": _chip(view.standing), "methods": methods}


def _chip(status: Status) -> dict[str, str]:
    return {"word": str(status), "tone": tone(status)}


def _word(kind: str) -> dict[str, str]:
    return _chip(Status(kind)) if kind in MARKS else {"word": kind, "tone": "bad"}


def _clean(value: Any) -> Any:
    match value:
        case str():
            return clean(value)
        case dict():
            return {key: _clean(item) for key, item in value.items()}
        case list() | tuple():
            return [_clean(item) for item in value]
        case _:
            return value
