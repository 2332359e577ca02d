"""Traceability as ReqIF (OMG, version 1.2): the paths of `avow.assurance.traceability` as objects and relations.

A hazard *is mitigated by* requirements and claims, a requirement *rests on* claims, a claim *is shown by* evidence. An
identifier is a digest of what it names, so a tool that imports a later export updates its objects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from avow.assurance.model import Case
from avow.assurance.traceability import Row
from avow.base.files import sha256
from avow.report.page import fill

TEXT = "ReqIF.Text"
KINDS: Mapping[str, tuple[str, ...]] = {
    "Hazard": (TEXT, "Status", "Severity", "Exposure", "Source", "Remark"),
    "Requirement": (TEXT, "Status", "Failure rate", "Formula", "Source", "Remark"),
    "Derived property": ("Status", "Remark"),
    "Claim": (TEXT, "Status", "Formula", "Remark"),
    "Evidence": (TEXT, "Verdict", "Method", "Link", "Tool", "Tool output", "SHA-256", "Re-run"),
}
"""Each kind of object with its attributes, besides ReqIF.ForeignID."""
RELATIONS = ("is mitigated by", "rests on", "is shown by")
_Name = tuple[str, str]
"""(kind, name)."""


def render_reqif(case: Case, rows: Sequence[Row]) -> str:
    """The traceability of a case, and a specification that lists each requirement with the claims below it."""
    objects: dict[_Name, dict[str, str]] = {}
    links: dict[tuple[str, _Name, _Name], str] = {}
    views = {view.id: view for view in case.obligations}
    summaries = {item.entry.hash[:12]: item.entry.evidence.summary for view in views.values() for item in view.evidence}
    graph = {m.name: m.words for view in case.hazards for m in view.mitigations}
    for own, status in ((view.hazard, view.level) for view in case.hazards):
        levels = {"Severity": own.severity, "Exposure": own.exposure, "Source": own.source}
        objects["Hazard", own.id] = {TEXT: own.text, "Status": status, **levels}
    for r in case.requirements:
        rate = {"Failure rate": r.rate.brief} if r.rate and r.level.holds else {}
        objects["Requirement", r.id] = {
            TEXT: r.words,
            "Status": r.level,
            "Formula": r.formal,
            "Source": r.source,
            **rate,
        }
    for row in rows:
        requirement, claim, evidence = ("Requirement", row.requirement), ("Claim", row.obligation), row.evidence
        path = (claim, ("Derived property", row.derivation), requirement, ("Hazard", row.hazards))
        about = next(name for name in path if name[1])
        if about == claim and claim not in objects:
            view = views.get(row.obligation)
            text, formula = (view.obligation.claim, view.obligation.formula) if view else (graph.get(claim[1], ""), "")
            objects[claim] = {TEXT: text, "Formula": formula, "Status": row.status}
        objects.setdefault(about, {"Status": row.status})
        if about == claim and row.requirement:
            links["rests on", requirement, claim] = row.derivation
        if evidence:
            told = (summaries.get(evidence, ""), row.verdict, row.method, row.link, row.tool)
            cells = (*told, row.output, row.digest, row.rerun)
            objects["Evidence", evidence] = dict(zip(KINDS["Evidence"], cells, strict=True))
            links["is shown by", claim, ("Evidence", evidence)] = ""
        said = objects[about].get("Remark", "")
        if row.remark not in said:
            objects[about]["Remark"] = f"{said}; {row.remark}" if said else row.remark
    for hazard in case.hazards:
        for m in hazard.mitigations:
            named = [("Requirement", m.name), *(("Claim", name) for name in (m.name, *m.claims))]
            source = "Hazard", hazard.hazard.id
            links |= {("is mitigated by", source, name): m.name for name in named if name in objects}
    below: dict[_Name, list[_Name]] = {}
    for _, source, target in links:
        below.setdefault(source, []).append(target)
    return fill(
        "traceability.reqif.j2",
        case=case,
        kinds=KINDS,
        relations=RELATIONS,
        objects=objects,
        links=links,
        below=below,
        id=lambda *parts: Markup(f'"{identifier(*parts)}"'),
        ref=lambda *parts: Markup(identifier(*parts)),
        when=f"{case.today}T00:00:00Z",
    )


def identifier(*parts: str) -> str:
    """An xsd:ID for the object that the parts name."""
    return f"_{sha256(chr(0).join(parts))[:32]}"
