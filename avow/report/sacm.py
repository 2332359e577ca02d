"""The argument as a structured assurance case: OMG SACM 2.3, as XMI.

A goal is a claim, a strategy the reasoning of an inference, a solution an artifact reference that supports its claim by
evidence, a context or an assumption a claim in context. An assurance claim point is a meta-claim of the evidence's
relationship; a defeater is a counter-inference to it, and is itself defeated if it has an answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

from avow.assurance.model import Case
from avow.report.goals import Defeater, Element, Module, Sort, argument, by_name
from avow.report.wording import clean

XMI, SACM = "http://www.omg.org/spec/XMI/20131001", "http://www.omg.org/spec/SACM/2.3"


def render_sacm(case: Case) -> str:
    """One assurance case package: an argument package for each module, an artifact package with the evidence."""
    modules = argument(case)
    writer = _Writer(by_name(modules))
    ET.register_namespace("xmi", XMI)
    ET.register_namespace("sacm", SACM)
    root = ET.Element(f"{{{XMI}}}XMI", {f"{{{XMI}}}version": "2.5"})
    package = writer.element(root, f"{{{SACM}}}AssuranceCasePackage", "", "case", case.title, case.answers.told)
    for module in modules:
        writer.package(package, module)
    artifacts = writer.element(package, "artifactPackage", "ArtifactPackage", "evidence", "Evidence")
    for element in (element for module in modules for element in module.elements if element.artifact):
        writer.artifact(artifacts, element)
    ET.indent(root, " ")
    return ET.tostring(root, "unicode", xml_declaration=True) + "\n"


class _Writer:
    def __init__(self, elements: Mapping[str, Element]) -> None:
        self.elements = elements

    def element(
        self, parent: ET.Element, tag: str, kind: str, name: str, title: str, text: str = "", **features: str
    ) -> ET.Element:
        """An element with its id, type, name, and description; `features`: attributes and references."""
        attributes = {f"{{{XMI}}}id": f"_{name}"} | ({f"{{{XMI}}}type": f"sacm:{kind}"} if kind else {})
        made = ET.SubElement(parent, tag, attributes | {"gid": name} | features)
        ET.SubElement(made, "name", {"lang": "en", "content": clean(title)})
        if text:
            self.content(ET.SubElement(made, "description"), "content", text)
        return made

    def content(self, parent: ET.Element, tag: str, text: str) -> None:
        ET.SubElement(ET.SubElement(parent, tag), "value", {"lang": "en", "content": clean(text)})

    def tagged(self, parent: ET.Element, key: str, text: str) -> None:
        value = ET.SubElement(parent, "taggedValue")
        self.content(value, "key", key)
        self.content(value, "content", text)

    def package(self, parent: ET.Element, module: Module) -> None:
        name = f"module-{module.elements[0].name}"
        package = self.element(parent, "argumentPackage", "ArgumentPackage", name, module.name, module.brief)
        for element in module.elements:
            self.argument_element(package, element)
        for element in module.elements:
            self.relationships(package, element)

    def argument_element(self, package: ET.Element, element: Element) -> None:
        title = element.label or element.name
        match element.sort:
            case Sort.STRATEGY:
                self.element(package, "argumentationElement", "ArgumentReasoning", element.name, title, element.text)
            case Sort.SOLUTION:
                refers = {"referencedArtifactElement": f"_artifact-{element.name}"} if element.artifact else {}
                kind = "ArtifactReference"
                self.element(package, "argumentationElement", kind, element.name, title, element.text, **refers)
            case Sort.GOAL | Sort.CONTEXT | Sort.ASSUMPTION | Sort.JUSTIFICATION:
                self.claim(package, element.name, title, element.text, _declared(element))

    def claim(self, package: ET.Element, name: str, title: str, text: str, declared: str) -> None:
        self.element(package, "argumentationElement", "Claim", name, title, text, assertionDeclaration=declared)

    def relationships(self, package: ET.Element, element: Element) -> None:
        if element.sort is Sort.STRATEGY:
            return  # it is the reasoning of its goal's inference
        for at, name in enumerate(element.supported_by, 1):
            below = self.elements[name]
            about = f"{element.name}-{at}"
            if below.sort is Sort.STRATEGY:
                self.relation(package, "AssertedInference", about, below.supported_by, element, reasoning=f"_{name}")
            elif below.sort is Sort.SOLUTION:
                meta = self.claim_point(package, about, below)
                counter = "true" if below.defeated else "false"
                self.relation(package, "AssertedEvidence", about, (name,), element, isCounter=counter, **meta)
            else:
                self.relation(package, "AssertedInference", about, (name,), element)
        if element.in_context_of:
            self.relation(package, "AssertedContext", f"{element.name}-context", element.in_context_of, element)

    def relation(
        self, package: ET.Element, kind: str, name: str, sources: tuple[str, ...], target: Element, **more: str
    ) -> None:
        if sources:
            features = {"source": " ".join(f"_{source}" for source in sources), "target": f"_{target.name}"}
            self.element(
                package,
                "argumentationElement",
                kind,
                f"{kind}-{name}",
                f"{kind} {name}",
                assertionDeclaration="asserted",
                **{"isCounter": "false", **features, **more},
            )

    def claim_point(self, package: ET.Element, about: str, solution: Element) -> dict[str, str]:
        """The meta-claim of an evidence relationship, with its defeaters; empty if the solution has no assurance claim
        point."""
        if not solution.believed:
            return {}
        point = f"ACP-{about}"
        self.claim(package, point, f"ACP {about}", f"The evidence may be believed: {solution.believed}", "asserted")
        for at, defeater in enumerate(solution.defeaters, 1):
            self.defeater(package, f"{point}-D{at}", point, defeater)
        return {"metaClaim": f"_{point}"}

    def defeater(self, package: ET.Element, name: str, point: str, defeater: Defeater) -> None:
        def counter(label: str, source: str, target: str, declared: str) -> None:
            self.element(
                package,
                "argumentationElement",
                "AssertedInference",
                f"{label}-counter",
                f"{label} counter",
                assertionDeclaration=declared,
                isCounter="true",
                source=f"_{source}",
                target=f"_{target}",
            )

        declared = "defeated" if defeater.answer else "needsSupport"
        self.claim(package, name, "Defeater", defeater.text, declared)
        counter(name, name, point, "defeated" if defeater.answer else "asserted")
        if defeater.answer:
            self.claim(package, f"{name}-answer", "Answer", defeater.answer, "asserted")
            counter(f"{name}-answer", f"{name}-answer", name, "asserted")

    def artifact(self, package: ET.Element, element: Element) -> None:
        made = element.artifact
        assert made is not None
        title = f"{made.tool}, {made.date[:10]}"
        known = {"version": made.record, "date": made.date}
        name = f"artifact-{element.name}"
        found = self.element(package, "artifactElement", "Artifact", name, title, element.text, **known)
        if made.command:
            self.tagged(found, "re-run", made.command)
        for path, digest in made.files:
            self.tagged(found, path, f"SHA-256 {digest}")


def _declared(element: Element) -> str:
    """A claim's declaration in SACM's terms."""
    if element.sort is Sort.ASSUMPTION:
        return "assumed"
    if element.defeated:
        return "defeated"
    return "needsSupport" if element.undeveloped or element.unsupported else "asserted"
