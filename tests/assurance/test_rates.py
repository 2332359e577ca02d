"""Rates of failure of requirements that rest on samples: composed, shown, gated."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from helpers import every_text

from assurance.sample import case, evidence, guarantee, node_plan, obligation, system
from avow.assurance.case import conclude_again
from avow.assurance.model import Case
from avow.assurance.rates import misstated
from avow.base.codec import from_json, to_json
from avow.base.verdict import Verdict
from avow.evidence.obligation import Kind
from avow.evidence.record import COMPOSES, LIKELY, LIKELY_LEAVES, RATE, Evidence
from avow.kernel.rates import Likely, Trial
from avow.report.explained import explained
from avow.report.short import terminal_lines
from avow.system.plan import Requirement
from avow.system.probability import Probability


def sampled(of: str, bound: str = "0.086", trials: int = 34, **more: Any) -> Evidence:
    strata = [{"name": "", "trials": trials, "failures": 0, "bound": bound, "confidence": "0.95"}]
    return evidence(of, Verdict.TESTED, "experiment", details={RATE: strata, **more})


OWN = obligation("system", Kind.REQUIREMENT, "R", clauses=("a.g", "b.g", "c.g"))
COMPOSED = {"at_once": True, "beyond": []}


def three(
    *records: Evidence,
    policy: Any = None,
    criticality: str = "medium",
    proof: dict[str, Any] | None = COMPOSED,
    asked: Probability | None = None,
    stated: Sequence[Likely] = (),
) -> Case:
    """A requirement that rests on one guarantee of each of three nodes; `proof`: how its proof composes them."""
    names = ("a", "b", "c")
    formula = None if proof is None else "a.x > 0"
    subject = system(
        {name: ["g"] for name in names},
        plans=[node_plan(name, criticality, "experiment", "hypothesis", "hoare") for name in names],
        requirements=[
            Requirement("R", "All is well.", formula, None, tuple(f"{name}.g" for name in names), probability=asked)
        ],
        policy=policy,
    )
    own = (
        []
        if proof is None
        else [evidence(OWN, Verdict.PROVED, "compose", details={COMPOSES: proof, LIKELY_LEAVES: to_json([*stated])})]
    )
    obligations = [*(guarantee(name, "g") for name in names), *([OWN] if own else [])]
    return case(subject, obligations, [*records, *own])


ALL = (sampled("a.g"), sampled("b.g"), sampled("c.g"))


def test_three_nodes_at_8_6_percent_give_25_8_percent_at_joint_confidence() -> None:
    requirement = three(*ALL).requirements[0]
    assert requirement.rate is not None
    assert (requirement.rate.bound, requirement.rate.confidence) == ("0.258", "0.85")
    assert "at most 25.8 % of steps fail, at 85 % confidence" in requirement.answer
    assert len(requirement.rate.leaves) == 3
    assert not requirement.rate.why


def test_a_leaf_that_is_proved_takes_no_part() -> None:
    requirement = three(sampled("a.g"), evidence("b.g"), evidence("c.g")).requirements[0]
    assert requirement.rate is not None
    assert requirement.rate.bound == "0.086"
    assert three(evidence("a.g"), evidence("b.g"), evidence("c.g")).requirements[0].rate is None


def test_of_two_samples_of_a_claim_the_worse_counts() -> None:
    twice = replace(sampled("a.g", "0.2"), method="experiment-2", key="k")
    requirement = three(*ALL, twice).requirements[0]
    assert requirement.rate is not None
    assert requirement.rate.bound == "0.372"


@pytest.mark.parametrize(
    "other",
    [
        evidence("c.g", Verdict.TESTED, "hypothesis"),
        evidence("c.g", Verdict.MONITORED, "rosmonitoring"),
        evidence("c.g", Verdict.CHECKED, "storm", details={LIKELY: "9/10"}),
    ],
)
def test_a_leaf_without_a_counted_rate_leaves_none(other: Evidence) -> None:
    found = three(sampled("a.g"), sampled("b.g"), other)
    (requirement,) = found.requirements
    assert requirement.rate is not None
    assert not requirement.rate.bound
    assert "unknown, as no experiment counts trials of the robot's use for c.g" in requirement.answer
    assert found.answers.unrated == "no experiment counts trials of the robot's use for c.g"
    assert found.answers.unrated in found.answers.beside


@pytest.mark.parametrize("wrong", [{"bound": "0.08"}, {"trials": 33}, {"bound": "-1"}, {"bound": "x"}])
def test_a_record_that_says_more_than_its_sample_shows_gives_no_rate(wrong: dict[str, Any]) -> None:
    requirement = three(sampled("a.g", **wrong), *ALL[1:]).requirements[0]
    assert requirement.rate is not None
    assert not requirement.rate.bound


def of_runs(*records: Evidence) -> tuple[Evidence, ...]:
    """The same samples, of whole runs."""
    for record in records:
        record.details[RATE][0]["trial"] = "run"
    return records


RUNS = [sampled(f"{n}.g") for n in "abc"]


@pytest.mark.parametrize(
    ("records", "proof", "why"),
    [
        (ALL, None, "no proof of a formula composes one"),  # prose, and properties of runs
        (ALL, COMPOSED | {"at_once": False}, "a trial of c.g is a single step"),
        (ALL, COMPOSED | {"beyond": ["b.g"]}, "trials of b.g need not meet its condition"),
        ((*of_runs(*RUNS[:2]), ALL[2]), COMPOSED, "a trial of c.g is a single step, and others are whole runs"),
        (RUNS, None, "no proof of a formula composes one"),
    ],
)
def test_no_rate_stands_where_trials_are_none_of_the_requirement(
    records: tuple[Evidence, ...], proof: dict[str, Any] | None, why: str
) -> None:
    found = three(*records, proof=proof, policy={"max_failure_rate": {"medium": 0.9}})
    (requirement,) = found.requirements
    assert requirement.rate is not None
    assert not requirement.rate.bound
    assert why in requirement.answer
    passed, said = gate(found)
    assert not passed
    assert why in said


def test_whole_runs_compose_whatever_step_a_failure_counts_at() -> None:
    for proof in (COMPOSED, COMPOSED | {"at_once": False}):
        requirement = three(*of_runs(*(sampled(f"{n}.g") for n in "abc")), proof=proof).requirements[0]
        assert "at most 25.8 % of runs fail, at 85 % confidence" in requirement.answer
        assert requirement.rate is not None
        assert not misstated(requirement.rate)


def gate(found: Case) -> tuple[bool, str]:
    return next((g.passed, g.reason) for g in found.gates if g.id == "rates")


def test_the_policy_limits_the_rate_by_criticality() -> None:
    assert not any(g.id == "rates" for g in three(*ALL).gates)
    assert gate(three(*sure(), policy={"max_failure_rate": {"medium": 0.4}}))[0]
    for limit in ({"medium": 0.3}, {"low": 0.3}, {"medium": 0.4, "low": 0.3}):
        passed, why = gate(three(*sure(), policy={"max_failure_rate": limit}))
        assert not passed
        assert "at most 39 % of steps fail" in why
        assert "at most 30 % is allowed" in why
    assert gate(three(*sure(), policy={"max_failure_rate": {"high": 0.3}}))[0]  # nothing is as critical


def sure() -> list[Evidence]:
    """At 98 % each, 94 % together: at most 39 % of steps fail."""
    found = [sampled(f"{n}.g", "0.13", 40) for n in "abc"]
    for record in found:
        record.details[RATE][0]["confidence"] = "0.98"
    return found


@pytest.mark.parametrize(
    ("records", "asked", "why"),
    [
        (sure(), Probability("0.6"), ""),
        (sure(), Probability("0.65"), "at most 35 % is allowed"),
        (sure(), Probability("0.6", steps=2), "at most 20 % is allowed"),
        (sure(), Probability("0.6", per_run=True), "a rate of whole runs is asked"),
        (of_runs(*sure()), Probability("0.6", per_run=True), ""),
        (of_runs(*sure()), Probability("0.6"), ""),
        (of_runs(*sure()), Probability("0.6", steps=9), "a rate of steps is asked"),  # the runs may be shorter
        (of_runs(*sure()), Probability("0.8", per_run=True), "at most 20 % is allowed"),
        (ALL, Probability("0.7"), "a confidence of 90 % is asked"),
        (
            (*sure()[:2], evidence("c.g", Verdict.TESTED, "hypothesis")),
            Probability("0.7"),
            "failure rate in use unknown",
        ),
        ([evidence(f"{n}.g") for n in "abc"], Probability("0.99"), ""),
    ],
)
def test_a_probability_is_shown_only_if_the_rate_of_its_samples_is_within_it(
    records: Iterable[Evidence], asked: Probability, why: str
) -> None:
    """A guarantee without a probability takes no share in the proof, but its sample may fail as well."""
    found = three(*records, asked=asked)
    (requirement,) = found.requirements
    assert requirement.level.holds is not bool(why)
    (passed,) = (g.passed for g in found.gates if g.id == "requirements")
    assert passed is not bool(why)
    assert why.lower() in requirement.answer.lower()
    assert why in requirement.too_often


@pytest.mark.parametrize("least", ["0.6", "0.7"])
def test_a_checked_probability_counts_with_what_it_states(least: str) -> None:
    """A model checker bounds no failures in trials, and states a least probability."""
    checked = evidence("c.g", Verdict.CHECKED, "storm", details={LIKELY: "3/5"})
    stated = [Likely("c.g", least, Trial.STEP)]
    (requirement,) = three(
        evidence("a.g"), evidence("b.g"), checked, asked=Probability("0.65"), stated=stated
    ).requirements
    assert requirement.level.holds is (least == "0.7")


def test_a_limit_asks_for_joint_confidence_and_for_a_rate() -> None:
    limit = {"max_failure_rate": {"medium": 0.3}}
    passed, why = gate(three(*ALL, policy=limit))
    assert not passed
    assert "a confidence of 90 % is asked" in why
    passed, why = gate(three(*ALL[:2], evidence("c.g", Verdict.TESTED, "hypothesis"), policy=limit))
    assert not passed
    assert "failure rate in use unknown" in why


SAYS_NO_STANDING = {
    *("report.sarif", "findings.sarif", "junit.xml", "attestation.jsonl"),  # of claims and gates, not of requirements
    *("traceability.html", "traceability.csv"),  # of what requirements lead to
    *("system.html", "contracts.html", "qualification.html"),  # of claims, texts and tools
    "gsn.svg",  # boxes with a word each
}


def test_every_format_that_says_how_a_requirement_stands_says_its_rate() -> None:
    found = three(*ALL)
    for name, content in every_text(found):
        if isinstance(content, str) and name not in SAYS_NO_STANDING and not name.startswith("node-"):
            rate = '"bound": "0.258"' if name == "report.json" else "at most 25.8 % of steps fail, at 85 % confidence"
            plain = " ".join(content.replace("\\%", "%").replace("\\", "").replace("&nbsp;", " ").split())
            assert rate in plain, name
    assert any("at most 25.8 % of steps fail" in line for line in terminal_lines(found))
    assert any("at most 25.8 % of steps fail" in line for _, lines in explained(found, "R") for line in lines)


def test_the_samples_in_a_report_are_the_certificate() -> None:
    found = three(*ALL)
    read = from_json(Case, to_json(found))
    assert read.requirements == found.requirements == conclude_again(read).requirements
