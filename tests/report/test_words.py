"""What people read in place of ids, of records' bounds, of commands and of long reasons."""

from __future__ import annotations

import csv
import io
import json
import re
from collections import Counter
from dataclasses import replace
from xml.etree import ElementTree

import pytest
import yaml
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, node_plan, obligation, rover_case, system
from helpers import every_text
from reqif.parser import ReqIFParser

from avow.assurance.model import Gate
from avow.assurance.naming import short
from avow.base.verdict import Hypothesis, HypothesisKind, Object, Verdict
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.report.markdown import render_markdown
from avow.report.page import render_page
from avow.report.wording import bound_text, gate_line, tally, tone, tool_command
from avow.sanity.claims import Property
from avow.system.plan import Hazard, Requirement, Validation
from report.test_reqif import values as reqif_values


@pytest.mark.parametrize("about", Property)
def test_a_sanity_claim_is_read_as_the_good_thing_that_it_states(about: Property) -> None:
    whole, part = short(f"s/agent/sanity/{about}"), short(f"s/agent/sanity/{about}-inspect_here")
    assert whole.startswith("agent (")
    assert part.startswith("agent.inspect_here (")
    assert "sanity" not in whole + part
    assert f"{about}-" not in part


def test_names_for_people_are_told_apart_and_what_is_unknown_stays() -> None:
    names = [f"s/agent/sanity/{about}{subject}" for about in Property for subject in ("", "-a", "-b")]
    assert len({short(name) for name in names}) == len(names)
    for odd in ("not-vacuousness", "not-vacuous-", "not-vacuous.a", "vacuous-a", "other-a"):
        assert short(f"s/agent/sanity/{odd}") == f"agent/sanity/{odd}"
    assert short("s/system/composition/environment.in.away") == "what is assumed of in.away"
    assert short("s/system/composition/D1.entailed") == "system/composition/D1.entailed"


def test_the_bounds_of_a_state_space_are_words() -> None:
    bound = {"exhaustive": True, "indices": ["i in 0…12"], "properties": 25, "states": 24119, "transitions": 1}
    assert bound_text(bound) == "every state explored, for each i in 0…12, 25 properties, 24 119 states, 1 transition"
    assert bound_text({"exhaustive": False}) == "not every state explored"


def test_a_tools_command_is_printed_with_the_folder_in_which_it_runs() -> None:
    claim = guarantee("agent", "low", "It is low", "out.x < 1")
    record = replace(evidence(claim, Verdict.TESTED, "my tests"), command=("python", "-P", "test_agent.py"))
    assert tool_command(record) == f"(cd 'artifacts/{claim.system}/agent/my tests' && python -P test_agent.py)"
    assert tool_command(replace(record, command=())) == ""


def test_a_gates_reason_is_a_line_and_all_of_it_a_fold() -> None:
    parts = [f"agent.clause_{n}: tested, but proved is asked of everything that moves" for n in range(5)]
    line = gate_line("; ".join(parts))
    assert line.startswith(parts[0])
    assert line.endswith("; and 3 more")
    assert len(line) <= 220
    assert gate_line(parts[0]) == parts[0]
    assert len(gate_line("x" * 900)) == 200
    gate = Gate("guarantees-high", "Guarantees", False, "; ".join(parts))
    case = replace(rover_case(), gates=(gate,))
    assert parts[4].replace("_", "\\_") not in render_markdown(case)
    assert "and 3 more" in render_markdown(case)
    page = render_page(case)
    assert page.count("<summary>all of it</summary>") == 1
    assert page.count(parts[0]) == 2
    assert page.count(parts[4]) == 1


_TAGS = re.compile(r"<(style|script)\b.*?</\1>|<[^>]*>", re.DOTALL)


@pytest.mark.parametrize("verdict", [*(v for v in Verdict if v is not Verdict.PARTIAL), "validated", "vacuous"])
def test_a_claim_has_one_status_in_every_format(verdict: str) -> None:
    """Each format is read back, claim by claim: requirements by their level, obligations by their standing."""
    first, second = guarantee("agent", "g1"), guarantee("agent", "g2", line=12)
    given = verdict if isinstance(verdict, Verdict) else Verdict.PROVED
    method = {Verdict.REVIEWED: "review", Verdict.JUSTIFIED: "review"}.get(given, "hoare")
    record = evidence(first, given, method, vacuous=verdict == "vacuous", strength=given if given.supports else None)
    unread = None if verdict == "validated" else Validation("A. Person", "2026-01-01")
    asked = [
        Requirement("R", "It is safe.", None, None, ("agent.g1", "agent.g2")),
        Requirement("Q", "It is so.", "agent.x > 0", None, ("agent.g2",), validation=unread),
    ]
    own = obligation("system", Kind.REQUIREMENT, "Q", clauses=("agent.g2",))
    reason, given_it = (obligation("system", Kind.COMPOSITION, name) for name in ("start", "whole.loop"))
    on_reason, on_both = (
        {"rests_on": (Hypothesis(HypothesisKind.CLAIM, o.local_id, o.digest),)} for o in (reason, given_it)
    )
    records = [record, evidence(second, of=Object.SOURCE), evidence(own, method="compose", **on_both)]
    records += [evidence(reason, Verdict.JUSTIFIED, "review"), evidence(given_it, method="compose", **on_reason)]
    plans = [node_plan("agent", "low", "hoare", "review")]
    hazards = [Hazard("H1", "It burns", "critical", mitigated_by=("R",)), Hazard("H2", "It drifts", "marginal")]
    subject = system({"agent": ["g1", "g2"]}, plans=plans, requirements=asked, hazards=hazards)
    found = make_case(subject, [first, second, own, reason, given_it], records)
    made = {name: text for name, text in every_text(found) if isinstance(text, str)}
    levels = {r.id: r.level.value for r in found.requirements}
    claims = {view.id: view.standing.value for view in found.obligations} | {own.id: levels["Q"]}
    dangers = {view.hazard.id: view.level.value for view in found.hazards}
    passing = {v.id for v in found.obligations if v.standing.supports and v.standing is not Status.JUSTIFIED} - {own.id}
    passing |= {own.id} if found.requirements[1].level.holds else set()
    assert {reason.id, given_it.id}.isdisjoint(passing)

    data = json.loads(made["report.json"])
    assert {o["obligation"]["name"]: o.get("level", o["standing"]) for o in data["obligations"]} == {
        view.obligation.name: claims[view.id] for view in found.obligations
    }
    assert {r["id"]: r["level"] for r in data["requirements"]} == levels
    assert {h["hazard"]["id"]: h["level"] for h in data["hazards"]} == dangers
    rows = list(csv.DictReader(io.StringIO(made["traceability.csv"])))
    assert {r["obligation"]: r["obligation status"] for r in rows if r["obligation"]} == claims
    assert {r["requirement"]: r["requirement status"] for r in rows if r["requirement"]} == levels
    objects = reqif_values(ReqIFParser.parse_from_string(made["traceability.reqif"])).values()
    for kind, wanted in (("Claim", claims), ("Requirement", levels), ("Hazard", dangers)):
        assert {told["ReqIF.ForeignID"]: told["Status"] for of, told in objects if of == kind} == wanted
    reasons = {r["tool"] for r in rows if r["verdict"] == "justified"}
    assert reasons <= {"a person"}, "a person's reason is no tool's"
    table = made["claims.html"].partition('<table class="counts">')[2].partition("</table>")[0]
    told = Counter[str]()
    for many, word in re.findall(r">(\d+) ([a-z -]+)</span>", table):
        told[word] += int(many)
    assert told == Counter(claims.values()) == Counter({w.value: n for w, n in tally(found.obligations).items()})
    results = json.loads(made["report.sarif"])["runs"][0]["results"]
    assert all(f" is {claims[r['properties']['obligation']]}. " in r["message"]["text"] for r in results)
    assert {r["properties"]["obligation"] for r in results if r["kind"] == "pass"} == passing
    cases = ElementTree.fromstring(made["junit.xml"]).findall("testsuite/testcase")
    tested = {c.get("name"): c for c in cases if not str(c.get("classname")).endswith((".gates", ".requirements"))}
    asked = {c.get("name"): c for c in cases if str(c.get("classname")).endswith(".requirements")}
    outputs = {name: str(c.findtext("system-out", "")) for name, c in asked.items()}
    assert {name: said.split(":")[0] for name, said in outputs.items() if said} == {
        r.id: r.stands for r in found.requirements if r.level.holds
    }
    for view in found.obligations:
        inside = list(tested[view.obligation.name])
        assert (not inside) == (view.id in passing)
        assert all(claims[view.id] in str(part.get("message")) for part in inside)
    (whole, *_) = map(json.loads, made["attestation.jsonl"].splitlines())
    assert set(whole["predicate"]["passedTests"]) == passing
    assert whole["predicate"]["verdict"] == found.answers.told
    assert (whole["predicate"]["result"] == "PASSED") == (found.good and all(r.level.holds for r in found.requirements))
    elements = {k: v for document in yaml.safe_load_all(made["gsn.yaml"]) for k, v in document.items()}
    texts = [str(body.get("text")) for body in elements.values()]
    declared = {label: claim.get("assertionDeclaration") for label, claim in _sacm(made["sacm.xml"], "Claim")}
    holding = {f"{r.id} [{r.stands}]": r.level.holds for r in found.requirements}
    holding |= {f"{v.obligation.name} [{v.standing}]": v.standing.supports for v in found.guarantees}
    assert {label: declared[label] == "asserted" for label in holding} == holding
    given = {claim.get("gid"): label for label, claim in _sacm(made["sacm.xml"], "ArtifactReference")}
    for _, said in _sacm(made["sacm.xml"], "AssertedEvidence"):
        label = given[str(said.get("source")).removeprefix("_")]
        if label.endswith("]"):  # a record of the ledger
            status = label.rpartition("[")[2].rstrip("]")
            assert (said.get("isCounter") == "true") == (status == "refuted")
            assert status == "refuted" or Status(status).supports
    for view in found.guarantees:
        assert any(text.startswith(f"{view.obligation.name} [{claims[view.id]}]") for text in texts)
    for name, level in (levels | dangers).items():
        assert any(text.startswith(f"{name} [{level}") for text in texts)
    sacm = [str(name.get("content")) for name in ElementTree.fromstring(made["sacm.xml"]).iter("name")]
    labels = [f"{view.obligation.name} [{claims[view.id]}]" for view in found.guarantees]
    for label in (*labels, *(f"{name} [{level}" for name, level in (levels | dangers).items())):
        assert sum(text.startswith(label) for text in sacm) == 1, label
    shown = {name: " ".join(_TAGS.sub(" ", made[name]).split()) for name in ("argument.html", "claims.html", "gsn.svg")}
    trace = " ".join(_TAGS.sub(" ", made["traceability.html"]).split())
    assert f"and {sum(r.level.holds for r in found.requirements)} of them are at least argued" in trace
    for name, level in levels.items():
        assert f"{name}: {level}" in shown["gsn.svg"]
        for page in ("argument.html", "claims.html"):
            assert re.search(rf"\b{name} \S+ {level}\b", shown[page]), (page, name, level)
        assert level in made["comment.md"]
    for name, level in dangers.items():
        assert re.search(rf"{name}\b.{{,200}}{level}", _TAGS.sub(" ", made["index.html"]), re.DOTALL), name
    for view in found.guarantees:
        row = next(line for line in made["report.md"].splitlines() if line.startswith(f"| {short(view.id)} "))
        assert f"| {claims[view.id]} |" in row
        assert re.search(rf"{claims[view.id]} +{re.escape(view.obligation.claim)}", shown["argument.html"])


def _sacm(text: str, kind: str) -> list[tuple[str, ElementTree.Element]]:
    """(name, element) of every element of a type."""
    every = ElementTree.fromstring(text).iter()
    return [(str(e.find("name").get("content")), e) for e in every if f"sacm:{kind}" in e.attrib.values()]


def test_only_what_supports_a_claim_has_a_good_colour() -> None:
    assert {s for s in Status if tone(s) in ("good", "fair")} == {s for s in Status if s.supports}
