"""Contracts whose faults are known: each must be found, and nothing else be called wrong."""

from __future__ import annotations

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.language.contract import Node
from avow.sanity.analysis import analyse, outcomes
from avow.sanity.claims import Property, claims, node_key
from avow.sanity.results import SanityResult
from avow.solving.questions import solve
from avow.solving.replay import replay

from .contracts import case_study, contract, node


def results(of: Node) -> dict[str, SanityResult]:
    return {result.name: result for result in analyse(of)}


def refuted(of: Node) -> set[str]:
    """The names of the refuted claims that are no mere consequence of another; no claim may stay open, but whether an
    assumption is needed where the contract is not realizable."""
    found = results(of)
    unknown = {r.name for r in found.values() if r.verdict is Verdict.UNKNOWN and r.asked.about is not Property.NEEDED}
    assert not unknown
    return {r.name for r in found.values() if r.verdict is Verdict.REFUTED and not r.because}


# -- seeded faults -----------------------------------------------------------------------------------------------------

LEVELS = "Level : {low, mid, high}; Command : {move(REAL, REAL), inspect(NATURAL), halt(BOOL)};"


def bands(a: str, b: str, *more: str) -> Node:
    """Classify a reading into three bands. The bands meet at a and b."""
    assumptions = " ".join(clause for clause in more if clause.startswith("assume"))
    more = tuple(clause for clause in more if not clause.startswith("assume"))
    return node(
        f"""inputs( r : REAL ) outputs( v : Level )| assume( 0 <= in.r ) {assumptions}
        guarantee( in.r < {a} -> out.v == low ) guarantee( {a} <= in.r < {b} -> out.v == mid )
        guarantee( {b} <= in.r -> out.v == high ) {" ".join(more)}""",
        LEVELS,
    )


GOOD = {"needed-A1"}
"""A reading below 0 would do no harm to `bands`."""


@pytest.mark.parametrize(("a", "b"), some([("120", "250"), ("0.5", "0.75"), ("1", "1000000")], 1, slow=2))
def test_a_good_contract_is_good(a: str, b: str) -> None:
    assert refuted(bands(a, b)) == GOOD
    found = results(bands(a, b))
    assert found["realizable"].verdict is Verdict.PROVED
    assert found["determined-v"].verdict is Verdict.PROVED


@pytest.mark.slow
@pytest.mark.parametrize(
    ("clause", "faults"),
    some(
        [
            # contradictory: no input at all is served
            ("guarantee( out.v == low ) guarantee( out.v == mid )", {"consistent"}),
            ("guarantee( in.r < 0 )", {"consistent"}),
            # unrealizable: served for some inputs only
            ("guarantee( in.r > 200 -> out.v == low )", {"realizable"}),
            ("guarantee( in.r == 120.5 -> out.v != mid )", {"realizable"}),
            ("guarantee( in.r != 7 )", {"realizable"}),
            # vacuous
            ("guarantee( in.r < -1 -> out.v == high )", {"not-tautological-G4"}),
            ("guarantee( (in.r < 100 and in.r > 130) -> out.v == high )", {"not-tautological-G4"}),
            # redundant
            ("guarantee( in.r == 3 -> out.v == low )", {"not-redundant-G4"}),
            ("guarantee( out.v == low or in.r >= 120 )", {"not-redundant-G4", "not-redundant-G1"}),
            ("guarantee( in.r < 120 -> out.v == low )", {"not-redundant-G4", "not-redundant-G1"}),
            # a tautology
            ("guarantee( out.v == low -> out.v in {low, mid} )", {"not-tautological-G4"}),
            # assumptions
            ("assume( in.r < 0 )", {"assumptions-satisfiable"}),
            ("assume( in.r >= -5 )", {"not-redundant-A2"}),
            ("assume( in.r == in.r )", {"not-tautological-A2"}),
        ],
        7,
    ),
)
def test_a_seeded_fault_is_found(clause: str, faults: set[str]) -> None:
    found = refuted(bands("120", "250", clause))
    assert {name for name in found if not name.startswith(("needed-A1",))} == faults


def test_unconstrained_and_undetermined_outputs() -> None:
    two = node(
        "inputs( r : REAL ) outputs( v : Level, w : Level, u : REAL )"
        "| guarantee( out.v == low or out.v == mid ) guarantee( out.u == in.r or out.w == out.w )",
        LEVELS,
    )
    found = refuted(two)
    assert {"constrained-w", "constrained-u", "determined-v", "not-tautological-G2"} >= found
    assert {"determined-v", "not-tautological-G2"} <= found
    answers = results(two)
    assert answers["constrained-v"].verdict is Verdict.PROVED
    assert answers["constrained-w"].verdict is Verdict.REFUTED
    assert answers["determined-w"].because == "constrained-w"


COMMANDS = {
    "two demands at once": (
        """guarantee( in.n < 5 -> out.c == inspect(in.n) )
        guarantee( in.r > 1 -> exists(x in REAL | out.c == move(x, x)) )""",
        {"realizable"},
    ),
    "kept apart": (
        """guarantee( (in.n < 5 and in.r <= 1) -> out.c == inspect(in.n) )
        guarantee( in.r > 1 -> exists(x in REAL | out.c == move(x, x)) )""",
        set(),
    ),
    "an existential that cannot be met": (
        "guarantee( exists(i in NATURAL | i < in.n and out.c == inspect(i)) )",
        {"realizable"},
    ),
    "an existential that can": ("guarantee( exists(i in NATURAL | i > in.n and out.c == inspect(i)) )", set()),
    "a negative number for a natural": (
        "guarantee( exists(i in NATURAL | i + 1 == in.n and out.c == inspect(i)) )",
        {"realizable"},
    ),
    "a demand for two waypoints": (
        "guarantee( forall(i in NATURAL | in.done(i) -> out.c == inspect(i)) )",
        {"realizable"},
    ),
    "a demand for one of them": (
        """guarantee( exists(i in NATURAL | in.done(i)) ->
        exists(i in NATURAL | in.done(i) and out.c == inspect(i)) )""",
        set(),
    ),
}


@pytest.mark.parametrize("name", some(COMMANDS, 3))
def test_commands(name: str) -> None:
    clauses, faults = COMMANDS[name]
    text = f"inputs( r : REAL, n : NATURAL, done : NATURAL --> BOOL ) outputs( c : Command )| {clauses}"
    assert {f for f in refuted(node(text, LEVELS)) if "determined" not in f} == faults


FUNCTIONS = {
    "a frame condition": ("guarantee( forall(i in NATURAL | out.f(i) <=> (in.f(i) or i == in.n)) )", set()),
    "and a demand that breaks it": (
        """guarantee( forall(i in NATURAL | out.f(i) <=> (in.f(i) or i == in.n)) )
        guarantee( forall(i in NATURAL | not (out.f(i) and i > 3)) )""",
        {"realizable"},
    ),
    "a single point": ("guarantee( exists_unique(i in NATURAL | out.f(i)) )", set()),
    "within bounds": (
        "guarantee( forall(i in NATURAL | out.f(i) -> i < 9) ) guarantee( exists(i in NATURAL | out.f(i)) )",
        set(),
    ),
    "within bounds that exclude everything": (
        "guarantee( forall(i in NATURAL | out.f(i) -> i < in.n) ) guarantee( exists(i in NATURAL | out.f(i)) )",
        {"realizable"},
    ),
    "a numeric function": ("guarantee( forall(x in REAL | out.g(x) == in.g(x) + 1) )", set()),
    "a numeric function below zero": ("guarantee( forall(x in REAL | out.g(x) + 1 == in.g(x)) )", {"realizable"}),
}


@pytest.mark.parametrize("name", some(FUNCTIONS, 4))
def test_functions(name: str) -> None:
    clauses, faults = FUNCTIONS[name]
    functions = "f : NATURAL --> BOOL, g : REAL --> NATURAL"
    text = f"inputs( n : NATURAL, {functions} ) outputs( {functions} )| {clauses}"
    found = {f for f in refuted(node(text)) if "determined" not in f and "constrained" not in f}
    assert found == faults


def test_division_by_zero_makes_nothing_realizable() -> None:
    impossible = node("inputs( r : REAL ) outputs( v : REAL )| guarantee( out.v == 1 / in.r )")
    assert results(impossible)["realizable"].verdict is Verdict.REFUTED
    possible = node("inputs( r : REAL ) outputs( v : REAL )| guarantee( in.r != 0 -> out.v == 1 / in.r )")
    assert results(possible)["realizable"].verdict is Verdict.PROVED


# -- the case study ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def published() -> dict[str, dict[str, SanityResult]]:
    return {n.name: results(n) for n in case_study("remote_inspection_published").nodes}


@pytest.fixture(scope="module")
def repaired() -> dict[str, dict[str, SanityResult]]:
    return {n.name: results(n) for n in case_study("remote_inspection").nodes}


@pytest.mark.nightly
def test_the_repaired_nodes_are_realizable(repaired: dict[str, dict[str, SanityResult]]) -> None:
    for name, found in repaired.items():
        for claim in ("assumptions-satisfiable", "consistent", "realizable"):
            assert found[claim].verdict is Verdict.PROVED, (name, claim)
        assert not [r.name for r in found.values() if r.fails]
        assert not [r.name for r in found.values() if r.verdict is Verdict.REFUTED and r.asked.severity == "warning"]
    assert set(repaired["agent"]["realizable"].clauses) == {"exit_known", "one_waypoint"}


@pytest.mark.slow
def test_the_published_agent_is_not_realizable(published: dict[str, dict[str, SanityResult]]) -> None:
    result = published["agent"]["realizable"]
    assert result.verdict is Verdict.REFUTED
    shown = dict(result.conflicts)
    assert shown.keys() == {("G1",), ("G2",), ("G3",)}, "each cannot be met for some inputs, by itself"
    assert dict(shown[("G2",)].values).keys() == {"in.wayP", "in.at", "in.inspected"}, "the status does not matter"
    assert len(result.clauses) == 1


@pytest.mark.slow
def test_the_published_radiation_sensor_says_nothing(published: dict[str, dict[str, SanityResult]]) -> None:
    found = published["radiationSensor"]
    assert found["not-tautological-G1"].verdict is Verdict.REFUTED
    for name in ("not-vacuous-G1", "constrained-radiationStatus", "constrained-inspected"):
        assert found[name].verdict is Verdict.REFUTED
        assert found[name].because == "not-tautological-G1"
    assert published["agent"]["not-tautological-A1"].verdict is Verdict.REFUTED, "an assumption that is true by typing"


@pytest.mark.slow
def test_the_other_published_nodes_are_sound(published: dict[str, dict[str, SanityResult]]) -> None:
    for name in ("localisation", "navigation"):
        assert not [r.name for r in published[name].values() if r.fails]
        assert published[name]["realizable"].verdict is Verdict.PROVED


# -- what the pipeline relies on ---------------------------------------------------------------------------------------


def test_an_unrealizable_input_is_really_without_output() -> None:
    bad = bands("120", "250", "guarantee( in.r > 200 -> out.v == low )")
    from avow.sanity.realizability import realizable

    ports = [p.variable for p in bad.inputs], [p.variable for p in bad.outputs]
    guarantees = {c.name: c.formula for c in bad.guarantees}
    assumptions = {c.name: c.formula for c in bad.assumptions}
    answer = realizable(*ports, assumptions, guarantees)
    assert answer.verdict is Verdict.REFUTED
    assert replay(assumptions.values(), answer.inputs) is True
    assert solve(guarantees, given=answer.inputs).status == "unsat"


def test_outcomes_answer_each_obligation() -> None:
    of = bands("120", "250")
    wanted = {f"s/n/sanity/{claim.name}": claim.name for claim in claims(of)} | {"s/n/sanity/gone": "gone"}
    found = outcomes(of, wanted)
    assert [o.obligation for o in found] == list(wanted)
    assert found[-1].verdict is Verdict.ERROR
    assert all(o.verdict in {Verdict.PROVED, Verdict.REFUTED} for o in found[:-1])


def test_the_key_follows_the_meaning_only() -> None:
    text = """context { L = 120; }
        node n { inputs(r : REAL) outputs(v : REAL) topics() assume(in.r > L) guarantee(out.v < L) }"""
    key = node_key(contract(text).nodes[0])
    assert node_key(contract(text.replace("assume(", "// because\n assume (")).nodes[0]) == key
    assert node_key(contract(text.replace("120", "121")).nodes[0]) != key
    assert node_key(contract(text.replace("guarantee(", "guarantee low (")).nodes[0]) != key


def test_names_of_claims_are_unique() -> None:
    for system in ("remote_inspection", "remote_inspection_published"):
        for of in case_study(system).nodes:
            names = [claim.name for claim in claims(of)]
            assert len(names) == len(set(names))


@pytest.mark.nightly
def test_a_chain_of_equivalences_does_not_double_the_work_with_every_link() -> None:
    """Each `<=>` is read four ways when outputs are looked for: bounded, or 26 of them would take for ever."""
    import time

    began = time.process_time()
    chain = " <=> ".join(["o", "a"] * 13)
    found = results(node(f"inputs( a : BOOL ) outputs( o : BOOL ) | guarantee( {chain} )"))
    assert time.process_time() - began < 20
    assert found["consistent"].verdict is Verdict.PROVED


def test_conflicts_about_different_outputs_are_all_shown() -> None:
    text = """
    node n {
      inputs( d : REAL, e : REAL ) outputs( v : REAL, w : REAL ) topics()
      guarantee( d > 3 -> v > 3 ) guarantee( d > 4 -> v < 2 )
      guarantee( e > 1 -> w > d ) guarantee( e < 2 -> w < d )
    }"""
    found = {r.name: r for r in analyse(contract(text).nodes[0], wanted={"realizable"})}["realizable"]
    assert [clauses for clauses, _ in found.conflicts] == [("G1", "G2"), ("G3", "G4")]
    assert all(shown.values for _, shown in found.conflicts)


@pytest.mark.parametrize("memory", ["", "guarantee w ( in.p -> within[3 steps](out.q) )"])
def test_of_several_conditions_the_one_that_cannot_come_about_is_named(memory: str) -> None:
    text = f"""node n {{ inputs( stop : BOOL, p : BOOL ) outputs( v : REAL, alarm : BOOL, q : BOOL ) topics()
      guarantee g ( (in.stop or (out.v > 3 and out.v < 2)) -> out.alarm ) {memory} }}"""
    (result,) = analyse(contract(text).nodes[0], wanted=frozenset({"not-vacuous-g"}))
    assert result.verdict is Verdict.REFUTED
    assert result.explanation == "one of its 2 conditions cannot come about: out.v > 3 ∧ out.v < 2"
