"""Derived claims: weakest links, hypotheses, consequences apart from failures, circles refused."""

from __future__ import annotations

import os
import random
from collections.abc import Mapping, Sequence

from avow.base.verdict import Link
from avow.evidence.claims import Claim, judge
from avow.evidence.status import Status

SETS = int(os.environ.get("AVOW_SETS", "400"))
"""How many random sets of claims are judged; 10,000 were, when this was written."""


def test_the_weakest_link_is_carried_up_with_hypotheses_and_link() -> None:
    found = judge(
        [
            Claim("req", rests_on=("d", "g1")),
            Claim("d", rests_on=("side", "g2"), hypotheses=("environment",)),
            Claim("side", Status.PROVED, link=Link.GENERATED),
            Claim("g1", Status.PROVED, hypotheses=("h1",), link=Link.GENERATED),
            Claim("g2", Status.TESTED, link=Link.GUIDED),
        ]
    )
    assert found["req"].status is Status.TESTED
    assert found["req"].weakest == ("g2", Status.TESTED)
    assert found["req"].hypotheses == ("environment", "h1")
    assert found["req"].link is Link.GUIDED


def test_a_failure_below_is_a_consequence_and_its_cause_is_named() -> None:
    found = judge(
        [
            Claim("req", rests_on=("d",)),
            Claim("d", rests_on=("g", "h")),
            Claim("g", Status.REFUTED),
            Claim("h", Status.PROVED),
        ]
    )
    assert found["g"].direct
    assert found["g"].status is Status.REFUTED
    for name in ("d", "req"):
        assert found[name].status is Status.UNSUPPORTED
        assert not found[name].direct
        assert found[name].below == ("g",)


def test_a_direct_failure_is_told_even_if_something_below_fails_too() -> None:
    found = judge([Claim("req", Status.REFUTED, ("g",)), Claim("g", Status.MISSING)])
    assert found["req"].status is Status.REFUTED
    assert found["req"].direct
    assert found["req"].below == ("g",)


def test_prose_is_linked_never_proved() -> None:
    found = judge([Claim("req", rests_on=("g",), prose=True), Claim("g", Status.PROVED, link=Link.GENERATED)])
    assert found["req"].status is Status.ARGUED
    assert found["req"].link is Link.GUIDED
    weak = judge([Claim("req", rests_on=("g",), prose=True), Claim("g", Status.REFUTED)])
    assert weak["req"].status is Status.UNSUPPORTED


def test_circular_support_is_refused_and_the_circle_is_shown() -> None:
    found = judge(
        [
            Claim("a", Status.PROVED, ("b",)),
            Claim("b", Status.PROVED, ("c",)),
            Claim("c", Status.PROVED, ("a",)),
            Claim("req", rests_on=("a", "fine")),
            Claim("fine", Status.PROVED),
        ]
    )
    for name in "abc":
        assert found[name].status is Status.CIRCULAR
        assert not found[name].status.supports
        assert found[name].circle[0] == found[name].circle[-1]
        assert set(found[name].circle) == {"a", "b", "c"}
    assert found["req"].status is Status.UNSUPPORTED
    assert judge([Claim("self", Status.PROVED, ("self",))])["self"].status is Status.CIRCULAR


def test_nothing_supports_nothing() -> None:
    found = judge([Claim("req"), Claim("other", rests_on=("no such claim",))])
    assert found["req"].status is Status.MISSING
    assert found["other"].status is Status.UNSUPPORTED
    assert found["no such claim"].status is Status.MISSING


def test_deep_chains_do_not_exhaust_the_stack() -> None:
    claims = [Claim(f"c{n}", rests_on=(f"c{n + 1}",)) for n in range(20_000)]
    assert judge([*claims, Claim("c20000", Status.CHECKED)])["c0"].status is Status.CHECKED


def test_random_graphs_deletion_recomputation_and_monotonicity() -> None:
    chance = random.Random(11)
    for _ in range(SETS):
        size = chance.randrange(2, 9)
        claims = [
            Claim(
                str(n),
                chance.choice([None, Status.PROVED, Status.TESTED, Status.REFUTED, Status.MISSING]),
                tuple(str(m) for m in range(size) if m != n and chance.random() < 0.25),
            )
            for n in range(size)
        ]
        found = judge(claims)
        shuffled = claims[:]
        chance.shuffle(shuffled)
        assert judge(shuffled) == found
        for claim in claims:
            # a claim never stands better than what it rests on, nor than its own evidence
            standing = found[claim.id]
            if standing.status.supports:
                assert all(found[name].status.supports for name in claim.rests_on)
                assert all(found[name].weakest[1].rank >= standing.weakest[1].rank for name in claim.rests_on)
                assert claim.own is None or claim.own.supports
        worse = [Claim(c.id, Status.REFUTED if c.id == "0" else c.own, c.rests_on) for c in claims]
        for name, standing in judge(worse).items():
            assert standing.status.supports <= found[name].status.supports


OWN = (None, Status.PROVED, Status.CHECKED, Status.TESTED, Status.REVIEWED, Status.REFUTED, Status.STALE)


def below(claims: Mapping[str, Claim], start: str) -> set[str]:
    """All that a claim rests on, itself only if it rests on itself. Slow, and another way than the one tested."""
    found: set[str] = set()
    while more := {n for name in (start, *found) for n in claims[name].rests_on} - found:
        found |= more
    return found


def random_claims(chance: random.Random) -> Sequence[Claim]:
    names = [str(n) for n in range(chance.randrange(2, 9))]
    backwards = chance.random() < 0.3  # circles, in some
    return [
        Claim(
            name,
            chance.choice(OWN),
            tuple(n for n in names if (n < name or backwards) and chance.random() < 0.3),
            (f"h{name}",) if chance.random() < 0.3 else (),
            chance.choice((None, *Link)),
            chance.random() < 0.2,
        )
        for name in names
    ]


def test_standings_against_a_plain_reading_of_the_rules() -> None:
    chance, circles = random.Random(20261121), 0
    for _ in range(SETS):
        listed = random_claims(chance)
        claims = {c.id: c for c in listed}
        found = judge(listed)
        for claim in listed:
            reach, standing = below(claims, claim.id), found[claim.id]
            if claim.id in reach:
                circles += 1
                assert not standing.status.supports
                assert standing.circle[0] == standing.circle[-1]
                assert all(b in claims[a].rests_on for a, b in zip(standing.circle, standing.circle[1:], strict=False))
                continue
            if any(name in below(claims, name) for name in reach):
                assert not standing.status.supports
                continue
            parts = [claims[name] for name in (claim.id, *reach)]
            owns = [c.own or Status.MISSING for c in parts if c.own is not None or not c.rests_on]
            assert standing.weakest[1].rank == min(own.rank for own in owns)
            assert standing.hypotheses == tuple(sorted({h for c in parts for h in c.hypotheses}))
            links = [c.link for c in parts if c.link] + [Link.GUIDED for c in parts if c.prose]
            order = (Link.GUIDED, Link.MAPPED, Link.GENERATED)
            assert standing.link == (min(links, key=order.index) if links else None)
            assert standing.status.supports == all(own.supports for own in owns)
            causes = {c.id for c in parts if c.id != claim.id and not (c.own or Status.MISSING).supports}
            causes -= {c.id for c in parts if c.own is None and c.rests_on}
            assert set(standing.below) == causes
    assert circles > SETS // 20


def test_deleting_any_claim_or_evidence_is_never_having_had_it() -> None:
    """Judging keeps nothing: after any other judgements, in any order, the same set has the same standings."""
    chance = random.Random(5)
    for _ in range(SETS // 4):
        listed = list(random_claims(chance))
        for at in range(len(listed)):
            judge(listed)
            without = listed[:at] + listed[at + 1 :]
            stripped = [Claim(c.id, None if n == at else c.own, c.rests_on) for n, c in enumerate(listed)]
            for some in (without, stripped):
                mixed = some[:]
                chance.shuffle(mixed)
                assert judge(some) == judge(mixed)
