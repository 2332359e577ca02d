"""Requirements, and what a plan assumes of the environment, that speak of other steps."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from helpers import some

from avow.base.diagnostics import Rejected
from avow.base.verdict import Outcome, Verdict
from avow.calculus.certificates import Certificates, requirement_scope
from avow.calculus.composition import compose
from avow.kernel.certificate import How
from avow.kernel.statements import Claimed

from .make import Limits, all_obligations, make, node, outcomes, settle_all

RELAY = node("a", "e : BOOL", "x : BOOL", "G keep: once(in.e) -> out.x") + node(
    "b", "x : BOOL", "y : BOOL", "G echo: out.y <=> in.x"
)


def required(folder: Path, rcl: str, formula: str, plan: str = "") -> Outcome:
    text = f"{plan}requirements: {{R: {{text: test, formula: '{formula}'}}}}\n"
    return outcomes(make(folder, rcl, text))["R"]


@pytest.mark.parametrize(
    ("formula", "verdict"),
    [
        ("once(a.in.e) -> b.y", Verdict.PROVED),
        ("a.e -> next(b.y)", Verdict.PROVED),
        ("a.e -> within[0 steps](b.y)", Verdict.PROVED),
        ("a.e -> (b.y until FALSE)", Verdict.PROVED),
        ("previous(b.y, FALSE) <=> previous(a.x, FALSE)", Verdict.PROVED),
        ("rose(b.y) -> rose(a.x)", Verdict.PROVED),
        ("counted(TRUE since a.e) >= 0", Verdict.PROVED),
        ("b.y -> next(a.e)", Verdict.REFUTED),
        ("b.y -> once(a.e)", Verdict.REFUTED),
        ("previous(a.e, TRUE) -> b.y", Verdict.REFUTED),
        ("a.e -> within[2 steps](not b.y)", Verdict.REFUTED),
        ("b.y -> eventually(a.e)", Verdict.UNKNOWN),
    ],
)
def test_a_requirement_with_memory_over_several_nodes(tmp_path: Path, formula: str, verdict: Verdict) -> None:
    found = required(tmp_path, RELAY, formula)
    assert found.verdict is verdict, found.summary
    if verdict is Verdict.REFUTED:
        assert found.counterexample is not None
    if verdict is Verdict.UNKNOWN:
        assert "eventually" in found.summary


def test_what_a_requirement_remembers_is_no_hypothesis(tmp_path: Path) -> None:
    system = make(tmp_path, RELAY, "requirements: {R: {text: t, formula: 'previous(a.e, FALSE) -> b.y'}}\n")
    composition = compose(system)
    obligations = all_obligations(composition)
    found = dict(zip((o.name for o in obligations), settle_all(composition, obligations, Limits()), strict=True))
    assert found["R"].verdict is Verdict.PROVED
    made = composition.certificates.made[requirement_scope("R")]
    assert How.DEFINED in {entry.how for entry in made.entries}
    again = Certificates(compose(system), {requirement_scope("R"): made})
    established = again.kept_for(requirement_scope("R"), Claimed.REQUIREMENT, "R")
    assert established is not None
    kinds = {need.kind for need in established.hypotheses}
    assert kinds == {How.GUARANTEE, How.TOGETHER}, "values of several nodes are of one step"
    # under another system the requirement remembers something else: the certificate shows nothing of it
    other = make(tmp_path, RELAY, "requirements: {R: {text: t, formula: 'previous(a.e, TRUE) -> b.y'}}\n")
    assert Certificates(compose(other), again.kept).kept_for(requirement_scope("R"), Claimed.REQUIREMENT, "R") is None


SLOPE = node("a", "v : REAL", "w : REAL", "G: out.w == in.v - previous(in.v, in.v)")
SLOW = "environment: {in.v: {assume: 'abs(in.v - previous(in.v, in.v)) <= 1', because: it is slow}}\n"


@pytest.mark.parametrize(
    ("formula", "plan", "verdict"),
    [
        ("a.w <= 1", SLOW, Verdict.PROVED),
        ("a.w + previous(a.w, 0) <= 2", SLOW, Verdict.PROVED),
        ("a.w <= 0.5", SLOW, Verdict.REFUTED),
        ("a.w <= 1", "", Verdict.REFUTED),
    ],
)
def test_the_environment_remembers(tmp_path: Path, formula: str, plan: str, verdict: Verdict) -> None:
    found = required(tmp_path, SLOPE, formula, plan)
    assert found.verdict is verdict, found.summary
    if verdict is Verdict.PROVED:
        assert "environment in.v" in found.summary


def test_what_is_assumed_with_memory_supports_an_assumption(tmp_path: Path) -> None:
    plan = "environment: {in.e: {assume: 'in.e -> next(not in.e)', because: it is a pulse}}\n"
    text = node("a", "e : BOOL", "x : BOOL", "A pulse: previous(in.e, FALSE) -> not in.e", "G: TRUE")
    found = outcomes(make(tmp_path, text, plan))
    assert found["whole.a.pulse"].verdict is Verdict.PROVED
    worse = plan.replace("next(not in.e)", "next(in.e)")
    assert outcomes(make(tmp_path / "worse", text, worse))["whole.a.pulse"].verdict is Verdict.REFUTED


def test_runs_over_a_scenario_keep_to_what_is_assumed(tmp_path: Path) -> None:
    """The environment's runs are those that it is assumed to have."""
    text = node("a", "e : BOOL", "x : BOOL", "G: out.x <=> (in.e and previous(in.e, FALSE))")
    plan = "{}environment: {{in.e: {{assume: '{}', because: so}}}}\n"
    wanted = "requirements: {R: {text: t, temporal: always not a.x}}\nscenario: {steps: 5}\n"
    good = outcomes(make(tmp_path / "good", text, plan.format(wanted, "in.e -> next(not in.e)")))["R"]
    assert good.verdict is Verdict.CHECKED, good.summary
    bad = outcomes(make(tmp_path / "bad", text, plan.format(wanted, "rose(in.e) -> next(in.e)")))["R"]
    assert bad.verdict is Verdict.REFUTED, bad.summary
    stuck = outcomes(make(tmp_path / "stuck", text, plan.format(wanted, "in.e and not previous(in.e, FALSE)")))["R"]
    assert stuck.verdict is not Verdict.CHECKED, "the environment can take one step and no other"


@pytest.mark.parametrize("assumed", ["in.e -> eventually(not in.e)", "steps(every 20 ms)"])
def test_the_environment_is_assumed_to_do_what_steps_can_break(tmp_path: Path, assumed: str) -> None:
    plan = f"environment: {{in.e: {{assume: '{assumed}', because: so}}}}\n"
    with pytest.raises(Rejected) as told:
        compose(make(tmp_path, RELAY, plan))
    assert {d.code for d in told.value.diagnostics} == {"PLAN113"}


@pytest.mark.parametrize("plan", ["temporal: always once(a.e)", "temporal: eventually (rose(a.e) and b.y)"])
def test_a_part_of_a_property_is_of_one_step(tmp_path: Path, plan: str) -> None:
    with pytest.raises(Rejected) as told:
        make(tmp_path, RELAY, f"requirements: {{R: {{text: t, {plan}}}}}\n")
    assert "RCL322" in {d.code for d in told.value.diagnostics}


LIDAR = node("lidar", "fault : BOOL", "silent : BOOL", "G same: out.silent <=> in.fault")
STOPPER = """node stopper {
  inputs( silent : BOOL ) outputs( stopped : BOOL ) topics()
  steps( at most 500 ms )
  guarantee stop "After two seconds of silence it stops within one" ( held[2 s](in.silent) -> within[1 s](stopped) )
}
"""


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("formula", "verdict"),
    [
        ("held[2 s](lidar.silent) -> within[1 s](stopper.stopped)", Verdict.PROVED),
        ("held[2 s](lidar.silent) -> within[1.5 s](stopper.stopped)", Verdict.PROVED),
        ("held[2 s](lidar.silent) -> within[0.5 s](stopper.stopped)", Verdict.REFUTED),
    ],
)
def test_a_requirement_in_seconds(tmp_path: Path, formula: str, verdict: Verdict) -> None:
    found = required(tmp_path, LIDAR + STOPPER, formula)
    assert found.verdict is verdict, found.summary


@pytest.mark.slow
def test_two_deadlines_belong_together(tmp_path: Path) -> None:
    """After two seconds of silence it stops within one, so three seconds from its beginning; by an invariant about two
    ages."""
    found = required(tmp_path, LIDAR + STOPPER, "lidar.silent -> within[3 s](stopper.stopped or not lidar.silent)")
    assert found.verdict is Verdict.PROVED, found.summary
    assert found.details["invariants"]
    assert "certificate" in found.details


PACED = """node a { inputs( e : BOOL ) outputs( x : BOOL ) topics() steps( every 20 ms )
  guarantee held (held[100 ms](in.e) -> out.x) }
"""
OTHERWISE = "node b { inputs( x : BOOL ) outputs( y : BOOL ) topics() steps( every 30 ms )\n"
LEFT_OUT = PACED + OTHERWISE + "assume given (x or not x and TRUE) guarantee echo (y <=> x) }\n"


@pytest.mark.parametrize(
    "formula", some(["a.e -> a.x", "held[5 steps](a.e) -> a.x", "a.e -> within[2 steps](b.y)"], 1, slow=2)
)
def test_no_example_is_known_to_keep_to_a_clause_that_is_left_out(tmp_path: Path, formula: str) -> None:
    """Nodes whose paces contradict share no time: what the first promises in seconds no hypothesis says, and a run that
    breaks `formula` may break that promise as well."""
    found = required(tmp_path, LEFT_OUT, formula)
    assert found.verdict is Verdict.UNKNOWN, found.summary
    assert "a and b declare different" in found.summary or "a.held" in found.summary


def test_with_what_is_left_out_proofs_stand_and_refutations_of_assumptions_and_room_do_not(tmp_path: Path) -> None:
    wants = OTHERWISE + "assume given (x) guarantee echo (y <=> x) }\n"
    assert required(tmp_path / "proof", LEFT_OUT, "b.y <=> a.x").verdict is Verdict.PROVED
    found = outcomes(make(tmp_path / "side", PACED + wants))
    assert found["whole.b.given"].verdict is Verdict.UNKNOWN, found["whole.b.given"].summary
    assert "a.held" in found["whole.b.given"].summary
    circle = OTHERWISE + "guarantee echo (x -> y) }\n"
    found = outcomes(make(tmp_path / "room", PACED + circle, "connections: [{from: b.y, to: a.e}]"))
    rooms = [one for name, one in found.items() if name.startswith("joint.")]
    assert rooms
    assert not [one for one in rooms if one.verdict is Verdict.PROVED]


def test_a_run_over_the_scenario_keeps_to_no_clause_that_is_left_out(tmp_path: Path) -> None:
    plan = (
        "scenario: {domains: {in.e: [TRUE]}, steps: 8}\n"
        "requirements: {R: {text: test, temporal: 'always not (a.e and not a.x)'}}\n"
    )
    found = outcomes(make(tmp_path, LEFT_OUT, plan))["R"]
    assert found.verdict is Verdict.UNKNOWN, found.summary
    assert "a.held" in found.summary


PULSE = "node a { inputs( u : BOOL ) outputs( v : BOOL ) topics() steps( %s ) guarantee g ( out.v <=> rose(in.u) ) }\n"
SLOW = "node b { inputs( v : BOOL ) outputs( w : BOOL ) topics() %s guarantee h ( in.v -> within[3 steps](out.w) ) }\n"
CLOCK = "node clock { inputs( r : BOOL ) outputs( s : BOOL ) topics() steps( at most 10 ms ) guarantee g ( out.s ) }\n"


@pytest.mark.parametrize(
    ("text", "formula", "verdict"),
    [
        (PULSE % "at most 100 ms" + SLOW % "steps( at most 1 s )", "a.v -> within[300 ms](b.w)", Verdict.UNKNOWN),
        (PULSE % "at most 100 ms" + SLOW % "steps( at most 1 s )", "a.v -> within[3 s](b.w)", Verdict.PROVED),
        (PULSE % "at most 100 ms" + SLOW % "", "a.v -> within[300 ms](b.w)", Verdict.UNKNOWN),
        (PULSE % "at most 100 ms" + SLOW % "steps( at most 100 ms )", "a.v -> within[300 ms](b.w)", Verdict.PROVED),
        (CLOCK + SLOW % "", "b.v -> within[30 ms](b.w)", Verdict.UNKNOWN),
        (CLOCK + SLOW % "", "b.v -> within[3 steps](b.w)", Verdict.PROVED),
    ],
)
def test_one_nodes_pace_bounds_no_step_that_another_counts(
    tmp_path: Path, text: str, formula: str, verdict: Verdict
) -> None:
    found = required(tmp_path, text, formula)
    assert found.verdict is verdict, found.summary


def test_a_run_that_breaks_a_limit_in_seconds_shows_the_times(tmp_path: Path) -> None:
    text = PULSE % "at most 100 ms" + SLOW % "steps( at most 100 ms )"
    shown = required(tmp_path, text, "a.v -> within[299 ms](b.w)").counterexample
    assert shown is not None
    assert all(0 < Fraction(dict(step)["dt"]) <= Fraction(1, 10) for step in shown.trace[1:])


@pytest.mark.parametrize("limit", ["3 steps", "300 ms"])
def test_where_paces_differ_no_number_of_steps_is_a_number_of_all_nodes_steps(tmp_path: Path, limit: str) -> None:
    text = PULSE % "every 100 ms" + SLOW % "steps( every 1 s )"
    found = required(tmp_path, text, f"a.v -> within[{limit}](b.w)")
    assert found.verdict is Verdict.UNKNOWN
    assert "a and b declare different `steps(…)`" in found.summary
