"""Warnings: what brings each about, what does not, and how it is switched off."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.suggestions import distance
from avow.language.lints import similar
from avow.language.load import check_paths, check_text

NODE = """\
context {{ Stat : {{red, orange, green}}; }}
node n {{
  inputs( r : REAL, s : Stat, k : NATURAL, b : BOOL, w : <REAL> )
  outputs( t : Stat )
  topics( float64 r matches(in.r), string s matches(in.s), int32 k matches(in.k), bool b matches(in.b),
          float64 w matches(in.w), string t matches(out.t) )
  assume( r > 0 and k > 0 and length(w) > 0 )
  {}
  guarantee( (b and s == red) -> t == red )
}}
"""


def codes(text: str, off: frozenset[str] = frozenset()) -> list[str]:
    contract, found = check_text(text, "f", off=off)
    assert contract is not None, [f"{d.span}: {d.message}" for d in found if d.is_error]
    return [d.code for d in found]


def test_a_tidy_node_has_none() -> None:
    assert codes(NODE.format("")) == []


@pytest.mark.parametrize(
    ("clause", "expected"),
    [
        ("assume( forall(i in <1 upto length(w) - 1> | w(i - 1) <= w(i)) )", ["RCL417"]),
        ("assume( forall(i, j in indices(w) | i < j -> w(i) <= w(j)) and (k > 1 -> w(k - 1) > 0) )", []),
        ("assume( b and r > 1 -> k > 2 )", ["RCL401"]),
        ("assume( b or r > 1 -> k > 2 )", ["RCL401"]),
        ("assume( b -> r > 1 or k > 2 )", []),  # the same either way
        ("assume( b or r > 1 <=> k > 2 )", ["RCL401"]),
        ("assume( b and (r > 1 -> k > 2) )", []),
        ("assume( (b and r > 1) -> k > 2 )", []),
        ("assume( b and r > 1 or k > 2 )", []),
        ("assume( b -> r > 1 -> k > 2 )", []),
        ("assume( b and b -> b )", ["RCL401"]),  # a tautology one way, `b` the other
        ("assume( b and TRUE -> b )", ["RCL401"]),
        ("assume( not b or b -> TRUE )", ["RCL401", "RCL408"]),
        ("assume( forall(x in REAL | b and x > 1 -> k > 2) )", ["RCL401"]),
        ("assume( exists(x, y in REAL | x > r) )", ["RCL407"]),
        ("assume( s in {red, orange, green} )", ["RCL408"]),
        ("assume( s in Stat )", ["RCL408"]),
        ("assume( s in {red, orange} )", []),
        ("assume( k >= 0 )", ["RCL408"]),
        ("assume( k >= 1 )", []),
        ("assume( out.t != red )", ["RCL416"]),
        ("assume( b -> out.t == s )", ["RCL416"]),
        ("assume( r >= 0 )", []),
        ("assume( s == red or s == orange )", []),
        ("assume( TRUE )", []),
    ],
)
def test_lints_of_formulas(clause: str, expected: list[str]) -> None:
    assert codes(NODE.format(clause)) == expected


def test_bracketing_says_how_it_is_read() -> None:
    _, found = check_text(NODE.format("assume( b and r > 1 -> k > 2 )"), "f")
    assert found[0].hint is not None
    assert "`(b and r > 1) -> k > 2`" in found[0].hint


def test_published_case_study(root: Path) -> None:
    path = root / "contracts" / "remote_inspection_published" / "system.rcl"
    contract, found = check_paths([path])
    assert contract is not None
    assert [d.code for d in found].count("RCL401") >= 4
    said = {(d.code, d.message) for d in found}
    assert ("RCL408", "the assumption `A1` says nothing: the types of the inputs make it true") in said
    assert ("RCL407", "`x'` is quantified and never used") in said
    assert ("RCL407", "`y'` is quantified and never used") in said
    assert ("RCL409", "the topic `r` matches a bare `r`") in said
    assert ("RCL402", "no clause of `localisation` speaks of its input `sensors`") in said


def test_ports_and_topics() -> None:
    text = """\
node n {
  inputs( used : REAL, unused : REAL )
  outputs( b : BOOL, loose : BOOL )
  topics( float64 used matches(in.used), bool b matches(b), bool stray, float64 unused )
  assume( loose_end > 0 )
  guarantee( b )
}
""".replace("assume( loose_end > 0 )", "assume( used > 0 )")
    assert sorted(codes(text)) == sorted(["RCL402", "RCL405", "RCL403", "RCL405", "RCL409", "RCL404", "RCL404"])
    bare = "node n { inputs(a : BOOL) outputs(b : BOOL) topics() guarantee(b == a) }"
    assert codes(bare) == ["RCL405"]


def test_two_spellings() -> None:
    one = "node {0} {{ inputs() outputs({1} : BOOL) topics({2}/State {1} matches(out.{1})) guarantee({1}) }}\n"
    assert codes(one.format("a", "at", "nav_plugin") + one.format("b", "at", "nav_plugins")) == ["RCL406"]
    assert codes(one.format("a", "at", "nav_plugin") + one.format("b", "at", "nav_plugin")) == []
    assert codes(one.format("a", "position", "p") + one.format("b", "postion", "p")) == ["RCL406", "RCL406"]
    assert codes(one.format("a", "arm1", "p") + one.format("b", "arm2", "p")) == []


def test_spelling() -> None:
    assert similar(["position", "velocity", "positions", "arm_1", "arm_2", "radiationStatus", "radiation_status"]) == [
        ("position", "positions"),
        ("radiationStatus", "radiation_status"),
    ]
    assert distance("gazebo_plugin", "gazebo_plugins", 2) == 1
    assert distance("abcd", "abdc", 2) == 1
    assert similar(["left", "lift", "at", "it"]) == []


def test_switched_off_by_code_and_by_comment() -> None:
    clause = "assume( b and r > 1 -> k > 2 )"
    assert codes(NODE.format(clause), frozenset({"RCL401"})) == []
    assert codes(NODE.format(clause + "  // avow: allow RCL401")) == []
    assert codes(NODE.format("// avow: allow RCL401\n  " + clause)) == []
    assert codes("// avow: allow RCL401\n" + NODE.format(clause)) == []
    assert codes(NODE.format(clause + "\n  // avow: allow RCL401")) == ["RCL401"], "it is about what follows"
    assert codes(NODE.format("// avow: allow RCL402\n  " + clause)) == ["RCL401"]
    assert codes(NODE.format(clause).replace("node n", "/* avow: allow RCL401 */\nnode n")) == []
    assert sorted(codes(NODE.format(clause + " // avow: allow RCL201"))) == ["RCL401", "RCL410"]
    assert codes(NODE.format(clause + " // avow: allow RCL201, RCL401, RCL410")) == []
    assert codes(NODE.format(clause + " // avow: allow RCL201"), frozenset({"RCL410"})) == ["RCL401"]


def test_errors_cannot_be_switched_off() -> None:
    text = NODE.format("assume( q )  // avow: allow RCL201")
    contract, found = check_text(text, "f", off=frozenset({"RCL201"}))
    assert contract is None
    assert {d.code for d in found} == {"RCL201", "RCL410"}
