"""What is remembered for each value of a quantified variable, monitored: the verdicts are what the definitions say."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

from reference.meaning import Step
from temporal import test_quantified_cells as quantified

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import Setup, setup
from avow.formulas.formula import free_variables
from avow.formulas.values import FunctionValue
from avow.language.contract import Clause, ClauseKind

from .test_other_steps import Make, found

Event = dict[str, Any]
HEAD = """
node n {
  inputs( a : BOOL, n : NATURAL, f : NATURAL --> BOOL, g : NATURAL --> NATURAL, p : NATURAL x NATURAL --> BOOL,
    s : <NATURAL> )
  outputs( b : BOOL )
  topics( m/I i matches(in.a), m/I i matches(in.n), m/I i matches(in.f), m/I i matches(in.g), m/I i matches(in.p),
    m/I i matches(in.s), m/O o matches(out.b) )
"""
MAPPING = {
    "in.a": "a",
    "in.n": "n",
    "in.f": {"fields": ["at"], "each": "f"},
    "in.g": {"fields": ["at", "is"], "each": "g", "elsewhere": 0},
    "in.p": {"fields": ["at", "and"], "each": "p"},
    "in.s": "s",
    "out.b": "b",
}


def events_of(run: list[Step]) -> list[Event]:
    def points(value: FunctionValue, *names: str) -> list[Event]:
        return [dict(zip(names, (*key, result), strict=False)) for key, result in value.table.items()]

    told: list[Event] = []
    for k, step in enumerate(run):
        tables = {
            "f": points(step["in.f"], "at"),
            "g": points(step["in.g"], "at", "is"),
            "p": points(step["in.p"], "at", "and"),
        }
        plain = {"a": step["in.a"], "n": step["in.n"], "s": list(step["in.s"].items)}
        told.append({"topic": "i", "time": k * 1.0, **plain, **tables})
        told.append({"topic": "o", "time": k + 0.5, "b": step["out.b"]})
    return told


def wrong(known: Setup, rng: random.Random) -> str | None:
    """What the monitor says otherwise than the definitions: of each step's end, whether the clause was broken."""
    term, run = quantified.quantified(rng, rng.randrange(1, 3)), quantified.run_of(rng)
    if not free_variables(term):
        return None
    clause = Clause(ClauseKind.GUARANTEE, "g", 1, term)
    monitor = Monitor(replace(known, node=replace(known.node, guarantees=(clause,))))
    tally, told = monitor.tallies["g"], list[bool | None]()
    for event in events_of(run)[::2]:
        decided, broken = tally.decided, tally.broken
        monitor.step(event)
        told.append(None if tally.decided == decided else tally.broken == broken)
    expected = quantified.by_definition(term, run)
    differs = any(one is not None and one is not other for one, other in zip(told, expected, strict=True))
    return f"{clause}: {told} for {expected}" if differs or (None in told and not tally.reason) else None


def test_verdicts_are_what_the_definitions_say(make_system: Make) -> None:
    known = found(make_system(HEAD + "guarantee g ( out.b or not out.b ) }", MAPPING))
    rng = random.Random(5)
    assert [fault for _ in range(60) if (fault := wrong(known, rng)) is not None] == []


TRACKS = """
node tracker {
  inputs( seen : NATURAL --> BOOL )
  outputs( lost : NATURAL --> BOOL )
  topics( m/I i matches(in.seen), m/O o matches(out.lost) )
"""


def told(make: Make, clause: str, *events: Event, **options: Any) -> list[tuple[str, str]]:
    mapping = {"in.seen": {"fields": ["id"], "each": "ids"}, "out.lost": {"fields": ["id"], "each": "ids"}}
    system = make(TRACKS + f"guarantee g ( {clause} ) }}", mapping, **options)
    node = system.contract.nodes[0]
    known, faults = setup(system, node, system.plan.node(node.name).methods[0].options)
    assert faults == ()
    monitor = Monitor(known)
    found = [v for event in events for v in monitor.step(event)]
    assert monitor.tallies["g"].undecided == 0 or options
    return [(v.time, dict(v.bindings).get("k", "")) for v in found]


def ids(topic: str, time: float, *seen: int) -> Event:
    return {"topic": topic, "time": time, "ids": [{"id": n} for n in seen]}


def test_each_track_has_its_own_deadline(make_system: Make) -> None:
    gone = "forall(k in NATURAL | fell(in.seen(k)) -> within[2 steps](out.lost(k)))"
    run = [ids("i", 0, 1, 2, 3), ids("o", 0), ids("i", 1, 2), ids("o", 1), ids("i", 2), ids("o", 2, 3)]
    assert told(make_system, gone, *run, ids("i", 2.5), ids("o", 3, 1)) == []
    assert told(make_system, gone, *run, ids("i", 2.5), ids("o", 3, 2)) == [("3", "1")]
    silent = "forall(k in NATURAL | once(in.seen(k)) and not once[1 s](in.seen(k)) -> out.lost(k))"
    run = [ids("i", 0, 1, 2), ids("o", 0.1), ids("i", 0.6, 2, 7), ids("o", 0.7), ids("i", 1.4, 2), ids("o", 1.5, 1)]
    assert told(make_system, silent, *run, ids("o", 2.3, 1)) == []
    assert told(make_system, silent, *run, ids("o", 2.4, 1), ids("o", 2.6, 1, 7)) == [("2.4", "")]
    assert told(make_system, silent, *run[:-1], ids("o", 1.5), ids("i", 1.8)) == [("1.6", "")]
    assert told(make_system, silent, *run[:-1], ids("o", 1.5), ids("i", 1.8), grace="200 ms") == []


def test_of_more_values_than_the_plan_keeps_nothing_is_said(make_system: Make) -> None:
    once = "forall(k in NATURAL | k < 100 -> (once(in.seen(k)) <=> out.lost(k)))"
    run = [ids("i", 0, 1, 2), ids("o", 0.1, 1, 2), ids("i", 1, 3), ids("o", 1.1), ids("o", 1.2)]
    assert told(make_system, once, *run) == [("1.1", "3"), ("1.2", "3")]
    assert told(make_system, once, *run, instances=2) == [("1.1", "3")]
