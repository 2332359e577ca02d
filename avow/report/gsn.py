"""The argument for other tools: modular GSN in gsn2x's format."""

from __future__ import annotations

from typing import Any

import yaml

from avow.assurance.model import Case
from avow.report.goals import Element, argument
from avow.report.wording import clean


def render_gsn(case: Case) -> str:
    """The argument (`avow.report.goals`) as YAML, a document for each module."""
    documents = []
    for module in argument(case):
        elements = {"module": {"name": clean(module.name), "brief": clean(module.brief)}}
        documents.append(elements | {element.name: _body(element) for element in module.elements})
    return yaml.safe_dump_all(documents, sort_keys=False, allow_unicode=True, width=120)


def _body(element: Element) -> dict[str, Any]:
    lines = [element.label, element.text]
    if element.artifact is not None:
        made = element.artifact
        lines.append(f"record {made.record[:12]}, {made.tool}, {made.date[:10]}")
        lines += [f"{path} (SHA-256 {digest[:12]})" for path, digest in made.files[:4]]
        lines.append(made.command)
    body: dict[str, Any] = {"text": clean("\n".join(line for line in lines if line))}
    if element.supported_by:
        body["supportedBy"] = list(element.supported_by)
    if element.in_context_of:
        body["inContextOf"] = list(element.in_context_of)
    if element.undeveloped:
        body["undeveloped"] = True
    if element.believed:  # gsn2x shows keys that it does not know as further text
        body["assuranceClaim"] = clean(element.believed)
    if element.defeaters:
        body["defeaters"] = clean("\n".join(element.text_of_defeaters()))
    return body
