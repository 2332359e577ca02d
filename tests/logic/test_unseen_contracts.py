"""More contracts of robot engineers, with what is to be found in each, of shapes that nothing was made for when they
were written: functions that are outputs, tuples, data, unspecified types, chains of `<=>`, conflicts of three."""

from __future__ import annotations

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.sanity.analysis import analyse
from avow.sanity.results import SanityResult

from .contracts import node

# name: (context, ports, clauses, errors and warnings, notes)
CONTRACTS = {
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
    "a height between two, for each of infinitely many": (
        "",
        "inputs( f : NATURAL --> REAL, g : NATURAL --> REAL ) outputs( h : NATURAL --> REAL )",
        "assume( forall(i in NATURAL | f(i) < g(i)) ) guarantee( forall(i in NATURAL | f(i) < h(i) and h(i) < g(i)) )",
        "",
        "determined-h",
    ),
    "the greater of two functions": (
        "",
        "inputs( f : NATURAL --> REAL, g : NATURAL --> REAL ) outputs( h : NATURAL --> REAL )",
        """guarantee( forall(i in NATURAL | h(i) >= f(i) and h(i) >= g(i)) )
        guarantee( forall(i in NATURAL | h(i) == f(i) or h(i) == g(i)) )""",
        "",
        "",
    ),
    "a machine for each task, of unspecified types": (
        "Task : {}; Machine : {};",
        "inputs( can : Machine x Task --> BOOL ) outputs( on : Task --> Machine )",
        """assume( forall(t in Task | exists(m in Machine | can(m, t))) )
        guarantee( forall(t in Task | can(on(t), t)) )""",
        "",
        "determined-on",
    ),
    "a function that must grow without bound": (
        "",
        "inputs( x : REAL ) outputs( f : REAL --> REAL )",
        "guarantee( forall(t in REAL | f(t) > t) )",
        "",
        "determined-f",
    ),
    "a height of its own for each of a swarm": (
        "",
        "inputs( n : NATURAL ) outputs( height : NATURAL --> REAL )",
        "guarantee( forall(a, b in NATURAL | a != b -> height(a) != height(b)) )",
        "",
        "determined-height",
    ),
    "a constant function": (
        "",
        "inputs( c : REAL ) outputs( h : REAL --> REAL )",
        "guarantee( exists(y in REAL | forall(x in REAL | h(x) == y)) ) guarantee( h(0) == c )",
        "",
        "",
    ),
    "wheel speeds, solved for": (
        "Wheels : (REAL, REAL);",
        "inputs( v : REAL, turn : REAL ) outputs( w : Wheels )",
        """assume( -1 <= v <= 1 ) assume( -1 <= turn <= 1 )
        guarantee( exists(l, r in REAL | w == (l, r) and l + r == 2 * v and r - l == turn) )""",
        "",
        "needed-A1 needed-A2",
    ),
    "wheel speeds out of range in a corner": (
        "Wheels : (REAL, REAL);",
        "inputs( v : REAL, turn : REAL ) outputs( w : Wheels )",
        """assume( -1 <= v <= 1 ) assume( -1 <= turn <= 1 )
        guarantee( exists(l, r in REAL | w == (l, r) and l + r == 2 * v and r - l == turn) )
        guarantee( forall(l, r in REAL | w == (l, r) -> (-1 <= l <= 1 and -1 <= r <= 1)) )""",
        "realizable",
        "",
    ),
    "a reading rounded down": (
        "",
        "inputs( r : REAL ) outputs( k : INTEGER )",
        "guarantee( k <= r ) guarantee( r < k + 1 )",
        "",
        "",
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
    "a report of a place that may be lost": (
        "Pose : {at(REAL, REAL), lost}; Msg : {report(Pose), ask(NATURAL), none};",
        "inputs( pose : Pose, asked : BOOL ) outputs( msg : Msg )",
        """guarantee( asked -> msg == report(pose) ) guarantee( not asked -> msg in {none, ask(0), ask(1)} )
        guarantee( pose == lost -> msg != report(lost) )""",
        "realizable",
        "determined-msg",
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
    "the strictly cheapest neighbour": (
        "Place : {a, b, c, d};",
        "inputs( edge : Place x Place --> BOOL, cost : Place --> REAL, from : Place ) outputs( step : Place )",
        """assume( exists(m in Place | edge(from, m)) ) guarantee( edge(from, step) )
        guarantee( forall(m in Place | (edge(from, m) and m != step) -> cost(step) < cost(m)) )""",
        "realizable",
        "",
    ),
    "another than both, of an unspecified type": (
        "Id : {};",
        "inputs( a : Id, b : Id ) outputs( c : Id )",
        "guarantee( c != a ) guarantee( c != b )",
        "consistent",
        "determined-c",
    ),
    "a chain of ten": (
        "",
        "inputs( r : REAL, s : REAL ) outputs( x : BOOL )",
        """guarantee( x <=> (r > 0) <=> (r > 1) <=> (r > 2) <=> (r > 3) <=> (r > 4) <=> (s > 0) <=> (s > 1) <=> (s > 2)
          <=> (s > 3) )""",
        "",
        "",
    ),
    "a chain that says nothing": (
        "",
        "inputs( a : BOOL, b : BOOL, c : BOOL, d : BOOL ) outputs( x : BOOL )",
        "guarantee( a <=> b <=> c <=> d <=> x <=> d <=> c <=> b <=> a <=> x )",
        "not-tautological-G1",
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
    "a quotient, and what follows from it": (
        "",
        "inputs( a : REAL, b : REAL ) outputs( q : REAL )",
        """guarantee( b != 0 -> q == a / b ) guarantee( b == 0 -> q == 0 ) guarantee( q * b == a or b == 0 )""",
        "not-redundant-G1 not-redundant-G3",
        "",
    ),
    "assumptions of which types make each true": (
        "S : {s1, s2};",
        "inputs( n : NATURAL, s : S ) outputs( o : BOOL )",
        "assume( n >= 0 ) assume( s in {s1, s2} ) assume( s == s1 or s != s1 ) guarantee( o <=> n > 3 )",
        "",
        "not-tautological-A1 not-tautological-A2 not-tautological-A3",
    ),
    "a queue the other way round": (
        "",
        "inputs( s : <NATURAL> ) outputs( t : <NATURAL> )",
        """guarantee( length(t) == length(s) )
        guarantee( forall(i in NATURAL | i < length(s) -> t(i) == s(length(s) - 1 - i)) )""",
        "",
        "",
    ),
    "a price looked up where there need be none": (
        "",
        "inputs( table : <(STRING, REAL)>, key : STRING ) outputs( v : REAL )",
        "guarantee( (key, v) in table )",
        "realizable",
        "determined-v",
    ),
}


LONG = ("a height of its own for each of a swarm",)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*some((n for n in CONTRACTS if n not in LONG), 10), *some(LONG, 0)])
def test_what_is_found(name: str) -> None:
    context, ports, clauses, faults, notes = CONTRACTS[name]
    found = analyse(node(f"{ports}|{clauses}", context))
    assert not [r.name for r in found if r.verdict is Verdict.UNKNOWN]
    refuted = [r for r in found if r.verdict is Verdict.REFUTED and not r.because]
    assert {r.name for r in refuted if r.asked.severity != "note"} == set(faults.split())
    assert {r.name for r in refuted if r.asked.severity == "note"} == set(notes.split())


def realizable(name: str) -> SanityResult:
    context, ports, clauses, _, _ = CONTRACTS[name]
    (found,) = analyse(node(f"{ports}|{clauses}", context), wanted=["realizable"])
    return found


def test_a_conflict_of_three_names_the_three() -> None:
    ((clauses, shown),) = realizable("points that conflict in three, not in two").conflicts
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
