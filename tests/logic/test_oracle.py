"""Random contracts: every sanity verdict against the oracle's.

`AVOW_ORACLE_CONTRACTS=1000 pytest tests/logic/test_oracle.py -m slow -s` asks for more contracts than the slow test
does by itself (from the seed AVOW_ORACLE_FIRST on), and says how many claims stayed open.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache

import pytest
from drawn.contracts import small_contract
from oracle.sanity import Survey, is_small, judge

from avow.base.verdict import Verdict
from avow.language.contract import Node
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.sanity.claims import Property
from avow.sanity.results import SanityResult

from .contracts import node

QUICK = (0, 1, 2, 3, 6, 7, 13, 15)
COUNT = int(os.environ.get("AVOW_ORACLE_CONTRACTS", "8"))
FIRST = int(os.environ.get("AVOW_ORACLE_FIRST", "100"))

ONE_SIDED = {Property.NOT_TAUTOLOGICAL, Property.NOT_VACUOUS, Property.NOT_REDUNDANT, Property.NEEDED}
"""Where types are infinite, the oracle knows of these only that they hold."""

OPPOSITE = {Verdict.PROVED: Verdict.REFUTED, Verdict.REFUTED: Verdict.PROVED}


@dataclass(slots=True)
class Tally:
    skipped: int = 0
    contracts: int = 0
    claims: int = 0
    hinging: int = 0
    wrong: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return (
            f"{self.contracts} contracts ({self.skipped} skipped), {self.claims} claims, {len(self.wrong)} wrong, "
            f"{len(self.unknown)} open, {self.hinging} open where something unspecified is asked for: {self.unknown}"
        )


def small_node(seed: int) -> Node | None:
    """None if the text is ill-typed (``<> == <>``), or has too many cases for the oracle."""
    found, _ = check_text(small_contract(seed), "test.rcl")
    return found.nodes[0] if found is not None and is_small(found.nodes[0]) else None


@cache
def analysed(seed: int) -> tuple[Node, tuple[SanityResult, ...]]:
    found = small_node(seed)
    assert found is not None, "the quick ones are small"
    return found, analyse(found)


def tally(seeds: Iterable[int]) -> Tally:
    found = Tally()
    for seed in seeds:
        asked = small_node(seed)
        if asked is None:
            found.skipped += 1
            continue
        results = analysed(seed)[1] if seed in QUICK else analyse(asked)
        judgement = judge(asked, results)
        found.contracts += 1
        found.claims += len(results)
        found.hinging += len(judgement.hinging)
        found.wrong += [f"{seed}: {name}\n{small_contract(seed)}" for name in judgement.wrong]
        found.unknown += [f"{seed}: {name}" for name in judgement.unknown]
    return found


@pytest.mark.nightly
def test_a_few_contracts() -> None:
    found = tally(QUICK)
    assert not found.wrong, "\n".join(found.wrong)
    assert found.contracts == len(QUICK)
    assert not found.unknown


@pytest.mark.nightly
def test_every_verdict_is_right() -> None:
    found = tally(range(FIRST, FIRST + COUNT))
    print(found)
    assert not found.wrong, "\n".join(found.wrong)
    assert found.contracts * 3 >= COUNT * 2, "too much is skipped"
    assert len(found.unknown) * 100 <= found.claims, found.unknown
    assert found.hinging * 5 <= found.claims


@pytest.mark.slow
def test_a_flipped_verdict_is_caught() -> None:
    caught: set[Property] = set()
    missed: set[Property] = set()
    for seed in QUICK:
        asked, results = analysed(seed)
        flipped = {r.name: replace(r, verdict=OPPOSITE[r.verdict]) for r in results if r.verdict in OPPOSITE}
        judgement = judge(asked, flipped.values())
        caught |= {flipped[name].asked.about for name in judgement.wrong}
        missed |= {flipped[name].asked.about for name in judgement.right}
    assert caught == set(Property) - {Property.MEETABLE}
    assert missed <= ONE_SIDED


def test_the_verdicts_of_another_contract_are_caught() -> None:
    ports = "inputs( i : BOOL, j : BOOL ) outputs( o : BOOL, p : BOOL )| assume( in.i )"
    asked = node(f"{ports} guarantee( in.j -> out.o ) guarantee( out.p )")
    assert not judge(asked, analyse(asked)).wrong
    other = node(f"{ports} guarantee( in.j -> out.o ) guarantee( out.p or out.o )")
    assert set(judge(asked, analyse(other)).wrong) == {"determined-p"}
    assert set(judge(other, analyse(asked)).wrong) == {"determined-p"}


def test_the_facts_of_a_contract_that_is_bad_in_every_way() -> None:
    bad = node(
        "inputs( i : BOOL, n : NATURAL ) outputs( o : BOOL, free : BOOL )"
        "| assume limit_n ( n <= 1 ) assume TRUISM ( n >= 0 ) assume ( n <= 2 ) assume ONLY ( n == 0 )"
        " guarantee DEMAND ( in.i -> out.o ) guarantee NEVER ( n == 1 -> out.o ) guarantee DENIAL ( not out.o )"
    )
    facts = Survey(bad).facts()
    assert {name for name, fact in facts.items() if not fact.holds} == {
        *("realizable", "not-tautological-NEVER", "not-vacuous-NEVER", "not-redundant-NEVER", "constrained-free"),
        *("determined-free", "not-tautological-TRUISM", "not-redundant-TRUISM", "needed-TRUISM"),
        *("not-redundant-A3", "needed-A3", "not-redundant-limit_n", "needed-limit_n"),
    }
