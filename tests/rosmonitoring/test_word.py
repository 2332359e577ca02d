"""Clauses that speak of other steps, where `answers` pairs messages by key, stamp or order: whatever order the topics
are recorded in, the verdicts are what the definitions say, and none depends on a step that went by unseen."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from drawn.memory import formula, response, run_of
from helpers import some
from reference.meaning import Step, broken, value

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND, engine
from avow.backends.rosmonitoring import word as words
from avow.backends.rosmonitoring.command import command
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.judged import Judgement, ReportingMonitor
from avow.backends.rosmonitoring.options import Setup
from avow.backends.rosmonitoring.watched import Fault
from avow.base.verdict import Verdict
from avow.formulas.formula import free_variables
from avow.language.contract import Clause, ClauseKind
from avow.language.terms import Implies, Term
from avow.system.plan import System

from .conftest import job_for
from .test_columns import both
from .test_other_steps import Event, Make, found

HEAD = """
node n {
  inputs( a : BOOL, n : NATURAL )
  outputs( b : BOOL )
  topics( m/A a matches(in.a), m/N n matches(in.n), m/O o matches(out.b) )
"""
MAPPING = {"in.a": "v", "in.n": "v", "out.b": "v"}
WAYS = {
    "key": {"by": "key", "input": "id", "output": "id"},
    "stamp": {"by": "stamp"},
    "order": {"by": "order", "because": "every link stood before the first message"},
}
SPEAKS = "guarantee g ( previous(in.a, FALSE) and in.n >= 0 -> out.b )"


def made(make: Make, way: str, *clauses: str, **options: Any) -> System:
    text = HEAD + "\n".join(clauses or (SPEAKS,)) + "\n}"
    return make(text, MAPPING, **{"answers": WAYS[way], **options})


def recorded(run: list[Step], rng: random.Random, numbered: bool = True) -> list[Event]:
    """Each topic in its own order; between them, any."""
    queues = {
        topic: [
            {"topic": topic, "v": step[name], "id": k, "header": {"stamp": {"secs": k + 1, "nsecs": 0}}}
            for k, step in enumerate(run)
        ]
        for topic, name in (("a", "in.a"), ("n", "in.n"), ("o", "out.b"))
    }
    events: list[Event] = []
    while left := [topic for topic, queue in queues.items() if queue]:
        event = queues[rng.choice(left)].pop(0)
        event["header"] |= {"seq": event["id"]} if numbered else {}
        events.append({**event, "time": len(events) / 10**5})
    return events


def verdicts(known: Setup, term: Term, events: list[Event]) -> dict[int, bool]:
    """What is said of a guarantee at each step, by the numbers of the answers that are decided."""
    clause = Clause(ClauseKind.GUARANTEE, "g", 1, term)
    monitor = ReportingMonitor(replace(known, node=replace(known.node, guarantees=(clause,))))
    told: list[Judgement] = []
    monitor.report = told.append
    broke = {v.index for event in events for v in monitor.step(event)} | {v.index for v in monitor.finish()}
    tally = monitor.tallies["g"]
    if monitor.backwards and not tally.decided:  # withdrawn
        assert not broke
        return {}
    assert broke == {j.event for j in told if j.verdict == "broken"}
    return {events[j.event - 1]["id"]: j.verdict == "held" for j in told if j.verdict in ("held", "broken")}


def wrong(known: Setup, rng: random.Random) -> list[str]:
    """What the monitor says otherwise than the definitions; in half of the runs, messages after the first are lost."""
    run, told = run_of(rng), list[str]()
    events = recorded(run, rng)
    fine = rng.random() < 0.5
    # no message shows that there was a step before the first one that is seen
    events = [event for event in events if fine or rng.random() > 0.1 or event["id"] == 0]
    term = formula(rng, rng.randrange(1, 4))
    trigger, wanted = response(rng)
    for asked in (term, Implies(trigger, wanted)):
        names = {v.qualified for v in free_variables(asked)}
        if "out.b" not in names:
            continue
        said = verdicts(known, asked, events)
        if fine and len(said) < len(run) and all(said.values()):  # a deadline that was missed is told once
            told.append(f"undecided: {asked}")
        if asked is term:
            told += [f"at {k}: {asked}" for k, holds in said.items() if holds != value(term, run, k)]
        else:
            first = broken(Implies(trigger, wanted), run)
            at = next((k for k in sorted(said) if not said[k]), None)
            if at != first if fine else at is not None and (first is None or at < first):
                told.append(f"first broken at {at}, and is at {first}: {asked}")
    return told


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", some(range(4), 1, slow=2))
def test_verdicts_are_what_the_definitions_say(seed: int, way: str, make_system: Make) -> None:
    known, rng = found(made(make_system, way)), random.Random(seed)
    assert [fault for _ in range(60) for fault in wrong(known, rng)] == []


def _all_whole(monitor: Monitor, steps: Any, found: Any) -> None:
    words.follow(monitor, (step for step in steps if step.whole), found)


@pytest.mark.parametrize("mutant", ["what belongs to no step is passed over", "a loss is not noted"])
def test_mutants_die(mutant: str, make_system: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    known = found(made(make_system, "key"))
    if mutant == "a loss is not noted":
        monkeypatch.setattr(Monitor, "miss", lambda self, names: None)
    else:
        monkeypatch.setattr(engine, "follow", _all_whole)
        monkeypatch.setattr(words.Step, "missed", property(lambda self: False))
    assert any(wrong(known, random.Random(seed)) for seed in range(100))


def lines(system: System, events: list[Event], *more: str) -> Any:
    trace = system.plan.root / "t.jsonl"
    trace.write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
    return CliRunner().invoke(command, [str(system.plan.root), str(trace), *more], standalone_mode=False)


def answered(rng: random.Random, count: int = 30, bad: int = -1) -> list[Step]:
    """A node that says what was asked the step before."""
    asked = [rng.random() < 0.5 for _ in range(count)]
    said = [k > 0 and asked[k - 1] for k in range(count)]
    return [
        {"in.a": a, "in.n": 0, "out.b": s is not (k == bad)} for k, (a, s) in enumerate(zip(asked, said, strict=True))
    ]


SAYS = "guarantee says ( out.b <=> (previous(in.a, FALSE) and in.n >= 0) )"


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("fast", [True, False])
def test_a_planted_fault_is_found_and_no_other(way: str, fast: bool, make_system: Make, tmp_path: Path) -> None:
    system = made(make_system, way, SAYS, traces=["t.jsonl"])
    rng = random.Random(3)
    for bad in (-1, 17):
        events = recorded(answered(rng, bad=bad), rng)
        wanted = [k for k, e in enumerate(events, start=1) if (e["topic"], e["id"]) == ("o", bad)]
        whole = json.loads(lines(system, events, "--json", *(() if fast else ("--all",))).output)
        assert [v["event"] for v in whole["violations"]] == wanted
        (clause,) = whole["nodes"][0]["clauses"]
        assert (clause["decided"], clause["reason"]) == (30, "")
        (only,) = BACKEND.discharge(job_for(system, "n"), tmp_path / str(bad), Limits()).outcomes
        assert only.verdict is (Verdict.MONITORED if bad < 0 else Verdict.REFUTED)


@pytest.mark.parametrize("way", WAYS)
def test_compiled_monitors_say_the_same(way: str, make_system: Make, tmp_path: Path) -> None:
    rng = random.Random(5)
    known = found(made(make_system, way, "assume few ( in.n <= 2 )", SAYS))
    run = [{**step, "in.n": int(rng.random() < 0.02) * 3} for step in answered(rng, 60, 9)]
    trace = tmp_path / "t.jsonl"
    trace.write_text("".join(json.dumps(event) + "\n" for event in recorded(run, rng)), encoding="utf-8")
    assert both(known, trace)[0] > 0


def test_what_breaks_an_assumption_later_excuses_nothing_before(make_system: Make) -> None:
    """Though it is recorded before the answer."""
    monitor = Monitor(found(made(make_system, "key", "assume few ( in.n <= 2 )", SAYS)))
    run = [{"in.a": False, "in.n": n, "out.b": b} for n, b in ((0, False), (0, True), (5, False), (0, True))]
    events = recorded(run, random.Random(0))
    events.sort(key=lambda event: event["topic"])
    faults = [v for event in events for v in monitor.step(event)] + monitor.finish()
    assert [(v.clause, v.fault, events[v.index - 1]["id"]) for v in faults] == [
        ("says", Fault.GUARANTEE, 1),
        ("few", Fault.ASSUMPTION, 2),
        ("says", Fault.EXCUSED, 3),
    ]


@pytest.mark.parametrize("topic", ["a", "o"])
def test_by_order_an_unnumbered_loss_breaks_nothing(topic: str, make_system: Make) -> None:
    rng = random.Random(4)
    events = [e for e in recorded(answered(rng), rng, numbered=False) if (e["topic"], e["id"]) != (topic, 11)]
    done = lines(made(make_system, "order", SAYS), events)
    assert "broken" not in done.output.replace("nothing broken", "")
    assert "no evidence" in done.output
    assert done.return_value == 1


@pytest.mark.parametrize(
    ("spoil", "way"), [("twice", "key"), ("twice", "stamp"), ("bare", "key"), ("bare", "stamp"), ("late", "key")]
)
def test_what_belongs_to_no_step_leaves_memory_unknown(spoil: str, way: str, make_system: Make) -> None:
    """A key that comes twice, none, or one that comes after a later one: nothing is broken, and the rest is decided."""
    run = answered(random.Random(6))
    events = [e for k in range(30) for e in recorded(run[k : k + 1], random.Random(k))]
    for k, event in enumerate(events):
        event |= {"id": k // 3, "time": k / 10**4, "header": {"stamp": {"secs": k // 3 + 1, "nsecs": 0}}}
    at = next(k for k, event in enumerate(events) if (event["id"], event["topic"]) == (12, "o"))
    if spoil == "twice":
        events.insert(at, {**events[at]})
    elif spoil == "bare":
        events[at] = {"topic": "o", "v": not events[at]["v"], "time": at / 10**4}
    else:
        events.insert(at + 6, events.pop(at))
    monitor = Monitor(found(made(make_system, way, SAYS)))
    assert [v for event in events for v in monitor.step(event)] + monitor.finish() == []
    tally = monitor.tallies["says"]
    assert 26 <= tally.decided < tally.published
    assert tally.order


def test_other_clauses_do_not_make_it_judged_without_its_order(make_system: Make) -> None:
    """Of a clause with limits in seconds, which is refused."""
    system = made(make_system, "key", SAYS, "guarantee soon ( once[2 s](in.a) -> out.b )")
    run = answered(random.Random(3), bad=17)
    monitor = Monitor(found(system))
    told = [v for event in recorded(run, random.Random(2)) for v in monitor.step(event)] + monitor.finish()
    assert [v.clause for v in told] == ["says"]
    assert (monitor.tallies["says"].decided, monitor.tallies["soon"].published) == (30, 0)
