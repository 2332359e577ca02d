"""The five answers: laws that no mixture of evidence and assumptions may break, and their words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from helpers import every_text
from hypothesis import given, settings
from hypothesis import strategies as st

from assurance.sample import (
    TODAY,
    case,
    evidence,
    guarantee,
    node_plan,
    obligation,
    rover_case,
    system,
    validated,
)
from avow.assurance.answers import (
    ABOUT,
    MEANINGS,
    PLATFORM,
    REACTION,
    START,
    TOOLS,
    Assumption,
    Level,
    Sort,
    Tone,
)
from avow.assurance.case import as_of, conclude_again
from avow.assurance.changes import KINDS, _edit, compare
from avow.assurance.deficits import _WORDS
from avow.assurance.deficits import words_of as deficit_words
from avow.assurance.first_screen import _lines, _owners
from avow.assurance.model import Case
from avow.assurance.relied import relied_of, weakness
from avow.assurance.state import baseline_of, state_of
from avow.base.plain import identifiers, words_of
from avow.base.verdict import Hypothesis, HypothesisKind, Link, Object, Verdict, bound
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.evidence.record import RATE, Evidence
from avow.evidence.status import Status
from avow.report.short import weakest_words
from avow.system.plan import EnvironmentInput, Hazard, Requirement, Statement, System

NODES = {"a": ["g", "h"], "b": ["g"]}
GUARANTEES = [guarantee(node, name) for node, names in NODES.items() for name in names]
METHODS = {"hoare": Verdict.PROVED, "ajpf": Verdict.CHECKED, "hypothesis": Verdict.TESTED, "review": Verdict.REVIEWED}
HYPOTHESES = ("the map is true", "the runs are drawn", "the table fits")
OWNED, LATE, NOBODY = ("somebody", "2030-01-01"), ("somebody", "2020-01-01"), ("", "")
ALWAYS = [Statement(place, "It is so", "", *OWNED) for place in (PLATFORM, REACTION, TOOLS)]
PLANS = [node_plan(node, "low", *METHODS) for node in NODES]
PROSE = Requirement("R", "It is safe.", None, None, ("a", "b"))
FORMAL = Requirement("R", "It is safe.", "a.x > 0", None, ("a", "b"))
HAZARDS = (
    Hazard("H", "It burns", "critical", mitigated_by=("a", "b")),
    *(Hazard(f"H-{m}", "It burns", "critical", mitigated_by=(f"a/{m}", f"b/{m}")) for m in ("hoare", "ajpf")),
)
OWN = obligation(SYSTEM_LEVEL, Kind.REQUIREMENT, "R", clauses=("a.g", "a.h", "b.g"))


def subject(requirement: Requirement, statements: Sequence[Statement] = (), **others: Any) -> System:
    made = system(NODES, plans=PLANS, requirements=[requirement], **others)
    return replace(made, plan=replace(made.plan, statements=tuple(statements)))


def build(
    records: Sequence[Evidence], statements: Sequence[Statement] = (), *, formal: bool, hazards: Sequence[Hazard] = ()
) -> Case:
    more = [OWN] if formal else []
    derived = [evidence(OWN, method="compose")] if formal else []
    made = subject(FORMAL if formal else PROSE, statements)
    made = replace(made, plan=replace(made.plan, hazards=tuple(hazards)))
    return case(made, [*GUARANTEES, *more], [*records, *derived])


@st.composite
def records(draw: st.DrawFn) -> list[Evidence]:
    found = []
    for target in GUARANTEES:
        for method in draw(st.lists(st.sampled_from(sorted(METHODS)), unique=True, max_size=4)):
            verdict = draw(st.sampled_from([METHODS[method], METHODS[method], Verdict.UNKNOWN, Verdict.REFUTED]))
            supposed = tuple(draw(st.lists(st.sampled_from(HYPOTHESES), unique=True, max_size=2)))
            of = draw(st.sampled_from([Object.MODEL, Object.SOURCE]))
            found.append(evidence(target, verdict, method, hypotheses=supposed, of=of))
    return found


@st.composite
def statements(draw: st.DrawFn) -> list[Statement]:
    found = []
    for method in METHODS:
        for word in ("map", "runs", "table"):
            who, until = draw(st.sampled_from([OWNED, OWNED, LATE, NOBODY]))
            found.append(Statement(f"assumptions.{method}.{word}", f"The {word} of {method}", "", who, until))
    return [*found, Statement("requirements.R.validation", "It amounts to it", "", *OWNED)]


LAW = settings(max_examples=40, deadline=None)


@pytest.mark.slow
@LAW
@given(records(), statements(), st.booleans(), st.data())
def test_lost_evidence_never_improves_the_colour(
    listed: list[Evidence], said: list[Statement], formal: bool, data: st.DataObject
) -> None:
    support = [at for at, record in enumerate(listed) if record.verdict.supports]
    if not support:
        return
    lost = data.draw(st.sampled_from(support))
    before = build(listed, said, formal=formal)
    after = build([*listed[:lost], *listed[lost + 1 :]], said, formal=formal)
    assert after.requirements[0].tone.rank <= before.requirements[0].tone.rank
    assert after.answers.tone.rank <= before.answers.tone.rank


@pytest.mark.slow
@LAW
@given(records(), statements(), st.booleans(), st.data())
def test_a_new_assumption_never_improves_the_colour(
    listed: list[Evidence], said: list[Statement], formal: bool, data: st.DataObject
) -> None:
    if not listed:
        return
    at = data.draw(st.sampled_from(range(len(listed))))
    text = data.draw(st.sampled_from([*HYPOTHESES, "something else"]))
    more = replace(listed[at], hypotheses=(*listed[at].hypotheses, text))
    before = build(listed, said, formal=formal)
    after = build([*listed[:at], more, *listed[at + 1 :]], said, formal=formal)
    assert after.requirements[0].tone.rank <= before.requirements[0].tone.rank
    assert after.answers.tone.rank <= before.answers.tone.rank


@pytest.mark.slow
@LAW
@given(records(), statements())
def test_what_is_argued_is_never_stronger_than_what_is_derived(listed: list[Evidence], said: list[Statement]) -> None:
    argued, derived = build(listed, said, formal=False), build(listed, said, formal=True)
    assert argued.requirements[0].tone.rank <= derived.requirements[0].tone.rank
    assert argued.requirements[0].tone is not Tone.GREEN
    # the derivation is a tool's answer; a person's sentence is none
    assert {s.key for s in argued.assumptions} | {TOOLS} >= {s.key for s in derived.assumptions}
    assert (
        argued.requirements[0].weakest_evidence == derived.requirements[0].weakest_evidence
        or derived.requirements[0].weakest_evidence is not None
    )


@pytest.mark.slow
@LAW
@given(records(), statements(), st.booleans())
def test_the_verdict_counts_what_it_speaks_of_and_follows_from_what_the_case_holds(
    listed: list[Evidence], said: list[Statement], formal: bool
) -> None:
    found = build(listed, said, formal=formal)
    assert conclude_again(found) == found
    a = found.answers
    match a.headline:
        case Level.NOT_SHOWN | Level.REFUTED:
            assert a.tone is Tone.RED
            assert found.exit_code != 0 or not all(r.level.holds for r in found.requirements)
        case Level.EXAMINED:
            assert a.tone is (Tone.AMBER if a.warned else Tone.GREY)
        case level:  # the least of what the requirements are
            assert found.exit_code == 0
            assert level.holds
            assert level is max((r.level for r in found.requirements), key=list(Level).index)
    assert sum(many for _, many in a.by_level) == len(found.requirements)
    assert sum(line.count for line in a.supposed) == len(found.assumptions)
    assert len({s.key for s in found.assumptions}) == len(found.assumptions)


@pytest.mark.slow
@LAW
@given(records(), statements(), st.booleans())
def test_no_verdict_is_above_what_lies_below_it(listed: list[Evidence], said: list[Statement], formal: bool) -> None:
    found = build(listed, said, formal=formal, hazards=HAZARDS)
    best, seen = Level.SHOWN if formal else Level.ARGUED, set()
    for target in GUARANTEES:
        own = [r for r in listed if r.obligation == target.id]
        sure = [r for r in own if r.verdict in (Verdict.PROVED, Verdict.CHECKED)]
        if any(r.verdict is Verdict.REFUTED for r in own):
            least = Level.NOT_SHOWN
        elif sure:
            least = Level.SHOWN if any(r.of is Object.SOURCE for r in sure) else Level.MODELS
        elif tests := [r for r in own if r.verdict is Verdict.TESTED]:
            least = Level.TESTS if any(r.of is not Object.MODEL for r in tests) else Level.TESTED_MODELS
        else:
            least = Level.ARGUED if any(r.verdict is Verdict.REVIEWED for r in own) else Level.NOT_SHOWN
        seen.add(least)
        best = max(best, least, key=list(Level).index)
    if best is Level.TESTS and Level.MODELS in seen:
        best = Level.TESTED_MODELS
    order = list(Level).index
    (asked,) = found.requirements
    assert order(asked.level) >= order(best)
    assert order(found.answers.headline) >= order(best)
    if asked.tone is Tone.GREEN:  # for all runs
        proofs = {r.obligation for r in listed if r.verdict is Verdict.PROVED}
        assert proofs >= {target.id for target in GUARANTEES}
    if formal:  # guarantees mitigate no more than a requirement that follows from them
        whole, *by_method = found.hazards
        assert order(whole.level) >= order(asked.level)
        assert whole.tone.rank <= asked.tone.rank
        for hazard in by_method:
            method = hazard.hazard.id.removeprefix("H-")
            taken = {r.obligation for r in listed if r.method == method}  # the guarantees that the method discharges
            said_so = {r.obligation for r in listed if r.method == method and r.verdict.supports}
            if hazard.level.holds:
                assert said_so == taken
                assert {target.node for target in GUARANTEES if target.id in taken} == set(NODES)
                assert asked.level.holds or taken != {target.id for target in GUARANTEES}
            late = any(a.expired and a.key.startswith(f"assumptions.{method}.") for a in found.assumptions)
            assert not (hazard.level.holds and late)


def test_samples_and_models_are_two_weaknesses() -> None:
    """A proof of a model beside a test of the program, below one requirement or two, and mitigations of a hazard."""
    model, tested, source = (
        [evidence(g, verdict, method, of=of) for g in GUARANTEES]
        for verdict, method, of in (
            (Verdict.PROVED, "hoare", Object.MODEL),
            (Verdict.TESTED, "hypothesis", Object.SOURCE),
            (Verdict.PROVED, "hoare", Object.SOURCE),
        )
    )
    hazard = Hazard("H", "It burns", "critical", mitigated_by=("a", "b"))
    for records, level in (
        ([*model[:2], tested[2]], Level.TESTED_MODELS),
        ([*source[:2], tested[2]], Level.TESTS),
        ([*source[:2], model[2]], Level.MODELS),
        (source, Level.SHOWN),
    ):
        found = build(records, ALWAYS, formal=True, hazards=[hazard])
        assert (found.requirements[0].level, found.hazards[0].level) == (level, level)
    two = [replace(FORMAL, supported_by=("a",)), replace(FORMAL, id="S", supported_by=("b",))]
    made = subject(two[0])
    made = replace(made, plan=replace(made.plan, requirements=tuple(map(validated, two))))
    owns = [replace(OWN, clauses=("a.g", "a.h")), replace(OWN, name="S", clauses=("b.g",))]
    records = [*model[:2], tested[2], *(evidence(own, method="compose") for own in owns)]
    both = case(made, [*GUARANTEES, *owns], records)
    assert [r.level for r in both.requirements] == [Level.MODELS, Level.TESTS]
    assert both.answers.headline is Level.TESTED_MODELS


def test_the_weakest_sample_has_the_highest_bound_whatever_its_kind() -> None:
    known = {"judged": 60}, {"runs": 40, "triggered": 20, "failure probability at most": 0.13911}, {"judged": 3}
    kinds = [(Verdict.MONITORED, "rosmonitoring"), (Verdict.TESTED, "experiment"), (Verdict.MONITORED, "rosmonitoring")]
    tests = [
        evidence(g, verdict, method, bound=dict(seen))
        for g, (verdict, method), seen in zip(GUARANTEES, kinds, known, strict=True)
    ]
    order = sorted(tests, key=lambda r: weakness(relied_of(r, Status(r.verdict.value))))
    assert [r.bound for r in order] == [known[2], known[1], known[0]]


def test_of_the_wiring_alone_nothing_is_shown_of_the_running_program() -> None:
    made = subject(replace(FORMAL, supported_by=()), ALWAYS)
    proof = evidence(OWN, method="compose", details={"needed": [], "certificate": {}})
    (found,) = case(made, [*GUARANTEES, replace(OWN, clauses=())], [proof]).requirements
    assert (found.closure, found.level, found.tone) == ((OWN.id,), Level.MODELS, Tone.AMBER)


def test_the_words_of_verdicts_are_those_of_the_docs() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reading-a-report.md").read_text("utf-8")
    rows = dict(re.findall(r"^\| \*(.+?)\* \| (.+) \|$", page, re.MULTILINE))
    assert rows == {level.capitalize(): meaning for level, meaning in MEANINGS.items()}


def test_past_its_last_day_an_assumption_opens_what_needs_it() -> None:
    listed = [evidence(g, hypotheses=("the map is true",), of=Object.SOURCE) for g in GUARANTEES]

    def on(until: str) -> Case:
        said = Statement("assumptions.hoare.map", "The map is true", "", "somebody", until)
        return build(listed, [said, *ALWAYS], formal=True)

    good = on(TODAY.isoformat())
    assert (good.requirements[0].level, good.requirements[0].tone, good.answers.tone) == (
        Level.SHOWN,
        Tone.GREEN,
        Tone.GREEN,
    )
    assert good.answers.verdict == "Shown"
    late = on("2026-11-20")
    assert late.requirements[0].level is Level.NOT_SHOWN
    assert as_of(good, TODAY + timedelta(days=1)).requirements[0].level is Level.NOT_SHOWN
    assert late.answers.verdict == "Not shown: 1 of 1 requirement"
    assert late.exit_code == 1
    (gate,) = [g for g in late.gates if g.id == "requirements"]
    assert "an assumption has expired" in gate.reason


NO_WORDS = "(no plain words yet: write says: … under assumptions.hoare.WORD, with a word of its text, in plan.yaml)"


def test_without_owner_or_date_an_assumption_weakens() -> None:
    listed = [evidence(g, hypotheses=("the map is true",)) for g in GUARANTEES]
    found = build(listed, formal=True)
    assert found.answers.tone is Tone.AMBER
    assert NO_WORDS in [s.words for s in found.assumptions]
    claims = {w.key: w.claims for w in found.deficits}
    assert set(claims["unowned"]) == {s.key for s in found.assumptions if not s.owned}
    assert claims["wordless"] == tuple(s.key for s in found.assumptions if s.words == NO_WORDS)
    shown = replace(found.requirements[0], level=Level.SHOWN, tone=Tone.AMBER, bounded=False, rate=None, searched="")
    assert shown.noted == "an assumption has no owner or end"
    assert replace(shown, tone=Tone.GREEN).noted == ""


def test_a_reason_that_says_no_more_than_its_assumption_is_none() -> None:
    said = Assumption("A1", "environment.n.x", Sort.WORLD, "It does not move", "", "", "", "", False, ("R",), ())
    for because in ("", "it does not move", "It does not move [R1]"):
        assert replace(said, because=because).reasoned == ("R1" in because)
    assert replace(said, because="it is bolted down").reasoned
    told = {w.key: w.claims for w in rover_case().deficits}["bare"]
    assert told == (PLATFORM,)


def test_an_assumption_of_a_proof_and_of_a_test_stands_once() -> None:
    listed = [evidence(g, hypotheses=("the map is true",)) for g in GUARANTEES]
    listed += [evidence(g, Verdict.TESTED, "hoare-2", hypotheses=("the map is true",)) for g in GUARANTEES]
    words = [Statement(f"assumptions.{m}.map", "The map is true", "", *OWNED) for m in ("hoare", "hoare-2")]
    assert [s.words for s in build(listed, words, formal=True).assumptions].count("The map is true") == 1


def test_an_assumption_stands_once_whoever_needs_it() -> None:
    said = [
        Statement("environment.in.a", "The map is right", "surveyed", "x", "2030-01-01", "2026-11-20"),
        Statement("environment.in.b", "The map is right", "surveyed", "x", "2029-01-01", "2026-11-21"),
    ]
    claims = [obligation(SYSTEM_LEVEL, Kind.COMPOSITION, f"environment.in.{p}") for p in "ab"]
    reasons = [evidence(c, Verdict.JUSTIFIED, "compose", link=Link.GUIDED, summary="surveyed") for c in claims]
    needs = tuple(Hypothesis(HypothesisKind.CLAIM, c.local_id, c.digest) for c in claims)
    proofs = [evidence(g, rests_on=needs) for g in GUARANTEES]
    made = subject(PROSE, said, environment=[EnvironmentInput(f"in.{p}", "TRUE", "surveyed") for p in "ab"])
    found = case(made, [*GUARANTEES, *claims], [*proofs, *reasons])
    (world,) = [s for s in found.assumptions if s.sort is Sort.WORLD]
    assert (world.key, world.until, world.needed_by) == ("environment.in.a", "2029-01-01", ("R",))
    assert world.date == "2026-11-21"
    assert "2026-11-21" in found.answers.owners


def test_a_reason_for_an_assumption_is_none_for_its_input_being_constant() -> None:
    """Two things are supposed, each with its own words and owner; no format knows of one reason for both."""
    about = "environment.in.a"
    said = [Statement(about, "It is small", "surveyed", *OWNED)]
    claim = obligation(SYSTEM_LEVEL, Kind.COMPOSITION, about)
    reason = evidence(claim, Verdict.JUSTIFIED, "compose", link=Link.GUIDED, summary="surveyed")
    stays = obligation(SYSTEM_LEVEL, Kind.COMPOSITION, f"{about}.constant")
    declared = evidence(stays, Verdict.JUSTIFIED, "compose", link=Link.GUIDED, summary="in.a is the same at every step")

    def supposed(entry: EnvironmentInput, words: list[Statement]) -> list[tuple[str, str, str]]:
        said = [claim, stays] if entry.constant else [claim]
        needs = tuple(Hypothesis(HypothesisKind.CLAIM, o.local_id, o.digest) for o in said)
        proofs = [evidence(g, rests_on=needs) for g in GUARANTEES]
        records = [*proofs, reason, *([declared] if entry.constant else [])]
        made = case(subject(PROSE, words, environment=[entry]), [*GUARANTEES, *said], records)
        world = [s for s in conclude_again(made).assumptions if s.sort is Sort.WORLD]
        return [(s.key, s.because, s.who) for s in world]

    both = EnvironmentInput("in.a", "TRUE", "surveyed", constant=True)
    first = (about, "surveyed", "somebody")
    assert supposed(both, said) == [first, (f"{about}.constant", "", "")]
    own = Statement(f"{about}.constant", "It stays", "bolted", *OWNED)
    assert supposed(both, [*said, own]) == [first, (f"{about}.constant", "bolted", "somebody")]
    assert supposed(replace(both, constant=False), said) == [first]


def test_a_side_condition_brings_what_its_proof_used_and_a_guarantee_what_its_node_assumes() -> None:
    """b assumes something that a's guarantee discharges, which a test supports: a requirement on b rests on a."""
    side = obligation(SYSTEM_LEVEL, Kind.COMPOSITION, "whole.b.input", clauses=("b.input", "a.g"))
    listed: list[Obligation] = [*GUARANTEES, side]
    made = subject(replace(PROSE, supported_by=("b.g",)))
    node = replace(made.contract.nodes[1], assumptions=(replace(made.contract.nodes[1].guarantees[0], name="input"),))
    made = replace(made, contract=replace(made.contract, nodes=(made.contract.nodes[0], node)))
    given_ = [
        evidence(GUARANTEES[0], Verdict.TESTED, "hypothesis", bound={"cases": 10, "failure_probability_below": 0.3}),
        evidence(GUARANTEES[2]),
        evidence(side, method="compose", details={"needed": ["a.g"]}),
    ]
    found = case(made, listed, given_).requirements[0]
    assert found.weakest_evidence is not None
    assert (found.weakest_evidence.node, found.weakest_evidence.words) == (
        "a",
        "10 cases, none failed (confidence not recorded: at most 30 % of cases drawn like these fail)",
    )
    named = ("b", "b.g", "b/hoare")
    hazards = tuple(Hazard(name, "It burns", "critical", mitigated_by=(name,)) for name in named)
    made = replace(made, plan=replace(made.plan, hazards=hazards))
    assert {hazard.level for hazard in case(made, listed, given_).hazards} == {Level.TESTED_MODELS}
    assert {hazard.level for hazard in case(made, listed, given_[1:]).hazards} == {Level.NOT_SHOWN}
    lost = case(made, listed, given_[1:]).requirements[0]
    assert lost.level is Level.NOT_SHOWN
    assert lost.failing == (GUARANTEES[0].id,)
    nothing = case(made, [*GUARANTEES], given_[:2])
    assert [s.key for s in nothing.assumptions if s.sort is Sort.WORLD] == ["assumption.b.input"]


def test_a_requirement_that_names_no_support_rests_on_what_its_certificate_names_or_else_on_everything() -> None:
    own = obligation(SYSTEM_LEVEL, Kind.REQUIREMENT, "R")
    proof = evidence(own, method="compose", details={"needed": ["b.g"]})
    certified = replace(proof, details={**proof.details, "certificate": {"key": "k", "solvers": 1}})
    asked = subject(replace(FORMAL, supported_by=()))
    tests = [evidence(g, Verdict.TESTED, "hypothesis") for g in GUARANTEES]
    of_runs = subject(replace(FORMAL, formula=None, temporal="always a.x > 0", supported_by=("a.g",)))
    for plan, record, below in (
        (asked, proof, GUARANTEES),
        (asked, certified, GUARANTEES[2:]),
        (of_runs, replace(proof, verdict=Verdict.REFUTED), GUARANTEES),  # a run is one of all nodes
    ):
        (found,) = case(plan, [*GUARANTEES, own], [record, *tests]).requirements
        assert [g for g in GUARANTEES if g.id in found.closure] == below


def test_a_key_is_about_a_whole_word() -> None:
    listed = [evidence(g, hypotheses=("the map is true", "the runs are drawn")) for g in GUARANTEES]
    words = [Statement(f"assumptions.hoare.{w}", f"said by {w}", "", *OWNED) for w in ("is", "th", "the_map", "run")]
    found = build(listed, words, formal=True)
    assert [s.words for s in found.assumptions if s.sort is Sort.MODELS and not s.general] == [
        "said by the_map",
        NO_WORDS,
    ]


def test_bounds_of_a_scenario_are_one_assumption() -> None:
    bounds = ("scenario.domains.N: it is one of 0, 1", "scenario: a.x has one of the values that are tried")
    limits = (bound("scenario.domains.N", bounds[0]), bound("scenario.values.a.x", bounds[1]))
    listed = [evidence(g, Verdict.CHECKED, "ajpf", rests_on=limits) for g in GUARANTEES]
    (one,) = [s for s in build(listed, formal=True).assumptions if s.text.startswith("scenario")]
    assert one.key == "assumptions.compose.scenario"
    assert one.text.splitlines() == list(bounds)


def test_changes_since_the_signed_report_worst_first() -> None:
    old = build([evidence(g) for g in GUARANTEES], formal=True)
    signed = baseline_of(old, "signed/rover/1.json", "A. Person", "2026-11-20", "2027-11-20")
    weaker = [evidence(GUARANTEES[0], Verdict.TESTED, "hypothesis"), *(evidence(g) for g in GUARANTEES[1:])]
    now = case(subject(FORMAL), [*GUARANTEES, OWN], [*weaker, evidence(OWN, method="compose")], baseline=signed)
    kinds = [e.kind for e in now.changes.entries]
    assert kinds == sorted(kinds, key=KINDS.index)
    assert "weaker" in kinds
    assert now.answers.signed.startswith("not signed: A. Person signed another state")
    same = case(
        subject(FORMAL),
        [*GUARANTEES, OWN],
        [*(evidence(g) for g in GUARANTEES), evidence(OWN, method="compose")],
        baseline=signed,
    )
    assert same.changes.entries == ()
    assert same.answers.signed == "signed by A. Person on 2026-11-20 until 2027-11-20"
    assert now.changes.against == same.changes.against


def test_what_is_lost_with_a_claim_is_no_gain() -> None:
    """A guarantee that is refuted is no longer sampled, and supposes nothing: the case is not better for it."""
    tested = evidence(GUARANTEES[0], Verdict.TESTED, "hypothesis", hypotheses=("the runs are drawn",))
    rest = [evidence(g) for g in GUARANTEES[1:]]
    signed = baseline_of(build([tested, *rest], formal=False), "f", "A", "2026-11-20")
    refuted = evidence(GUARANTEES[0], Verdict.REFUTED, "hypothesis")
    kinds = {e.kind for e in case(subject(PROSE), GUARANTEES, [refuted, *rest], baseline=signed).changes.entries}
    assert "open" in kinds
    assert "better" not in kinds
    proved = case(subject(PROSE), GUARANTEES, [evidence(g) for g in GUARANTEES], baseline=signed).changes.entries
    assert {e.kind for e in proved} == {"better"}
    assert "claim sampled, not proved: 1 → none" in {e.words for e in proved}


def test_what_means_something_else_shows_both_formulas() -> None:
    first = build([evidence(g) for g in GUARANTEES], formal=False)
    moved = replace(GUARANTEES[0], digest="0" * 64, formula="x > 2")
    signed = baseline_of(first, "f", "A", "2026-11-20")
    now = case(
        subject(PROSE), [moved, *GUARANTEES[1:]], [evidence(g) for g in (moved, *GUARANTEES[1:])], baseline=signed
    )
    (changed,) = [e for e in now.changes.entries if e.kind == "meaning"]
    assert (changed.before, changed.after) == ("", "x > 2")
    assert _edit("R", "", "x > 2") == "R means something else"
    assert _edit("R", "0 ≤ in.r < 120 ⇒ g", "0 ≤ in.r < 130 ⇒ g") == "R was “in.r < 120”, is “in.r < 130”"
    assert _edit("R", "a ∧ b", "a ∧ b ∧ c") == "R was “∧ b”, is “∧ b ∧ c”"
    assert _edit("R", "b ∧ b", "b") == "R was “b ∧ b”, is “b”"


def test_the_first_screen_of_a_full_case_is_in_plain_words() -> None:
    a = rover_case().answers
    own = [a.verdict, a.counts, a.weakened, a.gates, a.owned, a.signed, *(b.words for b in a.based_on)]
    own += [b.title for b in a.based_on]
    assert [name for text in own for name in identifiers(text)] == []
    first, whole, _ = a.refuted.split("; ")
    assert first.startswith("Refuted: navigation: “")
    assert first.endswith("(run = 31, distance_m = 0.43: outside of the tolerance of 0.25 m)")
    assert whole.startswith("the whole: “REQ4")  # one of the whole system is not among "more claims"
    assert a.refuted.endswith(" Requirements refuted: REQ4. Requirements not shown: REQ1, REQ2.")
    assert {r.id: r.weakest_evidence.status for r in rover_case().requirements if r.weakest_evidence}[
        "REQ4"
    ] == "refuted"


def test_each_tool_with_an_answer_that_counts_is_to_be_trusted_and_a_refuted_contract_is_named() -> None:
    claims, contract = [guarantee("a", name) for name in "ghk"], obligation("a", Kind.SANITY, "realizable")
    made = [evidence(claims[0], Verdict.TESTED, "hypothesis"), evidence(claims[1], Verdict.MONITORED, "rosmonitoring")]
    made += [evidence(claims[2], Verdict.CHECKED, "ajpf"), evidence(contract, Verdict.REFUTED, "sanity")]
    found = case(system({"a": ["g", "h", "k"]}), [*claims, contract], made).answers
    (line,) = (line for line in found.trusted if line.what == "tools whose answers have no certificate")
    named = ["ajpf 1.0", "hypothesis 1.0", "rosmonitoring 1.0", "sanity: z3 1.0"]  # also one that refutes
    assert line.which == f"1 answer of {', 1 of '.join(named)}"
    assert found.based_on[0].words.endswith("; a check of its contract fails")


def test_which_assumptions_there_are_and_who_answers_for_them_is_said_in_a_line() -> None:
    def supposed(at: int, who: str, until: str) -> Assumption:
        key = f"environment.n.{at}"
        return Assumption(f"A{at}", key, Sort.WORLD, f"It is {at}", "", "", who, until, False, ("R",), ())

    said = [supposed(at, "A. Person" if at < 5 else "B", f"2027-01-0{at}") for at in range(1, 7)]
    most = replace(said[2], needed_by=("R", "Q"))
    (line,) = _lines([*said[:2], most, *said[3:]])
    assert (line.number, line.about, line.more) == ("A3", "6 about the world", "also A1, A2, A4 to A6")
    ideal = replace(said[3], key=REACTION)
    assert [one.number for one in _lines([*said[:2], most, ideal])] == ["A4"], "an idealisation is in words"
    assert _owners(said) == "A. Person (4), B (2); the first ends 2027-01-01"
    assert _owners(said[:1]) == "A. Person, until 2027-01-01"
    assert _owners([replace(said[0], who="")]) == ""
    validated = replace(said[0], sort=Sort.MEANING, until="")
    assert _owners([said[1], validated]) == "A. Person; the first ends 2027-01-02; 1 ends when a text changes"
    made = [replace(one, date=f"2026-11-{20 + at}") for at, one in enumerate(said[:2])]
    assert _owners(made[:1]) == "A. Person, assumed since 2026-11-20, until 2027-01-01"
    assert _owners(made) == "A. Person, assumed since 2026-11-20 to 2026-11-21; the first ends 2027-01-01"
    assert made[0].term == "A. Person, 2026-11-20, until 2027-01-01"
    assert replace(made[0], expired=True, date="").term == "A. Person, expired 2027-01-01"
    assert replace(made[0], who="", until="").term == "no owner, 2026-11-20, no last day"
    assert set(ABOUT) == set(Sort)


def test_deficits_are_named_and_counted_on_the_first_screen() -> None:
    found = rover_case()
    said = found.answers.weakened_by.split(", ")
    assert [int(part.split(" ")[0]) for part in said] == [w.count for w in found.deficits]
    for many in (1, 2):
        said = [deficit_words(key, many) for key in _WORDS]
        assert not any("{" in words for words in said)
    assert deficit_words("single", 1) == "guarantee with one method only"


def test_deficits_are_of_all_that_the_page_shows() -> None:
    """Also of a guarantee that no requirement needs, of a premise without a reason, of a requirement that was searched,
    and of remarks of any kind."""
    premise = obligation(SYSTEM_LEVEL, Kind.COMPOSITION, "whole.persistence")
    remark = {"code": "HOARE410", "place": "p.imp:2", "message": "the program compares with 10"}
    listed = [
        evidence(GUARANTEES[0], details={"remarks": [remark]}),
        evidence(GUARANTEES[1], Verdict.UNKNOWN, run="earlier"),
        evidence(premise, Verdict.UNKNOWN, "compose", summary="the plan gives no reason for it"),
        evidence(OWN, Verdict.TESTED, "compose", bound={"depth": 52}),
    ]
    needs_one = replace(FORMAL, supported_by=("a.g",))
    found = case(subject(needs_one), [*GUARANTEES, premise, replace(OWN, clauses=("a.g",))], listed)
    number = {d.key: d.count for d in found.deficits}
    expected = {"open": 2, "premises": 1, "models": 1, "sampled": 1, "advice": 1}
    assert {key: number.get(key) for key in expected} == expected
    assert found.requirements[0].searched == "searched to step 52, not exhaustively"
    argued = dict(every_text(found))["argument.html"]
    assert ("A tool derived it" in argued, "Nothing refutes it: searched to step 52" in argued) == (
        False,
        found.requirements[0].level.holds,
    )


@pytest.mark.parametrize(
    ("verdict", "method", "bound", "told"),
    [
        (
            Verdict.TESTED,
            "experiment",
            {"runs": 47, "failures": 0, "failure probability at most": 0.0617, "confidence": 0.95},
            "47 runs, 0 failed (95 % confidence: at most 6.17 % fail)",
        ),
        (
            Verdict.TESTED,
            "hypothesis",
            {"runs": 9, "triggered": 9, "failure_probability_below": 0.3, "confidence": 0.95},
            "9 runs, 0 failed (95 % confidence: at most 30 % of runs drawn like these fail)",
        ),
        (
            Verdict.TESTED,
            "hypothesis",
            {"cases": 300, "triggered": 4, "failure_probability_when_triggered_below": 0.527, "confidence": 0.95},
            (
                "only 4 of 300 cases met its condition, none failed (95 % confidence: "
                "at most 52.7 % of cases drawn like these fail)"
            ),
        ),
        (
            Verdict.TESTED,
            "hypothesis",
            {"cases": 9, "failure_probability_below": 0.3, "confidence": 0.997},
            "9 cases, none failed (99.7 % confidence: at most 30 % of cases drawn like these fail)",
        ),
        (
            Verdict.MONITORED,
            "rosmonitoring",
            {"judged": 574, "traces": ["a", "b"]},
            "observed 574 times on 2 recorded runs, none against it",
        ),
    ],
)
def test_what_was_seen_has_one_wording(verdict: Verdict, method: str, bound: dict[str, object], told: str) -> None:
    details = {RATE: []} if method == "experiment" else {}
    found = case(
        subject(PROSE), [*GUARANTEES], [evidence(GUARANTEES[0], verdict, method, bound=bound, details=details)]
    )
    assert found.answers.weakest is not None
    assert found.answers.weakest.words == "missing", "of the other guarantees: what fails comes before all evidence"
    assert found.answers.next_weakest.endswith(f": {told}")


def test_what_rests_on_the_weakest_evidence_and_what_is_the_next() -> None:
    def drawn(bound: float) -> dict[str, object]:
        return {"cases": 20, "failure_probability_below": bound, "confidence": 0.95}

    node = [guarantee("a", "g"), guarantee("a", "h")]
    asked = [replace(PROSE, id=name, supported_by=(f"a.{g}",)) for name, g in (("R1", "g"), ("R2", "h"), ("R3", "h"))]
    made = [evidence(g, Verdict.TESTED, "hypothesis", bound=drawn(b)) for g, b in zip(node, (0.5, 0.1), strict=True)]
    danger = Hazard("H", "It burns", "critical", mitigated_by=("a",))
    whole = case(system({"a": ["g", "h"]}, requirements=asked, hazards=[danger]), node, made)
    found = whole.answers.weakest
    assert found is not None
    assert found.needed_by == ("R1", "H")
    assert whole.answers.next_weakest.startswith("a: “a meets h”: 20 cases")
    proved = case(system({"a": ["g", "h"]}, requirements=asked), node, [made[0], evidence(node[1])])
    assert proved.answers.next_weakest == "", "a proof is not weak"
    assert {d.key: d.claims for d in proved.deficits}.get("idle") is None
    idle = case(system({"a": ["g", "h"]}, requirements=asked[:1]), node, made)
    assert {d.key: d.claims for d in idle.deficits}["idle"] == (node[1].id,)
    assert idle.answers.unneeded == "1 guarantee needed by no requirement or hazard: not compared"
    assert weakest_words(idle).endswith(f"{idle.answers.unneeded}.")
    assert (whole.answers.unneeded, proved.answers.unneeded) == ("", "")
    assert {d.key: d.claims for d in whole.deficits}["underrated"] == (node[0].id, node[1].id)
    spilt = case(
        system({"a": ["g", "h"]}, requirements=asked, hazards=[replace(danger, severity="marginal")]), node, made
    )
    assert "underrated" not in {d.key for d in spilt.deficits}
    named = ("a.h", "R2", "a.g", "R1")
    orders = [replace(danger, mitigated_by=names) for names in (named, ("a.h", "a.g"), ("R2", "R1"))]
    for view in case(system({"a": ["g", "h"]}, requirements=asked, hazards=orders), node, made).hazards:
        assert view.weakest == "a.g, tested, bound 50 %", "as the weakest evidence of the whole case"
    assert whole.answers.verdict == "Argued (failure rate in use unknown)"
    alone = case(system({"a": ["g"]}, requirements=asked[:1]), node[:1], made[:1]).answers.weakest
    assert alone is not None
    assert alone.needed_by == ("R1",)
    lost = case(system({"a": ["g", "h"]}, requirements=asked, hazards=[danger]), node, made[1:])
    assert lost.hazards[0].stands == "not shown (weakest: a.g, missing)"
    steps = {gate.id: gate.suggestions[0] for gate in lost.gates if not gate.passed}
    assert steps["hazards"] == steps["guarantees-medium"], "one remedy for one claim"


def test_more_samples_never_make_a_claim_look_weaker() -> None:
    """A guarantee stands by its best sample; of experiments, which count for one rate, by the worst."""
    (target,) = claims = [guarantee("a", "g")]

    def bound(*samples: tuple[str, float, bool]) -> str:
        records = [
            evidence(
                target,
                Verdict.TESTED,
                method,
                bound={"runs": 40, "failure probability at most": most, "confidence": 0.95},
                details={RATE: []} if counts else {},
            )
            for method, most, counts in samples
        ]
        made = case(subject(replace(PROSE, supported_by=("a.g",))), claims, records).answers.weakest
        assert made is not None
        return made.bound

    assert bound(("hypothesis", 0.128, False), ("experiment", 0.0618, True)) == "bound 6.18 %"
    assert bound(("hypothesis", 0.02, False), ("experiment", 0.0618, True)) == "bound 2 %"
    assert bound(("experiment", 0.0618, True), ("experiment-2", 0.1, True)) == "bound 10 %"


def test_hazards_stand_by_level_and_then_by_their_weakest_evidence() -> None:
    bounds = dict(zip(GUARANTEES, (0.1, 0.4, 0.2), strict=True))
    records = [
        evidence(g, Verdict.TESTED, "hypothesis", bound={"cases": 20, "failure_probability_below": b}, of=Object.SOURCE)
        for g, b in bounds.items()
    ]
    named = [f"{g.node}.{g.name}" for g in GUARANTEES]
    hazards = [Hazard(name, "It burns", "critical", mitigated_by=(name,)) for name in named]
    found = build(records, formal=False, hazards=[*hazards, Hazard("bare", "It burns", "critical")])
    assert [view.hazard.id for view in found.hazards] == ["bare", "a.h", "b.g", "a.g"]


def test_what_refutes_is_the_weakest_evidence_in_data_and_words() -> None:
    """Though a claim beneath a requirement is missing."""
    found = build([evidence(GUARANTEES[1], Verdict.REFUTED), evidence(GUARANTEES[2])], formal=False)
    assert found.answers.weakest is not None
    assert found.answers.weakest.claim == GUARANTEES[1].id
    assert f"“{found.answers.weakest.quote}”" in found.answers.refuted
    refuted = [evidence(g, Verdict.REFUTED) for g in GUARANTEES]
    assert build(refuted, formal=False).answers.refuted.partition("; and ")[2].startswith("1 more claim, 3 in all.")


def test_a_test_of_too_few_cases_is_no_second_method() -> None:
    """As for the policy's gate: 20 cases are asked."""
    target = guarantee("a", "g")
    for triggered, alone in ((1, True), (30, False)):
        bound = {"cases": 300, "triggered": triggered}
        made = [evidence(target), evidence(target, Verdict.TESTED, "hypothesis", bound=bound)]
        found = case(system({"a": ["g"]}, plans=[node_plan("a", "medium", "hoare", "hypothesis")]), [target], made)
        assert ("single" in {d.key for d in found.deficits}) is alone
        (tools,) = [line for line in found.answers.trusted if line.what.startswith("tools")]
        assert f"{int(not alone)} of 1 guarantee that holds has a second" in tools.mitigation


def test_every_reason_in_place_of_evidence_is_a_numbered_assumption() -> None:
    """Whether or not a requirement or a guarantee rests on it."""
    given = obligation("system", Kind.COMPOSITION, "environment.n.x")
    found = case(system({}), [given], [evidence(given, Verdict.JUSTIFIED, "compose", summary="the map is loaded")])
    assert [(s.number, s.where) for s in found.assumptions] == [("A1", (given.id,))]


def test_plain_words() -> None:
    assert words_of("radiationSensor") == "radiation sensor"
    assert words_of("GRA") == "GRA"
    assert identifiers("agent.at and a_b in src/x.py of fooBar, 0123456789ab") == (
        "agent.at",
        "a_b",
        "src/x",
        "fooBar",
        "0123456789ab",
    )
    assert identifiers("It holds for 0.5 m, and/or less; REQ1.") == ("and/or",)
    assert date.fromisoformat("2030-01-01") > TODAY


@pytest.mark.parametrize("used", [["initial n.s"], ["initial n.s#1", "n.g"], []])
def test_first_values_that_the_plan_gives_are_assumed(used: list[str]) -> None:
    start = obligation("system", Kind.COMPOSITION, "start.n")
    begun = evidence(start, Verdict.PROVED, "compose", details={"initial": used})
    needs = Requirement("R", "It starts.", None, None, ("n.g", "system/composition/start.n"))
    subject = system({"n": ["g"]}, requirements=[needs])
    found = case(subject, [guarantee("n", "g"), start], [evidence("n.g"), begun])
    assert any(a.key == START for a in found.assumptions) == ("initial n.s" in used)


def test_hazards_and_gates_that_changed_since_the_signature_have_a_line_each() -> None:
    """A refutation, then a hazard judged less severe and a policy that asks less."""
    text, by = "It burns", (f"{GUARANTEES[0].node}.{GUARANTEES[0].name}",)
    fire, smoke = Hazard("H1", text, "critical", mitigated_by=by), Hazard("H2", text, "critical", mitigated_by=by)
    whole = subject(PROSE, hazards=(fire, smoke))
    first = [evidence(g) for g in GUARANTEES]
    signed = baseline_of(case(whole, GUARANTEES, first), "f", "A", "2026-11-20", "2027-11-20")

    def lines(subject: System, records: list[Evidence]) -> set[tuple[str, str]]:
        return {(e.kind, e.words) for e in case(subject, GUARANTEES, records, baseline=signed).changes.entries}

    assert lines(whole, first) == set()
    found = lines(whole, [evidence(GUARANTEES[0], Verdict.REFUTED), *first[1:]])
    assert ("open", "hazard H1 was shown of models, and is refuted") in found
    assert ("open", "gate “Every hazard has mitigations, and all of them hold”: passes → fails") in found
    found = lines(subject(PROSE, hazards=[replace(fire, severity="marginal")], policy="reproduction"), first)
    assert ("demand", "hazard H1, severity: critical → marginal") in found
    assert ("gone", "hazard H2 is not there any more") in found
    assert any(kind == "demand" and words.endswith("passes → does not apply any more") for kind, words in found)


def test_a_weaker_bound_of_a_requirement_is_a_change() -> None:
    node, asked = [guarantee("a", "g")], [replace(PROSE, id="R", supported_by=("a.g",))]

    def drawn(below: float) -> Case:
        bound = {"cases": 20, "failure_probability_below": below, "confidence": 0.95}
        made = [evidence(node[0], Verdict.TESTED, "hypothesis", bound=bound)]
        return case(system({"a": ["g"]}, requirements=asked), node, made)

    states = {below: state_of(drawn(below)) for below in (0.13, 0.78)}
    for (was, now), kind in (((0.13, 0.78), "weaker"), ((0.78, 0.13), "better")):
        found = [c for c in compare(states[was], states[now]) if c.about == "requirement"]
        assert [(c.kind, c.before, c.after) for c in found] == [
            (kind, f"bound {was * 100:g} %", f"bound {now * 100:g} %")
        ]
