"""The SACM export against the metamodel: classes, features, multiplicities and the types of what references name.

OMG's EMOF file of SACM 2.3 is not shipped. With its path in AVOW_SACM_METAMODEL the table is read from that file, and
must agree with the one here.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, node_plan, system
from assurance.test_case import rover_case

from avow.assurance.model import Case
from avow.base.verdict import Object, Verdict
from avow.evidence.record import Evidence
from avow.report.answers_page import render_argument
from avow.report.goals import Sort, argument, doubts
from avow.report.sacm import SACM, XMI, render_sacm
from avow.system.plan import EnvironmentInput, Requirement
from report.hostile import hostile_case

Feature = tuple[str, int, bool, bool]
"""(type, least number, several allowed, contained)."""
Classes = dict[str, tuple[str | None, dict[str, Feature]]]

_MODEL: dict[str, Feature] = {
    "name": ("LangString", 1, False, True),
    "description": ("Description", 0, False, True),
    "taggedValue": ("TaggedValue", 0, True, True),
}
_ASSERTION: dict[str, Feature] = {
    "assertionDeclaration": ("AssertionDeclaration", 1, False, False),
    "metaClaim": ("Claim", 0, True, False),
}
CLASSES: Classes = {
    "Element": (None, {}),
    "SACMElement": ("Element", {"gid": ("String", 0, False, False)}),
    "ModelElement": ("SACMElement", _MODEL),
    "UtilityElement": ("SACMElement", {"content": ("MultiLangString", 1, False, True)}),
    "Description": ("UtilityElement", {}),
    "TaggedValue": ("UtilityElement", {"key": ("MultiLangString", 1, False, True)}),
    "LangString": ("Element", {"lang": ("String", 0, False, False), "content": ("String", 0, False, False)}),
    "MultiLangString": ("Element", {"value": ("LangString", 1, True, True)}),
    "ArtifactElement": ("ModelElement", {}),
    "AssuranceCasePackage": (
        "ArtifactElement",
        {
            "argumentPackage": ("ArgumentPackage", 0, True, True),
            "artifactPackage": ("ArtifactPackage", 0, True, True),
        },
    ),
    "ArtifactPackage": ("ArtifactElement", {"artifactElement": ("ArtifactElement", 0, True, True)}),
    "ArtifactAsset": ("ArtifactElement", {}),
    "Artifact": ("ArtifactAsset", {"version": ("String", 0, False, False), "date": ("?", 0, False, False)}),
    "ArgumentationElement": ("ArtifactElement", {}),
    "ArgumentPackage": ("ArgumentationElement", {"argumentationElement": ("ArgumentationElement", 0, True, True)}),
    "ArgumentAsset": ("ArgumentationElement", {}),
    "Assertion": ("ArgumentAsset", _ASSERTION),
    "Claim": ("Assertion", {}),
    "ArgumentReasoning": ("ArgumentAsset", {}),
    "ArtifactReference": ("ArgumentAsset", {"referencedArtifactElement": ("ArtifactElement", 0, True, False)}),
    "AssertedRelationship": (
        "Assertion",
        {
            "isCounter": ("?", 1, False, False),
            "source": ("ArgumentAsset", 1, True, False),
            "target": ("ArgumentAsset", 0, False, False),
            "reasoning": ("ArgumentReasoning", 0, False, False),
        },
    ),
    "AssertedInference": ("AssertedRelationship", {}),
    "AssertedEvidence": ("AssertedRelationship", {}),
    "AssertedContext": ("AssertedRelationship", {}),
}
"""Class → the class above it and its own features, of the classes that the export uses."""
DECLARATIONS = {"asserted", "needsSupport", "assumed", "axiomatic", "defeated", "asCited"}
CASES = {"rover": rover_case, "hostile": hostile_case}


def above(name: str, classes: Classes = CLASSES) -> list[str]:
    found = [name]
    while (upper := classes[found[-1]][0]) is not None:
        found.append(upper)
    return found


def features(name: str) -> dict[str, Feature]:
    return {key: feature for one in reversed(above(name)) for key, feature in CLASSES[one][1].items()}


def faults(root: ET.Element) -> list[str]:
    """Everything in which the document departs from the metamodel."""
    found: list[str] = []
    types: dict[str, str] = {}
    references: list[tuple[str, str, str]] = []

    def visit(element: ET.Element, kind: str) -> None:
        at = element.get(f"{{{XMI}}}id", element.tag)
        assert at not in types, f"{at} is declared twice"
        types.update({at: kind} if at != element.tag else {})
        known = features(kind)
        given = {key: value for key, value in element.attrib.items() if not key.startswith("{")}
        inner: dict[str, list[ET.Element]] = {}
        for child in element:
            inner.setdefault(child.tag, []).append(child)
        for key in {*given, *inner} - known.keys():
            found.append(f"{at}: {kind} has no {key}")
        for key, (of, least, several, contained) in known.items():
            words = given.get(key, "").split() if several else [given[key]] if key in given else []
            number = len(inner.get(key, [])) if contained else len(words)
            if number < least or (number > 1 and not several) or (contained and key in given):
                found.append(f"{at}: {key} is there {number} times")
            if key in given and of in CLASSES:
                references.extend((at, target, of) for target in given[key].split())
            for child in inner.get(key, []):
                own = child.get(f"{{{XMI}}}type", f"sacm:{of}").removeprefix("sacm:")
                if own not in CLASSES or of not in above(own):
                    found.append(f"{at}: {key} holds a {own}, not a {of}")
                else:
                    visit(child, own)
        if given.get("assertionDeclaration", "asserted") not in DECLARATIONS:
            found.append(f"{at}: {given['assertionDeclaration']}")

    (top,) = root
    visit(top, top.tag.removeprefix(f"{{{SACM}}}"))
    for at, target, of in references:
        identifier = target
        if identifier not in types:
            found.append(f"{at} refers to {target}, which is nowhere")
        elif of not in above(types[identifier]):
            found.append(f"{at} refers to {target}, a {types[identifier]}, as a {of}")
    return found


@pytest.mark.parametrize("made", CASES.values(), ids=CASES)
def test_the_export_meets_the_metamodel(made: type[Case]) -> None:
    assert faults(ET.fromstring(render_sacm(made()))) == []


def test_every_element_of_the_argument_is_there_and_claim_points_have_defeaters() -> None:
    found = rover_case()
    root = ET.fromstring(render_sacm(found))
    ids = {element.get("gid") for element in root.iter()}
    elements = [element for module in argument(found) for element in module.elements]
    assert {element.name for element in elements} <= ids
    believed = [element for element in elements if element.sort is Sort.SOLUTION and element.believed]
    points = [name for name in ids if name and name.startswith("ACP-") and "-D" not in name]
    assert len(points) == len(believed) > 0
    assert all(element.defeaters for element in believed)
    counters = [element for element in root.iter() if element.get("isCounter") == "true"]
    assert len(counters) >= sum(len(element.defeaters) for element in believed)


@pytest.mark.parametrize("made", CASES.values(), ids=CASES)
def test_each_solution_has_a_claim_point_and_a_defeater(made: type[Case]) -> None:
    solutions = [e for module in argument(made()) for e in module.elements if e.sort is Sort.SOLUTION]
    assert solutions
    assert [e.text for e in solutions if not (e.believed and e.defeaters)] == []


def test_a_requirement_rests_on_claims_that_it_uses_and_a_model_without_a_program_is_open() -> None:
    found = rover_case()
    elements = {e.name: e for module in argument(found) for e in module.elements}
    for r in found.requirements:
        goal = next(e for e in elements.values() if e.label == f"{r.id} [{r.stands}]")
        (strategy,) = (elements[name] for name in goal.supported_by if elements[name].sort is Sort.STRATEGY)
        used = {v.obligation.claim for v in found.obligations if v.id in r.closure and "/guarantee/" in v.id}
        assert used <= {elements[name].text for name in strategy.supported_by}
    undeveloped = {e.label for e in elements.values() if e.undeveloped}
    assert "agent [missing]" in undeveloped
    met, of_all = sum(r.level.holds for r in found.requirements), len(found.requirements)
    given = f"requirements, given assumptions A1 to A{len(found.assumptions)}"
    assert met < of_all
    assert elements["G1"].unsupported  # the top goal says no more than the headline
    assert elements["G1"].text.endswith(f"is shown to meet {met} of {of_all} {given} ({found.answers.told})")
    rows = doubts(found)
    assert sum(about for _, about, _, _ in rows) == sum(len(e.defeaters) for e in elements.values())
    page = render_argument(found).replace("&#39;", "'")
    assert [text for text, *_ in rows if text[1:] not in page] == []


G = guarantee("n", "g")
PROOF, TEST = evidence(G), evidence(G, Verdict.TESTED, "hypothesis", bound={"cases": 9})
READ = evidence(G, Verdict.REVIEWED, "review", details={"reviewers": ["A. Person"]})
TWO = evidence(G, Verdict.REVIEWED, "review", details={"reviewers": ["A. Person", "B. Other"]})


@pytest.mark.parametrize(
    ("records", "words", "answered"),
    [
        ([PROOF], "the solver is wrong", False),
        ([PROOF, TEST], "the solver is wrong", False),
        ([PROOF], "the method would accept a wrong node as well", False),
        ([replace(PROOF, details={"mutation": {"killed": 2, "mutants": 2}})], "would accept a wrong node", True),
        ([replace(PROOF, details={"mutation": {"killed": 1, "mutants": 2}})], "1 of 2 mutants killed", False),
        ([PROOF], "the translation or the reading", True),
        ([replace(PROOF, backend="strange")], "the translation or the reading", False),
        ([PROOF], "an error in tools whose answers have no certificate", False),
        ([TEST], "a case that was not tried fails", False),
        ([replace(TEST, bound={"failures at most": 0.1})], "a case that was not tried fails (", False),
        ([READ], "the reviewer overlooked a fault", False),
        ([TWO], "the reviewer overlooked a fault", True),
        ([evidence(G, Verdict.CHECKED, "ajpf")], "what the finite scenario leaves out", False),
        ([evidence(G, Verdict.MONITORED, "rosmonitoring", of=Object.RECORDING)], "does not show the programs", False),
        ([PROOF], "an error in assumptions without an owner", False),
    ],
)
def test_a_defeater_is_answered_only_by_what_was_done(records: list[Evidence], words: str, answered: bool) -> None:
    asked = Requirement("R", "It is safe.", None, None, ("n.g",))
    environment = [EnvironmentInput("n.x", "in.x > 0", "so")]
    plans = [node_plan("n", "high", "hoare", "hypothesis", "review", "ajpf", "rosmonitoring")]
    subject = system({"n": ["g"]}, plans=plans, requirements=[asked], environment=environment)
    found = make_case(subject, [G], records)
    doubts = [d for module in argument(found) for e in module.elements for d in e.defeaters if words in d.text]
    assert doubts, [d.text for module in argument(found) for e in module.elements for d in e.defeaters]
    assert {bool(d.answer) for d in doubts} == {answered}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda root: root[0].set("color", "red"), "has no color"),
        (lambda root: root[0].remove(root[0].find("name")), "name is there 0 times"),
        (lambda root: next(e for e in root.iter() if e.get("source")).set("source", "_none"), "which is nowhere"),
        (
            lambda root: next(e for e in root.iter() if e.get("reasoning")).set("reasoning", "_G1"),
            "as a ArgumentReasoning",
        ),
    ],
)
def test_the_checker_finds_seeded_faults(change: object, words: str) -> None:
    root = ET.fromstring(render_sacm(rover_case()))
    assert callable(change)
    change(root)
    assert any(words in fault for fault in faults(root)), faults(root)


@pytest.mark.skipif("AVOW_SACM_METAMODEL" not in os.environ, reason="OMG's EMOF file of SACM 2.3 is not here")
def test_the_table_is_the_metamodels() -> None:
    mark = "{http://schema.omg.org/spec/XMI/2.1}"
    root = ET.parse(Path(os.environ["AVOW_SACM_METAMODEL"])).getroot()
    named = {e.get(f"{mark}id"): e.get("name") for e in root.iter() if e.get(f"{mark}id")}
    real: Classes = {}
    for kind in root.iter("ownedType"):
        upper = kind.get("superClass") or next((s.get(f"{mark}idref") for s in kind.findall("superClass")), None)
        own: dict[str, Feature] = {}
        for a in kind.findall("ownedAttribute"):
            part = a.find("type")
            href = part.get("href", "").rpartition("#")[2] if part is not None else ""
            several, contained = a.get("upper") == "*", a.get("isComposite") == "true"
            of = named.get(a.get("type")) or href or "?"
            own[a.get("name") or ""] = (of, int(a.get("lower", "1")), several, contained)
        real[kind.get("name") or ""] = (named.get(upper) if upper else None, own)
    literals = {e.get("name") for e in root.iter("ownedLiteral")}
    assert literals == DECLARATIONS
    for name, (upper, own) in CLASSES.items():
        assert real[name][0] == upper, name
        assert {key: real[name][1].get(key) for key in own} == own, name
