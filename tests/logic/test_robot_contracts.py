"""Contracts as robot engineers write them, each with what is to be found in it: nothing else may be, and nothing may
stay open."""

from __future__ import annotations

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds, SanityResult

from .contracts import node

# name: (context, ports, clauses, errors and warnings, notes)
CONTRACTS = {
    "a drone's geofence": (
        "P : (REAL, REAL);",
        "inputs( wish : P ) outputs( goal : P )",
        """guarantee( exists(x, y in REAL | out.goal == (x, y) and -50 <= x <= 50 and -50 <= y <= 50) )
        guarantee( forall(x, y in REAL |
          (in.wish == (x, y) and -50 <= x <= 50 and -50 <= y <= 50) -> out.goal == in.wish) )""",
        "",
        "determined-goal",
    ),
    "an arm out of reach": (
        "",
        "inputs( x : REAL ) outputs( y : REAL )",
        "guarantee( in.x * in.x + out.y * out.y == 4 ) guarantee( out.y >= 0 )",
        "realizable",
        "",
    ),
    "the lowest free floor": (
        "",
        "inputs( free : NATURAL --> BOOL ) outputs( next : NATURAL )",
        """assume( exists(i in NATURAL | in.free(i)) )
        guarantee( in.free(out.next) ) guarantee( forall(i in NATURAL | in.free(i) -> out.next <= i) )""",
        "",
        "",
    ),
    "a counter below zero": (
        "",
        "inputs( floor : NATURAL, down : BOOL ) outputs( next : NATURAL )",
        "guarantee( in.down -> out.next == in.floor - 1 ) guarantee( not in.down -> out.next == in.floor + 1 )",
        "realizable",
        "",
    ),
    "a member of a queue that may be empty": (
        "",
        "inputs( q : <NATURAL> ) outputs( x : NATURAL )",
        "guarantee( out.x in in.q )",
        "realizable",
        "determined-x",
    ),
    "a queue that grows": (
        "",
        "inputs( q : <NATURAL>, x : NATURAL ) outputs( r : <NATURAL> )",
        """guarantee( length(out.r) == length(in.q) + 1 ) guarantee( out.r(length(in.q)) == in.x )
        guarantee( forall(i in NATURAL | i < length(in.q) -> out.r(i) == in.q(i)) )""",
        "",
        "",
    ),
    "a way as a sequence": (
        "",
        "inputs( edge : NATURAL x NATURAL --> BOOL, a : NATURAL, b : NATURAL ) outputs( path : <NATURAL> )",
        """assume( in.edge(in.a, in.b) )
        guarantee( length(out.path) >= 2 and out.path(0) == in.a and out.path(length(out.path) - 1) == in.b )
        guarantee( forall(i in NATURAL | i + 1 < length(out.path) -> in.edge(out.path(i), out.path(i + 1))) )""",
        "",
        "determined-path",
    ),
    "the assumption that matters, and the one that does not": (
        "",
        "inputs( a : REAL, b : REAL ) outputs( o : REAL )",
        "assume( in.a > 0 ) assume( in.b > 0 ) guarantee( out.o * out.o == in.b ) guarantee( out.o > 0 )",
        "",
        "needed-A1",
    ),
    "joints kept within their limits": (
        "Joint : {base, elbow, wrist};",
        """inputs( wanted : Joint --> REAL, low : Joint --> REAL, high : Joint --> REAL )
        outputs( angle : Joint --> REAL )""",
        """assume( forall(j in Joint | low(j) <= high(j)) )
        guarantee( forall(j in Joint | low(j) <= angle(j) <= high(j)) )
        guarantee( forall(j in Joint | (low(j) <= wanted(j) <= high(j)) -> angle(j) == wanted(j)) )""",
        "",
        "determined-angle",
    ),
    "the greater of two functions": (
        "",
        "inputs( f : NATURAL --> REAL, g : NATURAL --> REAL ) outputs( h : NATURAL --> REAL )",
        """guarantee( forall(i in NATURAL | h(i) >= f(i) and h(i) >= g(i)) )
        guarantee( forall(i in NATURAL | h(i) == f(i) or h(i) == g(i)) )""",
        "",
        "",
    ),
    "a function that must grow without bound": (
        "",
        "inputs( x : REAL ) outputs( f : REAL --> REAL )",
        "guarantee( forall(t in REAL | f(t) > t) )",
        "",
        "determined-f",
    ),
    "wheel speeds, solved for": (
        "Wheels : (REAL, REAL);",
        "inputs( v : REAL, turn : REAL ) outputs( w : Wheels )",
        """assume( -1 <= v <= 1 ) assume( -1 <= turn <= 1 )
        guarantee( exists(l, r in REAL | w == (l, r) and l + r == 2 * v and r - l == turn) )""",
        "",
        "needed-A1 needed-A2",
    ),
    "a reading rounded down to what may be negative": (
        "",
        "inputs( r : REAL ) outputs( k : NATURAL )",
        "guarantee( k <= r ) guarantee( r < k + 1 )",
        "realizable",
        "",
    ),
    "points that conflict in three, not in two": (
        "Pos : {normal, reverse};",
        "inputs( p : BOOL, q : BOOL ) outputs( a : Pos, b : Pos )",
        "guarantee( p -> a != b ) guarantee( q -> a == normal ) guarantee( q -> b == normal )",
        "realizable",
        "determined-a determined-b",
    ),
    "routes of which one is asked for at most": (
        "Route : {r1, r2, r3};",
        "inputs( wanted : Route --> BOOL ) outputs( set : Route --> BOOL )",
        """assume( forall(r in Route, s in Route | wanted(r) and wanted(s) -> r == s) )
        guarantee( forall(r in Route | wanted(r) -> set(r)) )
        guarantee( forall(r in Route, s in Route | (set(r) and set(s)) -> r == s) )""",
        "",
        "determined-set",
    ),
    "a bolus at one point": (
        "",
        "inputs( rate : REAL, limit : REAL ) outputs( motor : REAL )",
        """assume( 0 < rate ) assume( 0 < limit )
        guarantee( rate <= limit -> motor == rate ) guarantee( rate >= limit -> motor == limit )
        guarantee( motor < 999.99 or rate < limit )""",
        "realizable",
        "needed-A1 needed-A2",
    ),
    "a chain of ten": (
        "",
        "inputs( r : REAL, s : REAL ) outputs( x : BOOL )",
        """guarantee( x <=> (r > 0) <=> (r > 1) <=> (r > 2) <=> (r > 3) <=> (r > 4) <=> (s > 0) <=> (s > 1) <=> (s > 2)
          <=> (s > 3) )""",
        "",
        "",
    ),
    "a chain of quantifiers": (
        "",
        "inputs( p : NATURAL --> BOOL, q : NATURAL --> BOOL, s : REAL --> BOOL ) outputs( x : BOOL )",
        """guarantee( x <=> exists(i in NATURAL | p(i)) <=> forall(i in NATURAL | q(i)) <=> exists(y in REAL | s(y))
          <=> forall(y in REAL | s(y)) )""",
        "",
        "",
    ),
    "assumptions of which types make each true": (
        "S : {s1, s2};",
        "inputs( n : NATURAL, s : S ) outputs( o : BOOL )",
        "assume( n >= 0 ) assume( s in {s1, s2} ) assume( s == s1 or s != s1 ) guarantee( o <=> n > 3 )",
        "",
        "not-tautological-A1 not-tautological-A2 not-tautological-A3",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTRACTS)
def test_what_is_found(name: str) -> None:
    context, ports, clauses, faults, notes = CONTRACTS[name]
    found = analyse(node(f"{ports}|{clauses}", context))
    assert not [r.name for r in found if r.verdict is Verdict.UNKNOWN]
    refuted = [r for r in found if r.verdict is Verdict.REFUTED and not r.because]
    assert {r.name for r in refuted if r.asked.severity != "note"} == set(faults.split())
    assert {r.name for r in refuted if r.asked.severity == "note"} == set(notes.split())


def realizable(ports: str, clauses: str) -> SanityResult:
    (found,) = analyse(node(f"{ports}|{clauses}"), wanted=["realizable"])
    return found


@pytest.mark.parametrize(
    ("clauses", "possible"),
    some(
        [
            # What speaks of what lies outside a sequence is not met there.
            ("guarantee( out.x == in.q(0) )", {Verdict.REFUTED}),
            ("guarantee( length(in.q) > 0 -> out.x == in.q(0) )", {Verdict.PROVED}),
            ("guarantee( length(out.r) == 0 ) guarantee( out.r(4) == 3 )", {Verdict.REFUTED}),
            ("guarantee( length(out.r) == 0 ) guarantee( out.r(4) == 3 and out.r(4) == 5 )", {Verdict.REFUTED}),
            ("guarantee( out.r == in.q ) guarantee( out.r(9) == in.q(9) )", {Verdict.REFUTED}),
            ("guarantee( out.r == in.q ) guarantee( out.r(9) != in.q(9) )", {Verdict.REFUTED}),
        ],
        1,
        slow=2,
    ),
)
def test_no_value_outside_a_sequence_is_made_up(clauses: str, possible: set[Verdict]) -> None:
    of = node(f"inputs( q : <NATURAL> ) outputs( x : NATURAL, r : <NATURAL> )|{clauses}")
    (found,) = analyse(of, wanted=["realizable"], bounds=Bounds(150))
    assert found.verdict in possible, found.explanation


def test_a_conflict_says_what_each_guarantee_would_have() -> None:
    found = realizable(
        "inputs( roll : REAL ) outputs( a : REAL, b : REAL )",
        """assume( -3 <= in.roll <= 3 )
        guarantee( out.a - out.b == in.roll ) guarantee( 0 <= out.a <= 2 and 0 <= out.b <= 2 )""",
    )
    ((clauses, shown),) = found.conflicts
    assert clauses == ("G1", "G2")
    assert shown.explanation.count("for example") == 2, "one for each guarantee, not for each output"


def test_a_conflict_of_three_names_the_three() -> None:
    context, ports, given, _, _ = CONTRACTS["points that conflict in three, not in two"]
    (found,) = analyse(node(f"{ports}|{given}", context), wanted=["realizable"])
    ((clauses, shown),) = found.conflicts
    assert clauses == ("G1", "G2", "G3")
    assert ("in.p", "TRUE") in shown.values
    assert ("in.q", "TRUE") in shown.values


def test_an_input_that_is_a_tuple_is_shown_as_one() -> None:
    of = node(
        "inputs( at : P ) outputs( d : NATURAL )|guarantee( exists(x, y in INTEGER | at == (x, y) and d == x + y) )",
        "P : (INTEGER, INTEGER);",
    )
    (found,) = analyse(of, wanted=["realizable"])
    assert found.counterexample is not None
    ((name, value),) = found.counterexample.values
    x, y = map(int, value.strip("()").split(", "))
    assert (name, x + y < 0) == ("in.at", True)


def test_inputs_are_small_numbers_if_small_ones_do() -> None:
    of = node(
        "inputs( x : INTEGER, y : INTEGER, wall : INTEGER x INTEGER --> BOOL ) outputs( d : Dir )|"
        "guarantee( d == n -> not wall(x, y + 1) ) guarantee( d == s -> not wall(x, y - 1) )",
        "Dir : {n, s};",
    )
    (found,) = analyse(of, wanted=["realizable"])
    assert found.counterexample is not None
    shown = dict(found.counterexample.values)
    assert abs(int(shown["in.x"])) <= 9
    assert abs(int(shown["in.y"])) <= 9
