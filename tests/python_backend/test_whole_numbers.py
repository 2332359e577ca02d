"""Quotients rounded down, remainders with the divisor's sign, and several names bound at once, as Python has them."""

from __future__ import annotations

import random
from itertools import product
from pathlib import Path

import pytest
from source_nodes import Example

from avow.base.verdict import Verdict

RCL = """node wheel { inputs( n : INTEGER, d : INTEGER ) outputs( q : INTEGER, r : INTEGER ) topics()
 assume some ( in.d == 7 or in.d == 0 - 7 )
 guarantee sign ( in.d == 7 -> 0 <= out.r and out.r < 7 )
 guarantee other_sign ( in.d == 0 - 7 -> 0 - 7 < out.r and out.r <= 0 )
 guarantee down ( in.n == 0 - 8 and in.d == 7 -> out.q == 0 - 2 and out.r == 6 )
 guarantee whole ( in.d == 7 -> out.q * 7 + out.r == in.n ) }"""
SOURCE = """
class Wheel:
    def __init__(self, params):
        pass
    def step(self, n: int, d: int):
        q, r = n // d, n % d
        q, r = r, q
        q, r = r, q
        return {"q": q, "r": r}
"""


@pytest.mark.slow
def test_quotients_and_remainders_are_pythons(tmp_path: Path) -> None:
    found = Example(SOURCE, RCL, "Wheel", {}).settled(tmp_path / "right")
    assert {o.verdict for o in found.values()} == {Verdict.PROVED}, found
    wrong = SOURCE.replace("n // d, n % d", "0 - (0 - n) // d, n - d * (0 - (0 - n) // d)")
    found = Example(wrong, RCL, "Wheel", {}).settled(tmp_path / "wrong")
    assert found["sign"].verdict is Verdict.REFUTED
    free = RCL.replace("assume some ( in.d == 7 or in.d == 0 - 7 )", "")
    found = Example(SOURCE, free, "Wheel", {}).settled(tmp_path / "free")
    assert {o.verdict for o in found.values()} == {Verdict.REFUTED}
    assert "ZeroDivisionError" in found["sign"].summary


def test_the_relation_has_pythons_answer_and_no_other() -> None:
    chance = random.Random(3)
    pairs = [*product(range(-9, 10), repeat=2), *((chance.randrange(-(10**30), 10**30), 7 - k) for k in range(14))]
    for n, d in pairs:
        if d:
            fits = [r for r in range(min(d + 1, 0), max(d, 1)) if (n - r) % d == 0]
            assert fits == [n % d]
            assert n // d * d + n % d == n
