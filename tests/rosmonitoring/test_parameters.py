"""Parameters of a ROS 2 node: monitors hear on /parameter_events what it declares, changes and deletes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring.further import of_job
from avow.backends.rosmonitoring.options import usable
from avow.backends.rosmonitoring.rml.translate import translate
from avow.backends.rosmonitoring.runs import discharge
from avow.backends.rosmonitoring.session import Session, session
from avow.backends.rosmonitoring.tuning import LIVE_APART
from avow.backends.rosmonitoring.watched import Fault
from avow.base.verdict import Verdict
from avow.system.plan import System

from .conftest import job_for, one_by_one
from .test_bags import write_events
from .test_dds import Listening, needs_dds, peer  # noqa: F401 - a fixture

RCL = """
context { Mode : {slow, fast}; }
node n {
  inputs( v : REAL, parameter limit : REAL, parameter gain_p : INTEGER, parameter on : BOOL, parameter mode : Mode )
  outputs( o : BOOL )
  topics( std_msgs/Float64 /v matches(in.v), std_msgs/Bool /o matches(out.o) )
  assume range ( limit < 100 )
  guarantee near ( v < limit -> o )
  guarantee all ( o -> gain_p >= 0 and on and mode == slow )
}
"""
PLAN = {"system": "p", "ros": {"distro": "humble", "nodes": {"n": {"name": "/ns/n"}}}}
GIVEN = {"limit": 0.1, "gain.p": 2, "on": True, "mode": "slow"}


def told(at: float, new: dict[str, Any], kind: str = "new", node: str = "/ns/n") -> dict[str, Any]:
    """The event of a message of rcl_interfaces/ParameterEvent."""
    kinds = {bool: 1, int: 2, float: 3, str: 4, list: 8, type(None): 0}
    every = []
    for name, given in new.items():
        value = {"bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": ""}
        arrays = {f"{of}_array_value": [] for of in ("byte", "bool", "integer", "double", "string")}
        names = ["", *value, *(f"{of}_array_value" for of in ("byte", "bool", "integer", "double"))]
        said = {names[kinds[type(given)]]: given} if given is not None else {}
        every.append({"name": name, "value": {"type": kinds[type(given)], **value, **arrays, **said}})
    lists = {f"{each}_parameters": every if each == kind else [] for each in ("new", "changed", "deleted")}
    return {"topic": "/parameter_events", "time": at, "stamp": {"sec": 1, "nanosec": 0}, "node": node, **lists}


def said(at: float, v: float, o: bool) -> list[dict[str, Any]]:
    return [{"topic": "v", "time": at, "data": v}, {"topic": "o", "time": at + 0.001, "data": o}]


def judged(system: System, events: Sequence[dict[str, Any]], folder: Path) -> tuple[Session, list[tuple[str, str]]]:
    """What is found, in columns and event by event alike."""
    trace = folder / "t.jsonl"
    trace.write_text("".join(f"{json.dumps(event)}\n" for event in events), encoding="utf-8")
    running, other = session(system), session(system)
    found = [(v.clause, v.fault.name) for _, v in running.run(trace)]
    assert [(v.clause, v.fault.name) for v in one_by_one(other, trace)] == found
    assert running.summary() == other.summary()
    return running, found


CHANGES: list[tuple[list[dict[str, Any]], list[tuple[str, str]]]] = [
    ([], []),
    ([told(4, {"limit": 0.1}, "changed")], []),  # set, to what it was
    ([told(4, {"limit": 0.3}, "changed", "/n")], []),
    ([told(4, {"limits": 0.3}, "changed")], []),
    ([told(4, {"limit": 0.3}, "changed")], [("limit_constant", "ASSUMPTION"), ("near", "EXCUSED")]),
    ([told(4, {"limit": 0.05}, "changed")], [("limit_constant", "ASSUMPTION")]),
    (
        [told(3.5, {"limit": 0.3}, "changed"), told(4, {"limit": 0.1}, "changed")],  # and back: the run had two values
        [("limit_constant", "ASSUMPTION"), ("limit_constant", "ASSUMPTION")],
    ),
    (
        [told(4, {"limit": 200.0}, "changed")],
        [("range", "ASSUMPTION"), ("limit_constant", "ASSUMPTION"), ("near", "EXCUSED")],
    ),
    ([told(4, {"limit": None}, "deleted")], [("in.limit", "MAPPING"), ("limit_constant", "ASSUMPTION")]),
    ([told(4, {"limit": [1.0]}, "changed")], [("in.limit", "MAPPING"), ("limit_constant", "ASSUMPTION")]),
    ([told(4, {"gain.p": 3}, "changed")], [("gain_p_constant", "ASSUMPTION")]),
    ([{"topic": "/parameter_events", "time": 4, "node": "/ns/n", "new_parameters": 1, "changed_parameters": [1]}], []),
]


@pytest.mark.parametrize(("changes", "wanted"), CHANGES)
@pytest.mark.parametrize("longer", [0, 40])
def test_a_change_breaks_that_a_parameter_keeps_its_value(
    make_system: Callable[..., System], tmp_path: Path, changes: list[Any], wanted: list[tuple[str, str]], longer: int
) -> None:
    system = make_system(RCL, plan=PLAN)
    before = [event for k in range(longer) for event in said(1 + k / 100, 0.05, True)]
    events = [told(0, GIVEN), *before, *said(3, 0.05, True), *changes, *said(5, 0.2, False)]
    running, found = judged(system, events, tmp_path)
    assert found == wanted
    assert not running.unmonitored() or wanted[0][1] == "MAPPING"


def test_before_it_is_told_nothing_is_judged_unless_the_plan_says_what_it_was(
    make_system: Callable[..., System], tmp_path: Path
) -> None:
    running, found = judged(make_system(RCL, plan=PLAN), said(1, 0.2, False), tmp_path)
    assert (found, [*running.unmonitored()]) == ([], ["n.range", "n.near", "n.all"])
    mapping = {"in.limit": {"initial": 0.3}}
    assert judged(make_system(RCL, mapping, plan=PLAN), said(1, 0.2, False), tmp_path)[1] == [("near", "GUARANTEE")]


def valued(make_system: Callable[..., System], **more: Any) -> System:
    """The plan gives the values."""
    node = {"parameters": GIVEN, "methods": [{"rosmonitoring": {"answers": ARRIVES, **more}}]}
    return make_system(RCL, plan={**PLAN, "nodes": {"n": node}})


ARRIVES = {"by": "arrival", "because": "one process writes the trace"}


@pytest.mark.parametrize(("limit", "wanted"), [(0.1, []), (0.2, [("limit_value", "ASSUMPTION")])])
def test_another_value_than_the_plans_is_a_broken_assumption(
    make_system: Callable[..., System], tmp_path: Path, limit: float, wanted: list[Any]
) -> None:
    system = valued(make_system)
    running, found = judged(system, [told(0, {"limit": limit}), *said(1, 0.05, True)], tmp_path)
    assert found == wanted
    assert ("limit_value" in {name for _, name, _, _ in running.clauses()}) is True
    running, _ = judged(system, said(1, 0.05, True), tmp_path)  # not told: as without the topic
    assert [name for _, name, _, _ in running.clauses()] == ["near", "all"]
    assert running.unmonitored() == {"n.all": running.unmonitored().get("n.all")} or not running.unmonitored()


def test_a_parameter_that_may_change_is_an_input(make_system: Callable[..., System], tmp_path: Path) -> None:
    rcl = RCL.replace("parameter limit", "limit").replace(
        "guarantee all ( o", "guarantee lower ( fell(in.v < limit) -> o )\n  guarantee all ( o"
    )
    system = make_system(rcl, {"in.limit": {"parameter": "limit"}}, plan=PLAN)
    events = [told(0, GIVEN), *said(1, 0.05, True), told(2, {"limit": 0.01}, "changed"), *said(3, 0.05, False)]
    assert judged(system, events, tmp_path)[1] == [("lower", "GUARANTEE")]
    events[3] = told(2, {"limit": 0.3}, "changed")
    assert judged(system, events, tmp_path)[1] == [("near", "GUARANTEE")]


@pytest.mark.parametrize(
    "answers", [{"latency": "20 ms", "jitter": "5 ms", "because": "x"}, {"by": "order", "because": "x"}]
)
def test_a_constant_parameter_needs_no_pairing(
    make_system: Callable[..., System], tmp_path: Path, answers: dict[str, str]
) -> None:
    system = make_system(RCL, answers=answers, plan=PLAN)
    events = [told(0, GIVEN), *said(1, 0.05, True), *said(2, 0.05, False), *said(3, 0.2, True)]
    running, found = judged(system, events, tmp_path)
    assert found == [("near", "GUARANTEE")]
    assert "limit" not in str(running.unmonitored())


STAMPED = """
node n {
  inputs( v : REAL, parameter limit : REAL )
  outputs( o : REAL )
  topics( geometry_msgs/PointStamped /v matches(in.v), geometry_msgs/PointStamped /o matches(out.o) )
  guarantee near ( in.v < limit -> out.o > 0 )
  guarantee soon ( rose(in.v < limit) -> next(out.o > 0) )
}
"""


@pytest.mark.parametrize("given", [True, False])
def test_steps_by_stamp_do_not_wait_for_a_constant_parameter(
    make_system: Callable[..., System], tmp_path: Path, given: bool
) -> None:
    method = {"answers": {"by": "stamp"}, "mapping": {"in.v": "point.x", "out.o": "point.x"}}
    entry = {"methods": [{"rosmonitoring": method}], **({"parameters": {"limit": 1.0}} if given else {})}
    system = make_system(STAMPED, plan={**PLAN, "nodes": {"n": entry}})
    events = [told(0, {"limit": 1.0})]
    for k, (v, o) in enumerate([(2.0, -1.0), (0.5, 1.0), (0.4, 1.0), (3.0, -1.0), (0.5, 1.0), (0.5, -1.0)], 1):
        for topic, at, x in (("v", k, v), ("o", k + 0.1, o)):
            header = {"stamp": {"sec": k, "nanosec": 0}, "frame_id": ""}
            events.append({"topic": topic, "time": at, "header": header, "point": {"x": x, "y": 0, "z": 0}})
    assert judged(system, events, tmp_path)[1] == [("near", "GUARANTEE"), ("soon", "GUARANTEE")]
    changed = [*events[:-2], told(5.5, {"limit": 0.9}, "changed"), *events[-2:]]
    running, found = judged(system, changed, tmp_path)
    name = "limit_value" if given else "limit_constant"
    assert found == [(name, "ASSUMPTION"), ("near", "EXCUSED"), ("soon", "EXCUSED")]
    assert not running.unmonitored()


KINDS = {
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
    "v": "std_msgs/msg/Float64",
    "o": "std_msgs/msg/Bool",
}


def test_a_bag_has_them_and_is_evidence(make_system: Callable[..., System]) -> None:
    system = make_system(RCL, plan={**PLAN, "ros": {"nodes": PLAN["ros"]["nodes"]}}, traces=["bag"])  # type: ignore[index]
    steps = [event for k in range(30) for event in said(1 + k, 0.05 + k % 2, k % 2 == 0)]
    write_events(system.plan.root / "bag", KINDS, [told(0, GIVEN), *steps])
    job = job_for(system, "n")
    report = discharge(job, {"bag": ""}, Limits())
    assert [o.verdict for o in report.outcomes] == [Verdict.MONITORED, Verdict.MONITORED], report.outcomes
    write_events(system.plan.root / "bag2", KINDS, [told(0, GIVEN), *steps, told(40, {"limit": 0.3}, "changed")])
    broken = of_job(job, "bag2", system.plan.root / "bag2", float("inf"))
    assert broken


def test_rml_refuses_them_and_the_configuration_lists_their_topic(make_system: Callable[..., System]) -> None:
    system = make_system(RCL, plan=PLAN)
    found = usable(system, system.contract.node("n"), None)
    refused = translate(found, system.contract.node("n").guarantees).refused
    assert all("is a parameter" in why for why in refused.values())
    assert len(refused) == 2


@pytest.mark.slow
@needs_dds
def test_parameters_are_heard_live(peer: Any, make_system: Callable[..., System], tmp_path: Path) -> None:  # noqa: F811
    ports = "inputs( v : REAL, parameter limit : REAL ) outputs( o : BOOL ) topics( std_msgs/Float64 /v matches(in.v) )"
    system = make_system(f"node n {{ {ports} assume small ( v < limit ) guarantee g ( TRUE ) }}", plan=PLAN)
    record = tmp_path / "run.jsonl"
    peer.write("parameter_events", "ParameterEvent")
    peer.write("v")
    with Listening(peer, system, record) as listening:
        peer.heard("parameter_events"), peer.heard("v")
        for count, (topic, value) in enumerate(
            [
                ("parameter_events", ("/ns/n", [("limit", 2.0), ("other", 0.0)], [], [])),
                ("v", 1.0),
                ("v", 3.0),
                ("parameter_events", ("/ns/other", [], [("limit", 5.0)], [])),
                ("parameter_events", ("/ns/n", [], [("limit", 5.0)], [])),
                ("v", 3.0),
            ],
            start=1,
        ):
            time.sleep(1.2 * float(LIVE_APART))  # otherwise their order would not be known
            peer.say(topic, value)
            listening.until(lambda s, count=count: s.events == count)  # type: ignore[misc]
    found = [(v.clause, v.index) for v in listening.found]
    assert sorted(found) == [("limit_constant", 5), ("small", 3)]
    assert [(v.clause, v.index) for _, v in session(system).run(record)] == found
    assert {v.fault for v in listening.found} == {Fault.ASSUMPTION}
