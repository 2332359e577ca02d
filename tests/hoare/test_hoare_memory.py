"""Programs that keep something from step to step: proofs and refutations against the definitions over all steps of a
run, and invariants that are not so are not believed."""

from __future__ import annotations

import random
from itertools import product
from pathlib import Path

import pytest
from drawn.memory import A, B, N, clause, formula
from helpers import some
from reference.meaning import breaks, keeps

from avow.backend_kit import one_step
from avow.backend_kit.protocol import Job, Limits
from avow.backends.hoare import BACKEND
from avow.base.verdict import Outcome, Verdict
from avow.formulas.formula import substitute
from avow.language.printer import show_term
from avow.language.sorts import NATURAL
from avow.language.terms import Literal

from .systems import gate, make_job

GATE = gate("guarantee later ( fell(request) -> next(not open) )")

PROGRAM = """MEMORY high : NATURAL := 0;
MEMORY waiting : NATURAL := 0;
IF reading > 10 THEN
  high := high + 1
ELSE
  high := 0
IF request THEN
  waiting := waiting + 1
ELSE
  waiting := 0
open := request and waiting > 1
alarm := high >= 3
n := high
"""


def job(folder: Path, program: str = PROGRAM, rcl: str = GATE, **options: object) -> Job:
    return make_job(folder, rcl, rcl.split()[1], {"program": "p.imp", **options}, {"p.imp": program}, "hoare")


def settle(wanted: Job) -> dict[str, Outcome]:
    report = one_step.discharge(BACKEND, wanted, wanted.root, Limits())
    return {o.obligation.rpartition("/")[2]: o for o in report.outcomes}


@pytest.mark.slow
def test_a_right_program_is_proved(tmp_path: Path) -> None:
    found = settle(job(tmp_path))
    assert {o.verdict for o in found.values()} == {Verdict.PROVED}, {n: o.summary for n, o in found.items()}
    assert not any(o.vacuous for o in found.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "broken"),
    [
        ("high >= 3", "high >= 2", {"alarm"}),
        ("high >= 3", "high > 3", {"alarm"}),
        ("MEMORY high : NATURAL := 0", "MEMORY high : NATURAL := 1", {"count", "alarm"}),
        ("waiting > 1", "waiting > 0", {"later"}),
        ("waiting > 1", "waiting > 1 and waiting < 5", {"still"}),
        ("high := high + 1", "high := high - 1", {"still", "alarm", "count", "later"}),
    ],
)
def test_seeded_faults_are_refuted_by_a_run(old: str, new: str, broken: set[str], tmp_path: Path) -> None:
    assert old in PROGRAM
    found = settle(job(tmp_path, PROGRAM.replace(old, new)))
    refuted = {name for name, o in found.items() if o.verdict is Verdict.REFUTED}
    assert broken == refuted, {name: (o.verdict, o.summary) for name, o in found.items()}
    for name in broken:
        assert found[name].counterexample is not None


COUNTER = """node c { inputs( up : BOOL ) outputs( n : NATURAL ) topics()
  guarantee g ( n == counted(up since not up) + counted(up since not up) ) }"""
TWICE = "MEMORY m : NATURAL := 0;\nIF up THEN\n  m := m + 2\nELSE\n  m := 0\nn := m\n"


@pytest.mark.parametrize(
    ("invariants", "verdict", "told"),
    [
        ((), Verdict.UNKNOWN, "an invariant may be missing"),
        (("m == 2 * previous(counted(up since not up), 0)",), Verdict.PROVED, "proved"),
        (("m == 2 * previous(counted(up since not up), 0)", "m <= 4"), Verdict.PROVED, "proved"),
        (("m == 3 * previous(counted(up since not up), 0)",), Verdict.UNKNOWN, "a run contradicts `m == 3 *"),
        (("FALSE",), Verdict.UNKNOWN, "a run contradicts `FALSE`"),
    ],
)
def test_an_invariant_of_the_plan(invariants: tuple[str, ...], verdict: Verdict, told: str, tmp_path: Path) -> None:
    found = settle(job(tmp_path, TWICE, COUNTER, invariants=list(invariants)))["g"]
    assert found.verdict is verdict, found.summary
    assert told in found.summary


def test_an_invariant_that_no_run_happens_to_contradict_is_not_believed(tmp_path: Path) -> None:
    """It would take a thousand steps: a step does not keep it, and nothing rests on it."""
    rcl = "node c { inputs( up : BOOL ) outputs( b : BOOL ) topics() guarantee g ( once(up) or b or up ) }"
    program = "MEMORY m : NATURAL := 0;\nm := m + 1\nb := m <= 1000\n"
    found = settle(job(tmp_path, program, rcl, invariants="m < 1000"))["g"]
    assert found.verdict is Verdict.UNKNOWN
    assert "not shown that a step keeps `m < 1000`" in found.summary


@pytest.mark.parametrize(
    ("program", "invariant", "code"),
    [
        ("MEMORY up : BOOL := TRUE;\nn := 0\n", "TRUE", "BACKEND007"),
        ("MEMORY m : NATURAL := 0;\nn := 0\n", "m == counted(up since not up)", "BACKEND007"),
        ("MEMORY m : NATURAL := 0;\nn := 0\n", "m == 0 -> next(up)", "RCL321"),
        ("MEMORY m : NATURAL := 0;\nn := 0\n", "k == 0", "RCL201"),
        ("MEMORY m : Nat := 0;\nn := 0\n", "TRUE", "HOARE200"),
        ("MEMORY m : NATURAL := -1;\nn := 0\n", "TRUE", "HOARE300"),
    ],
)
def test_faults_are_told(program: str, invariant: str, code: str, tmp_path: Path) -> None:
    work = job(tmp_path, program, COUNTER, invariants=invariant)
    assert code in [d.code for d in BACKEND.check(work)]
    assert settle(work)["g"].verdict is Verdict.ERROR


def test_what_is_exported_has_the_invariants_of_the_plan(tmp_path: Path) -> None:
    work = job(tmp_path, TWICE, COUNTER, invariants="m == 2 * previous(counted(up since not up), 0)")
    made = BACKEND.export(work)
    assert {"g.hoare", "invariant-1.first.smt2", "invariant-1.hoare", "invariant-1.pre.smt2"} <= set(made)


def test_a_value_of_the_step_before_had_to_be_one_there(tmp_path: Path) -> None:
    """At the step after one with m == 0 the claim has no value, whatever quotient a solver thinks of."""
    clause = "guarantee g ( p or abs(previous(1 / m, 1)) >= 0 )"
    rcl = f"node n {{ inputs( p : BOOL ) outputs( m : NATURAL ) topics() {clause} }}"
    program = "IF p THEN\n  m := 0\nELSE\n  m := {}\n"
    found = settle(job(tmp_path, program.format(1), rcl))["g"]
    assert found.verdict is Verdict.REFUTED, found.summary
    assert found.counterexample is not None
    assert [dict(step)["in.p"] for step in found.counterexample.trace] == ["TRUE", "FALSE"]
    right = job(tmp_path, "m := 2\n", rcl, invariants="previous(m != 0.0, TRUE)")
    assert settle(right)["g"].verdict is Verdict.PROVED


def test_what_is_remembered_for_each_value_of_a_variable(tmp_path: Path) -> None:
    """A program that says ok at all steps but the first: true clauses may be proved, and false ones never are."""
    said = {
        "no": "forall(i in Id | (not ok and in.k == i) -> not previous(once(in.k == i), FALSE))",
        "yes": "forall(i in Id | (in.k == i and previous(once(in.k == i), FALSE)) -> ok)",
        "first": "forall(i in Id | (in.k == i and ok) -> previous(once(in.k == i), FALSE))",
        "twice": "forall(i in Id | in.k == i -> counted(in.k == i since FALSE) < 3)",
        "soon": "forall(i in Id | in.k == i -> within[1 steps](not ok))",
        "next": "forall(i in Id | in.k == i -> next(ok and in.k != i))",
    }
    clauses = " ".join(f"guarantee {name} ( {text} )" for name, text in said.items())
    rcl = f"node n {{ inputs( k : {{a, b, c}} ) outputs( ok : BOOL ) topics() {clauses} }}".replace("Id", "{a, b, c}")
    invariant = "forall(i in {a, b, c} | previous(once(in.k == i), FALSE) -> s)"
    work = job(tmp_path, "MEMORY s : BOOL := FALSE\nok := s\ns := TRUE\n", rcl, invariants=invariant)
    found = {name: o.verdict for name, o in settle(work).items()}
    assert {name for name, verdict in found.items() if verdict is Verdict.PROVED} == {"no", "yes"}, found
    assert Verdict.ERROR not in found.values()


# -- generated contracts against every run ---------------------------------------------------------------------------


def text_of(table: dict[tuple[int, bool], tuple[bool, int]]) -> str:
    lines = ["MEMORY s : NATURAL := 0;"]
    for k, ((state, a), (b, after)) in enumerate(table.items()):
        lines.append(f"{'ELSE ' if k else ''}IF s == {state} and (a <=> {str(a).upper()}) THEN")
        lines += [f"  b := {str(b).upper()}", f"  s := {after}"]
    return "\n".join((*lines, "ELSE", "  b := FALSE", "ENDIF")) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(200), 4))
def test_every_verdict_stands_by_the_definitions(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    promised, assumed = clause(rng), substitute(formula(rng, 1), {B: A, N: Literal(1, NATURAL)})
    states = range(rng.choice((1, 2, 2, 3)))
    table = {(s, a): (rng.random() < 0.8, rng.choice(states)) for s in states for a in (False, True)}
    said = [show_term(t, "rcl") for t in (assumed, promised)]
    ports = "inputs( a : BOOL ) outputs( b : BOOL ) topics()"
    work = job(tmp_path, text_of(table), f"node n {{ {ports} assume m ( {said[0]} ) guarantee g ( {said[1]} ) }}")
    assumption, guarantee = (clause.formula for clause in work.node.clauses)
    found = settle(work)["g"]
    bad = False
    for word in product((False, True), repeat=6):
        run, state = list[dict[str, bool]](), 0
        for a in word:
            b, state = table[state, a]
            run.append({"in.a": a, "out.b": b})
            if not keeps(assumption, run):
                break
            bad = bad or breaks(guarantee, run)
    assert found.verdict in (Verdict.PROVED, Verdict.REFUTED, Verdict.UNKNOWN), found.summary
    assert found.verdict is not Verdict.PROVED or not bad, said
    if found.verdict is Verdict.REFUTED:
        assert found.counterexample is not None
        steps = found.counterexample.trace or (found.counterexample.values,)
        run = [{name: value == "TRUE" for name, value in step} for step in steps]
        assert breaks(guarantee, run), said
        assert not breaks(assumption, run)
