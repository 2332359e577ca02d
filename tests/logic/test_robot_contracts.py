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
    "an arm at a fixed distance": (
        "",
        "inputs( x : REAL ) outputs( y : REAL )",
        "assume( -2 <= in.x <= 2 ) guarantee( in.x * in.x + out.y * out.y == 4 ) guarantee( out.y >= 0 )",
        "",
        "",
    ),
    "an arm out of reach": (
        "",
        "inputs( x : REAL ) outputs( y : REAL )",
        "guarantee( in.x * in.x + out.y * out.y == 4 ) guarantee( out.y >= 0 )",
        "realizable",
        "",
    ),
    "the least of some readings, of which there may be none": (
        "",
        "inputs( range : NATURAL --> REAL, n : NATURAL ) outputs( min : REAL )",
        """guarantee( forall(i in NATURAL | i < in.n -> out.min <= in.range(i)) )
        guarantee( exists(i in NATURAL | i < in.n and out.min == in.range(i)) )""",
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
    "battery bands that overlap at a corner": (
        "Level : {low, ok, full};",
        "inputs( v : REAL ) outputs( level : Level )",
        """assume( 9 <= in.v ) guarantee( in.v <= 10.5 -> out.level == low )
        guarantee( 10.5 <= in.v < 12.5 -> out.level == ok ) guarantee( in.v >= 12.5 -> out.level == full )""",
        "realizable",
        "needed-A1",
    ),
    "a counter below zero": (
        "",
        "inputs( floor : NATURAL, down : BOOL ) outputs( next : NATURAL )",
        "guarantee( in.down -> out.next == in.floor - 1 ) guarantee( not in.down -> out.next == in.floor + 1 )",
        "realizable",
        "",
    ),
    "a counter that is told when to stop": (
        "",
        "inputs( floor : NATURAL, down : BOOL ) outputs( next : NATURAL )",
        """assume( in.down -> in.floor > 0 )
        guarantee( in.down -> out.next == in.floor - 1 ) guarantee( not in.down -> out.next == in.floor + 1 )""",
        "",
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
    "a path whose only element is two things": (
        "",
        "inputs( a : NATURAL ) outputs( path : <NATURAL> )",
        "guarantee( out.path == <in.a> ) guarantee( out.path(0) != 3 )",
        "realizable",
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
    "a map kept within bounds": (
        "",
        "inputs( a : NATURAL x NATURAL --> BOOL ) outputs( m : NATURAL x NATURAL --> BOOL )",
        """guarantee( forall(x, y in NATURAL | in.a(x, y) -> out.m(x, y)) )
        guarantee( forall(x, y in NATURAL | out.m(x, y) -> x < 10 and y < 10) )""",
        "realizable",
        "determined-m",
    ),
    "the assumption that matters, and the one that does not": (
        "",
        "inputs( a : REAL, b : REAL ) outputs( o : REAL )",
        "assume( in.a > 0 ) assume( in.b > 0 ) guarantee( out.o * out.o == in.b ) guarantee( out.o > 0 )",
        "",
        "needed-A1",
    ),
    "an assumption true by typing, in a contract that nobody can meet": (
        "",
        "inputs( n : NATURAL ) outputs( o : NATURAL )",
        "assume( in.n >= 0 ) guarantee( out.o + 1 == in.n )",
        "realizable",
        "not-tautological-A1",
    ),
}


SQUARES = "an arm at a fixed distance"


@pytest.mark.slow
@pytest.mark.parametrize("name", some([name for name in CONTRACTS if name != SQUARES], 8))
def test_what_is_found(name: str) -> None:
    found_in(name)


@pytest.mark.nightly
def test_what_is_found_over_squares() -> None:
    """Z3 instantiates for a while before its other engine is asked."""
    found_in(SQUARES)


def found_in(name: str) -> None:
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
