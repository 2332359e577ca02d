"""Clauses that speak of other steps, monitored: the verdicts are what the definitions over all steps of a run say, none
depends on a step that went by unseen, and seeded faults of the memory are found."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from drawn.memory import formula, response, run_of
from helpers import some
from reference.meaning import Step, broken, value

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND, columns
from avow.backends.rosmonitoring.command import command
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.memory import Memory
from avow.backends.rosmonitoring.options import Setup, setup
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault
from avow.base.verdict import Outcome, Verdict
from avow.formulas.formula import free_variables
from avow.language.contract import Clause, ClauseKind
from avow.language.terms import Implies, Term
from avow.system.plan import System

from .conftest import job_for

Event = dict[str, Any]
Make = Callable[..., System]
HEAD = """
node n {
  inputs( a : BOOL, n : NATURAL )
  outputs( b : BOOL )
  topics( m/I i matches(in.a), m/I i matches(in.n), m/O o matches(out.b) )
"""
MAPPING = {"in.a": "a", "in.n": "n", "out.b": "b"}


def made(make: Make, *clauses: str, **options: Any) -> System:
    clauses = clauses or ("guarantee g ( in.a -> in.n >= 0 or out.b )",)
    return make(HEAD + "\n".join(clauses) + "\n}", MAPPING, **options)


def found(system: System) -> Setup:
    known, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert faults == ()
    return known


def events_of(run: list[Step], numbered: bool = False) -> list[Event]:
    told: list[Event] = []
    for k, step in enumerate(run):
        number = {"header": {"seq": k}} if numbered else {}
        told.append({"topic": "i", "time": k * 1.0, "a": step["in.a"], "n": step["in.n"], **number})
        told.append({"topic": "o", "time": k + 0.5, "b": step["out.b"], **number})
    return told


def verdicts(known: Setup, term: Term, events: list[Event], names: int) -> list[bool | None]:
    """What the monitor says of a guarantee at each step of two events; None where it says nothing."""
    clause = Clause(ClauseKind.GUARANTEE, "g", 1, term)
    monitor = Monitor(replace(known, node=replace(known.node, guarantees=(clause,))))
    told: list[bool | None] = []
    tally = monitor.tallies["g"]
    for first, second in zip(events[::2], events[1::2], strict=True):
        decided, broke = tally.decided, tally.broken
        for event in (first, second):
            monitor.step(event)
        assert tally.decided - decided <= 1
        told.append(None if tally.decided == decided else tally.broken == broke)
    return told


def wrong(known: Setup, rng: random.Random) -> list[str]:
    """What the monitor says otherwise than the definitions; in half of the runs, steps are lost."""
    run, told = run_of(rng), list[str]()
    lost = {k for k in range(1, len(run)) if rng.random() < 0.2} if rng.random() < 0.5 else set[int]()
    events = [e for e in events_of(run, True) if e["header"]["seq"] not in lost]
    seen = [k for k in range(len(run)) if k not in lost]
    term = formula(rng, rng.randrange(1, 4))
    trigger, wanted = response(rng)
    for asked in (term, Implies(trigger, wanted)):
        if not free_variables(asked):
            continue
        said = verdicts(known, asked, events, len(seen))
        if not lost and None in said and False not in said:  # a deadline that was missed is told once
            told.append(f"undecided: {asked}")
        if asked is term:
            right = [value(term, run, k) for k in seen]
            told += [f"at {k}: {asked}" for k, r, s in zip(seen, right, said, strict=True) if s is not None and s != r]
        else:
            first = broken(Implies(trigger, wanted), run)
            at = next((k for k, s in zip(seen, said, strict=True) if s is False), None)
            if at != first if not lost else at is not None and (first is None or at < first):
                told.append(f"first broken at {at}, and is at {first}: {asked}")
    return told


@pytest.mark.parametrize("seed", some(range(4), 1, slow=3))
def test_verdicts_are_what_the_definitions_say(seed: int, make_system: Make) -> None:
    known, rng = found(made(make_system)), random.Random(seed)
    assert [fault for _ in range(40) for fault in wrong(known, rng)] == []


def test_most_steps_after_a_lost_one_are_decided_again(make_system: Make) -> None:
    known, rng, decided = found(made(make_system)), random.Random(7), 0
    for _ in range(60):
        term, run = formula(rng, 2), run_of(rng)
        if free_variables(term):
            events = [e for e in events_of(run, True) if e["header"]["seq"] != 2]
            decided += verdicts(known, term, events, 8)[-1] is not None
    assert decided > 30


def _restart(self: Memory) -> None:
    self._keeper.restart()


MUTANTS: dict[str, tuple[type, str, Any]] = {
    "a step is not remembered": (Memory, "advance", lambda self, values, event: None),
    "a lost step is ignored": (Memory, "forget", lambda self: None),
    "a lost step begins a new run": (Memory, "forget", _restart),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_mutants_die(name: str, make_system: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    known = found(made(make_system))
    monkeypatch.setattr(*MUTANTS[name])
    assert any(wrong(known, random.Random(seed)) for seed in range(150))


# -- assumptions -------------------------------------------------------------------------------------------------------

CALM = "assume calm ( in.n <= 3 )", "guarantee kept ( once(in.a) -> out.b )", "guarantee plain ( in.a -> out.b )"


def steps(*told: tuple[bool, int, bool]) -> list[Step]:
    return [{"in.a": a, "in.n": n, "out.b": b} for a, n, b in told]


def faults(system: System, events: list[Event]) -> list[tuple[str, Fault]]:
    running = session(system)
    return [(v.clause, v.fault) for event in events for v in running.step(event)]


def test_a_broken_assumption_excuses_to_the_end_of_the_run(make_system: Make) -> None:
    system = made(make_system, *CALM)
    run = steps((True, 0, True), (False, 9, True), (False, 0, False), (True, 0, False))
    assert faults(system, events_of(run)) == [
        ("calm", Fault.ASSUMPTION),
        ("kept", Fault.EXCUSED),
        ("kept", Fault.EXCUSED),
        ("plain", Fault.EXCUSED),
    ]
    assert faults(system, events_of(run[:1] + run[2:3])) == [("kept", Fault.GUARANTEE)]


def test_an_assumption_with_memory(make_system: Make) -> None:
    system = made(make_system, "assume short ( not held[1 steps](in.a) )", "guarantee still ( not out.b )")
    fine = steps((True, 0, False), (False, 0, False), (True, 0, True))
    assert faults(system, events_of(fine)) == [("still", Fault.GUARANTEE)]
    long = steps((True, 0, False), (True, 0, False), (False, 0, True))
    assert faults(system, events_of(long)) == [("short", Fault.ASSUMPTION), ("still", Fault.EXCUSED)]


def test_nobody_is_blamed_where_an_assumption_was_not_seen(make_system: Make) -> None:
    system = made(make_system, *CALM)
    events = events_of(steps((True, 0, True), (False, 0, True), (False, 0, False)))
    events[2]["n"] = "many"
    running = session(system)
    assert {v.fault for event in events for v in running.step(event)} == {Fault.MAPPING}
    tally = running.monitors[0].tallies["kept"]
    assert (tally.broken, tally.undecided) == (0, 1)


# -- evidence ----------------------------------------------------------------------------------------------------------


def outcome(system: System, events: list[Event], tmp_path: Path) -> Outcome:
    (system.plan.root / "t.jsonl").write_text("".join(json.dumps(e) + "\n" for e in events), encoding="utf-8")
    (only,) = BACKEND.discharge(job_for(system, "n"), tmp_path / "made", Limits()).outcomes
    return only


PROMPT = "guarantee prompt ( in.a -> within[2 steps](out.b) )"


@pytest.mark.parametrize(
    ("told", "verdict", "said"),
    [
        ([(True, 0, False), (False, 0, True), (False, 0, False)], Verdict.MONITORED, "held at all 3 judgements"),
        ([(True, 0, False), (False, 0, False), (False, 0, False)], Verdict.REFUTED, "broken at event 6"),
        ([(True, 0, True), (False, 0, False), (True, 0, False)], Verdict.MONITORED, "open at the end of 1 of 1 traces"),
        ([(False, 0, False), (True, 0, False)], Verdict.MONITORED, "condition of it was never met"),
    ],
)
def test_evidence(told: Any, verdict: Verdict, said: str, make_system: Make, tmp_path: Path) -> None:
    result = outcome(made(make_system, PROMPT, traces=["t.jsonl"]), events_of(steps(*told)), tmp_path)
    assert result.verdict is verdict
    assert said in result.summary
    assert "RML judges single steps" in str(result.details["rml"])
    assert result.bound.get("open") == (1 if "open" in said or "never" in said else None)


def test_an_unread_step_is_no_evidence(make_system: Make, tmp_path: Path) -> None:
    events = events_of(steps((False, 0, False), (True, 0, True), (False, 0, False), (False, 0, False)), True)
    system = made(make_system, "guarantee g ( once(in.a) -> out.b )", traces=["t.jsonl"])
    assert outcome(system, events, tmp_path).verdict is Verdict.REFUTED
    del events[2:4]
    lost = outcome(system, events, tmp_path)
    assert lost.verdict is Verdict.UNKNOWN
    assert "since earlier steps were not seen 2" in lost.summary


TWO = """
node n {
  inputs( a : BOOL )
  outputs( b : BOOL, c : BOOL )
  topics( m/I i matches(in.a), m/O o matches(out.b), m/P p matches(out.c) )
  guarantee g ( once(out.b and out.c) -> in.a )
}
"""


@pytest.mark.parametrize(
    ("topics", "held", "left"),
    [
        ("iopop", 2, {}),
        ("opiop", 0, {"early": 1, "forgotten": 1}),  # an answer before the input's first value
        ("iopoop", 1, {"partial": 1, "forgotten": 1}),  # an answer that never was whole
    ],
)
def test_a_step_that_is_not_judged_is_not_forgotten(
    topics: str, held: int, left: dict[str, int], make_system: Make
) -> None:
    fields = {"in.a": "a", "out.b": "b", "out.c": "c"}
    running = session(make_system(TWO, fields))
    for k, topic in enumerate(topics):
        field = {"i": "a", "o": "b", "p": "c"}[topic]
        assert list(running.step({"topic": topic, "time": k, field: topic == "p"})) == []
    tally = running.monitors[0].tallies["g"]
    assert (tally.decided, {name: getattr(tally, name) for name in left}) == (held, left)


@pytest.mark.parametrize(
    ("clause", "said", "options"),
    [
        ("guarantee g ( in.a -> eventually(out.b) )", "`eventually`", {}),
        ("guarantee g ( once(in.a) -> out.b )", "latency", {"answers": {"latency": "1 ms", "because": "measured"}}),
        ("guarantee g ( once[2 s](in.a) -> out.b )", "limits in seconds", {"answers": {"by": "stamp"}}),
        ("guarantee g ( once(in.a) -> out.b )", "when: any", {"answers": {"by": "stamp"}, "when": "any"}),
    ],
)
def test_what_is_not_monitored_is_refused_by_name(
    clause: str, said: str, options: Any, make_system: Make, tmp_path: Path
) -> None:
    system = made(make_system, clause, traces=["t.jsonl"], **options)
    result = outcome(system, events_of(steps((True, 0, True))), tmp_path)
    assert result.verdict is Verdict.UNKNOWN
    assert said in result.summary
    assert [d.message for d in BACKEND.check(job_for(system, "n")) if d.code == "MON103" and said in d.message]


def _told(system: System) -> list[int]:
    lines = [json.dumps({"topic": "o", "time": k / 2, "b": True}) for k in range(8)]
    (system.plan.root / "t.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    arguments = [str(system.plan.root), str(system.plan.root / "t.jsonl"), "--json"]
    whole = json.loads(CliRunner().invoke(command, arguments, standalone_mode=False).output)
    return [v["event"] for v in whole["violations"]]


def test_the_command_judges_each_line(make_system: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file of lines that are all alike: an event that is like one before may have another verdict."""
    system = made(make_system, "guarantee few ( counted(out.b since not out.b) <= 4 )")
    monkeypatch.setattr(columns, "FEW", 0)
    assert _told(system) == [5, 6, 7, 8]


@pytest.mark.parametrize("limit", ["2 steps", "2 s"])
def test_a_missed_deadline_is_one_breach_however_long_it_is_still_missed(limit: str, make_system: Make) -> None:
    clause = f"guarantee g ( rose(in.a) -> within[{limit}](out.b) )"
    monitor = Monitor(found(made(make_system, clause)))
    asked, answered = (False, True, True, True, True, True, False, True, False, False, False), {7}
    told = []
    for k, a in enumerate(asked):
        told += monitor.step({"topic": "i", "time": k, "a": a, "n": 0})
        told += monitor.step({"topic": "o", "time": k + 0.1, "b": k in answered})
    told += monitor.step({"topic": "elsewhere", "time": 20})
    tally = monitor.tallies["g"]
    assert [v.fault for v in told] == [Fault.GUARANTEE]
    assert (tally.broken, tally.overdue > 0) == (1, True)
    assert tally.asked == tally.decided


SAID = [
    "rose(in.a) -> within[1 steps](out.b)",
    "in.a -> for[2 steps](out.b)",
    "in.a -> next(out.b)",
    "in.a -> out.b until in.n > 100",
    "historically(in.a) -> out.b",
    "held[1 steps](in.a) -> out.b",
    "rose(in.a) -> within[1 s](out.b)",
    "once[2 s](in.a) -> out.b",
]


@pytest.mark.parametrize("text", SAID)
def test_a_breach_is_told_in_the_words_of_the_contract(make_system: Make, tmp_path: Path, text: str) -> None:
    """Also in evidence, where the clause comes without its text; and it is not said that its condition never came."""
    system = made(make_system, f"guarantee g ( {text} )")
    run: list[Step] = [{"in.a": k > 0, "in.n": 0, "out.b": False} for k in range(6)]
    run[0] = {"in.a": "historically" in text, "in.n": 0, "out.b": False}
    known = found(system)
    (clause,) = known.node.guarantees
    monitor = Monitor(replace(known, node=replace(known.node, guarantees=(replace(clause, text="", sentence=None),))))
    told = [violation for event in events_of(run) for violation in monitor.step(event)]
    assert told
    assert all("#" not in violation.explanation and "out.b" in violation.explanation for violation in told)
    trace = tmp_path / "t.jsonl"
    trace.write_text("".join(json.dumps(event) + "\n" for event in events_of(run)))
    done = CliRunner().invoke(command, [str(system.plan.root), str(trace)])
    assert "broken" in done.output
    assert "condition of it was never met" not in done.output
