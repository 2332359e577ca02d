"""`<a upto b>` with bounds that are no numbers, as a value: found by `test_oracle`, which such a contract crashed."""

from __future__ import annotations

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.sanity.analysis import analyse

from .contracts import node

PORTS = "inputs( k : NATURAL, s : <NATURAL> ) outputs( o : <NATURAL> )"

HOLDS, FAILS = Verdict.PROVED, Verdict.REFUTED


def verdicts(*guarantees: str, wanted: tuple[str, ...] | None = None) -> dict[str, Verdict]:
    clauses = " ".join(f"guarantee( {g} )" for g in guarantees)
    return {result.name: result.verdict for result in analyse(node(f"{PORTS}| {clauses}"), wanted=wanted)}


@pytest.mark.parametrize(
    ("guarantees", "realizable"),
    some(
        [
            (("out.o == <1 upto in.k>",), HOLDS),
            (("out.o == <in.k upto in.k>", "length(out.o) == 1"), HOLDS),
            (("out.o == <1 upto in.k>", "length(out.o) == 2"), FAILS),
            (("out.o == <0 upto in.k>", "out.o(in.k) != in.k"), FAILS),
            (("<1 upto in.k> == <2 upto in.k + 1> -> length(out.o) == in.k",), HOLDS),
            (("<1 upto in.k> != <in.k - in.k + 1 upto in.k>",), FAILS),
            (("out.o == in.s", "length(out.o) == 1 -> in.k in <1 upto in.k>"), FAILS),
        ],
        1,
        slow=2,
    ),
)
def test_a_range_may_be_compared(guarantees: tuple[str, ...], realizable: Verdict) -> None:
    assert verdicts(*guarantees, wanted=("realizable",)) == {"realizable": realizable}


def test_a_range_decides_an_output() -> None:
    found = verdicts("out.o == <1 upto in.k>")
    assert found == dict.fromkeys(found, HOLDS)
    off = verdicts("length(out.o) == in.k", "forall(i in NATURAL | i + 1 < in.k -> out.o(i) == i + 1)")
    assert off["determined-o"] is FAILS


def test_a_range_within_a_value_is_said_to_be_inexpressible() -> None:
    found = analyse(
        node("inputs( k : NATURAL ) outputs( p : (BOOL, <INTEGER>) )| guarantee( p == (TRUE, <1 upto k>) )")
    )
    assert Verdict.REFUTED not in {result.verdict for result in found}
    assert all("range" in r.explanation for r in found if r.verdict is Verdict.UNKNOWN)
