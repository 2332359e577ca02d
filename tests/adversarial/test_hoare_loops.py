"""A loop without a variant leaves partial correctness, and a refutation where some run of it never ends."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict

from .settling import settle

CONTRACT = "node n { inputs( k : NATURAL ) outputs( m : NATURAL ) topics() guarantee g ( k > 3 -> m == k ) }"


@pytest.mark.parametrize(
    ("loop", "verdict"),
    [
        ("WHILE TRUE INVARIANT TRUE DO\n   m := 0\n", Verdict.REFUTED),
        ("WHILE m < k + 1 INVARIANT m == 0 DO\n   m := 0\n", Verdict.REFUTED),
        ("WHILE m < k INVARIANT m <= k DO\n   m := m + 1\n", Verdict.PARTIAL),
        ("WHILE m < k INVARIANT m <= k VARIANT k - m DO\n   m := m + 1\n", Verdict.PROVED),
    ],
)
def test_a_loop_that_never_ends_proves_nothing(tmp_path: Path, loop: str, verdict: Verdict) -> None:
    outcome = settle(tmp_path, CONTRACT, "hoare: {program: p.imp}", {"p.imp": f"m := 0\n{loop}"})["g"]
    assert outcome.verdict is verdict, outcome.summary
