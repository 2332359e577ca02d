"""Whether a contract is realizable is not said on one question's word: a seeded fault on the way is noticed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from avow.base.verdict import Verdict
from avow.language.load import check_text
from avow.language.sorts import INTEGER
from avow.language.terms import FALSE, TRUE, Compare, Literal, Term
from avow.sanity import realizability, witness_search
from avow.sanity.analysis import analyse
from avow.sanity.witness_candidates import Candidates, candidates
from avow.sanity.witness_search import Realizability, Search
from avow.solving.questions import Solution


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


@pytest.mark.slow
def test_they_are_decided() -> None:
    assert {realizable(text) for text in RIGHT} == {Verdict.PROVED}
    assert {realizable(text) for text in WRONG} == {Verdict.REFUTED}
    assert realizable(POINTS.format(CAN)) is Verdict.PROVED
    assert realizable(POINTS.format(CANNOT)) is Verdict.REFUTED
    assert realizable(PAIRS.format("q == p")) is Verdict.PROVED


@pytest.mark.parametrize("value", ["if in.b then 1 else 2", "1", "if in.b then 1 else (if in.c then 2 else 3)"])
def test_a_real_output_may_be_given_whole_numbers(value: str) -> None:
    text = "node n {{ inputs( b : BOOL, c : BOOL ) outputs( y : REAL ) topics() guarantee( out.y == ({}) {} ) }}"
    assert realizable(text.format(value, "")) is Verdict.PROVED
    assert realizable(text.format(value, "and out.y > 1")) is Verdict.REFUTED


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


NUMBERS = "node n {{ inputs( k : INTEGER ) outputs( m : INTEGER ) topics() assume( k > 0 ) guarantee( {} ) }}"
SEQUENCES = (
    "context {{ List : <INTEGER>; }} node n {{ inputs( s : List ) outputs( t : List ) topics() guarantee( {} ) }}"
)
WRONG = (
    NUMBERS.format("m > k and m < k + 1"),
    NUMBERS.format("m * m == k"),
    NUMBERS.format("exists(i in NATURAL | m == i and i + k < 0)"),
    POINTS.format(CANNOT),
    PAIRS.format("q == p and q != p"),
    SEQUENCES.format("length(t) > length(s) and length(t) < length(s)"),
)
RIGHT = (
    NUMBERS.format("m > k"),
    NUMBERS.format("exists(i in INTEGER | i > k and m == i)"),
    POINTS.format(CAN),
    PAIRS.format("q == p"),
    SEQUENCES.format("length(t) == length(s) + 1 and forall(i in NATURAL | i < length(s) -> t(i) == s(i))"),
)


@pytest.mark.parametrize("text", WRONG)
def test_a_search_that_believes_in_wrong_witnesses_proves_nothing(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    """Each alternative is believed to do for all inputs; and each question of the search is answered `unsat`."""
    honest = witness_search.check
    monkeypatch.setattr(witness_search, "check", lambda *a, **k: replace(honest(*a, **k), status="unsat", model=None))
    monkeypatch.setattr(witness_search, "solve", lambda *a, **k: Solution("unsat"))
    monkeypatch.setattr(Search, "judge", lambda *_: None)
    assert realizable(text) is Verdict.UNKNOWN


@pytest.mark.parametrize("text", WRONG[:2])
@pytest.mark.parametrize("axiom", [FALSE, Compare("<", Literal(9, INTEGER), Literal(0, INTEGER))])
def test_constants_that_need_not_exist_prove_nothing(monkeypatch: pytest.MonkeyPatch, text: str, axiom: Term) -> None:
    def wrong(*told: Any) -> Candidates:
        found = candidates(*told)
        found.axioms.append(axiom)
        return found

    monkeypatch.setattr(witness_search, "candidates", wrong)
    monkeypatch.setattr(Search, "_axioms", lambda self, *_: list(self.found.axioms))
    assert realizable(text) is not Verdict.PROVED


@pytest.mark.parametrize("text", [*WRONG, *RIGHT[:2], pytest.param(RIGHT[2], marks=pytest.mark.slow), *RIGHT[3:]])
def test_a_verdict_without_anything_found_is_none(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    for verdict in (Verdict.PROVED, Verdict.REFUTED):
        monkeypatch.setattr(Search, "decide", lambda *_, verdict=verdict: Realizability(verdict))
        assert realizable(text) is Verdict.UNKNOWN


@pytest.mark.parametrize("k", [-1, 0, 1])
def test_inputs_that_are_not_allowed_or_have_an_output_refute_nothing(monkeypatch: pytest.MonkeyPatch, k: int) -> None:
    def wrong(self: Any, _: bool = False) -> Realizability:
        return Realizability(Verdict.REFUTED, dict.fromkeys(self.inputs, k), tuple(self.group.guarantees))

    monkeypatch.setattr(Search, "decide", wrong)
    for text in (RIGHT[0], NUMBERS.format("m > k or k > 0")):
        assert realizable(text) is Verdict.UNKNOWN


def test_a_change_of_words_that_changes_the_meaning_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    pointwise, untupled, flatten = realizability.pointwise, realizability.untupled, realizability.flatten

    def weaker(found: Any) -> Any:
        for name in ("guarantees", "formulas"):
            if found is not None and hasattr(found, name):
                return replace(found, **{name: dict.fromkeys(getattr(found, name), TRUE)})
        return found

    monkeypatch.setattr(realizability, "pointwise", lambda *a: weaker(pointwise(*a)))
    monkeypatch.setattr(realizability, "untupled", lambda *a: weaker(untupled(*a)))
    monkeypatch.setattr(realizability, "flatten", lambda *a: weaker(flatten(*a)))
    for text in WRONG[3:]:
        assert realizable(text) is not Verdict.PROVED


def test_the_elements_that_a_search_has_met_are_not_all_that_there_are() -> None:
    """Of a sort with one element it would be so, and the search met no other."""
    text = (
        "context { T : {}; } node n { inputs( a : T, b : T ) outputs( c : T ) topics() "
        "guarantee( c == a ) guarantee( forall(x in T | x == c) ) }"
    )
    assert realizable(text) is not Verdict.PROVED
