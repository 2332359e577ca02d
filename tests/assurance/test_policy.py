"""Policies: profiles, rules of a plan, located errors, and what a demand accepts."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import pytest
from helpers import every_text

from assurance.sample import METHODS, SPAN, TODAY, case, evidence, guarantee, node_plan, obligation, system
from avow.assurance.answers import Level, Tone
from avow.assurance.gap import independent
from avow.assurance.model import Case, MethodInfo
from avow.assurance.policy import Demand, costs, profile, profile_names, read_policy
from avow.base.diagnostics import Rejected, Span
from avow.base.packaged import packaged
from avow.base.verdict import Link, Object, Verdict
from avow.evidence.obligation import Kind, Obligation
from avow.evidence.record import CASE, ISOLATION, SIGNED_BY, SOLVER, Evidence
from avow.evidence.status import Status
from avow.report.short import terminal_lines
from avow.system.pieces import Located, Piece
from avow.system.plan import Finding, Requirement
from avow.system.schema import plan_schema, violations


def located(data: Any) -> Located:
    lines = itertools.count(1)

    def piece(value: Any) -> Piece:
        line = next(lines)
        made = Piece(Span("plan.yaml", line, 1, line, 9), value)
        if isinstance(value, dict):
            made.entries = {key: piece(item) for key, item in value.items()}
        if isinstance(value, list):
            made.items = [piece(item) for item in value]
        return made

    return piece(data).located()


def test_profiles_are_ready_and_ordered_by_strictness() -> None:
    assert {"default", "reproduction", "sil1", "sil2", "sil3", "sil4"} <= set(profile_names())
    demands = [profile(f"sil{n}").demand("high") for n in (1, 2, 3, 4)]
    for weaker, stricter in itertools.pairwise(demands):
        assert set(stricter.one_of) <= set(weaker.one_of)
        assert stricter.methods >= weaker.methods
        assert stricter.reviewers >= weaker.reviewers
    assert profile("sil4").certified
    assert set(costs()) == {v.value for v in Verdict if v.supports}


def test_no_section_means_default_and_names_mean_profiles() -> None:
    assert read_policy(located(None)) == read_policy(located({})) == profile("default")
    assert read_policy(located("sil3")) == profile("sil3")


def test_rules_replace_what_they_name() -> None:
    policy = read_policy(
        located(
            {
                "profile": "sil2",
                "guarantees": {"low": {"one_of": ["justified"], "max_age_days": 30, "ties": ["generated"]}},
                "reviewers": ["A. Person"],
                "certified": True,
                "sanity": [],
            }
        )
    )
    assert policy.demand("high") == profile("sil2").demand("high")
    assert policy.demand("low").one_of == (Status.JUSTIFIED,)
    assert policy.demand("low").max_age(Status.TESTED) == 30
    assert policy.demand("low").links == (Link.GENERATED,)
    assert (policy.reviewers, policy.certified, policy.sanity) == (("A. Person",), True, ())
    assert policy.demand("unheard of") == policy.demand("high")


def test_the_plans_schema_has_the_form_of_a_policy() -> None:
    """A wrong policy is a fault of the plan's form; a profile is data of the same form."""
    rules = plan_schema()
    rules = {**rules["properties"]["policy"], "$defs": rules["$defs"]}
    for wrong in (
        {"guarantee": {}},
        {"guarantees": []},
        {"guarantees": {"hihg": {}}},
        {"guarantees": {"high": {"one_of": ["refuted"]}}},
        {"guarantees": {"high": {"methods": -1}}},
        {"guarantees": {"high": {"methods": True}}},
        {"guarantees": {"high": {"independent": "yes"}}},
        {"guarantees": {"high": {"max_age_days": {"proven": 3}}}},
        {"guarantees": {"high": {"isolation": "seald"}}},
        {"guarantees": {"high": 2}},
        {"sanity": {"a": 1}},
        {"certified": "on"},
        {"proved": "claimed"},
        {"max_failure_rate": {"high": 1}},
        3,
    ):
        assert len(violations(located(wrong), rules)) == 1, wrong
    (slip,) = violations(located({"requirments": ["proved"]}), rules)
    assert slip.hint == "did you mean `requirements`?"
    for profile_rules in packaged("avow.assurance", "profiles.yaml")["profiles"].values():
        own = {key: value for key, value in profile_rules.items() if key in rules["properties"]}
        assert violations(located(own), rules) == ()


@pytest.mark.parametrize(("data", "path"), [("sil5", ()), ({"profile": "defautl"}, ("profile",))])
def test_a_profile_that_does_not_exist_is_told_with_its_place(data: Any, path: tuple[str, ...]) -> None:
    with pytest.raises(Rejected) as caught:
        read_policy(located(data))
    (fault,) = caught.value.diagnostics
    assert (fault.code, fault.span) == ("POLICY001", located(data).at(*path))


def the_case(policy: Any, *records: Evidence, criticality: str = "high") -> Case:
    subject = system({"n": ["g"]}, plans=[node_plan("n", criticality, "hoare", "hypothesis", "review")], policy=policy)
    return case(subject, [guarantee("n", "g")], list(records))


def gate(found: Case, name: str = "guarantees-high") -> tuple[bool, str]:
    it = next(g for g in found.gates if g.id == name)
    return it.passed, it.reason


PROOF = evidence("n.g")
TEST = evidence("n.g", Verdict.TESTED, "hypothesis")
REVIEW = evidence("n.g", Verdict.REVIEWED, "review", details={"reviewers": ["A", "B"], "date": "2026-11-01"})


def test_no_single_point_of_evidence() -> None:
    met = the_case("default", PROOF, TEST)
    assert gate(met) == (True, "1 of 1 is supported: 1 proved and tested; 1 of a model only")
    asks = next(g.asks for g in met.gates if g.id == "guarantees-high")
    assert asks.startswith("proved or checked, supported by 2 independent methods, reviewed not")
    passed, reason = gate(the_case("default", PROOF))
    assert not passed
    assert "1 independent method, but 2" in reason
    same_solver = replace(TEST, tool="z3")
    assert not gate(the_case("default", PROOF, same_solver))[0]  # two wrappings of one solver are one


def test_a_method_that_failed_is_not_hidden_by_another_that_answered() -> None:
    failed = evidence("n.g", Verdict.ERROR, "review", summary="the class is not made: KeyError")
    passed, reason = gate(the_case("default", PROOF, TEST, failed))
    assert (passed, "review failed: the class is not made: KeyError" in reason) == (False, True)


def test_independence_is_a_matching() -> None:
    def item(backend: str, tool: str) -> Evidence:
        return replace(PROOF, backend=backend, tool=tool)

    assert independent([]) == 0
    assert independent([item("a", "z3"), item("b", "z3"), item("a", "cvc5")]) == 2
    assert independent([item("a", "z3"), item("a", "cvc5")]) == 1
    assert independent([item("hoare", "z3"), replace(item("dafny", "dafny"), details={SOLVER: "z3"})]) == 1
    assert independent([item("a", "x"), item("b", "x"), item("b", "y"), item("c", "y"), item("c", "z")]) == 3


def test_a_refutation_is_never_disregarded() -> None:
    old = replace(evidence("n.g", Verdict.REFUTED, "review"), started="2001-01-01T00:00:00Z")
    assert not gate(the_case("default", PROOF, TEST, old))[0]


def test_age_reviewers_links_hypotheses() -> None:
    low = {
        "guarantees": {
            "high": {"one_of": ["proved", "tested", "reviewed"], "reviewers": 2, "max_age_days": {"reviewed": 30}}
        }
    }
    assert gate(the_case(low, REVIEW))[0]
    stale = replace(REVIEW, details={"reviewers": ["A", "B"], "date": "2026-09-01"})
    assert "81 days old" in gate(the_case(low, stale))[1]
    assert (
        "dated in the future"
        in gate(the_case(low, replace(REVIEW, details={**REVIEW.details, "date": "2027-01-01"})))[1]
    )
    assert "reviewed by 1" in gate(the_case(low, replace(REVIEW, details={"reviewer": "A", "date": "2026-11-01"})))[1]
    named = {**low, "reviewers": ["A"]}
    assert "B may not review" in gate(the_case(named, REVIEW))[1]
    strict = {"guarantees": {"high": {"one_of": ["proved"], "ties": ["generated"], "unconditional": True}}}
    assert gate(the_case(strict, PROOF))[0]
    assert "tie is mapped" in gate(the_case(strict, replace(PROOF, link=Link.MAPPED)))[1]
    assert "rests on hypotheses" in gate(the_case(strict, replace(PROOF, hypotheses=("h",))))[1]
    assert TODAY.isoformat() == "2026-11-21"


@pytest.mark.parametrize(
    ("asked", "met"),
    [
        ({"methods": 2}, (PROOF, TEST)),
        ({"independent": True}, (TEST,)),
        ({"max_age_days": 30}, (REVIEW,)),
        ({"reviewers": 2}, (REVIEW,)),
        ({"ties": ["generated"]}, (PROOF,)),
        ({"of": ["source"]}, (replace(PROOF, of=Object.SOURCE),)),
        ({"numbers": ["float64"]}, (replace(PROOF, numbers="float64"),)),
        ({"unconditional": True}, (PROOF,)),
        ({"cases": 20}, (replace(TEST, bound={"cases": 300, "triggered": 20}),)),
        ({"isolation": "processes"}, (replace(TEST, details={ISOLATION: "processes"}),)),
    ],
)
def test_each_demand_counts_without_the_names_of_statuses(asked: dict[str, Any], met: tuple[Evidence, ...]) -> None:
    policy = {"guarantees": {"high": asked}}
    assert gate(the_case(policy, *met))[0]
    assert not gate(the_case(policy))[0]
    assert "nothing is asked" not in read_policy(located(policy)).demand("high").text()
    assert gate(the_case({"guarantees": {"high": {}}}))[0]


def test_a_test_of_too_few_cases_does_not_count() -> None:
    few = replace(TEST, bound={"cases": 300, "triggered": 19})
    told = "19 cases met its condition, 20 are asked"
    assert told in gate(the_case({"guarantees": {"high": {"one_of": ["tested"], "cases": 20}}}, few))[1]
    assert [n for n in profile_names() if not profile(n).demand("medium").cases] == ["reproduction"]


def test_what_is_asked_is_said_in_the_words_of_the_page() -> None:
    asked = Demand(one_of=(Status.PROVED, Status.MONITORED, Status.ARGUED))
    assert asked.text() == "proved or monitored or argued"


def test_what_was_verified_and_in_which_numbers() -> None:
    asked = {"guarantees": {"high": {"one_of": ["proved"], "of": ["source"], "numbers": ["float64"]}}}
    real = replace(PROOF, of=Object.SOURCE, numbers="float64")
    assert gate(the_case(asked, real))[0]
    assert "it is of a model, source is asked" in gate(the_case(asked, PROOF))[1]
    assert "a REAL is exact in it, float64 is asked" in gate(the_case(asked, replace(real, numbers="exact")))[1]
    words = next(b.words for b in the_case(asked, real).answers.bases if b.squares)
    assert words == "1 proved (source in float64)"


@pytest.mark.parametrize(("until", "good"), [("2026-11-21", True), ("2026-11-20", False), ("some day", False)])
def test_what_is_given_until_a_day_ends_with_it(until: str, good: bool) -> None:
    """A review says itself how long it may be relied upon; the backend reads no clock, so its record never changes."""
    review = replace(REVIEW, details={**REVIEW.details, "valid_until": until})
    found = the_case("sil1", review)
    assert gate(found)[0] is good
    assert found.obligations[0].status is (Status.REVIEWED if good else Status.STALE)
    assert found.exit_code == (0 if good else 1)
    if not good:
        assert (
            "renew the review" in found.gates[[g.id for g in found.gates].index("guarantees-high")].suggestions[0].text
        )
    rejected = replace(review, verdict=Verdict.REFUTED)
    assert the_case("sil1", rejected).obligations[0].status is Status.REFUTED


def test_two_reviewers_are_two_persons_in_one_record_or_in_two() -> None:
    asked = {"guarantees": {"high": {"one_of": ["reviewed"], "reviewers": 2, "max_age_days": 30}}}

    def review(*names: str, method: str = "review", date: str = "2026-11-01") -> Evidence:
        return replace(REVIEW, method=method, key=method, details={"reviewers": list(names), "date": date})

    def passes(*records: Evidence) -> bool:
        subject = system({"n": ["g"]}, plans=[node_plan("n", "high", "review", "review-2")], policy=asked)
        return gate(case(subject, [guarantee("n", "g")], list(records)))[0]

    assert passes(review("A. Person", "B. Person"))
    assert passes(review("A. Person"), review("B. Person", method="review-2"))
    assert not passes(review("A. Person"), review("A. Person", method="review-2"))
    assert not passes(review("A. Person", "a person "))

    def signed(by: str, name: str, method: str = "review") -> Evidence:
        found = review(name, method=method)
        return replace(found, details={**found.details, SIGNED_BY: by})

    assert passes(signed("k1", "A. Person"), signed("k2", "B. Person", method="review-2"))
    assert passes(signed("k1", "A. Person"), review("B. Person", method="review-2"))
    assert not passes(signed("k1", "A. Person"), signed("k1", "B. Person", method="review-2"))
    assert not passes(signed("k1", "A. Person"), signed("k2", "a person", method="review-2"))
    assert not passes(review("A. Person"), review("B. Person", method="review-2", date="2026-09-01"))


def test_the_cheapest_step_is_named() -> None:
    def step(found: Case) -> str:
        suggestion = found.obligations[0].suggestion
        return suggestion.text if suggestion else ""

    assert step(the_case("default", PROOF, TEST)) == ""
    assert step(the_case("default", PROOF)).startswith("add `hypothesis`")  # any second method: the cheapest is a test
    assert step(the_case("default")).startswith("add `ajpf`")  # a check is asked, and cheaper than a proof
    only = case(
        system({"n": ["g"]}, plans=[node_plan("n", "high", "dafny")]),
        [guarantee("n", "g")],
        [],
        keys={("rover/n/guarantee/g", "dafny"): "k"},
    )
    assert step(only) == "install what `dafny` needs: apt install dafny"
    assert step(the_case("default", evidence("n.g", Verdict.REFUTED))).startswith("repair")


def test_persons_are_dearer_than_machines() -> None:
    """Measured runs give no more than tests do, but somebody must drive."""
    tested = the_case(
        {"guarantees": {"high": {"one_of": ["tested", "proved"], "methods": 2, "independent": True}}}, TEST
    )
    suggestion = tested.obligations[0].suggestion
    assert suggestion is not None
    assert suggestion.text.startswith("add `ajpf`")
    assert suggestion.text.endswith("or `hoare` or `experiment`")


def environment(*accepted: Finding, policy: Any = "sil3", formal: bool = False, reason: bool = False) -> Case:
    """A requirement that rests on a guarantee (with `reason`, on a person's word alone) and on what is assumed of the
    environment, with a person's reason."""
    subject = system(
        {"n": ["g"]},
        plans=[node_plan("n", "low", "hoare")],
        policy=policy,
        accepted=accepted,
        requirements=[
            Requirement(
                "R", "safe", "0 <= r" if formal else None, None, ("n.g", "system/composition/environment.n.r"), SPAN
            )
        ],
    )
    condition = obligation("system", Kind.COMPOSITION, "environment.n.r", "0 <= r")
    proof = evidence("n.g", Verdict.JUSTIFIED if reason else Verdict.PROVED, tool="z3")
    told = evidence(condition, Verdict.JUSTIFIED, "compose", strength=Verdict.PROVED)
    own = obligation("system", Kind.REQUIREMENT, "R", "R follows")
    listed = [guarantee("n", "g"), condition, *([own] if formal else [])]
    return case(subject, listed, [proof, told, *([evidence(own, method="compose")] if formal else [])])


def risk(**more: str) -> Finding:
    terms = {"reason": "data sheet", "who": "R. A.", "date": "2026-10-01", "expires": "2026-12-01", **more}
    matched = ("system/composition/environment.n.r",)
    return Finding("system/composition/environment.*", "justified", matched=matched, **terms)


def test_what_is_weaker_than_asked_is_told_with_what_is_asked() -> None:
    found = environment()
    passed, reason = gate(found, "composition")
    assert not passed
    assert "justified, but proved or checked or reviewed is asked" in reason
    told = next(g for g in found.gates if g.id == "composition").suggestions
    assert "accepted" in told[0].text


def test_a_gate_that_passes_by_excuses_says_so() -> None:
    """In every format that lists gates: no sentence says more than the policy let pass."""
    excuse = Finding("n/guarantee/g", "refuted", "known", "A. Person", "2026-11-01", "2027-11-01")
    subject, about = (
        system({"n": ["g"]}, plans=[node_plan("n", "low", "hoare")], accepted=[excuse]),
        guarantee("n", "g"),
    )
    found = case(subject, [about], [evidence(about, Verdict.REFUTED)])
    gate = next(gate for gate in found.gates if gate.id == "refuted")
    assert (gate.passed, gate.mark) == (True, "◐")
    made = {name: str(text) for name, text in every_text(found)}
    for name in ("index.html", "claims.html", "report.md"):
        assert gate.state in made[name]
    assert f"<system-out>{gate.reason}</system-out>" in made["junit.xml"]


def test_a_risk_that_is_taken_excuses_what_rests_on_it_until_its_day() -> None:
    strict = {"requirements": ["proved"], "composition": ["proved"]}
    for policy in ("sil3", strict):
        good = environment(risk(), policy=policy)
        assert gate(good, "composition")[0], gate(good, "composition")
        assert good.obligations[1].status is Status.JUSTIFIED  # it makes no claim true
        late = environment(risk(expires="2026-11-20"), policy=policy)
        assert not gate(late, "accepted")[0]
        assert not gate(late, "composition")[0]
        assert late.exit_code == 1
    assert gate(environment(risk(), policy=strict, formal=True), "requirements")[0]
    passed, reason = gate(environment(risk(expires="2026-11-20"), policy=strict, formal=True), "requirements")
    assert not passed
    assert "R is justified, but proved is asked: it rests on what is assumed of n.r" in reason
    assert environment(risk(expires="2026-11-21")).exit_code == environment(risk()).exit_code  # its last day counts


@pytest.mark.parametrize("name", [name for name in profile_names() if name != "reproduction"])
def test_the_gates_agree_on_an_assumption_and_each_that_fails_has_a_next_step(name: str) -> None:
    """A reason for a condition is accepted by the gate of the composition and by that of requirements, or by none; a
    guarantee with a reason alone is no such condition."""
    found = environment(policy=name, formal=True)
    accepts = Status.JUSTIFIED in profile(name).composition
    assert [gate(found, one)[0] for one in ("composition", "requirements")] == [accepts, accepts]
    assert all(g.suggestions for g in found.gates if not g.passed and g.id != "standard")
    alone = environment(policy=name, formal=True, reason=True)
    assert gate(alone, "requirements")[0] == (Status.JUSTIFIED in profile(name).requirements)


def test_a_requirement_in_prose_is_excused_by_no_risk() -> None:
    found = environment(risk(), policy={"requirements": ["proved"], "composition": ["proved"]})
    passed, reason = gate(found, "requirements")
    assert not passed
    assert "argued, but proved is asked" in reason
    assert "formula" in next(g for g in found.gates if g.id == "requirements").suggestions[0].text


def test_where_the_plan_gave_up_every_method_another_is_named() -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "high")])
    suggestion = case(subject, [guarantee("n", "g")], [PROOF], keys={}).obligations[0].suggestion
    assert suggestion is not None
    assert suggestion.text.startswith("add `ajpf`")  # and not: run the plan's methods again


def test_who_gives_up_the_method_that_refutes_is_told_of() -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hypothesis")])
    refuted = evidence("n.g", Verdict.REFUTED)
    found = case(subject, [guarantee("n", "g")], [refuted, TEST], keys={(TEST.obligation, "hypothesis"): TEST.key})
    assert found.obligations[0].status is Status.TESTED
    assert any(i.kind == "withdrawn" and "hoare refuted it on" in i.text and not i.advice for i in found.open_items)
    other = replace(refuted, obligation_digest="of another meaning")
    found = case(subject, [guarantee("n", "g")], [other, TEST], keys={(TEST.obligation, "hypothesis"): TEST.key})
    assert not any(i.kind == "withdrawn" for i in found.open_items)


@pytest.mark.parametrize(
    ("read", "told"),
    [({"good": "1"}, True), ({"good": "1", "bad": "3"}, False), ({"good": "4"}, False), ({"other": "5"}, False)],
)
def test_a_refutation_by_a_file_that_is_no_longer_read_is_told_of(read: dict[str, str], told: bool) -> None:
    """A recording that refutes does not go away by no longer being named; a changed program or recording is another."""
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hypothesis")])
    refuted = evidence("n.g", Verdict.REFUTED, "hypothesis", key="before", inputs={"good": "1", "bad": "2"})
    now = replace(TEST, inputs=read)
    found = case(subject, [guarantee("n", "g")], [refuted, now], keys={(now.obligation, "hypothesis"): now.key})
    assert found.obligations[0].status is Status.TESTED
    assert any("the plan no longer has it read bad" in i.text and not i.advice for i in found.open_items) is told
    assert ("withdrawn" in {d.key for d in found.deficits}) is told
    assert (found.deficits[0].key == "withdrawn") is told  # the first screen shows the weightiest kinds only


@pytest.mark.parametrize(
    ("read", "program", "told"),
    [
        ({"other": "5"}, "1", True),
        ({"msg": "1", "other": "5"}, "1", True),
        ({"msg": "1", "bad": "6"}, "1", True),
        ({"msg": "1", "other": "5"}, "7", False),
        ({"msg": "1", "other": "5"}, "", True),
        ({"msg": "1", "bad": "6"}, "", False),
    ],
)
def test_another_recording_refutes_no_refutation_of_the_same_program(
    read: dict[str, str], program: str, told: bool
) -> None:
    """`program`: its digest now, 1 when the recording refuted; empty: no method reads it."""
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "rosmonitoring", "hypothesis")])
    recording = evidence("n.g", Verdict.REFUTED, "rosmonitoring", key="before", of=Object.RECORDING)
    refuted = replace(recording, inputs={"msg": "1", "bad": "2"})
    now = replace(recording, key="now", verdict=Verdict.MONITORED, strength=Verdict.MONITORED, inputs=read)
    run = replace(TEST, of=Object.SOURCE, inputs={"program": "1"})
    again = replace(run, key="again", inputs={"program": program}, run="later", started="2026-11-22")
    records = [run, refuted, now, again] if program else [refuted, now]
    keys = {(r.obligation, r.method): r.key for r in records}
    found = case(subject, [guarantee("n", "g")], records, keys=keys)
    assert found.obligations[0].status.supports
    assert ("withdrawn" in {d.key for d in found.deficits}) is told
    other = evidence("m.h", Verdict.MONITORED, "rosmonitoring", inputs=refuted.inputs)
    both = system({"n": ["g"], "m": ["h"]}, plans=[node_plan(n, "low", "rosmonitoring", "hypothesis") for n in "nm"])
    asked = {**keys, (other.obligation, other.method): other.key}
    found = case(both, [guarantee("n", "g"), guarantee("m", "h")], [*records, other], keys=asked)
    assert any(", on which 1 other claim still relies" in i.text for i in found.open_items) is told


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({}, True),
        ({"details": {CASE: {"x": 1}}}, False),
        ({"tool_version": "0"}, False),
        ({"inputs": {"p": "0"}}, False),
    ],
)
def test_other_options_refute_no_refutation(change: dict[str, Any], told: bool) -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hypothesis")])
    now = replace(TEST, inputs={"p": "1"})
    refuted = replace(now, key="before", verdict=Verdict.REFUTED, **change)
    found = case(subject, [guarantee("n", "g")], [refuted, now], keys={(now.obligation, "hypothesis"): now.key})
    assert any("no longer has the options" in i.text for i in found.open_items) is told


def test_reproduction_asks_nothing_of_guarantees() -> None:
    assert the_case("reproduction").exit_code == 0
    assert the_case("default").exit_code == 1


def test_a_method_is_suggested_where_the_contract_looks_like_its_matter() -> None:
    def step(methods: tuple[MethodInfo, ...]) -> str:
        subject = system({"n": ["g"]}, plans=[node_plan("n", "high", "hoare")])
        unknown = evidence("n.g", Verdict.UNKNOWN)
        suggestion = case(subject, [guarantee("n", "g")], [unknown], methods=methods).obligations[0].suggestion
        return suggestion.text if suggestion else ""

    assert step(METHODS).startswith("add `ajpf`")
    assert step(tuple(replace(m, unsuited=("n",)) if m.name == "ajpf" else m for m in METHODS)).startswith(
        "add `dafny`"
    )
    assert step(tuple(replace(m, unsuited=("m",)) if m.name == "ajpf" else m for m in METHODS)).startswith("add `ajpf`")


def test_of_two_opposite_answers_one_is_wrong_or_something_has_to_be_repaired() -> None:
    suggestion = the_case("default", PROOF, evidence("n.g", Verdict.REFUTED, "hypothesis")).obligations[0].suggestion
    assert suggestion is not None
    assert suggestion.text.startswith("n.g: one method proves it and another refutes it; repair what is wrong")


def test_a_method_that_gave_no_answer_is_seen_to_first() -> None:
    def step(verdict: Verdict, words: str) -> str:
        other = replace(evidence("n.g", verdict, "hypothesis"), summary=words)
        suggestion = the_case("default", PROOF, other).obligations[0].suggestion
        return suggestion.text if suggestion else ""

    assert step(Verdict.ERROR, "n.py, line 3: no Python") == (
        "repair what keeps `hypothesis` from answering: n.py, line 3: no Python"
    )
    given_up = step(Verdict.UNKNOWN, "its condition was never met " * 20)
    assert "; or see why `hypothesis` gave up: its condition was never met" in given_up
    assert given_up.endswith("…")


ADA = """Lovelace Ada|Dr. Ada Lovelace|Ada Lovelace MSc|Ada Lovelace-King|Ada King Lovelace|A.L.|Ada|Mrs Lovelace
ada.lovelace@x.org|Ada Lovelace <a@b.c>|Ada Lovelace (safety)|Ada Lovelace Jr.|Ada  Love lace|ADA LOVELACE
A. B. Lovelace"""
SPELLINGS = ADA.replace("\n", "|").split("|")
OTHERS = [
    ("A. Müller", "B. Müller"),
    ("A. Müller", "A. Maier"),
    ("Ada Lovelace", "Alan Turing"),
    ("Ада", "Олег"),
    ("Иван Петров", "Olga Petrova"),
    ("Ann Lee", "Dan Lee"),
    ("Anna Schmidt", "Hanna Schmitt"),
    ("Li Wei", "Wang Wei"),
]


def test_one_person_under_several_spellings_is_one_reviewer() -> None:
    from avow.base.persons import one_person

    same = [
        "A. Müller",
        "Anna Müller",
        "anna mueller",
        "Müller, Anna",
        "Anna-Maria Müller",
        "MÜLLER, A.",
        "Prof. Müller",
    ]
    assert [(a, b) for a in same for b in same if not one_person(a, b)] == []
    assert [
        name for name in SPELLINGS if not one_person("Ada Lovelace", name) or not one_person(name, "Ada Lovelace")
    ] == []
    assert [pair for pair in OTHERS if one_person(*pair)] == []
    marked = [("Björn Åse", "Bjoern Aase"), ("Jörg Größ-Bär", "Joerg Groess-Baer"), ("Øæ Åå", "Oeae Aaaa")]
    assert [pair for pair in marked if not one_person(*pair)] == []


@pytest.mark.parametrize(
    "name",
    [
        "Ada L\u200bovelace",
        "123",
        "?",
        "TBD",
        "n.o. One",
        "unknown",
    ],
)
def test_names_that_look_like_anothers_are_told(name: str) -> None:
    from avow.base.persons import unreadable

    assert unreadable(name)
    assert [n for n in (*SPELLINGS, "Jürgen Weiß", "Søren Ågård", "Łukasz", "Олег", "山田 はな") if unreadable(n)] == []


def test_names_taken_for_one_are_told() -> None:
    asked = {"guarantees": {"high": {"one_of": ["reviewed"], "reviewers": 2}}}
    record = replace(REVIEW, details={"reviewers": ["Ada Lovelace", "Dr. Ada Lovelace"], "date": "2026-11-01"})
    subject = system({"n": ["g"]}, plans=[node_plan("n", "high", "review")], policy=asked)
    passed, why = gate(case(subject, [guarantee("n", "g")], [record]))[:2]
    assert not passed
    assert "'Ada Lovelace' and 'Dr. Ada Lovelace' are taken for one person" in str(why)


@pytest.mark.parametrize(
    ("of", "word"),
    [
        (obligation("n", Kind.GUARANTEE, "g"), "trigger"),
        (obligation("system", Kind.COMPOSITION, "environment.n.r"), "assume less"),
    ],
)
def test_what_says_nothing_is_repaired_by_what_it_is(of: Obligation, word: str) -> None:
    hollow = evidence(of, Verdict.TESTED, "experiment", strength=Verdict.TESTED, vacuous=True)
    found = case(system({"n": ["g"]}, plans=[node_plan("n", "high")]), [guarantee("n", "g"), of], [hollow])
    suggestion = next(v for v in found.obligations if v.id == of.id).suggestion
    assert suggestion is not None
    assert word in suggestion.text


@pytest.mark.parametrize("lesser", [Verdict.TESTED, Verdict.UNKNOWN, Verdict.ERROR])
def test_the_first_step_is_about_what_is_refuted_and_each_names_its_claim(lesser: Verdict) -> None:
    subject = system({"n": ["broken", "lacking"]}, plans=[node_plan("n", "high", "hoare", "hypothesis")])
    refuted = evidence("n.broken", Verdict.REFUTED, "hypothesis")
    hollow = evidence("n.lacking", lesser, "hypothesis", vacuous=lesser is Verdict.TESTED)
    found = case(subject, [guarantee("n", "broken"), guarantee("n", "lacking")], [refuted, hollow])
    steps = [s.text for gate in found.gates for s in gate.suggestions if gate.id == "guarantees-high"]
    assert steps[0].startswith("repair what the counterexample of n.broken shows")
    if lesser is Verdict.TESTED:
        assert steps[1] == "give the method inputs that meet the trigger of n.lacking"


def test_the_first_step_about_a_contract_names_the_clauses_at_fault() -> None:
    whole = obligation("n", Kind.SANITY, "consistent")
    none = replace(
        evidence(whole, Verdict.REFUTED, "sanity"), summary="no inputs and outputs meet air and wet together"
    )
    found = case(system({"n": ["air", "wet"]}), [guarantee("n", "air"), whole], [none])
    first = next(gate.suggestions[0].text for gate in found.gates if gate.id == "refuted")
    assert first.startswith("repair n: no inputs and outputs meet air and wet together")


def test_the_gates_that_fail_are_in_the_order_of_what_to_do() -> None:
    """What is wrong, then what lacks a reason, then what lacks a method: also on the terminal's last line."""
    subject = system({"n": ["g", "h"]}, plans=[node_plan("n", "high", "hoare")])
    claims = [guarantee("n", "g"), guarantee("n", "h"), obligation("system", Kind.COMPOSITION, "whole.one-output")]
    records = [evidence("n.g", Verdict.TESTED, "hoare"), evidence(claims[2], Verdict.UNKNOWN, "compose")]
    lacking = case(subject, claims, records)
    assert [g.id for g in lacking.gates if not g.passed] == ["composition", "guarantees-high"]
    assert terminal_lines(lacking)[-1].startswith("next: give a reason in the plan")
    wrong = case(subject, claims, [*records, evidence("n.h", Verdict.REFUTED, "hoare")])
    assert [g.id for g in wrong.gates if not g.passed] == ["refuted", "guarantees-high", "composition"]
    assert terminal_lines(wrong)[-1].startswith("next: repair what the counterexample of n.h shows")


def test_a_requirement_that_says_nothing_is_red_though_a_person_accepts_it() -> None:
    own = obligation("system", Kind.REQUIREMENT, "R", "R follows")
    terms = {"reason": "r", "who": "R. A.", "date": "2026-10-01", "expires": "2026-12-01"}
    subject = system(
        {"n": ["g"]},
        accepted=[Finding("system/requirement/R", "vacuous", matched=("system/requirement/R",), **terms)],
        requirements=[Requirement("R", "safe", "TRUE", None, ("n.g",), SPAN)],
    )
    says_nothing = evidence(own, Verdict.PROVED, "compose", vacuous=True)
    found = case(subject, [guarantee("n", "g"), own], [evidence("n.g"), says_nothing])
    assert found.good
    assert (found.answers.headline, found.answers.tone) == (Level.NOT_SHOWN, Tone.RED)


@pytest.mark.parametrize(("criticality", "offered"), [("high", False), ("low", True)])
def test_a_refuted_guarantee_of_high_criticality_is_to_be_repaired(criticality: str, offered: bool) -> None:
    target = guarantee("n", "g")
    subject = system({"n": ["g"]}, plans=[node_plan("n", criticality, "hoare")])
    (view,) = case(subject, [target], [evidence(target, Verdict.REFUTED)]).guarantees
    assert view.suggestion is not None
    assert ("accept it" in view.suggestion.text) == offered


@pytest.mark.parametrize("verdict", [Verdict.PROVED, Verdict.REFUTED])
def test_the_gate_of_findings_says_that_remarks_do_not_count(verdict: Verdict) -> None:
    """A guarantee that is not needed is a remark: no gate fails, and none says that nothing is refuted."""
    remark = obligation("n", Kind.SANITY, "needed-g")
    found = case(system({"n": ["g"]}), [guarantee("n", "g"), remark], [evidence("n.g"), evidence(remark, verdict)])
    (refuted,) = (gate for gate in found.gates if gate.id == "refuted")
    assert refuted.passed
    assert ("but for remarks" in refuted.reason) is (verdict is Verdict.REFUTED)
