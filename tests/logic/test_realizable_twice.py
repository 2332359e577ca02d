"""Whether a contract is realizable is not said on one question's word: a seeded fault on the way is noticed."""

from __future__ import annotations

from typing import Any

import pytest

from avow.base.verdict import Verdict
from avow.language.load import check_text
from avow.language.terms import TRUE
from avow.sanity import realizability, witness_search
from avow.sanity.analysis import analyse
from avow.sanity.witness_search import Realizability


def realizable(text: str) -> Verdict:
    found, faults = check_text(text, "n.rcl")
    assert found is not None, faults
    (result,) = analyse(found.nodes[0], wanted={"realizable"})
    return result.verdict


POINTS = (
    "context {{ Map : INTEGER --> BOOL; }} "
    "node n {{ inputs( k : INTEGER ) outputs( m : Map ) topics() guarantee( {} ) }}"
)
PAIRS = (
    "context {{ Pair : (INTEGER, INTEGER); }} "
    "node n {{ inputs( p : Pair ) outputs( q : Pair ) topics() guarantee( {} ) }}"
)
CAN, CANNOT = "forall(i in INTEGER | m(i) <=> i > k)", "forall(i in INTEGER | (m(i) <=> i > k) and (m(i) <=> i < k))"


def test_they_are_decided() -> None:
    assert realizable(POINTS.format(CAN)) is Verdict.PROVED
    assert realizable(POINTS.format(CANNOT)) is Verdict.REFUTED
    assert realizable(PAIRS.format("q == p")) is Verdict.PROVED


def test_a_wrong_instance_of_a_guarantee_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(witness_search, "instantiate", lambda found, guarantee, **_: TRUE)
    assert realizable(POINTS.format(CANNOT)) is not Verdict.PROVED


def test_a_refutation_at_inputs_that_have_an_output_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = realizability.Search.decide

    def wrong(self: Any, doubtful: bool = False) -> Realizability:
        answer = honest(self, doubtful)
        if any("(" in v.name or v.name.count("'") or "." in v.name for v in self.inputs) or len(self.inputs) > 1:
            return Realizability(Verdict.REFUTED, dict.fromkeys(self.inputs, 0), tuple(self.group.guarantees))
        return answer

    monkeypatch.setattr(realizability.Search, "decide", wrong)
    for text in (POINTS.format(CAN), PAIRS.format("q == p")):
        assert realizable(text) is not Verdict.REFUTED
