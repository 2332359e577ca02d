"""What an answer rests on is discharged by what it says, never by its name; what nobody discharges is an error."""

from __future__ import annotations

from dataclasses import replace

import pytest

from assurance.sample import rover_case
from avow.assurance.case import conclude
from avow.assurance.facts import Facts, facts_of_case
from avow.assurance.gap import reason_wanted
from avow.base.verdict import Hypothesis, HypothesisKind, Verdict, bound
from avow.evidence.ledger import Entry
from avow.evidence.status import Status
from avow.system.plan import Finding

CLAIM = HypothesisKind.CLAIM


def resting(facts: Facts, at: str, *hypotheses: Hypothesis) -> Facts:
    """The facts, where the proof of one obligation rests on something."""

    def change(entry: Entry) -> Entry:
        if entry.evidence.obligation != at:
            return entry
        return replace(entry, evidence=replace(entry.evidence, rests_on=hypotheses))

    return replace(facts, entries=tuple(map(change, facts.entries)))


def proved(facts: Facts) -> str:
    case = conclude(facts)
    return next(v.id for v in case.obligations if v.standing is Status.PROVED and v.obligation.kind == "guarantee")


def test_by_meaning() -> None:
    facts = facts_of_case(rover_case())
    at = proved(facts)
    other = next(o for o in facts.obligations if o.id != at and o.kind == "guarantee")
    for name, digest, status in (
        (other.local_id, other.digest, None),
        (other.local_id, "0" * 64, Status.ERROR),
        (other.local_id.rsplit("/", 1)[0] + "/renamed", other.digest, None),
        ("nobody/guarantee/nothing", other.digest, Status.ERROR),
    ):
        view = conclude(resting(facts, at, Hypothesis(CLAIM, name, digest))).obligation(at)
        if status is None:
            assert other.id in view.rests_on
        else:
            assert view.standing is status


def test_an_assumption_wants_a_person() -> None:
    facts = facts_of_case(rover_case())
    at = proved(facts)
    ends = Hypothesis(HypothesisKind.ASSUMPTION, "agent/assumption/termination", "1" * 64, "the loop ends")
    facts = resting(facts, at, ends)
    found = conclude(facts)
    assert found.obligation(at).standing is Status.UNSUPPORTED
    wanted = "accept the assumption: `accepted: [{obligation: agent/assumption/termination, verdict: missing,"
    assert {g.id for g in found.gates if any(s.text.startswith(wanted) for s in g.suggestions)} == {"requirements"}
    taken = Finding(
        ends.name, Verdict.REFUTED, "seen", "A. Person", facts.today.isoformat(), "2030-01-01", found="1" * 12
    )
    assert conclude(replace(facts, accepted=(taken,))).obligation(at).standing is Status.UNSUPPORTED
    taken = replace(taken, verdict="missing", says="The loop ends")
    found = conclude(replace(facts, accepted=(taken,)))
    assert found.obligation(at).standing is Status.JUSTIFIED
    assert "The loop ends" in [a.words for a in conclude(facts_of_case(found)).assumptions]
    assert not {"unused", "unmarked", "another finding"} & {item.kind for item in found.open_items}
    unused = conclude(replace(facts, accepted=(replace(taken, obligation="mem/assumption/other"),)))
    assert "unused" in [item.kind for item in unused.open_items]


@pytest.mark.parametrize(("mark", "item"), [("2" * 12, "another finding"), ("", "unmarked")])
def test_an_accepted_assumption_is_bound_to_its_text(mark: str, item: str) -> None:
    """An edit of the box, or of the initial values, ends the acceptance; the report says what to write."""
    facts = facts_of_case(rover_case())
    at = proved(facts)
    facts = resting(facts, at, Hypothesis(HypothesisKind.ASSUMPTION, "agent/assumption/box", "1" * 64, "0 <= x <= 2"))
    today = facts.today.isoformat()
    taken = Finding("agent/assumption/box", "missing", "seen", "A. Person", today, "2030-01-01", found=mark)
    found = conclude(replace(facts, accepted=(taken,)))
    assert found.obligation(at).standing is Status.UNSUPPORTED
    assert [i.text.endswith("write  found: 111111111111") for i in found.open_items if i.kind == item] == [True]


def test_what_rests_on_a_limit_is_checked_at_most() -> None:
    """Whatever its evidence says of itself; and the limit is among what the case supposes."""
    facts = facts_of_case(rover_case())
    at = proved(facts)
    assert conclude(facts).obligation(at).standing is Status.PROVED
    limit = bound("scenario.domains.in.r", "scenario.domains.in.r: it is one of 0, 1")
    found = conclude(resting(facts, at, limit))
    assert found.obligation(at).standing is Status.CHECKED
    assert limit.text in found.obligation(at).hypotheses
    assert limit.text in [a.text for a in found.assumptions]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("whole.loop.mem", "compose: {whole: {entered: {because: …}}}"),
        ("D1.one-output", "compose: {D1: {one_output: {because: …}}}"),
        ("start.mem", "initial: …"),
        ("environment.a.some", "the input, with PORT its input, and why: `environment: {a.PORT: {assume: …"),
        ("environment.in.r", "environment: {in.r: {assume: …, because: …}}"),
    ],
)
def test_the_hint_where_a_reason_belongs_names_a_key_that_plans_have(name: str, words: str) -> None:
    assert words in reason_wanted(name)
