"""On a running graph nothing orders the topics: a breach is told where no order makes it none."""

from __future__ import annotations

import itertools
import json
import random
from collections.abc import Callable
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest

from avow.backends.rosmonitoring.session import Session, session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.ros.bags import LIVE
from avow.system.plan import System

from .test_pairing import MAPPING, RCL, Event

Make = Callable[..., System]
TWO = """
node n {
  inputs( a : REAL, b : REAL )
  outputs( s : REAL )
  topics( m/A a matches(in.a), m/B b matches(in.b), m/S s matches(out.s) )
  assume alike ( in.a == in.b )
  guarantee small ( out.s <= 10 )
"""
VALUES = {"in.a": "value", "in.b": "value", "out.s": "value"}


def live(events: list[Event]) -> list[Event]:
    return [{**event, LIVE: True} for event in events]


def judge(running: Session, events: list[Event]) -> list[Violation]:
    return [v for event in events for v in running.step(event)] + list(running.finish())


def tally(running: Session, clause: str) -> Any:
    return running.monitors[0].tallies[clause]


def answered(rng: random.Random, late: float, wrong: frozenset[int] = frozenset()) -> list[Event]:
    """Readings that change every two seconds, each answered at once; each topic is heard up to so many seconds late."""
    said: list[tuple[float, Event]] = []
    last = {"r": 0.0, "s": 0.0}
    for k in range(100):
        high = k // 20 % 2 == 1
        for topic, fields in (
            ("r", {"value": 40 if high else 5}),
            ("s", {"level": "high" if high is not (k in wrong) else "low"}),
        ):
            last[topic] = max(last[topic], k * 0.1 + rng.uniform(0, late))  # of one topic, in order
            said.append((last[topic], {"topic": topic, "time": round(last[topic], 6), **fields}))
    return [event for _, event in sorted(said, key=lambda one: one[0])]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("answers", [{}, {"answers": None}])
def test_a_correct_node_is_never_called_broken(seed: int, answers: dict[str, Any], make_system: Make) -> None:
    events = answered(random.Random(seed), 0.4)
    system = make_system(RCL, MAPPING, **answers)
    assert Fault.GUARANTEE in {v.fault for v in judge(session(system), events)}
    running = session(system)
    assert judge(running, live(events)) == []
    counted = tally(running, "low")
    assert counted.order > 0
    assert counted.published == counted.judged + counted.order + counted.early == 100


@pytest.mark.parametrize("seed", range(5))
def test_what_is_broken_in_any_order_is_found_at_its_event(seed: int, make_system: Make) -> None:
    wrong = frozenset((10, 30, 50))  # a second from any change
    events = answered(random.Random(seed), 0.4, wrong)
    found = judge(session(make_system(RCL, MAPPING)), live(events))
    places = [k for k, event in enumerate(events, start=1) if event["topic"] == "s"]
    assert [(v.fault, v.index) for v in found] == [(Fault.GUARANTEE, places[k]) for k in sorted(wrong)]


def test_what_nothing_else_could_change_is_told_by_the_initial_value_and_by_one_topic(make_system: Make) -> None:
    mapping = {**MAPPING, "in.r": {"field": "value", "initial": 40}}
    running = session(make_system(RCL, mapping))
    found = judge(running, live([{"topic": "s", "time": 1, "level": "low"}]))
    assert [v.clause for v in found] == ["high"]
    running = session(make_system(TWO.replace("assume alike ( in.a == in.b )", "") + "}", VALUES))
    event = {"topic": "s", "time": 1, "value": 11, LIVE: True}
    assert [v.clause for v in running.step(event)] == ["small"]  # at once


def test_an_assumption_about_two_topics_waits_too(make_system: Make) -> None:
    events = [{"topic": topic, "time": k, "value": k} for k in (1, 2) for topic in "ab"]
    running = session(make_system(TWO + "}", VALUES))
    assert judge(running, live(events)) == []
    assert tally(running, "alike").order == 1
    found = judge(session(make_system(TWO + "}", VALUES)), live([*events, {"topic": "b", "time": 4, "value": 7}]))
    assert [(v.fault, v.clause, v.index) for v in found] == [(Fault.ASSUMPTION, "alike", 5)]


@pytest.mark.parametrize("b", [5, 6])
def test_what_only_an_assumption_speaks_of_may_be_said_for_the_first_time_at_a_breach(
    b: int, make_system: Make
) -> None:
    """The node is wrong at 1 s. It is excused where the assumption was known by then, and broken."""
    system = make_system(TWO + "}", VALUES)
    for first in itertools.product([0.2, 0.9, 1.0001, 1.3, 3, None], repeat=2):
        said = [(1.0, "s", 11), *((time, topic, value) for time, topic, value in zip(first, "ab", (5, b), strict=True))]
        events = [{"topic": topic, "time": time, "value": value} for time, topic, value in said if time is not None]
        running = session(system)
        found = [v.fault for v in judge(running, live(sorted(events, key=itemgetter("time")))) if v.clause == "small"]
        may_be_known = all(time is not None and time <= 1.5 for time in first)
        surely_known = all(time is not None and time <= 0.5 for time in first)
        if b == 5 or not may_be_known:
            assert found == [Fault.GUARANTEE], first
        else:
            assert found == ([Fault.EXCUSED] if surely_known else []), first
        assert tally(running, "small").order == (not found)


def test_what_only_an_assumption_speaks_of_excuses_nobody_where_it_cannot_be_read(make_system: Make) -> None:
    """As of a recorded run; where a value that can be read may have been there instead, it counts, too."""
    system, breach = make_system(TWO + "}", VALUES), {"topic": "s", "time": 2.0, "value": 11}
    odd, b = {"topic": "a", "time": 0.2, "value": "x"}, {"topic": "b", "time": 0.2, "value": 5}
    for more, known in (({}, True), ({"value": 5}, True), ({"value": 6}, False)):
        said = [odd, b, breach, {"topic": "a", "time": 2.1, **more}, {"topic": "b", "time": 4.0, "value": 5}]
        for events in (said, live(said)) if known else (live(said),):
            running = session(system)
            found = [(v.fault, v.index) for v in judge(running, events) if v.clause == "small"]
            assert found == ([(Fault.GUARANTEE, 3)] if known else [])
            assert tally(running, "small").order == (not known)


def test_memory_of_several_topics_is_undecided_and_that_of_one_is_told(make_system: Make) -> None:
    more = "  guarantee follows ( previous(in.a, 0) >= 5 -> out.s >= 5 )\n"
    more += "  guarantee grows ( out.s >= previous(out.s, 0) )\n}"
    running = session(make_system(TWO.replace("assume alike ( in.a == in.b )", "") + more, VALUES))
    events = [{"topic": t, "time": k, "value": v} for k, (t, v) in enumerate([("a", 7), ("s", 6), ("s", 4)], 1)]
    assert [v.clause for v in judge(running, live(events))] == ["grows"]
    assert tally(running, "follows").order == 1


def test_a_filter_withholds_at_once_what_is_told_later(make_system: Make) -> None:
    running = session(make_system(RCL, MAPPING, filter=["out.s"]))
    events = [(0.0, "r", 40), (2.0, "s", "low"), (2.1, "s", "high"), (2.6, "s", "high"), (2.7, "s", "high")]
    passed = []
    found = []
    for time, topic, value in events:
        event = {LIVE: True, "topic": topic, "time": time, "value" if topic == "r" else "level": value}
        if topic == "r":
            found += list(running.step(event))
            continue
        told, on = running.offer(event)
        found += told
        passed.append(on is event)
    assert passed == [False, True, True, True]
    assert [(v.fault, v.index) for v in found] == [(Fault.GUARANTEE, 2)]


@pytest.mark.parametrize("seed", range(3))
def test_a_record_is_judged_as_it_was_live(seed: int, make_system: Make, tmp_path: Path) -> None:
    """Also where what came before it, in one file, was written in order."""
    events, system = answered(random.Random(seed), 0.4, frozenset((10, 30))), make_system(RCL, MAPPING)
    found = [(v.clause, v.index) for v in judge(session(system), live(events))]
    assert len(found) == 2
    record = tmp_path / "run.jsonl"

    def judged(lines: list[Event]) -> tuple[list[tuple[str, int]], int]:
        record.write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")
        running = session(system)
        return [(v.clause, v.index) for _, v in running.run(record)], tally(running, "low").order

    again, open_ = judged(live(events))
    assert again == found
    assert open_ > 0
    before = answered(random.Random(seed), 0)
    later = [{**event, "time": event["time"] + 100} for event in events]
    assert judged(before + live(later))[0] == [(clause, index + len(before)) for clause, index in found]
