"""The argument for other tools: modular GSN in gsn2x's format."""

from __future__ import annotations

from typing import Any

from avow.assurance.model import Case
from avow.report.goals import Element, argument
from avow.report.layout import yaml_text


def render_gsn(case: Case) -> str:
    """The argument (`avow.report.goals`) as YAML, a document for each module."""
    documents = []
    for module in argument(case):
        elements = {"module": {"name": module.name, "brief": module.brief}}
        documents.append(yaml_text(elements | {element.name: _body(element) for element in module.elements}))
    return "---\n".join(documents)


def _body(element: Element) -> dict[str, Any]:
    lines = [element.label, element.text]
    if element.artifact is not None:
        made = element.artifact
        lines.append(f"record {made.record[:12]}, {made.tool}, {made.date[:10]}")
        lines += [f"{path} (SHA-256 {digest[:12]})" for path, digest in made.files[:4]]
        lines.append(made.command)
    body: dict[str, Any] = {"text": "\n".join(line for line in lines if line)}
    if element.supported_by:
        body["supportedBy"] = element.supported_by
    if element.in_context_of:
        body["inContextOf"] = element.in_context_of
    if element.undeveloped:
        body["undeveloped"] = True
    if element.believed:  # gsn2x shows keys that it does not know as further text
        body["assuranceClaim"] = element.believed
    if element.defeaters:
        body["defeaters"] = "\n".join(element.text_of_defeaters())
    return body
