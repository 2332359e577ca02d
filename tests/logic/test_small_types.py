"""How many elements an unspecified type has is nobody's choice: what needs several is not called possible."""

from __future__ import annotations

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.solving.sizes import _sizes

NODE = (
    "context {{ O : {{}}; Q : {{}}; C : {{p(O), q}}; T : (O, O); F : NATURAL --> O; }} "
    "node n {{ inputs( x : BOOL ) outputs( {} ) topics() {} guarantee g ( {} ) }}"
)


def verdicts(outputs: str, guarantee: str, assumption: str = "") -> dict[str, Verdict]:
    found, faults = check_text(NODE.format(outputs, assumption, guarantee), "n.rcl")
    assert found is not None, faults
    return {r.name: r.verdict for r in analyse(found.nodes[0], wanted={"consistent", "realizable"})}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("outputs", "guarantee"),
    some(
        [
            ("y : O, z : O", "y != z"),
            ("y : O, z : O", "not (y == z)"),
            ("y : BOOL", "y and exists(a, b in O | a != b)"),
            ("c : C, d : C, e : C", "c != d and d != e and c != e"),
            ("s : T, t : T", "s != t"),
            ("f : F", "f(0) != f(1)"),
            ("y : BOOL", "y and forall(a, b in O | a == b)"),
            ("y : BOOL", "y and forall(a, b, c in O | a == b or b == c or a == c)"),
            ("y : BOOL", "y and (exists(a, b in O | a != b) <=> exists(a, b in Q | a != b))"),
            ("a : O, b : O, c : Q, d : Q", "a != b or c != d"),
        ],
        3,
    ),
)
def test_what_hinges_on_the_number_of_elements_fails(outputs: str, guarantee: str) -> None:
    assert set(verdicts(outputs, guarantee).values()) == {Verdict.REFUTED}


@pytest.mark.parametrize(("outputs", "guarantee"), [("y : O, z : O", "y == z"), ("c : C, d : C", "c != d")])
def test_what_holds_of_one_element_stands(outputs: str, guarantee: str) -> None:
    found = verdicts(outputs, guarantee)
    assert found["consistent"] is Verdict.PROVED
    assert found["realizable"] is not Verdict.REFUTED


def test_what_the_assumptions_say_of_it_counts() -> None:
    found = verdicts("y : O, z : O", "y != z", "assume several ( exists(a, b in O | a != b) )")
    assert found["consistent"] is Verdict.PROVED
    assert found["realizable"] is not Verdict.REFUTED


def test_sizes_are_mixed_and_few() -> None:
    pairs = list(_sizes(2))
    assert pairs[:4] == [(1, 1), (2, 2), (3, 3), (4, 4)]
    assert len(pairs) == len(set(pairs)) == 16
    assert {(1, 4), (4, 1), (1, 2), (2, 1)} <= set(pairs)
    many = list(_sizes(5))
    assert len(many) == len(set(many)) == 14
    assert (1, 4, 4, 4, 4) in many
    assert list(_sizes(0)) == []
