"""The case as PDF, typeset by Typst: offline, with its own fonts, same bytes every time."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from importlib import resources
from itertools import chain
from typing import Any

from avow.assurance.answers import Assumption
from avow.assurance.model import Case, ObligationView, RequirementView, SourceView
from avow.assurance.naming import short
from avow.assurance.state import baseline_of
from avow.backend_kit.timeline import in_words, picture, timelines
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.plain import listed
from avow.base.tuning.shown import CONTRACT_LINES, PDF_COLUMNS, PDF_OBLIGATIONS
from avow.base.verdict import Counterexample
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.evidence.status import Status
from avow.report import example
from avow.report.answers_page import full_reason
from avow.report.modules import RequirementModule, requirement_modules
from avow.report.page import by_node
from avow.report.short import weakest_words
from avow.report.source import plain_lines
from avow.report.wording import (
    NO_HAZARD,
    NOT_SHOWN,
    bound_text,
    by_claim,
    clean,
    dangers,
    hazard_rows,
    in_lines,
    protocol,
    tone,
    weakest,
    worth,
)


def render_pdf(case: Case) -> bytes:
    """Same case, same bytes. Raises Rejected (``CLI023``) if Typst is missing or fails."""
    try:
        import typst  # an optional package

        source = resources.files("avow.report").joinpath("templates/report.typ").read_bytes()
        data: bytes = typst.compile(
            source,
            format="pdf",
            sys_inputs={"case": json.dumps(_data(case))},
            ignore_system_fonts=True,
            timestamp=0,
            pdf_standards="ua-1",
        )
    except ImportError as error:
        raise Rejected(Diagnostic("CLI023", "typst is not installed", hint="pip install typst")) from error
    except Exception as error:  # typst's own exception types differ between versions
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise Rejected(Diagnostic("CLI023", f"typst fails: {said}")) from error
    return data


def _data(case: Case) -> dict[str, Any]:
    """What `report.typ` lays out: views of the case as they are, and what it cannot compute."""
    views = list(chain.from_iterable(by_node(case).values()))[:PDF_OBLIGATIONS]
    levels = {node.name: node.criticality for node in case.nodes}
    facts = [
        ("system", case.system),
        ("proofs", f"{case.grade.word}: {case.grade_reason}"),
        ("policy", case.policy.name),
        ("date", case.today),
        ("run", case.run.id),
        ("ledger", case.ledger_head),
    ]
    left_out = len(case.obligations) - len(views)
    more = [f"{left_out} obligations are left out of this document: see report.json."] if left_out else []
    items = [i for i in case.open_items[:PDF_OBLIGATIONS] if not i.advice]
    found: dict[str, Any] = {
        "title": case.title,
        "today": case.today,
        "proofs": f"proofs {case.grade.word}",
        "facts": [*facts, *case.digests],
        "answers": case.answers,
        "first": _first(case),
        "tones": {status.value: tone(status) for status in Status},
        "assumptions": [_assumption(s) for s in case.assumptions],
        "deficits": [[str(w.count), w.words, w.why, by_claim(w)] for w in case.deficits],
        "modules": [_module(module) for module in requirement_modules(case)],
        "hazards": hazard_rows(case),
        "no_hazard": NO_HAZARD,
        "gates": case.gates,
        "open": [replace(item, claim=short(item.claim)) for item in items],
        "remarks": [f"{i.title or short(i.claim)} ({i.text})" for i in case.open_items if i.advice][:PDF_OBLIGATIONS],
        "derivations": case.derivations,
        "obligations": [_obligation(case, view, levels) for view in views],
        "environment": case.environment,
        "findings": case.findings,
        "not_shown": [*more, *NOT_SHOWN],
        "sources": [_source(source) for source in case.sources if source.is_contract],
    }
    plain: dict[str, Any] = _plain(found)
    return plain


def _source(source: SourceView) -> dict[str, Any]:
    lines = list(plain_lines(source))
    more = f"and {len(lines) - CONTRACT_LINES} more lines: see report.json" if len(lines) > CONTRACT_LINES else ""
    return {
        "path": source.path,
        "lines": [[str(at), line] for at, line in enumerate(lines[:CONTRACT_LINES], 1)],
        "more": more,
    }


def _first(case: Case) -> dict[str, Any]:
    """For the first sheet, which has the content of the page's first screen."""
    a, many = case.answers, len(case.listed) < len(case.requirements)
    rows = [(r.id, r.words, _toned(r), weakest(r), str(len(r.supposes)), r.noted) for r in case.listed]
    levels = [(f"{n} {one}", ", ".join(r.id for r in case.requirements if r.level is one)) for one, n in a.by_level]
    return {
        "mark": a.tone.mark,
        "hazards": "; ".join(f"{tone.mark} mitigation {level}: {names}" for tone, level, names in dangers(case)),
        "by_level": levels if many else [],
        "listed": rows,
        "weakest": weakest_words(case),
        "deficits": [f"{w.count} {w.words}" for w in case.deficits] or ["No deficit is known."],
        "supposed": [(line.about, f"{line.number} {line.says}", line.more) for line in a.supposed],
        "content": f"What is signed has the digest {baseline_of(case).content[:16]}…",
    }


def _toned(requirement: RequirementView) -> dict[str, str]:
    return {"word": f"{requirement.tone.mark} {requirement.level}", "tone": requirement.tone.value}


def _assumption(assumption: Assumption) -> list[str]:
    s = assumption
    reason = full_reason(s)
    return [s.number, f"{s.words}. {reason}".strip(), str(s.sort), listed(s.needing), s.term]


def _module(module: RequirementModule) -> dict[str, Any]:
    r = module.requirement
    lines = [f"{title}: {words}" for _, title, words in module.away]
    lines += [f"composition: {module.conditions}"] if module.conditions else []
    lines += [f"assumes {', '.join(module.supposes)}"] if module.supposes else []
    return {
        "id": r.id,
        "text": r.words,
        "formula": in_lines(r.formal),
        "status": _toned(r),
        "because": module.because,
        "strategy": module.strategy,
        "lines": lines,
        "failing": ", ".join(map(short, module.failing[:12])),
    }


def _obligation(case: Case, view: ObligationView, levels: Mapping[str, str]) -> dict[str, Any]:
    said, o = case.said(view.id), view.obligation
    return {
        "name": short(view.id),
        "own": o.name if o.kind is Kind.GUARANTEE else "",
        "node": "the whole system" if o.node == SYSTEM_LEVEL else o.node,
        "criticality": f"{levels.get(o.node, '')} criticality",
        "claim": o.claim,
        "formula": in_lines(o.formula),
        "reason": f"{said.how.capitalize()}: {said.reason}" if said and said.reason else "",
        "status": view.standing,
        "evidence": [
            {
                "status": worth(e),
                "method": e.method,
                "tool": e.tool_told,
                "summary": f"{e.summary}. How it was measured: {protocol(e)}" if protocol(e) else e.summary,
                "bound": bound_text(e.bound),
                "counter": _counter(e.counterexample) if e.counterexample else None,
                "lanes": [{"svg": str(picture(t, alone=True)), "told": in_words(t)} for t in timelines(e.details)],
            }
            for e in view.records
        ],
    }


def _counter(shown: Counterexample) -> dict[str, Any]:
    """The contract's values and the run as on the page, without the tool's own names and the middle of long runs."""
    told, found = example.values(shown), example.run(shown)
    rows = [row for row in found.rows if not row.middle]
    notes = [f"{found.left_out + found.beyond} rows in the middle are left out"] if found.left_out else []
    if shown.loop is not None:
        notes.append(f"after the last step the run returns to step {shown.loop}, and goes on like this for ever")
    return {
        "why": shown.explanation or "what the contract leaves open",
        "values": [[v.name, v.value, v.other] for v in told],
        "other": any(v.other for v in told),
        "columns": list(found.columns) if found.columns and len(found.columns) <= PDF_COLUMNS else [],
        "rows": [[row.label + (" ↺" if row.returns else ""), *([c.text, c.new] for c in row.cells)] for row in rows],
        "note": "; ".join(notes),
    }


def _plain(value: Any) -> Any:
    """Views as plain data, with what their properties say; texts without characters that XML cannot hold."""
    match value:
        case str():
            return clean(value)
        case Mapping():
            return {key: _plain(item) for key, item in value.items()}
        case list() | tuple():
            return list(map(_plain, value))
        case _ if is_dataclass(value):
            said = [name for name, part in vars(type(value)).items() if isinstance(part, property)]
            return {name: _plain(getattr(value, name)) for name in (*(f.name for f in fields(value)), *said)}
        case _:  # a number, a Boolean or None
            return value
