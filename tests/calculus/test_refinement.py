"""Refinement, the derived contract, and hierarchy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from helpers import some

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates
from avow.calculus.composition import compose
from avow.calculus.export import derived_contract
from avow.calculus.refinement import Demand, Refinement, refines
from avow.cli.refines import command as refines_command
from avow.kernel.certificate import How
from avow.language.contract import Node
from avow.language.load import check_text
from avow.language.translate import to_rcl
from avow.system.load import load_bare

from .case_study import REPAIRED
from .make import case_study, make, node, settled
from .test_commands import invoke


def only(text: str, context: str = "") -> Node:
    contract, diagnostics = check_text(context + text, "test.rcl")
    assert contract is not None, diagnostics
    return contract.nodes[0]


BASE = node("n", "r : REAL", "x : REAL", "A reading: 0 <= in.r <= 10", "G above: out.x >= in.r")


@pytest.mark.parametrize(
    ("text", "verdict", "clause"),
    [
        (BASE, Verdict.PROVED, ""),
        (BASE.replace("0 <= in.r <= 10", "-1 <= in.r"), Verdict.PROVED, ""),
        (BASE.replace("out.x >= in.r", "out.x == in.r + 1"), Verdict.PROVED, ""),
        (BASE.replace("out.x >= in.r", "(in.r <= 10 -> out.x > in.r)"), Verdict.PROVED, ""),
        (BASE.replace("<= 10", "< 10"), Verdict.REFUTED, "reading"),
        (BASE.replace("out.x >= in.r", "out.x >= in.r - 0.001"), Verdict.REFUTED, "above"),
    ],
)
def test_weaker_assumptions_stronger_guarantees(text: str, verdict: Verdict, clause: str) -> None:
    found = refines(only(text), only(BASE))
    assert found.verdict is verdict
    failing = [demand for demand in found.demands if demand.verdict is not Verdict.PROVED]
    assert [demand.clause.name for demand in failing] == ([clause] if clause else [])
    assert all(demand.counterexample is not None for demand in failing)


@pytest.mark.parametrize(
    ("guarantees", "at"),
    [
        (("G above: out.x >= in.r", "G least: out.x < 5"), True),
        (("G above: out.x >= in.r", "G least: out.x < in.r"), True),
        (("G above: out.x >= in.r", "G least: (in.r > 10 -> out.x < in.r)"), False),  # BASE never gives such an input
    ],
)
def test_of_a_contract_that_nothing_can_keep_it_says_so(guarantees: tuple[str, ...], at: bool, tmp_path: Path) -> None:
    text = node("n", "r : REAL", "x : REAL", "A some: in.r >= 0", *guarantees)
    found = refines(only(text), only(BASE))
    assert found.verdict is Verdict.PROVED
    assert (found.vacuous, found.holds) == (at, not at)
    if found.unrealizable is not None:
        ((name, value),) = found.unrealizable.values
        assert name == "in.r"
        assert 0 <= float(value) <= 10
    (tmp_path / "a.rcl").write_text(text)
    (tmp_path / "b.rcl").write_text(BASE)
    code, out = invoke(refines_command, str(tmp_path / "a.rcl"), str(tmp_path / "b.rcl"))
    assert code == (1 if at else 0)
    assert (": vacuous" in out) == at
    assert ("not realizable: in.r = " in out) == at


@pytest.mark.slow
@pytest.mark.parametrize(
    "wanted",
    some(
        [
            "forall(i in NATURAL | in.f(i) < out.y)",
            "out.y > in.f(3)",
            "exists(m in REAL | forall(i in NATURAL | in.f(i) < m))",
        ],
        1,
    ),
)
def test_where_it_is_not_decided_whether_anything_can_keep_it_nothing_is_proved(wanted: str, tmp_path: Path) -> None:
    """No number lies above all values of an unbounded function: `unknown` or `vacuous`, and never `proved`."""
    context = "context { F : NATURAL --> REAL; }\n"
    texts = [
        context + f"node n {{ inputs( f : F ) outputs( y : REAL ) topics() guarantee g ( {formula} ) }}"
        for formula in ("forall(i in NATURAL | y > f(i))", wanted.replace("in.f", "f").replace("out.y", "y"))
    ]
    code, out = command(tmp_path, *texts, "--seconds", "1", "--json")
    assert code == 1
    told = json.loads(out)
    assert told["nodes"][0]["verdict"] in ("unknown", "vacuous")
    assert not told["refines"]


@pytest.mark.parametrize("vacuous", [False, True])
def test_a_doubt_is_the_answer_where_all_demands_are_proved(vacuous: bool) -> None:
    proved = Demand("n", only(BASE).guarantees[0], Verdict.PROVED, (), None, "", vacuous)
    doubted = Refinement("n", "n", (), (proved,), doubt="no answer in time")
    assert (doubted.verdict is Verdict.UNKNOWN, doubted.vacuous, doubted.holds) == (not vacuous, vacuous, False)


def test_a_natural_where_the_other_has_an_integer() -> None:
    wide = node("n", "r : INTEGER", "x : NATURAL", "A positive: in.r >= 0", "G same: out.x == in.r")
    narrow = node("n", "r : NATURAL", "x : INTEGER", "G something: out.x > -1")
    found = refines(only(wide), only(narrow))
    assert found.holds, found.demands
    below = refines(only(wide.replace("in.r >= 0", "in.r >= 1")), only(narrow))
    assert below.verdict is Verdict.REFUTED
    # of an input that the narrower type rules out nothing is asked
    negative = wide.replace("G same: out.x == in.r", "G same: out.x == in.r").replace(" (in.r >= 0)", " (TRUE)")
    assert refines(only(negative), only(narrow)).holds


def test_a_natural_where_the_other_has_an_integer_over_runs() -> None:
    """A clause speaks of the port as it is, whatever the step: an earlier input was taken for the one of now, and what
    had been put out for a value that nothing is known of."""
    copies = node("n", "r : INTEGER", "x : INTEGER", "G same: out.x == in.r")
    constant = node("n", "r : NATURAL", "x : INTEGER", "G kept: out.x == previous(out.x, out.x)")
    assert refines(only(copies), only(constant)).verdict is Verdict.REFUTED
    three = node("n", "r : INTEGER", "x : NATURAL", "G same: out.x == 3")
    fed_back = node(
        "n", "r : INTEGER", "x : INTEGER", "A above: in.r > previous(out.x, 3)", "G kept: out.x == 3 and in.r > 3"
    )
    assert refines(only(three), only(fed_back)).verdict is not Verdict.REFUTED  # every run has it


def test_ports_must_fit() -> None:
    missing = refines(only(node("n", "r : REAL", "z : REAL")), only(BASE))
    assert missing.verdict is Verdict.REFUTED
    assert "no output 'x'" in missing.faults[0].message
    wants_more = refines(only(BASE.replace("r : REAL", "r : REAL, s : REAL")), only(BASE))
    assert "wants an input 's'" in wants_more.faults[0].message
    other_type = refines(only(BASE.replace("x : REAL", "x : REAL").replace("r : REAL", "r : INTEGER")), only(BASE))
    assert other_type.verdict is Verdict.REFUTED


def test_types_are_compared_by_what_they_are() -> None:
    text = node("n", "c : %s", "d : %s", "G: in.c == red -> out.d in {red, green}")
    one = only(text % ("Colour", "Colour"), "context { Colour : {red, green, blue}; }\n")
    other = only(text % ("Lamp", "Lamp"), "context { Lamp : {red, green, blue}; }\n")
    assert refines(one, other).verdict is Verdict.PROVED
    assert refines(other, one).verdict is Verdict.PROVED


def test_types_within_types_are_compared_by_what_they_are() -> None:
    text = node("n", "v : %s", "d : %s", "G: forall(w in %s | w == in.v -> out.d == go(w))")
    context = "context { %s : {slow, quick}; %s : {go(%s), halt}; }\n"
    one = only(text % ("Speed", "Order", "Speed"), context % ("Speed", "Order", "Speed"))
    other = only(text % ("Pace", "Step", "Pace"), context % ("Pace", "Step", "Pace"))
    assert refines(one, other).verdict is Verdict.PROVED
    of_orders = node("n", "d : Order", "e : BOOL", "G: out.e == exists(v in Speed | in.d == go(v))")
    one = only(of_orders, context % ("Speed", "Order", "Speed"))
    other = only(of_orders.replace("Speed", "Pace"), context % ("Pace", "Order", "Pace"))
    assert refines(one, other).verdict is Verdict.PROVED


def test_the_derived_contract_is_a_contract(tmp_path: Path) -> None:
    composition = compose(case_study(tmp_path, "remote_inspection", REPAIRED))
    for goal in composition.goals:
        text = to_rcl(derived_contract(composition, goal))
        contract, diagnostics = check_text(text, "derived.rcl")
        assert contract is not None, diagnostics
    whole = derived_contract(composition, composition.whole).nodes[0]
    assert {port.name for port in whole.outputs} == {
        "position",
        "at",
        "command",
        "phase",
        "radiationStatus",
        "inspected",
    }
    assert {port.name for port in whole.inputs} >= {"wayP", "r", "command_before", "at_before"}
    assert "navigation_was_somewhere" in [clause.name for clause in whole.assumptions], "shown only over own steps"


def test_hierarchy(tmp_path: Path) -> None:
    """A composed subsystem takes its part in a larger system."""
    inner = make(
        tmp_path / "inner",
        node("a", "r : REAL", "m : REAL", "A: in.r >= 0", "G: out.m == in.r + 1")
        + node("b", "m : REAL", "x : REAL", "A: in.m >= 1", "G: out.x >= in.m"),
    )
    composition, answers = settled(inner)
    assert answers.verdict is Verdict.PROVED
    (tmp_path / "sub.rcl").write_text(to_rcl(derived_contract(composition, composition.whole)))
    (tmp_path / "top.rcl").write_text(
        node("source", "", "r : REAL", "G: out.r >= 2") + node("sink", "x : REAL", "", "A: in.x >= 3")
    )
    system = load_bare([tmp_path / "sub.rcl", tmp_path / "top.rcl"])
    _, answers = settled(system)
    assert answers.verdict is Verdict.PROVED
    assert answers.goal.root.nodes == ("source", "inner", "sink") or len(answers.goal.root.nodes) == 3


# -- the command -------------------------------------------------------------------------------------------------------

OTHER = BASE.replace("node n", "node m").replace("x : REAL", "y : REAL").replace("out.x", "out.y")


def command(tmp_path: Path, new: str, old: str, *options: str) -> tuple[object, str]:
    (tmp_path / "new.rcl").write_text(new)
    (tmp_path / "old.rcl").write_text(old)
    return invoke(refines_command, str(tmp_path / "new.rcl"), str(tmp_path / "old.rcl"), *options)


def test_renamed_ports_and_nodes(tmp_path: Path) -> None:
    code, output = command(tmp_path, OTHER, BASE)
    assert code == 1
    assert "m has no output 'x', which n gives" in output
    assert command(tmp_path, OTHER, BASE, "--rename", "y=x")[0] == 0
    assert command(tmp_path, OTHER.replace(">= in.r", "> in.r - 1"), BASE, "--rename", "y=x")[0] == 1
    assert command(tmp_path, OTHER + BASE, BASE, "--node", "m=n", "--rename", "y=x")[0] == 0


def test_a_renamed_port_does_not_meet_another_of_that_name(tmp_path: Path) -> None:
    """The new node's own x has nothing to do with the old one's."""
    new = node("n", "r : REAL", "x : REAL, y : REAL", "A reading: 0 <= in.r <= 10", "G: out.x >= in.r and out.y < 0")
    assert command(tmp_path, new, BASE)[0] == 0
    code, output = command(tmp_path, new, BASE, "--rename", "y=x")
    assert code == 1
    assert "guarantees above, which" in output


def test_counterexamples_say_whose_clause_it_is(tmp_path: Path) -> None:
    _, output = command(tmp_path, BASE.replace("<= 10", "< 10"), BASE)
    assert "new.rcl assumes reading, which" in output
    assert output.rstrip().endswith("old.rcl does not: at in.r = 10")
    _, output = command(tmp_path, BASE.replace("out.x >=", "out.x >"), BASE.replace("out.x >=", "out.x - 1 >="))
    assert "old.rcl guarantees above, which" in output
    assert "out.x = " in output


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--node", "k"], "has no node 'k'"),
        (["--node", "n=k"], "old.rcl has no node 'k'"),
        (["--rename", "y"], "wanted is NEW=OLD"),
        (["--rename", "q=x"], "there is no port 'q'"),
        (["--rename", "r=x", "--rename", "r=y"], "each port once"),
    ],
)
def test_bad_options(tmp_path: Path, options: list[str], words: str) -> None:
    with pytest.raises(Rejected) as rejected:
        command(tmp_path, BASE, BASE, *options)
    assert words in rejected.value.diagnostics[0].message


def test_systems_are_compared_by_what_is_derived_of_them(tmp_path: Path) -> None:
    first = node("a", "r : REAL", "m : REAL", "A: in.r >= 0", "G: out.m == in.r + 1")
    second = node("b", "m : REAL", "x : REAL", "A: in.m >= 1", "G: out.x >= in.m")
    for name, text in {
        "old": first + second,
        "weak": first + second.replace("out.x >= in.m", "out.x >= in.m - 1"),
        "open": first.replace("in.r + 1", "in.r") + second.replace("in.m >= 1", "in.m >= 2"),
    }.items():
        make(tmp_path / name, text)
    code, output = invoke(refines_command, str(tmp_path / "weak"), str(tmp_path / "old"))
    assert code == 1
    assert "guarantees b_G1, which" in output
    assert invoke(refines_command, str(tmp_path / "old"), str(tmp_path / "old"))[0] == 0
    assert invoke(refines_command, str(tmp_path / "old"), str(tmp_path / "weak"))[0] == 0
    code, output = invoke(refines_command, str(tmp_path / "open"), str(tmp_path / "open"))
    assert code == 1
    assert "its own derivation is refuted" in output, "a derived contract is worth what its derivation is"


def test_what_is_proved_the_kernel_has_established(monkeypatch: pytest.MonkeyPatch) -> None:
    stronger = BASE.replace("out.x >= in.r", "out.x >= in.r + 1")
    found = refines(only(stronger), only(BASE))
    assert found.verdict is Verdict.PROVED
    hows = {entry.how for certificate in found.certificates for entry in certificate.entries}
    assert hows <= {How.SHOWN, How.GUARANTEE, How.ENVIRONMENT}
    monkeypatch.setattr(Certificates, "requirement", lambda *_: None)
    assert refines(only(stronger), only(BASE)).verdict is Verdict.UNKNOWN


@pytest.mark.parametrize(
    ("own", "verdict"),
    [
        ("guarantee g ( in.p -> out.d )", Verdict.PROVED),
        ("guarantee g ( in.p or out.d )", Verdict.UNKNOWN),
        ("guarantee g with probability >= 0.9 given ( in.p ) ( out.d )", Verdict.UNKNOWN),
    ],
)
def test_a_probability_is_refined_by_what_always_holds(own: str, verdict: Verdict) -> None:
    text = "node {} {{ inputs( p : BOOL ) outputs( d : BOOL ) topics() {} }}"
    one = only(text.format("a", own))
    other = only(text.format("b", "guarantee h with probability >= 0.9 given ( in.p ) ( out.d )"))
    assert refines(one, other).verdict is verdict
