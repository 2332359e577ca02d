"""Contracts in number, good ones and ones with a seeded fault: the verdicts must all be right.

`AVOW_SANITY_CONTRACTS=2000 pytest tests/logic/test_seeded_contracts.py -s` asks for more of them than every run does
(from the seed AVOW_SANITY_FIRST on), and says how many claims stayed open.
"""

from __future__ import annotations

import os
from collections import Counter

import pytest

from avow.base.verdict import Verdict
from avow.sanity.analysis import analyse

from .contracts import contract
from .seeded_contracts import FAULTS, SHAPES, seeded

WHOLE = len(SHAPES) * len(FAULTS)
COUNT = int(os.environ.get("AVOW_SANITY_CONTRACTS", "0"))
FIRST = int(os.environ.get("AVOW_SANITY_FIRST", "0"))
SEEDS = range(FIRST, FIRST + COUNT) if COUNT else range(0, WHOLE, 7)


@pytest.mark.nightly
def test_every_verdict_is_right() -> None:
    wrong: list[str] = []
    unknown: Counter[str] = Counter()
    total = 0
    for seed in SEEDS:
        name, text, faults = seeded(seed)
        results = analyse(contract(text).nodes[0])
        total += len(results)
        unknown.update(f"{name}: {r.name}" for r in results if r.verdict is Verdict.UNKNOWN)
        found = {
            r.name for r in results if r.verdict is Verdict.REFUTED and not r.because and r.asked.severity != "note"
        }
        open_claims = {r.name for r in results if r.verdict is Verdict.UNKNOWN}
        if found - faults or faults - found - open_claims:
            wrong.append(f"{name}: found {sorted(found)}, wanted {sorted(faults)}\n{text}")
    print(f"{len(SEEDS)} contracts, {total} claims, {len(wrong)} wrong, {unknown.total()} open: {sorted(unknown)}")
    assert not wrong, "\n".join(wrong)
    assert unknown.total() * 200 <= total, sorted(unknown)


def test_every_shape_and_every_fault_has_its_turn() -> None:
    names = [seeded(seed)[0].split(", ")[:2] for seed in range(WHOLE)]
    assert len({tuple(name) for name in names}) == WHOLE
    assert {name[1] for name in (seeded(seed)[0].split(", ") for seed in range(0, WHOLE, 7))} == {
        f.__name__ for f in FAULTS
    }


@pytest.mark.parametrize("seed", range(0, WHOLE, 11))
def test_the_text_is_a_contract(seed: int) -> None:
    assert contract(seeded(seed)[1]).nodes
