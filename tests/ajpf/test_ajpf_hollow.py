"""Evidence that would be green for nothing: tautologies of the table, "eventually not", near misses of a guarantee."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers import some
from hypothesis import HealthCheck, given, settings
from test_ajpf_ltl import FORMULAS, oracle
from test_ajpf_ltl import Kripke as Graph
from test_ajpf_ltl import Not as Negation

from avow.backend_kit.protocol import Limits
from avow.backends.ajpf import BACKEND, psl
from avow.backends.ajpf.checker import label_states
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.psl import compiled
from avow.backends.ajpf.psl_parser import parse_psl
from avow.backends.ajpf.society import system
from avow.backends.ajpf.tautology import constant, is_satisfiable, is_valid, standing
from avow.backends.ajpf.terms import Struct
from avow.base.verdict import Verdict
from avow.sanity.mutants import mutants
from avow.system.plan import Scenario


def settle(job, tmp_path):
    report = BACKEND.discharge(job, tmp_path, Limits(seconds=60))
    return {outcome.obligation.rpartition("/")[2]: outcome for outcome in report.outcomes}


# Tautologies

ALL_WORDS = Graph((0, 1, 2, 3), [(0, 1, 2, 3)] * 4, [0, 1, 2, 3])


@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
@given(FORMULAS)
def test_valid_is_what_the_oracle_cannot_refute_on_any_word(formula):
    assert is_valid(formula) is not oracle(ALL_WORDS, Negation(formula), False)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[] (B(a, p) -> (<> (B(a, q) || ~B(a, q))))", True),
        ("[] (B(a, p) -> (<> B(a, p)))", True),
        ("[] (B(a, p) -> (<> B(a, q)))", False),
        ("[] ((B(a, p) & B(a, q)) -> (<> (B(a, q) || D(a, go(1)))))", True),
        ("[] (D(a, go(1)) -> (<> D(a, go(_))))", True),
        ("[] (D(a, go(_)) -> (<> D(a, go(1))))", False),
        ("[] (D(a, go(_, 1)) -> (<> D(a, go(2, _))))", False),
        ("[] (D(a, go(1)) -> (<> (~D(a, go(2)))))", True),
        ("[] (D(a, go(_)) -> (<> (~D(a, go(2)))))", False),
        ("[] (D(a, go(1)) -> (<> (~D(b, go(2)))))", False),
        ("[] (I(a, f(1)) -> (<> G(a, f(1))))", True),
        ("[] (G(a, f(1)) -> (<> I(a, f(1))))", False),
        ("[] (P(f(1)) -> (<> P(f(_))))", True),
        ("[] (B(a, f(1)) -> (<> B(a, f(_))))", False),  # with `f(X) :- ~g(X)`, what covers f(1) need not be derivable
        ("([] B(a, p)) -> (<> B(a, p))", True),
        ("B(a, p) U (B(a, q) || ~B(a, q))", True),
    ],
)
def test_what_is_true_of_every_agent(text, expected):
    assert is_valid(parse_psl(text)) is expected


def test_constants():
    assert constant(parse_psl("B(a, p) || ~B(a, p)")) is True
    assert constant(parse_psl("D(a, go(1)) & D(a, go(2))")) is False
    assert constant(parse_psl("D(a, go(1)) & D(a, go(_))")) is None


def test_what_takes_too_long_is_no_tautology():
    """An unsatisfiable conjunct behind as many cases as fourteen beliefs have."""
    names = [f"B(a, p{k})" for k in range(14)]
    formula = parse_psl(f"({' & '.join(f'({n} || ~{n})' for n in names)}) & (B(a, q) & ~B(a, q))")
    assert is_satisfiable(formula)


def test_a_row_that_is_a_tautology_shows_nothing(lift, tmp_path):
    rows = {**lift().options["predicates"], "out.motion == go(f)": "B(cabin, x) || ~B(cabin, x)"}
    job = lift({"predicates": rows})
    (warning,) = [d for d in BACKEND.check(job) if d.code == "AJPF132"]
    assert not warning.is_error
    assert "out.motion == go(f)" in warning.message
    outcomes = settle(job, tmp_path)
    assert outcomes["answers"].vacuous
    assert "the table takes for granted: “out.motion == go(f)”" in outcomes["answers"].summary
    assert not outcomes["halts"].vacuous


def test_what_is_given_up_in_the_open_is_told(lift, tmp_path):
    job = lift({"predicates": {**lift().options["predicates"], "out.motion == go(f)": "T"}})
    assert not [d for d in BACKEND.check(job) if d.code == "AJPF132"]
    outcome = settle(job, tmp_path)["answers"]
    assert outcome.vacuous
    assert outcome.details["taken_for_granted"] == ["out.motion == go(f)"]


def test_a_goal_that_is_its_own_trigger_shows_nothing(lift, tmp_path):
    rows = {**lift().options["predicates"], "out.motion == go(f)": "B(cabin, call(_)) || B(cabin, call(f))"}
    outcome = settle(lift({"predicates": rows}), tmp_path)["answers"]
    assert outcome.verdict is Verdict.CHECKED
    assert outcome.vacuous
    assert len(outcome.bound["nothing_shown_for"]) == len(outcome.details["properties"])
    assert "the table makes it a tautology" in outcome.summary
    assert all(entry["tautology"] for entry in outcome.details["properties"])


RULED = """\
GWENDOLEN
:name: ag
:Initial Beliefs:
ready old near(1) fixed
:Reasoning Rules:
barred :- outside;
barred :- wet, ~dry;
stopped :- barred;
close(X) :- near(X), at(X);
odd(X) :- near(X), [X < 2];
hidden :- ~(near(X), at(X));
quiet :- ~noise(X);
tired :- wet, dry, !, wet;
tired :- outside;
:Initial Goals:
:Plans:
+p : { True } <- act, -old, -at(2);
+outside : { True } <- +seen, -near(_);
"""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[] (B(ag, outside) -> (<> B(ag, barred)))", True),
        ("[] (B(ag, outside) -> (<> B(ag, stopped)))", True),  # by two rules
        ("[] ((B(ag, wet) & ~B(ag, dry)) -> (<> B(ag, stopped)))", True),
        ("[] (B(ag, wet) -> (<> B(ag, barred)))", False),
        ("[] (B(ag, barred) -> (<> B(ag, outside)))", False),
        ("[] ((B(ag, near(1)) & B(ag, at(1))) -> (<> B(ag, close(1))))", True),
        ("[] ((B(ag, near(1)) & B(ag, at(1))) -> (<> B(ag, close(_))))", True),
        ("[] ((B(ag, near(1)) & B(ag, at(2))) -> (<> B(ag, close(_))))", False),
        ("[] (B(ag, near(1)) -> (<> B(ag, odd(1))))", False),  # what a comparison says is not followed
        ("[] ((~B(ag, noise(_))) -> (<> B(ag, quiet)))", True),
        ("[] (B(ag, outside) -> (<> B(ag, ready)))", True),  # nothing ever drops it
        ("[] (B(ag, outside) -> (<> B(ag, old)))", False),  # a plan drops it
        ("[] (B(ag, outside) -> (<> B(ag, fixed)))", False),  # it may go with a percept
        ("[] (B(ag, outside) -> (<> B(ag, seen)))", False),
        ("[] (B(ag, outside) -> (<> B(ag, tired)))", False),  # another rule's cut may keep it from being tried
        ("[] (B(other, outside) -> (<> B(other, barred)))", False),
    ],
)
def test_what_follows_from_the_agents_own_rules_shows_nothing_of_its_plans(text, expected):
    laws = standing(parse_system(RULED, "a.gwen"), [Struct("outside"), Struct("fixed")])
    assert is_valid(parse_psl(text), laws) is expected


def test_the_laws_are_true_wherever_an_agent_comes(tmp_path):
    percepts = "{x: [outside, wet, nothing], y: [dry, fixed, 'at(1)', nothing]}"
    (tmp_path / "e.yaml").write_text(f"draws: {{at_quiescence: once}}\npercepts: {percepts}\n")
    programs, draws = parse_system(RULED, "a.gwen"), read_environment(tmp_path / "e.yaml")
    names = [
        "barred",
        "stopped",
        "close(1)",
        "close(_)",
        "hidden",
        "quiet",
        "ready",
        "fixed",
        "old",
        "at(1)",
        "near(_)",
    ]
    asked = parse_psl(" & ".join(f"B(ag, {name})" for name in names))
    offered = [p for _, group in draws.groups for p in group if p is not None]
    laws = tuple(standing(programs, offered)(tuple(psl.atoms(asked))))
    assert len(laws) >= 6
    atoms = tuple(dict.fromkeys(a for law in laws for a in psl.atoms(law)))
    graph = explore(system(programs, draws, Semantics.MCAPL), states=5_000)
    labels = set(label_states(graph.system, graph.states, atoms))
    assert len(labels) > 5
    for law in laws:
        true = compiled(law, {atom: at for at, atom in enumerate(atoms)})
        assert all(map(true, labels)), psl.show(law)


def test_a_goal_that_its_rule_derives_of_the_trigger_shows_nothing(lift, tmp_path):
    rows = {**lift().options["predicates"], "out.motion == go(f)": "B(cabin, wanted(f))"}
    path = lift().options["program"]
    text = (lift().root / path).read_text()
    assert ":Reasoning Rules:\n" in text
    ruled = text.replace(":Reasoning Rules:\n", ":Reasoning Rules:\nwanted(F) :- call(F);\n")
    outcome = settle(lift({"predicates": rows}, {path: ruled}), tmp_path)["answers"]
    assert outcome.verdict is Verdict.CHECKED
    assert outcome.vacuous
    assert "true of every agent with these rules" in outcome.summary


# What a guarantee forbids

STAYS = "in.door == open -> not exists(n in NATURAL | out.motion == go(n))"
TURNED = "exists(n in NATURAL | out.motion == go(n)) -> not in.door == open"
TABLE = {
    "in.call(f)": "B(cabin, call(f))",
    "in.door == shut": "B(cabin, shut)",
    "in.door == open": "B(cabin, open)",
    "out.motion == go(f)": "D(cabin, go(f))",
    "exists(n in NATURAL | out.motion == go(n))": "D(cabin, go(_))",
    "exists(n in NATURAL | out.motion == halt(n))": "D(cabin, halt(_))",
}
ONE_AT_A_TIME = """
draws: {at_quiescence: repeatedly}
percepts: {panel: [open, call(1), call(2), nothing]}
after: {go: {panel: [nothing]}, halt: {panel: [nothing]}}
"""
PROGRAM = (
    "GWENDOLEN\n:name: cabin\n:Initial Beliefs:\nfloor(1)\nfloor(2)\n:Reasoning Rules:\nshut :- ~open;\n"
    ":Initial Goals:\n:Plans:\n"
)


@pytest.fixture(params=[STAYS, TURNED])
def stays(lift, tmp_path, request):
    """The outcome for a guarantee that forbids, of a cabin with these plans."""

    def outcome(plans, rows=TABLE, properties=None, formula=request.param):
        contract = (lift().root / "system.rcl").read_text()
        contract = contract[: contract.rindex("}")] + f"guarantee stays ( {formula} )\n}}\n"
        files = {"system.rcl": contract, "cabin.gwen": PROGRAM + plans, "cabin.yaml": ONE_AT_A_TIME}
        job = lift({"predicates": dict(rows), "properties": properties, "states": 3000}, files)
        assert not [d for d in BACKEND.check(job) if d.is_error]
        return settle(job, tmp_path)["stays"]

    return outcome


def test_what_never_comes_is_forbidden_well(stays):
    outcome = stays("+open : { True } <- halt(0);\n")
    assert outcome.verdict is Verdict.CHECKED
    assert not outcome.vacuous
    (entry,) = outcome.details["properties"]
    assert entry["property"] == "[] (B(cabin, open) -> ([] (~D(cabin, go(_)))))"


def test_the_answer_to_the_trigger_refutes(stays):
    """Seeded fault: it moves whenever the door opens. Afterwards it halts, so that "eventually it does not
    move" would hold."""
    outcome = stays("+open : { True } <- go(1), halt(0);\n")
    assert outcome.verdict is Verdict.REFUTED
    assert "what is then forbidden comes in step" in outcome.counterexample.text()


def test_what_comes_later_for_another_reason_does_not_refute(stays):
    outcome = stays("+call(F) : { B shut, B floor(F) } <- go(F);\n+open : { True } <- halt(0);\n")
    assert outcome.verdict is Verdict.UNKNOWN
    assert "may have another reason than the trigger" in outcome.summary
    assert outcome.counterexample is None
    assert outcome.details["properties"][0]["answer"] == "refuted"


GO, HALT = (f"exists(n in NATURAL | out.motion == {does}(n))" for does in ("go", "halt"))


@pytest.mark.parametrize("stays", [STAYS], indirect=True)
@pytest.mark.parametrize(
    ("formula", "plans", "verdict"),
    [
        (
            f"in.door == open and {HALT} -> not {GO}",
            "+call(F) : { True } <- halt(0);\n+open : { True } <- go(1);\n",
            "",
        ),
        (f"in.door == open and {HALT} -> not {GO}", "+open : { True } <- halt(0), go(1);\n", Verdict.REFUTED),
        (f"not {HALT} -> not in.door == open", "+open : { True } <- halt(0);\n", Verdict.CHECKED),
        (f"not {HALT} -> not in.door == open", "+open : { True } <- go(1);\n", Verdict.REFUTED),
    ],
)
def test_an_action_before_the_trigger_refutes_nothing(stays, formula, plans, verdict):
    assert stays(plans, formula=formula).verdict is (verdict or Verdict.UNKNOWN)


WHILE_OPEN = "[] ((B(cabin, open) & D(cabin, halt(_))) -> (B(cabin, shut) R (~(B(cabin, open) & D(cabin, go(_))))))"
FORBIDS = "exists(n in NATURAL | out.motion == go(n))"


def test_a_property_of_the_plan_says_when_it_must_not_come(stays):
    mover = "+call(F) : { B shut, B floor(F) } <- go(F);\n+open : { True } <- halt(0);\n"
    extra = {"psl": WHILE_OPEN, "guarantee": "stays", "forbids": FORBIDS}
    outcome = stays(mover, properties={"while_open": extra})
    assert outcome.verdict is Verdict.CHECKED
    assert not outcome.vacuous
    assert "is left to 'while_open'" in outcome.summary
    assert outcome.details["properties"] == []
    (said,) = [h for h in outcome.hypotheses if "'while_open'" in h]
    assert "says rightly when" in said
    assert "was not shown" in said  # of an agent that has moved and not halted it asks nothing
    at_once = {**extra, "psl": "[] (B(cabin, open) -> ([] (~D(cabin, go(_)))))"}
    (said,) = [h for h in stays("+x : { True };\n", properties={"p": at_once}).hypotheses if "'p'" in h]
    assert "it rules out, of every agent, that this comes while the guarantee's condition holds" in said
    beside = {**extra, "psl": "[] (B(cabin, shut) -> ([] (~D(cabin, go(_)))))"}  # another trigger altogether
    (said,) = [h for h in stays("+x : { True };\n", properties={"p": beside}).hypotheses if "'p'" in h]
    assert "was not shown" in said
    never_opens = {**extra, "psl": "[] (B(cabin, never) -> (<> D(cabin, halt(_))))"}
    assert stays(mover, properties={"while_open": never_opens}).vacuous
    valid = {**extra, "psl": "[] (B(cabin, open) -> (<> B(cabin, open)))"}
    assert stays(mover, properties={"while_open": valid}).vacuous
    refuting = {**extra, "psl": "[] (B(cabin, open) -> ([] (~D(cabin, go(_)))))"}
    assert stays(mover, properties={"while_open": refuting}).verdict is Verdict.REFUTED


def test_a_row_for_the_negation_does_not_make_it_a_demand(stays):
    rows = {key: value for key, value in TABLE.items() if key != FORBIDS}
    rows[f"not {FORBIDS}"] = "~D(cabin, go(_))"
    assert stays("+open : { True } <- go(1), halt(0);\n", rows).verdict is Verdict.REFUTED


def test_what_stands_for_a_ban_must_count_and_must_be_needed(lift):
    extra = {"psl": "T", "guarantee": "halts", "forbids": FORBIDS}
    (unused,) = [d for d in BACKEND.check(lift({"properties": {"p": extra}})) if d.code == "AJPF131"]
    assert "forbids nothing" in unused.message
    for wrong in ({**extra, "counts": False}, {"psl": "T", "forbids": FORBIDS}):
        (error,) = [d for d in BACKEND.check(lift({"properties": {"p": wrong}})) if d.is_error]
        assert error.code == "AJPF125"
    (error,) = [
        d for d in BACKEND.check(lift({"properties": {"p": {**extra, "forbids": "out.nowhere"}}})) if d.is_error
    ]
    assert error.span is not None


# Near misses


def altered(job, name, formula):
    node = job.node
    guarantees = tuple(replace(c, formula=formula) if c.name == name else c for c in node.guarantees)
    return replace(
        job,
        node=replace(node, guarantees=guarantees),
        obligations=tuple(o for o in job.obligations if o.name == name),
    )


@pytest.mark.parametrize("name", ["answers", "halts"])
def test_no_negated_guarantee_of_the_lift_is_supported(lift, tmp_path, name):
    job = lift()
    (negated,) = [m for m in mutants(job.node.clause(name).formula) if m.change == "the whole is negated"]
    assert settle(job, tmp_path)[name].verdict is Verdict.CHECKED
    assert settle(altered(job, name, negated.formula), tmp_path)[name].verdict is not Verdict.CHECKED


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", some(["next_waypoint", "inspect_here", "exit_on_danger", "abandon", "end_of_mission"], 2)
)
def test_no_negated_guarantee_of_the_rover_is_supported(rover, tmp_path, name):
    job = rover("remote_inspection", "repaired_method.yaml", {"instances": {"i": "1..3"}})
    (negated,) = [m for m in mutants(job.node.clause(name).formula) if m.change == "the whole is negated"]
    outcome = settle(altered(job, name, negated.formula), tmp_path)[name]
    assert outcome.verdict is Verdict.REFUTED, outcome.summary


def test_instances_that_leave_out_what_the_scenario_has(lift, tmp_path):
    def told(numbers: list[int], domain: list[int] | None) -> list[str]:
        job = lift({"instances": {"f": numbers}})
        scenario = None if domain is None else Scenario(domains={"NATURAL": tuple(map(str, domain))})
        plan = replace(job.system.plan, scenario=scenario)
        found = BACKEND.check(replace(job, system=replace(job.system, plan=plan)))
        return [d.message for d in found if d.code == "AJPF133"]

    (message,) = told([1, 2], [0, 1, 2, 3])
    assert "f = 0, 3" in message
    assert told([0, 1, 2], [1, 2]) == []
    assert told([1, 2], None) == []


def test_properties_of_the_plan_range_over_the_scenario_where_the_instances_say_nothing(lift):
    job = lift({"instances": None, "properties": {"heard": "[] (B(cabin, call(f)) -> <> D(cabin, go(f)))"}})
    plan = replace(job.system.plan, scenario=Scenario(domains={"NATURAL": ("1", "2", "3")}))
    text = BACKEND.export(replace(job, system=replace(job.system, plan=plan)))["cabin.psl"]
    assert [n for n in range(5) if f"[] (B(cabin, call({n})) -> (<> D(cabin, go({n}))))" in text] == [1, 2, 3]
    assert "call(f)" not in text


def test_words_that_the_agent_lacks_are_told(lift):
    """Seeded fault: a slip in the table, so that what is forbidden never comes, whatever the agent does."""

    def told(rows, environment=ONE_AT_A_TIME, stop="halt"):
        contract = (lift().root / "system.rcl").read_text()
        contract = contract[: contract.rindex("}")] + f"guarantee stays ( {STAYS} )\n}}\n"
        program = PROGRAM + "+call(F) : { B shut } <- go(F);\n+open : { True } <- halt(0);\n".replace("halt", stop)
        files = {"system.rcl": contract, "cabin.gwen": program, "cabin.yaml": environment}
        found = BACKEND.check(lift({"predicates": dict(rows)}, files))
        return [f"{d.code} {d.message}" for d in found if d.code in ("AJPF134", "AJPF135")]

    assert told(TABLE) == []
    (message,) = told({**TABLE, "exists(n in NATURAL | out.motion == go(n))": "D(cabin, hallt(_))"})
    assert message.startswith("AJPF135 ")
    assert "the action hallt(_)" in message
    (message,) = told({**TABLE, "in.call(f)": "B(cabin, call(f, _))"})
    assert message.startswith("AJPF135 ")
    assert "the belief call(_, _)" in message
    for word, code in (("zzz(_)", "AJPF135"), ("go(_, _)", "AJPF135"), ("rest", "AJPF134"), ("never", "AJPF134")):
        modality = "B" if word == "never" else "D"
        environment = ONE_AT_A_TIME.replace("halt: {", "rest: {") if word == "rest" else ONE_AT_A_TIME
        row = {"exists(n in NATURAL | out.motion == go(n))": f"{modality}(cabin, {word})"}
        found = told({**TABLE, **row}, environment)
        assert any(message.startswith(code) and "the row" in message for message in found), (word, found)
    (row, environment) = told(TABLE, stop="halts")  # the slip is the program's
    assert row.startswith("AJPF135 ")
    assert environment.startswith("AJPF135 ")
    (message,) = told(TABLE, ONE_AT_A_TIME.replace("halt: {", "hold: {"))
    assert "cabin.yaml speaks of the action hold" in message
