"""The lattice's laws, over random sets of evidence."""

from __future__ import annotations

import random
from itertools import permutations

import pytest
from assurance.sample import evidence
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.base.verdict import Verdict
from avow.evidence.record import Evidence
from avow.evidence.status import NOTHING, Status, Weight, behind, effective, join, roll_up, weigh

BOUNDED = (Verdict.CHECKED, Verdict.TESTED, Verdict.MONITORED, Verdict.REVIEWED, Verdict.JUSTIFIED)


POOL = [
    evidence("n.g", verdict, method, strength=strength, vacuous=vacuous, hypotheses=assumed)
    for verdict in Verdict
    for strength in (*BOUNDED, Verdict.PROVED)
    for vacuous in (False, False, True)
    for method, assumed in (("hoare", ()), ("dafny", ("a", "b")), ("hypothesis", ("c",)))
]


def items() -> st.SearchStrategy[Evidence]:
    return st.sampled_from(POOL)


def test_ten_thousand_sets_order_duplication_and_refutation() -> None:
    chance = random.Random(20261121)
    refutation = evidence("n.g", Verdict.REFUTED)
    seen = set()
    for _ in range(10_000):
        found = [chance.choice(POOL) for _ in range(chance.randrange(7))]
        outdated = chance.random() < 0.3
        status = roll_up(found, outdated=outdated)
        seen.add(status)
        mixed = found + [chance.choice(found) for _ in range(3) if found]
        chance.shuffle(mixed)
        assert roll_up(mixed, outdated=outdated) is status
        refuted = roll_up([*found, refutation], outdated=outdated)
        assert refuted.rank <= status.rank
        assert refuted in (Status.REFUTED, Status.CONTRADICTORY)
        if any(e.verdict is Verdict.REFUTED for e in found):
            assert status in (Status.REFUTED, Status.CONTRADICTORY)
        if not any(e.verdict is Verdict.PROVED and e.strength is Verdict.PROVED and not e.vacuous for e in found):
            assert status is not Status.PROVED
    assert len(seen) > 8  # the sample reached most of the lattice: else this test shows little


@given(st.lists(items(), max_size=4), items(), items())
@settings(max_examples=200, deadline=None)
def test_join_is_a_semilattice(some: list[Evidence], one: Evidence, other: Evidence) -> None:
    a, b, c = join(map(weigh, some)), weigh(one), weigh(other)
    assert a.join(b) == b.join(a)
    assert a.join(b).join(c) == a.join(b.join(c))
    assert a.join(a) == a
    assert a.join(NOTHING) == a


@given(st.lists(items(), max_size=5), st.integers(0, 4))
@settings(max_examples=200, deadline=None)
def test_deleting_an_item_is_never_having_had_it(some: list[Evidence], at: int) -> None:
    rest = [e for number, e in enumerate(some) if number != at]
    assert roll_up(rest) is join([weigh(e) for e in rest]).status
    assert behind(rest) == behind(list(reversed(rest)))


@pytest.mark.parametrize("strength", BOUNDED)
def test_a_bounded_method_never_proves_whatever_its_record_says(strength: Verdict) -> None:
    record = evidence("n.g", Verdict.PROVED, strength=strength)
    assert effective(record) is strength
    assert roll_up([record]) is Status(strength)


def test_more_evidence_of_the_same_side_never_lowers() -> None:
    chance = random.Random(7)
    for _ in range(2_000):
        found = [e for e in (chance.choice(POOL) for _ in range(5)) if e.verdict is not Verdict.REFUTED]
        more = chance.choice(POOL)
        if more.verdict is not Verdict.REFUTED:
            assert roll_up([*found, more]).rank >= roll_up(found).rank


def test_the_words() -> None:
    proof, refutation = evidence("n.g", Verdict.PROVED), evidence("n.g", Verdict.REFUTED)
    assert roll_up([]) is Status.MISSING
    assert roll_up([], outdated=True) is Status.STALE
    assert roll_up([proof], outdated=True) is Status.PROVED
    assert all(roll_up(order) is Status.CONTRADICTORY for order in permutations([proof, refutation]))
    tested = evidence("n.g", Verdict.TESTED, "hypothesis")
    assert roll_up([tested, refutation]) is Status.REFUTED
    assert roll_up([evidence("n.g", Verdict.PROVED, vacuous=True)]) is Status.VACUOUS
    assert roll_up([evidence("n.g", Verdict.PROVED, vacuous=True), tested]) is Status.TESTED
    assert roll_up([evidence("n.g", Verdict.NOT_RUN), evidence("n.g", Verdict.UNKNOWN)]) is Status.UNKNOWN
    assert roll_up([evidence("n.g", Verdict.PROVED, strength=Verdict.ERROR)]) is Status.UNKNOWN


def test_hypotheses_are_those_of_the_least_demanding_best_item() -> None:
    with_two = evidence("n.g", hypotheses=("a", "b"))
    with_one = evidence("n.g", method="dafny", hypotheses=("c",))
    tested = evidence("n.g", Verdict.TESTED, "hypothesis")
    assert behind([with_two, with_one, tested])[1] == ("c",)
    assert behind([with_two, evidence("n.g", method="ajpf", strength=Verdict.PROVED)])[1] == ()
    assert behind([evidence("n.g", Verdict.UNKNOWN, hypotheses=("a",))])[1] == ()


def test_a_weight_cannot_forget_a_refutation() -> None:
    assert Weight(Status.PROVED).join(Weight(refuted=True)).status is Status.CONTRADICTORY
