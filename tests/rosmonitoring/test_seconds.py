"""Clauses with limits in seconds, monitored: silence breaks one at its deadline, clocks are no better than they are."""

from __future__ import annotations

from typing import Any

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.watched import Fault, Violation

from .test_other_steps import Make, found, made

Event = dict[str, Any]


def at(time: float, **values: Any) -> Event:
    topic = "o" if "b" in values else "i"
    return {"topic": topic, "time": time, **({"n": 0} | values if topic == "i" else values)}


def told(make: Make, clauses: str, *events: Event) -> list[tuple[Fault, str, str]]:
    monitor = Monitor(found(made(make, *clauses.split("\n"))))
    broken: list[Violation] = []
    for event in events:
        broken += monitor.step(event)
    return [(v.fault, v.clause, v.time) for v in broken]


WITHIN = "guarantee g ( rose(in.a) -> within[1 s](out.b) )"
OTHER = {"topic": "elsewhere", "time": 9.0}


def test_an_answer_in_time(make_system: Make) -> None:
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True), at(1.9, b=True), OTHER]
    assert told(make_system, WITHIN, *events) == []


def test_silence_breaks_a_response_at_its_deadline(make_system: Make) -> None:
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True)]
    assert told(make_system, WITHIN, *events, {**OTHER, "time": 2.04}) == []  # a message may be on its way
    assert told(make_system, WITHIN, *events, {**OTHER, "time": 2.06}, OTHER) == [(Fault.GUARANTEE, "g", "2")]
    assert told(make_system, WITHIN, *events, at(2.04, b=True), OTHER) == []
    assert told(make_system, WITHIN, *events, at(3, b=True)) == [(Fault.GUARANTEE, "g", "2")]


def test_times_that_go_back(make_system: Make) -> None:
    events = [at(10, a=False), at(10.1, b=False), at(11, a=True)]
    assert told(make_system, WITHIN, *events, at(10.995, b=True), OTHER) == []  # a clock's jitter
    assert told(make_system, WITHIN, *events, at(5, a=False), {**OTHER, "time": 50}) == []  # a new run
    assert told(make_system, WITHIN, *events, at(5, a=False), at(6, a=True), {**OTHER, "time": 50}) == [
        (Fault.GUARANTEE, "g", "7")
    ]


def test_a_node_that_dies_breaks_its_pace(make_system: Make) -> None:
    pace = "guarantee g ( TRUE )\nguarantee steps ( steps(at most 500 ms) )"
    answers = [at(0, b=True), at(0.5, b=True), at(0.9, b=False)]
    assert told(make_system, pace, *answers, {**OTHER, "time": 1.4}) == []
    assert told(make_system, pace, *answers, OTHER) == [(Fault.GUARANTEE, "steps", "1.4")]
    every = pace.replace("at most", "every")
    assert told(make_system, every, at(0, b=True), at(0.495, b=True), at(1.002, b=True)) == []
    assert told(make_system, every, at(0, b=True), at(0.3, b=True)) == [(Fault.GUARANTEE, "steps", "0.3")]


def test_a_sensor_that_dies_or_never_lived(make_system: Make) -> None:
    alive = "assume alive ( once[1 s](arrived(in.a)) )\nguarantee g ( TRUE )"
    assert told(make_system, alive, at(0, a=True), at(0.9, a=True), at(1.9, a=True)) == []
    assert told(make_system, alive, at(0, a=True), at(0.9, a=True), OTHER) == [(Fault.ASSUMPTION, "alive", "1.9")]
    assert told(make_system, alive, {**OTHER, "time": 3}, OTHER) == [(Fault.ASSUMPTION, "alive", "4")]


def test_what_was_promised_while_a_sensor_lives_is_not_laid_at_the_node_when_it_died(make_system: Make) -> None:
    both = "assume alive ( once[1 s](arrived(in.a)) )\n" + WITHIN
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True)]
    assert [f for f, _, _ in told(make_system, both, *events, at(5, b=True))] == [Fault.ASSUMPTION, Fault.EXCUSED]
