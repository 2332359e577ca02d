"""Standards: each query of a case is answered both ways, and docs/standards.md has all of them and all standards."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from assurance.sample import case, evidence, guarantee, node_plan, obligation, system
from avow.assurance.model import Case
from avow.assurance.policy import profile, profile_names
from avow.assurance.standards import Query, State, _Queries, standards
from avow.base.verdict import Object, Verdict
from avow.evidence.obligation import Kind, ProgramClaim
from avow.report import formats
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
    assert states["A-3.1"] is State.SERVED
    assert states["A-3.4"] is State.OPEN  # the requirement is prose
    assert states["DO-330"] is State.OUTSIDE
    assert "A-3.7" in states
    (gate,) = [gate for gate in found.gates if gate.id == "standard"]
    assert not gate.passed
    assert "A-3.4: requirements without a formula: R" in gate.reason
    page = dict(formats(found))["index.html"]
    assert all(word in page for word in ("A-3.4", "Avow is not qualified", found.standard.counts))


def test_levels_choose_objectives_and_other_policies_have_none() -> None:
    b, c = (case_of(f"do178c-dal-{level}").standard for level in "bc")
    assert b is not None
    assert c is not None
    assert {o.id for o in b.objectives} - {o.id for o in c.objectives} == {"A-3.3"}
    assert case_of("default").standard is None


def asked(found: Case, query: Query) -> str:
    return _Queries(found.gates, found.requirements, found.obligations, found.hazards).missing(query)


@pytest.mark.parametrize(
    ("query", "good", "bad"),
    [
        (Query.SOURCES, case_of(), case_of(source="")),
        (Query.REQUIREMENTS, case_of(), case_of(verdict=Verdict.REFUTED)),
        (Query.TRACE, case_of(), case_of(idle=True)),
        (Query.GUARANTEES, case_of(), case_of(verdict=Verdict.UNKNOWN)),
        (Query.NOTHING_REFUTED, case_of(), case_of(verdict=Verdict.REFUTED)),
        (Query.FORMAL_METHODS, case_of(), case_of(verdict=Verdict.TESTED)),
        (Query.TESTS, case_of(verdict=Verdict.TESTED), case_of()),
        (Query.SOURCE, case_of(of=Object.SOURCE), case_of()),
        (Query.MODELS_LINKED, case_of(of=Object.SOURCE), case_of()),
        (Query.MUTANTS, case_of(details={"mutation": {"killed": 2, "mutants": 2}}), case_of()),
        (Query.MONITORS, case_of(verdict=Verdict.MONITORED), case_of()),
        (Query.REVIEWS, case_of(verdict=Verdict.REVIEWED), case_of()),
    ],
)
def test_a_query_is_answered_both_ways(query: Query, good: Case, bad: Case) -> None:
    assert asked(good, query) == ""
    assert asked(bad, query) != ""


@pytest.mark.parametrize("compared", ["hoare", "dafny"])
def test_a_model_is_linked_where_the_program_was_compared_with_that_one(compared: str) -> None:
    claim = obligation("n", Kind.PROGRAM, ProgramClaim.LINKED)
    agreed = evidence(claim, Verdict.TESTED, "hypothesis", details={"agrees": {compared: ["g"]}})
    subject = system({"n": ["g"]}, plans=[node_plan("n", "high", "hoare", "hypothesis")])
    found = case(subject, [G, claim], [evidence(G), agreed])
    assert (asked(found, Query.MODELS_LINKED) == "") == (compared == "hoare")


def test_nothing_is_served_by_the_absence_of_what_is_asked_about() -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "medium", "hoare")], policy="iso26262-asil-d")
    found = case(subject, [G], [evidence(G)])
    for query in (Query.SOURCE, Query.FORMAL_METHODS, Query.TESTS, Query.MUTANTS, Query.PROGRAMS, Query.HAZARDS):
        assert asked(found, query) != "", query


def test_validation_and_hazards_are_asked() -> None:
    found = case_of()
    unread = replace(found, requirements=tuple(replace(r, validated=False) for r in found.requirements))
    assert asked(found, Query.VALIDATED) == ""
    assert "not validated: R" in asked(unread, Query.VALIDATED)
    assert asked(found, Query.HAZARDS) == "no hazard is listed"


def test_every_profile_that_names_a_standard_names_one_there_is() -> None:
    named = {name: profile(name).standard for name in profile_names() if profile(name).standard}
    assert set(named.values()) == set(standards())
    used = {query for _, objectives in standards().values() for o in objectives for query in o.serves}
    assert used == set(Query)


def test_the_page_has_every_standard() -> None:
    rows = [
        f"| {title} | {', '.join(f'`{p}`' for p in profile_names() if profile(p).standard == name)} |"
        for name, (title, _) in standards().items()
    ]
    text = PAGE.read_text("utf-8")
    assert [row for row in rows if row not in text] == []
    served = {word for row in re.findall(r"^\| ([a-z, -]+) \|", text, re.MULTILINE) for word in row.split(", ")}
    assert set(Query) <= served
