"""The case: staleness by meaning, history, roll-up to requirements, findings, grades, exit codes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from assurance.sample import (
    RUN,
    case,
    evidence,
    guarantee,
    key_of,
    keys_of,
    node_plan,
    obligation,
    rover_case,
    rover_parts,
    system,
    validated,
)
from avow.assurance.answers import Level, Tone
from avow.assurance.case import conclude_again
from avow.assurance.codec import case_schema, from_json, to_json
from avow.assurance.model import Case, Currency, Derivation, SideCondition
from avow.base.codec import Unreadable
from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.verdict import Counterexample, Verdict
from avow.cli.schemas import schemas
from avow.evidence.audit import Discrepancy, Fault
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.evidence.status import Status
from avow.system.plan import Finding, Requirement, Validation, is_wild

G = guarantee("n", "g")
PLANS = [node_plan("n", "low", "hoare", "hypothesis")]
SYSTEM = system({"n": ["g"]}, plans=PLANS)
SCHEMAS = Path(__file__).parents[2] / "docs" / "schemas"


def status_of(found: Case, name: str = "rover/n/guarantee/g") -> Status:
    return found.obligation(name).status


# -- staleness by meaning -------------------------------------------------------------------------------------------


def test_evidence_of_another_meaning_is_stale_and_kept_as_history() -> None:
    changed = replace(G, digest=sha256("another threshold"))
    record = evidence(G)
    found = case(SYSTEM, [changed], [record], keys={(G.id, "hoare"): key_of(changed, "hoare")})
    assert status_of(found) is Status.STALE
    view = found.obligations[0]
    assert [item.currency for item in view.evidence] == [Currency.STALE]
    assert view.counting == ()
    assert not found.good
    (item,) = [item for item in found.open_items if item.kind == "stale"]
    assert item.text == "was proved by hoare on 2026-11-21; the claim means something else now"
    assert item.suggestion.startswith("run `avow verify")


def test_the_same_key_but_another_digest_does_not_count() -> None:
    found = case(SYSTEM, [replace(G, digest=sha256("other"))], [evidence(G)], keys=keys_of([evidence(G)]))
    assert status_of(found) is Status.STALE


def test_a_withdrawn_method_does_not_count() -> None:
    found = case(SYSTEM, [G], [evidence(G)], keys={})
    assert status_of(found) is Status.STALE
    assert found.obligations[0].evidence[0].currency is Currency.WITHDRAWN
    assert found.open_items[0].text.endswith("; the plan no longer uses the method for this claim")


def test_a_newer_pass_does_not_hide_an_older_refutation_of_the_same_question() -> None:
    found = case(SYSTEM, [G], [evidence(G, Verdict.REFUTED, run="1"), evidence(G, run="2")])
    assert status_of(found) is Status.CONTRADICTORY
    tested = [evidence(G, Verdict.REFUTED, "hypothesis", run="1"), evidence(G, Verdict.TESTED, "hypothesis", run="2")]
    assert status_of(case(SYSTEM, [G], tested)) is Status.REFUTED
    assert all(item.counts for item in found.obligations[0].evidence)


def test_what_a_newer_attempt_says_too_is_superseded_and_changes_nothing() -> None:
    failed = evidence(G, Verdict.ERROR, run="1")
    found = case(
        SYSTEM, [G], [failed, evidence(G, run="2"), evidence(G, run="3"), evidence(G, Verdict.UNKNOWN, run="4")]
    )
    superseded = Currency.SUPERSEDED
    # the ledger alone has the proof of run 2: the report has that of run 3
    assert [i.currency for i in found.obligations[0].evidence] == [superseded, Currency.CURRENT, superseded]
    assert status_of(found) is Status.PROVED
    idle = case(SYSTEM, [G], [failed, evidence(G, Verdict.UNKNOWN, run="2"), evidence(G, Verdict.ERROR, run="3")])
    assert [i.counts for i in idle.obligations[0].evidence] == [True, True]


def test_places_are_relative_to_the_workspace() -> None:
    place = Path.cwd() / "contracts" / "rover" / "system.rcl"
    span = Span(str(place), 3, 1, 3, 9)
    found = case(SYSTEM, [replace(G, span=span)], [evidence(G)])
    assert found.obligations[0].obligation.span == replace(span, file="contracts/rover/system.rcl")


def test_deleting_a_record_is_never_having_had_it() -> None:
    subject, obligations, records, keys, extras = rover_parts()
    for at in range(0, len(records), 3):
        rest = records[:at] + records[at + 1 :]
        found = case(subject, obligations, rest, keys=keys, **extras)
        again = conclude_again(from_json(json.loads(json.dumps(to_json(found)))))
        assert again == found


def test_order_of_records_does_not_matter_for_any_status() -> None:
    subject, obligations, records, keys, extras = rover_parts()
    one = case(subject, obligations, records, keys=keys, **extras)
    other = case(subject, obligations, records[::-1], keys=keys, **extras)
    assert [v.standing for v in one.obligations] == [v.standing for v in other.obligations]
    assert [(r.status, r.answer) for r in one.requirements] == [(r.status, r.answer) for r in other.requirements]


# -- requirements ---------------------------------------------------------------------------------------------------


def requirement_case(*supports: str, formula: str | None = None, own: Verdict | None = None, **others: Any) -> Case:
    sanity = obligation("n", Kind.SANITY, "realizable")
    ours = obligation(SYSTEM_LEVEL, Kind.REQUIREMENT, "R")
    records = [evidence(G), evidence(sanity, others.pop("sanity", Verdict.PROVED), "sanity")]
    obligations = [G, sanity]
    if own is not None:
        obligations.append(ours)
        records.append(evidence(ours, own, "compose"))
    subject = system({"n": ["g"]}, plans=PLANS, requirements=[Requirement("R", "text", formula, None, supports)])
    return case(subject, obligations, records, **others)


def test_prose_is_argued() -> None:
    for supports in (("n.g",), ("n",), ("n/guarantee/g",)):
        r = requirement_case(*supports).requirements[0]
        assert r.status is Status.ARGUED
        assert r.weakest_status is Status.PROVED
        assert "Argued" in r.answer


def test_a_formula_is_as_good_as_its_own_evidence_and_what_it_rests_on() -> None:
    assert requirement_case("n.g", formula="f", own=Verdict.PROVED).requirements[0].status is Status.PROVED
    refuted = requirement_case("n.g", formula="f", own=Verdict.REFUTED).requirements[0]
    assert refuted.status is Status.REFUTED
    unknown = requirement_case("n.g", formula="f", own=Verdict.UNKNOWN).requirements[0]
    assert unknown.status is Status.UNKNOWN
    assert requirement_case("n.g", formula="f").requirements[0].status is Status.MISSING
    # settled on the contracts, nobody said on which: then it rests on every guarantee
    assert requirement_case(formula="f", own=Verdict.PROVED).requirements[0].rests_on[-1] == G.id


def test_an_unrealizable_contract_supports_nothing() -> None:
    found = requirement_case("n.g", sanity=Verdict.REFUTED)
    view = found.obligation(G.id)
    assert view.status is Status.PROVED  # its own evidence
    assert view.standing is Status.UNSUPPORTED  # all things considered
    assert found.requirements[0].status is Status.UNSUPPORTED
    assert found.requirements[0].below == ("rover/n/sanity/realizable",)


def test_names_that_stand_for_nothing_are_told() -> None:
    r = requirement_case("n.g", "n.nothing").requirements[0]
    assert r.status is Status.MISSING
    assert r.unknown_names == ("n.nothing",)
    assert requirement_case().requirements[0].status is Status.MISSING


def test_requirements_that_support_each_other_are_refused() -> None:
    subject = system(
        {"n": ["g"]},
        plans=PLANS,
        requirements=[Requirement("A", "a", None, None, ("B",)), Requirement("B", "b", None, None, ("A", "n"))],
    )
    found = case(subject, [G], [evidence(G)])
    assert [r.status for r in found.requirements] == [Status.CIRCULAR, Status.CIRCULAR]
    assert "support itself" in found.requirements[0].answer
    assert not found.good


def test_words_that_are_an_obligations_id_count_neither_for_nor_against() -> None:
    other = guarantee("n", "h")
    subject = system({"n": ["g", "h"]}, plans=PLANS)
    good = case(subject, [G, other], [evidence(G, hypotheses=("n/guarantee/h",)), evidence(other)])
    assert good.obligation(G.id).standing is Status.PROVED
    assert "n/guarantee/h" in [a.text for a in good.assumptions]  # not discharged by the claim of that name
    bad = case(subject, [G, other], [evidence(G, hypotheses=(other.id,)), evidence(other, Verdict.REFUTED)])
    assert bad.obligation(G.id).standing is Status.PROVED
    assert other.id in [a.text for a in bad.assumptions]
    circle = case(subject, [G, other], [evidence(G, hypotheses=(other.id,)), evidence(other, hypotheses=(G.id,))])
    assert circle.obligation(G.id).standing is Status.PROVED


def test_a_derivation_rests_on_side_conditions_and_premises() -> None:
    side = obligation(SYSTEM_LEVEL, Kind.COMPOSITION, "side")
    subject = system({"n": ["g"]}, plans=PLANS, requirements=[Requirement("R", "t", None, None, ("D1",))])
    d1 = Derivation("D1", "R1", "…", "…", ("n",), (SideCondition("A", side.id),))
    good = case(subject, [G, side], [evidence(G), evidence(side, method="compose")], derivations=[d1])
    assert good.derivations[0].status is Status.PROVED
    assert good.requirements[0].status is Status.ARGUED
    bad = case(subject, [G, side], [evidence(G), evidence(side, Verdict.REFUTED, "compose")], derivations=[d1])
    assert bad.derivations[0].status is Status.UNSUPPORTED
    named = replace(d1, conditional=("system/composition/side", "a mere sentence"), side_conditions=())
    told = case(subject, [G, side], [evidence(G), evidence(side, Verdict.REFUTED, "compose")], derivations=[named])
    assert told.derivations[0].below == (side.id,)  # a condition that an obligation settles is no mere hypothesis
    assert told.derivations[0].conditional == ("a mere sentence",)
    lost = case(
        subject, [G, side], [evidence(G), evidence(side, method="compose")], derivations=[replace(d1, premises=("x",))]
    )
    assert lost.derivations[0].status is Status.MISSING


@pytest.mark.parametrize("changed", [{"text": "Another sentence."}, {"supported_by": ("n.g", "n")}])
def test_what_is_linked_to_a_changed_sentence_is_suspect(changed: dict[str, Any]) -> None:
    asked = Requirement("R", "It does.", None, None, ("n.g",))
    confirmed = validated(asked)
    unread = replace(asked, validation=Validation("A. Person", "2026-01-01"))

    def stated(requirement: Requirement) -> Case:
        return case(system({"n": ["g"]}, requirements=[requirement], plans=PLANS), [G], [evidence(G)])

    assert replace(confirmed, text="It  does.\n").validated  # white space says nothing
    good = stated(confirmed)
    assert good.requirements[0].status is Status.ARGUED
    assert "unvalidated" not in {w.key for w in good.deficits}
    lacking = stated(unread)
    assert "unvalidated" in {w.key for w in lacking.deficits}
    assert (lacking.answers.headline, lacking.answers.tone) == (Level.NOT_SHOWN, Tone.AMBER)
    assert conclude_again(lacking) == lacking
    bad = stated(replace(confirmed, **changed))
    assert bad.requirements[0].level is Level.NOT_SHOWN
    assert bad.requirements[0].status is Status.MISSING
    assert "Not validated" in bad.requirements[0].answer
    assert bad.exit_code == 1
    assert conclude_again(bad) == bad
    # that what stands under it is accepted excuses no changed sentence
    risk = Finding("n/guarantee/g", "refuted", "seen", "A. Person", "2026-01-01", "2026-12-31")
    for requirement, passes in ((confirmed, True), (replace(confirmed, **changed), False)):
        subject = system({"n": ["g"]}, requirements=[requirement], plans=PLANS, accepted=[risk])
        gates = {g.id: g.passed for g in case(subject, [G], [evidence(G, Verdict.REFUTED)]).gates}
        assert gates["requirements"] is passes


def test_wildcards_stand_for_what_they_matched_when_they_were_written() -> None:
    other = guarantee("n", "h")
    plans = [node_plan("n", "high", "hoare")]

    def taken(how: str, *matched: str) -> Case:
        terms = {"reason": "seen", "who": "A. Person", "date": "2026-01-01", "expires": "2026-12-31"}
        found = [Finding("n/guarantee/*", "refuted", matched=matched, **terms)]
        subject = system({"n": ["g", "h"]}, plans=plans, policy="reproduction", **{how: found})
        return case(subject, [G, other], [evidence(G, Verdict.REFUTED), evidence(other, Verdict.REFUTED)])

    for how in ("expected", "accepted"):
        assert taken(how, "n/guarantee/g", "n/guarantee/h").exit_code == 0
        new = taken(how, "n/guarantee/g")
        assert new.exit_code == 1
        assert new.obligation(G.id).handled == how
        assert new.obligation(other.id).handled == ""
        item = next(i for i in new.open_items if i.kind == "unlisted")
        assert not item.advice
        assert "matched: [n/guarantee/g, n/guarantee/h]" in item.text
        assert taken(how).exit_code == 1
        assert conclude_again(new) == new
    gone = taken("expected", "n/guarantee/g", "n/guarantee/h", "n/guarantee/i")
    assert "expected but not there: n/guarantee/i" in next(g.reason for g in gone.gates if g.id == "expected")


@pytest.mark.parametrize("terms", [{"date": "2026-01-01", "expires": "2026-11-01"}, {"date": "2099-01-01"}])
def test_a_finding_out_of_its_days_excuses_nothing(terms: dict[str, str]) -> None:
    found = [Finding("n/guarantee/g", "refuted", "seen", "A. Person", **terms)]
    assert finding_case(None, found, REFUTED).exit_code == 1
    if "expires" in terms:
        assert finding_case(found, [], REFUTED).exit_code == 1


# -- findings -------------------------------------------------------------------------------------------------------


def finding_case(expected: list[Finding] | None = None, accepted: list[Finding] = [], *records: Any) -> Case:  # noqa: B006
    subject = system({"n": ["g"]}, plans=PLANS, expected=expected, accepted=accepted, policy="reproduction")
    return case(subject, [G], list(records))


REFUTED = evidence(G, Verdict.REFUTED)


@pytest.mark.parametrize("pattern", ["n/guarantee/g", "n/*/g", "*/guarantee/?"])
def test_expected_findings_are_strict_both_ways(pattern: str) -> None:
    expected = [Finding(pattern, "refuted", matched=("n/guarantee/g",) if is_wild(pattern) else ())]
    assert finding_case(expected, [], REFUTED).exit_code == 0
    absent = finding_case(expected, [], evidence(G))
    assert absent.exit_code == 1
    assert "expected but not there" in next(g.reason for g in absent.gates if g.id == "expected")
    extra = finding_case([], [], REFUTED)
    assert extra.exit_code == 1
    assert "there but not expected: n.g" in next(g.reason for g in extra.gates if g.id == "expected")
    assert finding_case([], [], evidence(G)).exit_code == 0
    assert finding_case([Finding(pattern, "vacuous")], [], REFUTED).exit_code == 1


def test_an_expected_finding_may_name_the_method() -> None:
    records = (evidence(G), evidence(G, Verdict.REFUTED, "hypothesis"))
    assert finding_case([Finding("n/guarantee/g", "refuted", method="hypothesis")], [], *records).exit_code == 0
    assert finding_case([Finding("n/guarantee/g", "refuted", method="hoare")], [], *records).exit_code == 1


def test_accepted_findings_expire() -> None:
    def accepted(**changes: str) -> Finding:
        return replace(Finding("n/guarantee/g", "refuted", "known", "A. Person", "2026-01-01", "2026-12-31"), **changes)

    taken = finding_case(None, [accepted()], REFUTED)
    assert taken.exit_code == 0
    assert taken.obligations[0].handled == "accepted"
    assert status_of(taken) is Status.REFUTED  # accepting a risk does not make the claim true
    assert finding_case(None, [accepted(expires="2026-11-20")], REFUTED).exit_code == 1
    assert finding_case(None, [accepted(expires="2026-11-21")], REFUTED).exit_code == 0
    no_end = replace(accepted(), expires=None)
    assert finding_case(None, [no_end], REFUTED).exit_code == 1  # no plan can say so
    assert finding_case(None, [accepted(verdict="vacuous")], REFUTED).exit_code == 1
    unused = finding_case(None, [accepted()], evidence(G))
    assert any(i.kind == "unused" for i in unused.open_items)
    in_case = finding_case(None, [accepted(verdict="not-run")], evidence(G))  # another machine may lack the tool
    assert not any(i.kind == "unused" for i in in_case.open_items)


def test_a_marked_finding_is_that_one_and_no_later_one() -> None:
    taken = Finding("n/guarantee/g", "refuted", "known", "A. Person", "2026-01-01", "2026-12-31")
    small, large = (replace(REFUTED, counterexample=Counterexample((("in.x", x),))) for x in ("1", "1000"))
    unmarked = finding_case(None, [taken], small)
    assert unmarked.exit_code == 0
    (told,) = (i for i in unmarked.open_items if i.kind == "unmarked")
    assert told.advice
    marked = replace(taken, found=told.text.rpartition(" ")[2])
    assert finding_case(None, [marked], small).exit_code == 0
    assert not any(i.kind == "unmarked" for i in finding_case(None, [marked], small).open_items)
    both = (small, replace(large, method="hypothesis"))
    for records in ((large,), both, (replace(small, obligation_digest=G.digest, vacuous=True), large)):
        worse = finding_case(None, [marked], *records)
        assert worse.exit_code == 1
        assert any(i.kind == "another finding" and not i.advice for i in worse.open_items)
        assert worse.obligations[0].handled == ""
    assert finding_case([marked], [], large).exit_code == 1  # expected ones, too
    by_one = replace(taken, method=small.method)
    of_one = finding_case(None, [by_one], *both)
    mark = next(i.text for i in of_one.open_items if i.kind == "unmarked").rpartition(" ")[2]
    assert mark == marked.found


def test_advice_fails_nothing_but_is_told() -> None:
    advice = obligation("n", Kind.SANITY, "not-redundant-g")
    for verdict in (Verdict.REFUTED, Verdict.UNKNOWN):
        found = case(SYSTEM, [G, advice], [evidence(G), evidence(advice, verdict, "sanity")])
        assert found.exit_code == 0
        assert [i.kind for i in found.open_items if i.advice] == ["advice"], verdict
    real = obligation("n", Kind.SANITY, "realizable")
    assert case(SYSTEM, [G, real], [evidence(G), evidence(real, Verdict.REFUTED, "sanity")]).exit_code == 1


# -- gates, grades, exit codes --------------------------------------------------------------------------------------


def test_exit_code_3_only_for_want_of_a_tool() -> None:
    assert case(SYSTEM, [G], [evidence(G)]).exit_code == 0
    assert case(SYSTEM, [G], [evidence(G, Verdict.NOT_RUN)]).exit_code == 3
    assert case(SYSTEM, [G], [evidence(G, Verdict.ERROR)]).exit_code == 3
    assert case(SYSTEM, [G], [evidence(G, Verdict.UNKNOWN)]).exit_code == 1
    both = system({"n": ["g", "h"]}, plans=PLANS)
    other = guarantee("n", "h")
    mixed = case(both, [G, other], [evidence(G, Verdict.NOT_RUN), evidence(other, Verdict.REFUTED)])
    assert mixed.exit_code == 1


def test_tampering_fails_whatever_the_evidence_says() -> None:
    serious = Discrepancy(Fault.CHANGED, "a.log", "a.log was changed")
    assert case(SYSTEM, [G], [evidence(G)], discrepancies=[serious]).exit_code == 1
    assert case(SYSTEM, [G], [evidence(G)], discrepancies=[replace(serious, serious=False)]).exit_code == 0


def test_fresh_means_all_fresh_and_all_verified() -> None:
    fresh = replace(RUN, fresh=True)
    assert case(SYSTEM, [G], [evidence(G)], run=fresh).fresh
    assert not case(SYSTEM, [G], [evidence(G)]).fresh
    assert not case(SYSTEM, [G], [evidence(G)], run=fresh, discrepancies=None).fresh
    old = evidence(G, run="an earlier run")
    found = case(SYSTEM, [G], [old], run=fresh)
    assert not found.fresh
    assert status_of(found) is Status.STALE  # a fresh run believes no support that it did not see
    refuted = case(SYSTEM, [G], [evidence(G, Verdict.REFUTED, run="an earlier run"), evidence(G)], run=fresh)
    assert status_of(refuted) is Status.CONTRADICTORY  # but it forgets no refutation


def test_sil4_asks_for_a_fresh_case() -> None:
    subject = system({"n": ["g"]}, plans=PLANS, policy={"profile": "default", "certified": True})
    assert case(subject, [G], [evidence(G)]).exit_code == 1
    assert case(subject, [G], [evidence(G)], run=replace(RUN, fresh=True)).exit_code == 0


def test_vanished_obligations_leave_orphans_not_support() -> None:
    found = case(SYSTEM, [], [evidence(G)])
    assert len(found.orphans) == 1
    assert found.obligations == ()


def test_single_methods_and_hypotheses_are_listed() -> None:
    found = rover_case()
    alone = next(d.claims for d in found.deficits if d.key == "single")
    assert "rover/agent/guarantee/next_waypoint" in alone
    assert "rover/radiationSensor/guarantee/low" not in alone
    assert "percepts are edge-triggered" in [a.text for a in found.assumptions]


# -- as data --------------------------------------------------------------------------------------------------------


def test_a_case_survives_json_and_meets_its_schema() -> None:
    found = rover_case()
    data = json.loads(json.dumps(to_json(found)))
    assert from_json(data) == found
    assert conclude_again(from_json(data)) == found
    jsonschema.Draft202012Validator(case_schema()).validate(data)
    data["requirements"][0]["status"] = "splendid"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(case_schema()).validate(data)
    with pytest.raises(Unreadable):
        from_json(data)


@pytest.mark.parametrize("bad", [None, [], {}, {"schema": "other"}, {"schema": "https://avow.invalid/schemas/case-2"}])
def test_other_json_is_no_case(bad: object) -> None:
    with pytest.raises(Unreadable):
        from_json(bad)


@pytest.mark.parametrize(("name", "schema"), schemas().items())
def test_published_schemas_are_up_to_date(name: str, schema: dict[str, Any]) -> None:
    published = json.loads((SCHEMAS / f"{name}.schema.json").read_text())
    assert published == schema, "write it again: python -m avow.cli.schemas docs/schemas"
