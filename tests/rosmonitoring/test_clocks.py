"""A monitor that goes by the simulation's clock, or by the stamps of the messages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from avow.backends.rosmonitoring import pace
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault

from .test_other_steps import Make, found

Event = dict[str, Any]
RCL = """
node n {
  inputs( a : BOOL )
  outputs( b : BOOL )
  topics( m/V i matches(in.a), m/V o matches(out.b) )
  guarantee g ( rose(in.a) -> within[1 s](out.b) )
}"""
MESSAGES = {"m/V": "std_msgs/Header header\nbool v\n", "std_msgs/Header": "time stamp\nstring frame_id\n"}
SLOW = 10
"""Seconds of the recording in one of the robot."""


def time(seconds: float) -> Event:
    return {"sec": int(seconds), "nanosec": round(seconds % 1 * 10**9)}


def run(by: str, answered: float) -> list[Event]:
    """A request after two seconds of the robot's time, and when it is answered: recorded ten times slower."""
    said = [(k / 10, "i", k >= 20) for k in range(60)]
    said += [(k / 10 + 0.01, "o", answered <= k / 10) for k in range(60)]
    told: list[Event] = []
    for at, topic, value in sorted(said):
        if by == "sim":
            told.append({"topic": "/clock", "time": at * SLOW, "clock": time(1000 + at)})
        stamp = {"header": {"stamp": time(1000 + at)}} if by == "stamp" else {}
        told.append({"topic": topic, "time": at * SLOW, "v": value, **stamp})
    return told


def made(make: Make, by: str, **more: Any) -> Any:
    return make(RCL, {"in.a": "v", "out.b": "v"}, messages=MESSAGES, fresh={"in.a": "500 ms"}, time=by, **more)


@pytest.mark.parametrize("by", ["sim", "stamp"])
def test_deadlines_are_of_the_clock_that_the_plan_names(make_system: Make, by: str, tmp_path: Path) -> None:
    system = made(make_system, by)
    for answered, broken in ((2.9, []), (3.5, [(Fault.GUARANTEE, "g")])):
        events = run(by, answered)
        monitor = Monitor(found(system))
        told = [violation for event in events for violation in monitor.step(event)]
        told += [*monitor.tick({"time": 10**6}), *monitor.finish()]
        assert list(dict.fromkeys((v.fault, v.clause) for v in told)) == broken
        assert [v.time for v in told][:1] == ["1003.01"] * len(broken)
        assert monitor.backwards == ""
        trace = tmp_path / "t.jsonl"
        trace.write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
        running = session(system, (), trace)
        assert [violation for _, violation in running.run(trace)] == told
        assert "/clock" not in running.unheard
    slow = Monitor(found(made(make_system, "receipt")))
    assert {v.fault for event in run(by, 2.9) for v in slow.step(event)} == {Fault.GUARANTEE, Fault.SILENT}


def test_without_the_clock_nothing_is_judged(make_system: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    for by, what in (("sim", "no message of /clock"), ("stamp", "no message had a `header.stamp`")):
        monitor = Monitor(found(made(make_system, by)))
        assert [v for event in run("receipt", 9) for v in monitor.step(event)] == monitor.finish() == []
        assert what in monitor.backwards
    unset = Monitor(found(made(make_system, "stamp")))
    for event in run("receipt", 9):
        unset.step({**event, "header": {"stamp": time(0)}})
    assert unset.finish() == []
    assert "no message had a `header.stamp`" in unset.backwards
    monkeypatch.setattr(pace, "EVENTS_WITHOUT_CLOCK", 5)
    late = Monitor(found(made(make_system, "sim")))
    events = run("sim", 2.9)
    for event in (*[e for e in events if e["topic"] != "/clock"][:9], *events):
        late.step(event)
    late.finish()
    assert "more than 5 events" in late.backwards


def test_a_clock_that_stands_still_is_no_evidence(make_system: Make) -> None:
    monitor = Monitor(found(made(make_system, "sim")))
    for event in run("sim", 9):
        monitor.step({**event, "clock": time(1000)} if event["topic"] == "/clock" else event)
    assert monitor.finish() == []
    assert "/clock did not advance" in monitor.backwards
