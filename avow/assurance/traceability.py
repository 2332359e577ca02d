"""Traceability: source ↔ hazard ↔ requirement ↔ derived property ↔ guarantee ↔ obligation ↔ evidence ↔ tool output.

Orphans are listed in both directions.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import astuple, fields, replace

from avow.assurance.model import Case, ObligationView
from avow.assurance.naming import derivation_claim, requirement_claim, rerun, short
from avow.base.records import dataclass
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh


@dataclass(frozen=True, slots=True)
class Row:
    """One path from a requirement to a piece of evidence; an orphan has gaps, and a remark that says so."""

    source: str = ""
    hazards: str = ""
    requirement: str = ""
    level: str = ""
    derivation: str = ""
    guarantee: str = ""
    obligation: str = ""
    status: str = ""
    method: str = ""
    verdict: str = ""
    link: str = ""
    tool: str = ""
    evidence: str = ""
    output: str = ""
    digest: str = ""
    rerun: str = ""
    remark: str = ""


_HEADS = {
    "level": "requirement status",
    "derivation": "derived property",
    "status": "obligation status",
    "output": "tool output",
    "digest": "SHA-256",
    "rerun": "re-run",
}
COLUMNS = tuple(_HEADS.get(part.name, part.name) for part in fields(Row))
"""The head of the CSV."""


def trace(case: Case) -> tuple[Row, ...]:
    """Every path, requirement by requirement; then the orphans: guarantees and derivations that serve no requirement,
    evidence of claims that no longer exist."""
    rows: list[Row] = []
    reached: set[str] = set()
    derivations = {derivation_claim(d.derivation.name): d for d in case.derivations}
    requirements = {requirement_claim(r.id): r for r in case.requirements}
    views = {view.id: view for view in case.obligations}
    mitigating: dict[str, dict[str, None]] = {}
    for hazard in case.hazards:
        for name in (name for m in hazard.mitigations for name in (m.name, *m.claims)):
            mitigating.setdefault(name, {})[hazard.hazard.id] = None
    named = {requirement.id for requirement in case.requirements}
    for requirement in case.requirements:
        before = len(rows)
        seen: set[str] = set()
        stack = [(claim, "") for claim in reversed(requirement.rests_on)]
        while stack:
            claim, through = stack.pop()
            if claim in seen:
                continue
            seen.add(claim)
            reached.add(claim)
            if claim in derivations:
                name = derivations[claim].derivation.name
                path = f"{through} / {name}" if through else name
                stack += [(below, path) for below in reversed(derivations[claim].rests_on)]
            elif claim in requirements:
                stack += [(below, through) for below in reversed(requirements[claim].rests_on)]
            elif claim in views:
                rows += _rows(views[claim], through)
                # a guarantee is worth no more than its node's contract, so claims about the contract are traced too
                stack += [(below, through) for below in reversed(views[claim].rests_on)]
            else:
                rows.append(Row(derivation=through, obligation=claim, remark="orphan: no such claim"))
        if len(rows) == before:
            rows.append(Row(remark="orphan: nothing supports this requirement"))
        rows += [Row(remark=f"orphan: '{name}' stands for nothing") for name in requirement.unknown_names]
        known = {"source": requirement.source, "level": requirement.level, "requirement": requirement.id}
        rows[before:] = [replace(row, **known) for row in rows[before:]]
    for view in case.guarantees:
        if view.id not in reached:
            rows += _rows(view, "", "orphan: serves no requirement")
    used = {name for r in case.requirements for name in r.closure}
    rows += [
        Row(derivation=d.derivation.name, status=d.status.value, remark="orphan: serves no requirement")
        for claim, d in derivations.items()
        if claim not in reached and used.isdisjoint(d.rests_on)
    ]
    rows += [
        Row(
            obligation=entry.evidence.obligation,
            method=entry.evidence.method,
            verdict=entry.evidence.verdict.value,
            evidence=entry.hash[:12],
            remark="orphan: evidence of a claim that no longer exists",
        )
        for entry in case.orphans
    ]
    for at, row in enumerate(rows):
        found = mitigating.get(row.requirement, {}) | mitigating.get(row.obligation, {})
        rows[at] = replace(row, hazards=", ".join(v.hazard.id for v in case.hazards if v.hazard.id in found))
    for hazard in case.hazards:
        for m in hazard.mitigations:
            if not m.claims and m.name not in named:  # a mitigation by the dataflow graph alone
                status = Status.ARGUED if m.level.holds else Status.MISSING
                rows.append(Row(hazards=hazard.hazard.id, obligation=m.name, status=status))
        if not hazard.mitigations:
            rows.append(Row(hazards=hazard.hazard.id, remark="orphan: nothing mitigates this hazard"))
    return tuple(rows)


def _rows(view: ObligationView, derivation: str, remark: str = "") -> Iterable[Row]:
    o = view.obligation
    guarantee = short(o.id) if o.kind is Kind.GUARANTEE else ""
    start = Row(derivation=derivation, guarantee=guarantee, obligation=o.id, status=view.word, remark=remark)
    if not view.counting:
        missing = "orphan: no evidence"
        yield replace(start, remark=f"{remark}; {missing}" if remark else missing)
    for item in view.counting:
        record = item.entry.evidence
        yield replace(
            start,
            method=record.method,
            verdict=weigh(record).status.value,  # the status that it counts as: a vacuous pass shows nothing
            link=record.link.value,
            tool=record.tool_told,
            evidence=item.entry.hash[:12],
            output="; ".join(sorted(record.outputs)),
            digest="; ".join(digest for _, digest in sorted(record.outputs.items())),
            rerun=rerun(o, record.method),
        )


def to_csv(rows: Iterable[Row]) -> str:
    """As CSV (RFC 4180). A cell that a spreadsheet would read as a formula gets a leading apostrophe."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    writer.writerows([[_harmless(cell) for cell in astuple(row)] for row in rows])
    return out.getvalue()


def _harmless(cell: str) -> str:
    return "'" + cell if cell[:1] in ("=", "+", "-", "@", "\t", "\r") else cell
