"""Standards: each query of a case is answered both ways, and docs/standards.md has all of them and all standards."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from helpers import every_text

from assurance.sample import case, evidence, guarantee, node_plan, obligation, system
from avow.assurance.answers import Sort
from avow.assurance.model import Case
from avow.assurance.policy import profile, profile_names
from avow.assurance.standards import Queries, State, standards
from avow.base.packaged import packaged
from avow.base.verdict import Object, Verdict
from avow.evidence.obligation import Kind, ProgramClaim
from avow.system.plan import Requirement

PAGE = Path(__file__).parents[2] / "docs/standards.md"
G = guarantee("n", "g")


def case_of(policy: str = "do178c-dal-c", *, source: str = "SRS 1", idle: bool = False, **evidence_of: Any) -> Case:
    """One guarantee under one requirement; with `idle` another guarantee that serves none."""
    asked = Requirement("R", "It keeps low", None, None, ("n.g",), source=source)
    claims = [G, *([guarantee("n", "h")] if idle else [])]
    names = {"n": [claim.name for claim in claims]}
    subject = system(names, plans=[node_plan("n", "high", "hoare")], requirements=[asked], policy=policy)
    return case(subject, claims, [evidence(G, **evidence_of)])


def test_a_policy_that_names_a_standard_has_a_gate_and_a_table() -> None:
    found = case_of()
    assert found.standard is not None
    states = {o.id: o.state for o in found.standard.objectives}
    assert states["A-3.1"] is State.PARTLY  # nobody compares the sentences with their source
    assert states["A-3.4"] is State.OPEN  # the requirement is prose
    assert states["DO-330"] is State.OUTSIDE
    assert "A-3.7" in states
    (gate,) = [gate for gate in found.gates if gate.id == "standard"]
    assert not gate.passed
    assert "A-3.4: requirements without a formula: R" in gate.reason
    assert gate.suggestions
    page = dict(every_text(found))["index.html"]
    assert all(
        word in page
        for word in ("A-3.4", "Avow is not qualified", found.standard.counts, found.standard.selection[:60])
    )


def test_levels_choose_objectives_and_other_policies_have_none() -> None:
    b, c = (case_of(f"do178c-dal-{level}").standard for level in "bc")
    assert b is not None
    assert c is not None
    assert {o.id for o in b.objectives} - {o.id for o in c.objectives} == {
        "A-3.3",
        "A-4.3, A-4.10",
        "A-4.4",
        "A-4.11",
        "A-5.3",
        "A-7.6",
    }
    assert case_of("default").standard is None


def asked(found: Case, query: str) -> str:
    queries = Queries(found.gates, found.requirements, found.obligations, found.hazards, found.assumptions)
    return queries.missing(query)


@pytest.mark.parametrize(
    ("query", "good", "bad"),
    [
        ("sources", case_of(), case_of(source="")),
        ("requirements", case_of(), case_of(verdict=Verdict.REFUTED)),
        ("trace", case_of(), case_of(idle=True)),
        ("guarantees", case_of(), case_of(verdict=Verdict.UNKNOWN)),
        ("nothing-refuted", case_of(), case_of(verdict=Verdict.REFUTED)),
        ("formal-methods", case_of(), case_of(verdict=Verdict.TESTED)),
        ("tests", case_of(verdict=Verdict.TESTED, of=Object.BINARY), case_of(verdict=Verdict.TESTED)),
        ("tests", case_of(verdict=Verdict.TESTED, of=Object.BINARY), case_of(verdict=Verdict.MONITORED)),
        ("source", case_of(of=Object.SOURCE), case_of()),
        ("models-linked", case_of(of=Object.SOURCE), case_of()),
        ("mutants", case_of(details={"mutation": {"killed": 2, "mutants": 2}}), case_of()),
        ("reviews", case_of(verdict=Verdict.REVIEWED), case_of()),
    ],
)
def test_a_query_is_answered_both_ways(query: str, good: Case, bad: Case) -> None:
    assert asked(good, query) == ""
    assert asked(bad, query) != ""


@pytest.mark.parametrize("compared", ["hoare", "dafny"])
def test_a_model_is_linked_where_the_program_was_compared_with_that_one(compared: str) -> None:
    claim = obligation("n", Kind.PROGRAM, ProgramClaim.LINKED)
    agreed = evidence(claim, Verdict.TESTED, "hypothesis", details={"agrees": {compared: ["g"]}})
    subject = system({"n": ["g"]}, plans=[node_plan("n", "high", "hoare", "hypothesis")])
    found = case(subject, [G, claim], [evidence(G), agreed])
    assert (asked(found, "models-linked") == "") == (compared == "hoare")


def test_nothing_is_served_by_the_absence_of_what_is_asked_about() -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "medium", "hoare")], policy="iso26262-asil-d")
    found = case(subject, [G], [evidence(G)])
    for query in ("formal-methods", "mutants", "programs", "hazards", "requirements", "trace", "sanity", "composition"):
        assert asked(found, query) != "", query
    nothing = case(system({"n": []}, policy="ul4600"), [], [], discrepancies=None)
    for query in Queries.NAMES - {"assumptions", "nothing-refuted"}:
        assert asked(nothing, query) != "", query


@pytest.mark.parametrize("name", [name for name in profile_names() if profile(name).standard])
def test_an_objective_that_a_gate_serves_is_open_with_its_reason_while_the_gate_fails(name: str) -> None:
    found = case_of(name, verdict=Verdict.REFUTED)
    failing = [gate for gate in found.gates if gate.id == "requirements"]
    assert [gate.passed for gate in failing] == [False]
    assert found.standard is not None
    _, _, objectives = standards()[profile(name).standard]
    mine = {o.id for o in objectives if "requirements" in o.serves}
    views = [o for o in found.standard.objectives if o.id in mine]
    assert views
    assert all(o.state is State.OPEN and failing[0].reason in o.why and o.next for o in views)
    assert all(o.next for o in found.standard.objectives if o.state is State.OPEN)


def test_validation_and_hazards_are_asked() -> None:
    found = case_of()
    unread = replace(found, requirements=tuple(replace(r, validated=False) for r in found.requirements))
    assert asked(found, "validated") == ""
    assert "not validated: R" in asked(unread, "validated")
    assert asked(found, "hazards") == "no hazard is listed"
    term = {"who": "A. Person", "until": "2030-12-31", "because": "a data sheet", "expired": False}
    owned = replace(found, assumptions=tuple(replace(a, **term) for a in found.assumptions))
    assert owned.assumptions
    assert asked(owned, "assumptions") == ""
    for bare in ({"who": ""}, {"until": "", "sort": Sort.WORLD}, {"because": ""}, {"expired": True}):
        one = replace(owned, assumptions=(replace(owned.assumptions[0], **bare),))
        assert "A1" in asked(one, "assumptions")


def test_every_profile_that_names_a_standard_names_one_there_is() -> None:
    named = {name: profile(name).standard for name in profile_names() if profile(name).standard}
    assert set(named.values()) == set(standards())
    used = {query for *_, objectives in standards().values() for o in objectives for query in o.serves}
    assert used == Queries.NAMES == set(packaged("avow.assurance", "standards.yaml")["next"])


def test_the_page_has_every_standard() -> None:
    rows = [
        f"| {title} | {', '.join(f'`{p}`' for p in profile_names() if profile(p).standard == name)} |"
        for name, (title, *_) in standards().items()
    ]
    text = PAGE.read_text("utf-8")
    assert [row for row in rows if row not in text] == []
    served = {word for row in re.findall(r"^\| ([a-z, -]+) \|", text, re.MULTILINE) for word in row.split(", ")}
    assert served >= Queries.NAMES
