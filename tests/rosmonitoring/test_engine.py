"""The engine on the case study: the nominal run is clean, each guarantee broken once is caught where it breaks."""

from __future__ import annotations

import copy
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.system.plan import System

from .conftest import CASE

Event = dict[str, Any]
Change = Callable[[list[Event]], int]


def run(system: System, events: list[Event]) -> list[Violation]:
    running = session(system)
    return [violation for event in events for violation in running.step(event)]


def nth(events: list[Event], topic: str, count: int, **fields: Any) -> int:
    """The position, from 0, of the count-th event (from 1) of a topic with these fields."""
    found = [k for k, e in enumerate(events) if e["topic"] == topic and all(e.get(n) == v for n, v in fields.items())]
    return found[count - 1]


def test_the_shipped_trace_is_what_its_script_writes() -> None:
    made = subprocess.run(
        [sys.executable, str(CASE / "models" / "make_trace.py"), "--print"], capture_output=True, check=True, text=True
    )
    assert made.stdout == (CASE / "traces" / "nominal.jsonl").read_text(encoding="utf-8")


def at_waypoint_of_second_move(events: list[Event]) -> int:
    return nth(events, "command", 2, command="move")


def skip_a_waypoint(events: list[Event]) -> int:
    at = at_waypoint_of_second_move(events)
    events[at].update(posX=-7.25, posY=-5.26)
    return at


def inspect_another(events: list[Event]) -> int:
    at = nth(events, "command", 1, command="inspect")
    events[at]["id"] = 5
    return at


def flee_to_the_wrong_place(events: list[Event]) -> int:
    red = nth(events, "radiationStatus", 1, level="red")
    at = next(k for k in range(red, len(events)) if events[k]["topic"] == "command")
    events[at].update(posX=5.48, posY=-3.48)
    return at


def go_on_exploring(events: list[Event]) -> int:
    at = nth(events, "phase", 1, phase="leaving")
    events[at]["phase"] = "exploring"
    return at


def end_too_early(events: list[Event]) -> int:
    at = nth(events, "phase", 1, phase="exploring")
    events[at]["phase"] = "leaving"
    return at


def misread_green(events: list[Event]) -> int:
    at = nth(events, "radiationStatus", 2, level="green")
    events[at]["level"] = "orange"
    return at


def misread_red(events: list[Event]) -> int:
    at = nth(events, "radiationStatus", 1, level="red")
    events[at]["level"] = "green"
    return at


def misread_orange(events: list[Event]) -> int:
    at = nth(events, "radiationStatus", 1, level="orange")
    events[at]["level"] = "red"
    return at


def mark_another(events: list[Event]) -> int:
    at = nth(events, "inspected", 2)
    events[at]["id"] = 9
    return at


def arrive_elsewhere(events: list[Event]) -> int:
    at = nth(events, "at", 3)
    events[at]["posX"] = 0.0
    return at


def drift_while_inspecting(events: list[Event]) -> int:
    at = nth(events, "at", 2)
    events[at]["posX"] += 0.01
    return at


FAULTS: dict[str, Change] = {
    "agent.next_waypoint": skip_a_waypoint,
    "agent.inspect_here": inspect_another,
    "agent.exit_on_danger": flee_to_the_wrong_place,
    "agent.abandon": go_on_exploring,
    "agent.end_of_mission": end_too_early,
    "radiationSensor.low": misread_green,
    "radiationSensor.medium": misread_orange,
    "radiationSensor.high": misread_red,
    "radiationSensor.marks_inspected": mark_another,
    "navigation.arrives": arrive_elsewhere,
    "navigation.stays": drift_while_inspecting,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_each_guarantee_broken_once_is_caught_where_it_is_broken(name: str, case: System, nominal: list[Event]) -> None:
    events = copy.deepcopy(nominal)
    at = FAULTS[name](events)
    found = [v for v in run(case, events) if f"{v.node}.{v.clause}" == name]
    assert found, name
    assert found[0].fault is Fault.GUARANTEE
    assert found[0].index == at + 1
    assert run(case, events)[0].index == at + 1, "nothing is reported before the fault"
    assert found[0].values
    assert found[0].time


def test_every_guarantee_that_a_trace_can_break_has_a_seeded_fault(case: System) -> None:
    """`one_position` and `somewhere` hold of any single position: they have their own test below."""
    names = {f"{n.name}.{g.name}" for n in case.contract.nodes for g in n.guarantees}
    assert names - FAULTS.keys() == {"localisation.one_position", "navigation.somewhere"}


RELATIONS = """
context {{ Place : REAL x REAL --> BOOL; }}
node n {{
  inputs( go : BOOL )
  outputs( p : Place )
  topics( std_msgs/Bool go matches(in.go), a/P p matches(out.p) )
  guarantee g ( {formula} )
}}
"""


@pytest.mark.parametrize(
    ("formula", "good", "bad"),
    [
        ("exists_unique(x, y in REAL | out.p(x, y))", [[1, 2]], [[1, 2], [1, 3]]),
        (
            "exists(a, b in REAL | forall(x, y in REAL | out.p(x, y) -> a - 0.25 <= x <= a + 0.25 and b <= y <= b))",
            [[1, 2], [1.5, 2]],
            [[1, 2], [1.51, 2]],
        ),
    ],
)
def test_several_tuples_in_one_message(
    make_system: Callable[..., System], formula: str, good: list[Any], bad: list[Any]
) -> None:
    mapping = {"out.p": {"fields": ["x", "y"], "each": "points"}}
    system = make_system(RELATIONS.format(formula=formula), mapping)
    for points, expected in ((good, 0), (bad, 1)):
        event = {"topic": "p", "points": [{"x": x, "y": y} for x, y in points]}
        assert len(run(system, [event])) == expected


def test_bindings_name_the_witness(case: System, nominal: list[Event]) -> None:
    events = copy.deepcopy(nominal)
    arrive_elsewhere(events)
    first = next(v for v in run(case, events) if v.clause == "arrives")
    assert dict(first.bindings) == {"x": "-4.07", "y": "-7.24"}
    assert "in.command" in dict(first.values)


ASSUMING = """
node n {
  inputs( r : REAL )
  outputs( s : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 s matches(out.s) )
  assume positive ( 0 <= in.r )
  guarantee doubled ( out.s == in.r + in.r )
}
"""


def test_a_guarantee_is_excused_while_an_assumption_is_broken(make_system: Callable[..., System]) -> None:
    system = make_system(ASSUMING, {"in.r": "data", "out.s": "data"})
    events = [
        {"topic": "/r", "data": 2.5},
        {"topic": "s", "data": 5},
        {"topic": "r", "data": -1},
        {"topic": "s", "data": 7},
        {"topic": "r", "data": 1},
        {"topic": "s", "data": 7},
    ]
    found = [(v.index, v.fault) for v in run(system, events)]
    assert found == [(3, Fault.ASSUMPTION), (4, Fault.EXCUSED), (6, Fault.GUARANTEE)]


def test_mapping_errors_are_their_own_kind_and_make_the_value_unknown(case: System, nominal: list[Event]) -> None:
    events = copy.deepcopy(nominal)
    at = nth(events, "radiationStatus", 2)
    events[at]["level"] = "purple"
    found = run(case, events)
    assert {v.fault for v in found} == {Fault.MAPPING}
    assert {(v.node, v.index) for v in found} == {("agent", at + 1), ("radiationSensor", at + 1)}
    assert "outside {red, orange, green}" in found[0].explanation


@pytest.mark.parametrize(
    "event",
    [
        {},
        {"topic": None},
        {"topic": 3},
        {"topic": ["r"]},
        {"topic": "r"},
        {"topic": "r", "radiation": None},
        {"topic": "r", "radiation": True},
        {"topic": "r", "radiation": float("nan")},
        {"topic": "r", "radiation": float("inf")},
        {"topic": "r", "radiation": "12"},
        {"topic": "r", "radiation": {"deep": {}}},
        {"topic": "r", "data": {"radiation": []}},
        {"topic": "command", "command": "fly"},
        {"topic": "command", "command": 7},
        {"topic": "command", "command": "inspect", "id": -1},
        {"topic": "command", "command": "inspect", "id": 1.5},
        {"topic": "command", "command": "move", "posX": 1},
        {"service": "r", "request": {}},
        {"topic": "time", "time": {}},
    ],
)
def test_strange_events_never_crash(case: System, event: Event) -> None:
    found = run(case, [event])
    assert {v.fault for v in found} <= {Fault.MAPPING}
