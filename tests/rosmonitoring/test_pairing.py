"""Which input an answer answered: no verdict that another order of cause contradicts; every publication is counted."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault, Tally
from avow.base.verdict import Verdict
from avow.system.plan import System

from .conftest import job_for

RCL = """
context { Level : {low, high}; }
node n {
  inputs( r : REAL )
  outputs( s : Level )
  topics( m/R r matches(in.r), m/S s matches(out.s) )
  assume positive ( in.r >= 0 )
  guarantee low ( in.r < 10 -> out.s == low )
  guarantee high ( in.r >= 10 -> out.s == high )
}
"""
MAPPING = {"in.r": "value", "out.s": "level"}
LATENCY = {"latency": "20 ms", "jitter": "5 ms", "because": "measured"}
KEY = {"by": "key", "input": "id", "output": "id"}
Event = dict[str, Any]


def judge(system: System, events: list[Event]) -> tuple[list[Any], dict[str, Tally]]:
    found, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert faults == ()
    monitor = Monitor(found)
    violations = [v for event in events for v in monitor.step(event)] + monitor.finish()
    return violations, monitor.tallies


def run(rng: random.Random, wrong: frozenset[int] = frozenset(), count: int = 60) -> list[Event]:
    """A node that answers every reading after 5 to 15 ms; each topic's messages are recorded up to 5 ms late."""
    events: list[tuple[float, Event]] = []
    for k in range(count):
        at = k * 0.1
        value = rng.choice((1, 5, 12, 40))
        answer = at + rng.uniform(0.005, 0.015)
        level = "high" if (value >= 10) is not (k in wrong) else "low"
        for when, event in (
            (at + rng.uniform(0, 0.005), {"topic": "r", "value": value, "id": k}),
            (answer + rng.uniform(0, 0.005), {"topic": "s", "level": level, "id": k}),
        ):
            events.append((when, {**event, "time": round(when, 6)}))
    return [event for _, event in sorted(events, key=lambda one: one[0])]


@pytest.mark.parametrize("seed", range(5))
def test_by_key_every_wrong_answer_is_found(seed: int, make_system: Callable[..., System]) -> None:
    wrong = frozenset({3, 17, 44})
    events = run(random.Random(seed), wrong)
    random.Random(seed).shuffle(events)  # the order of arrival says nothing
    violations, _ = judge(make_system(RCL, MAPPING, answers=KEY), events)
    ids = {events[v.index - 1]["id"] for v in violations}
    assert ids == wrong
    assert {v.fault for v in violations} == {Fault.GUARANTEE}


@pytest.mark.parametrize("seed", range(20))
def test_by_latency_the_verdicts_are_those_of_all_combinations(seed: int, make_system: Callable[..., System]) -> None:
    """Against brute force, with readings so frequent that windows hold several."""
    rng = random.Random(seed)
    events: list[Event] = []
    at = 0.0
    for _ in range(80):
        at = round(at + rng.choice((0.001, 0.004, 0.01, 0.03)), 6)
        topic = rng.choice("rrs")
        body = {"value": rng.choice((1, 12))} if topic == "r" else {"level": rng.choice(("low", "high"))}
        events.append({"topic": topic, "time": at, **body})
    violations, tallies = judge(make_system(RCL, MAPPING, answers=LATENCY), events)
    expected = {"held": 0, "broken": set(), "open": 0}
    latency, jitter = Fraction("0.02"), Fraction("0.005")
    for index, event in enumerate(events, start=1):
        if event["topic"] != "s":
            continue
        when = Fraction(str(event["time"]))
        values: list[int] = []
        before = False
        for other in events:
            if other["topic"] == "r" and (t := Fraction(str(other["time"]))) <= when + jitter:
                if t <= when - latency - jitter:
                    values, before = [other["value"]], True
                else:
                    values.append(other["value"])
        if not values or not before:
            expected["open"] += 1
            continue
        verdicts = {v >= 10 or event["level"] == "low" for v in values}
        if verdicts == {True}:
            expected["held"] += 1
        elif verdicts == {False}:
            expected["broken"].add(index)
        else:
            expected["open"] += 1
    low = tallies["low"]
    assert {v.index for v in violations if v.clause == "low"} == expected["broken"]
    assert low.decided - low.broken == expected["held"]
    assert low.order + low.early == expected["open"]


@pytest.mark.parametrize("seed", range(8))
def test_by_latency_a_trace_out_of_order_is_judged_as_in_order_or_not_at_all(
    seed: int, make_system: Callable[..., System]
) -> None:
    """Lines moved a little, or far."""
    rng = random.Random(seed)
    events = run(rng, frozenset(rng.sample(range(60), 8)))
    reach = 10.0 ** rng.uniform(-3, 1)
    moved = sorted(events, key=lambda event: float(event["time"]) + rng.uniform(0, reach))
    answers = {"latency": "10 ms", "jitter": "10 ms", "because": "measured"}
    found: list[Any] = []
    for trace in (events, moved):
        system = make_system(RCL, MAPPING, answers=answers)
        made, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
        assert not faults
        monitor = Monitor(made)
        violations = [v for event in trace for v in monitor.step(event)] + monitor.finish()
        about = {
            name: (t.judged, t.broken) for name, t in monitor.tallies.items() if not t.unpaired and name != "positive"
        }
        found.append((sorted((v.clause, v.time) for v in violations if v.clause in about), about, monitor.backwards))
    assert not found[0][2]
    assert found[1][2] or found[1][:2] == found[0][:2]


def test_by_stamp(make_system: Callable[..., System]) -> None:
    def stamped(topic: str, seconds: int, **fields: Any) -> Event:
        return {"topic": topic, "header": {"stamp": {"sec": seconds, "nanosec": 5}}, "time": 1, **fields}

    events = [stamped("s", 1, level="high"), stamped("r", 2, value=1), stamped("r", 1, value=12)]
    violations, tallies = judge(make_system(RCL, MAPPING, answers={"by": "stamp"}), events)
    assert violations == []
    assert (tallies["high"].decided, tallies["high"].order) == (1, 0)
    events.append(stamped("s", 3, level="high"))
    _, tallies = judge(make_system(RCL, MAPPING, answers={"by": "stamp"}), events)
    assert (tallies["high"].decided, tallies["high"].order) == (1, 1)
    assert "has the answer's stamp" in tallies["high"].reason


LOOPED = f"""{RCL}
node m {{
  inputs( s : Level )
  outputs( r : REAL )
  topics( m/S s matches(in.s), m/R r matches(out.r) )
  guarantee any ( TRUE )
}}
"""


@pytest.mark.parametrize("clause", ["", "guarantee ever ( once(in.r < 10) -> TRUE )"])
@pytest.mark.parametrize("connection", [["m.r", "n.r", "0"], ["n.s", "m.s", "low"], None])
def test_in_a_loop_an_answer_is_not_paired_with_what_was_made_from_it(
    clause: str, connection: list[str] | None, make_system: Callable[..., System]
) -> None:
    rcl = LOOPED.replace("  guarantee high", f"  {clause}\n  guarantee high")
    keys = ("from", "to", "initial")
    told = [{**dict(zip(keys, connection, strict=True)), "delayed": True}] if connection else []
    for topics, judged in (("sr", 0), ("rs", 20)):
        events = [
            {"topic": topic, "time": k + at / 100, "id": k, "value": 12, "level": "low"}
            for k in range(20)
            for at, topic in enumerate(topics)
        ]
        violations, tallies = judge(make_system(rcl, MAPPING, answers=KEY, plan={"connections": told}), events)
        assert (tallies["high"].decided, len(violations)) == (judged, judged)


@given(st.lists(st.tuples(st.sampled_from("rsx"), st.sampled_from((1, 12, "?")), st.integers(0, 40)), max_size=40))
def test_every_publication_is_counted_once(steps: list[tuple[str, Any, int]]) -> None:
    events: list[Event] = []
    at = 0
    for topic, value, pause in steps:
        at += pause
        level = {1: "low", 12: "high", "?": "?"}[value]
        events.append({"topic": topic, "time": at / 1000, "value": value, "level": level, "id": at})
    for answers in (None, LATENCY, KEY):
        system = _SYSTEMS[json.dumps(answers)]
        _, tallies = judge(system, events)
        published = sum(topic == "s" for topic, _, _ in steps)
        for name in ("low", "high"):
            t = tallies[name]
            held = t.decided - t.broken
            assert t.published == published
            assert t.partial == 0
            assert held + t.broken + t.undecided + t.order + t.early + t.unreadable == published


_SYSTEMS: dict[str, System] = {}


@pytest.fixture(autouse=True)
def _systems(make_system: Callable[..., System], request: pytest.FixtureRequest) -> None:
    if request.node.name == "test_every_publication_is_counted_once":
        for answers in (None, LATENCY, KEY):
            more = {} if answers is None else {"answers": answers}
            _SYSTEMS[json.dumps(answers)] = make_system(RCL, MAPPING, **more)


def discharge(system: System, tmp_path: Path) -> dict[str, Any]:
    job = job_for(system, "n")
    report = BACKEND.discharge(job, tmp_path, Limits())
    return {o.name: outcome for o, outcome in zip(job.obligations, report.outcomes, strict=True)}


def traced(make: Callable[..., System], events: list[Event], **more: Any) -> System:
    system = make(RCL, MAPPING, traces=["t.jsonl"], **more)
    text = "".join(json.dumps({"time": k, **event}) + "\n" for k, event in enumerate(events))
    (system.plan.root / "t.jsonl").write_text(text, encoding="utf-8")
    return system


GOOD = [{"topic": "r", "value": 1}, {"topic": "s", "level": "low"}]
BAD = [{"topic": "r", "value": 1}, {"topic": "s", "level": "high"}]


def test_without_answers_nothing_is_evidence(make_system: Callable[..., System], tmp_path: Path) -> None:
    for events in (GOOD, BAD):
        found = discharge(traced(make_system, events, answers=None), tmp_path)
        assert found["low"].verdict is Verdict.UNKNOWN
        assert "which input an answer answered" in found["low"].summary
    assert discharge(traced(make_system, GOOD), tmp_path)["low"].verdict is Verdict.MONITORED
    assert discharge(traced(make_system, BAD), tmp_path)["low"].verdict is Verdict.REFUTED


def test_a_run_of_which_little_was_decided_is_no_evidence(make_system: Callable[..., System], tmp_path: Path) -> None:
    late = [{"topic": "s", "level": "low"}] * 200 + GOOD
    found = discharge(traced(make_system, late), tmp_path)["low"]
    assert found.verdict is Verdict.UNKNOWN
    assert "1 of 201 publications" in found.summary
    assert "before the first value 200" in found.summary
    assert discharge(traced(make_system, late, decided=0.001), tmp_path)["low"].verdict is Verdict.MONITORED


# -- by order ----------------------------------------------------------------------------------------------------------

ORDER = {"by": "order", "because": "every link stood before the first message"}


def shuffled(rng: random.Random, wrong: frozenset[int]) -> list[Event]:
    """As `run`, with a recorder that may write an answer long before its input: each topic stays in its own order."""
    events = run(rng, wrong)
    queues = {topic: [e for e in events if e["topic"] == topic] for topic in ("r", "s")}
    found: list[Event] = []
    while any(queues.values()):
        topic = rng.choice([name for name, left in queues.items() if left])
        found.append({**queues[topic].pop(0), "time": len(found) / 10**5})
    return found


@pytest.mark.parametrize("seed", range(5))
def test_the_kth_answer_is_held_against_the_kth_input(seed: int, make_system: Callable[..., System]) -> None:
    rng = random.Random(seed)
    wrong = frozenset(rng.sample(range(60), 3))
    events = shuffled(rng, wrong)
    violations, tallies = judge(make_system(RCL, MAPPING, answers=ORDER), events)
    answers = [index for index, event in enumerate(events, start=1) if event["topic"] == "s"]
    assert sorted({v.index for v in violations}) == [answers[k] for k in sorted(wrong)]
    assert all(v.fault is Fault.GUARANTEE for v in violations)
    assert all(tally.decided == 60 for name, tally in tallies.items() if name != "positive")


MEMORY = """
node n {
  inputs( r : REAL, last : REAL )
  outputs( s : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 s matches(out.s) )
  guarantee same ( out.s == in.r or (in.last > 1000) )
}
"""


@pytest.mark.parametrize("initial", [{}, {"initial": 0}])
@pytest.mark.parametrize("seed", range(4))
def test_an_answer_that_is_not_judged_is_counted(
    seed: int, initial: dict[str, Any], make_system: Callable[..., System]
) -> None:
    """The first, where the step before is not known: the second is still the answer to the second input."""
    rng = random.Random(seed)
    values = [float(rng.randrange(900)) for _ in range(30)]
    wrong = frozenset(rng.sample(range(1, 29), 3))
    events: list[Event] = []
    for k, value in enumerate(values):
        pair = [("r", value), ("s", value + 0.5 * (k in wrong))]
        for topic, told in reversed(pair) if k == 29 or rng.random() < 0.3 else pair:
            events.append({"topic": topic, "time": len(events) / 1000, "data": told})
    mapping = {"in.r": "data", "out.s": "data", "in.last": {"previous": "out.s", **initial}}
    violations, tallies = judge(make_system(MEMORY, mapping, answers=ORDER), events)
    answers = [index for index, event in enumerate(events, start=1) if event["topic"] == "s"]
    assert sorted(v.index for v in violations) == [answers[k] for k in sorted(wrong)]
    assert tallies["same"].early == (not initial)


@pytest.mark.parametrize(
    ("lost", "topic", "fine"),
    [(20, "r", False), (20, "s", False), (0, "r", False), (59, "r", False), (59, "s", True)],
)
def test_after_a_loss_order_tells_nothing(
    lost: int, topic: str, fine: bool, make_system: Callable[..., System], tmp_path: Path
) -> None:
    """But for the last answer, which the recording may have ended before."""
    events = [e for e in run(random.Random(1)) if (e["topic"], e["id"]) != (topic, lost)]
    trace = tmp_path / "run.jsonl"
    trace.write_text("".join(json.dumps(e) + "\n" for e in events), encoding="utf-8")
    running = session(make_system(RCL, MAPPING, answers=ORDER), (), trace)
    found = list(running.run(trace))
    assert ([*running.unmonitored()] == []) is fine
    assert found == []
    if not fine:
        assert "their order does not show which belong together" in running.monitors[0].backwards


@pytest.mark.parametrize(("again", "evidence"), [(5, True), (12, False)])
def test_a_key_that_comes_again_with_another_value_once_it_was_answered_is_no_evidence(
    again: int, evidence: bool, make_system: Callable[..., System], tmp_path: Path
) -> None:
    said = [("r", {"value": 5}), ("s", {"level": "low"}), ("r", {"value": again})]
    events = [{"topic": topic, "time": k, "id": 1, **fields} for k, (topic, fields) in enumerate(said)]
    trace = tmp_path / "run.jsonl"
    trace.write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
    running = session(make_system(RCL, MAPPING, answers=KEY))
    assert list(running.run(trace)) == []
    assert bool([*running.unmonitored()]) is not evidence


REMEMBERS = RCL.replace("guarantee low", "guarantee same ( once(in.r < 10) or out.s == high )\n  guarantee low")


@pytest.mark.parametrize("text", [RCL, REMEMBERS], ids=["pairs", "steps"])
@pytest.mark.parametrize(
    ("inputs", "answered", "missing"),
    [
        ([1, 12, 12, 12, 1], [0, 3], 2),  # the last may have its answer later
        ([1, 12, 12], [0, 1, 2], 0),
        ([1, 12, 12], [2, 1], 1),  # an answer that comes late is one
        ([1, 12], [], 0),
        ([1, 12, 1, 1], [0, 3, 3], 2),
    ],
)
def test_inputs_without_an_answer_are_counted(
    inputs: list[int], answered: list[int], missing: int, text: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    events: list[Event] = [{"topic": "r", "time": k, "value": r, "id": k} for k, r in enumerate(inputs)]
    events += [
        {"topic": "s", "time": 10 + k, "level": "low" if inputs[of] < 10 else "high", "id": of}
        for k, of in enumerate(answered)
    ]
    system = make_system(text, MAPPING, answers=KEY, traces=["t.jsonl"])
    if text is RCL:
        violations, tallies = judge(system, events)
        assert violations == []
        assert {name: tallies[name].unanswered for name in ("low", "high")} == dict.fromkeys(("low", "high"), missing)
    elif answered == sorted(set(answered)):
        assert judge(system, events)[1]["same"].unanswered == missing
    if text is RCL and answered:
        (system.plan.root / "t.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events))
        found = BACKEND.discharge(job_for(system, "n"), tmp_path / "made", Limits()).outcomes[0]
        assert found.verdict is Verdict.MONITORED
        assert found.bound.get("unanswered") == (missing or None)
        assert ("inputs without an answer" in found.summary) is bool(missing)


@pytest.mark.parametrize(("last", "answered", "open_"), [(12, False, 1), (12, True, 0), (1, False, 0)])
def test_by_arrival_a_trace_that_ends_with_an_unanswered_condition_is_open(
    last: int, answered: bool, open_: int, make_system: Callable[..., System]
) -> None:
    events: list[Event] = [
        {"topic": "r", "time": 0, "value": 12},
        {"topic": "s", "time": 1, "level": "high"},
        *({"topic": "r", "time": 2 + k, "value": last} for k in range(3)),
        *([{"topic": "s", "time": 9, "level": "high"}] if answered else ()),
    ]
    violations, tallies = judge(make_system(RCL, MAPPING, answers={"by": "arrival", "because": "one process"}), events)
    assert violations == []
    assert tallies["high"].open == open_


def test_an_input_that_breaks_an_assumption_needs_no_answer(make_system: Callable[..., System]) -> None:
    events: list[Event] = [{"topic": "r", "time": k, "value": r, "id": k} for k, r in enumerate((1, -1, 1))]
    events.append({"topic": "s", "time": 9, "level": "low", "id": 2})
    violations, tallies = judge(make_system(RCL, MAPPING, answers=KEY), events)
    assert [v.fault for v in violations] == [Fault.ASSUMPTION]
    assert tallies["low"].unanswered == 1


BESIDE = """
node n {
  inputs( hold : BOOL, speed : REAL )
  outputs( held : BOOL, motor : REAL )
  topics( std_srvs/SetBool_Request stop matches(in.hold), std_srvs/SetBool_Response stop matches(out.held),
          float64 speed matches(in.speed), float64 motor matches(out.motor) )
  assume slow ( in.speed < 40 )
  guarantee obeyed ( out.held <=> in.hold )
  guarantee taken ( out.held -> in.hold and in.speed < 10 )
  guarantee still ( in.hold -> out.motor == 0 )
}
"""
FIELDS = {"in.hold": "data", "out.held": "success", "in.speed": "data", "out.motor": "data"}
OTHERS = {"by": "call", "others": LATENCY}
TRUE = {
    "obeyed": lambda v: v["out.held"] == v["in.hold"],
    "taken": lambda v: not v["out.held"] or (v["in.hold"] and v["in.speed"] < 10),
    "still": lambda v: not v["in.hold"] or v["out.motor"] == 0,
}


@pytest.mark.parametrize("seed", range(20))
def test_a_request_is_paired_by_its_call_and_a_state_beside_it_by_latency(
    seed: int, make_system: Callable[..., System]
) -> None:
    """Against brute force over the request of the answer's call, and over every value that a state may have had."""
    rng = random.Random(seed)
    events: list[Event] = [
        {"topic": "/stop/_request", "data": False, "_call": "c0", "time": 0.0},
        {"topic": "speed", "data": 1.0, "time": 0.0},
    ]
    at, open_calls, number = 0.1, [], 0
    for _ in range(120):
        at = round(at + rng.choice((0.001, 0.004, 0.01, 0.03)), 6)
        match rng.choice("qqsmr"):
            case "q":
                number += 1
                open_calls.append((f"c{number}", rng.random() < 0.5))
                event = {"topic": "/stop/_request", "data": open_calls[-1][1], "_call": f"c{number}"}
            case "r" if open_calls:
                call, hold = open_calls.pop(rng.randrange(len(open_calls)))
                event = {"topic": "/stop/_response", "success": hold is not (rng.random() < 0.2), "_call": call}
            case "m":
                event = {"topic": "motor", "data": rng.choice((0.0, 3.0))}
            case _:
                event = {"topic": "speed", "data": rng.choice((1.0, 5.0, 20.0, 50.0))}
        events.append({**event, "time": at})
    violations, tallies = judge(make_system(BESIDE, FIELDS, answers=OTHERS), events)

    def around(topic: str, when: Fraction) -> list[Any]:
        times = [(Fraction(str(e["time"])), e["data"]) for e in events if e["topic"] == topic]
        start, end = when - Fraction("0.025"), when + Fraction("0.005")
        before = [value for time, value in times if time <= start]
        return before[-1:] + [value for time, value in times if start < time <= end]

    for name, topic in (("obeyed", "/stop/_response"), ("taken", "/stop/_response"), ("still", "motor")):
        broken, judged = set(), 0
        for index, event in enumerate(events, start=1):
            if event["topic"] != topic:
                continue
            when, call = Fraction(str(event["time"])), event.get("_call")
            asked = [e["data"] for e in events if call and e["topic"] == "/stop/_request" and e["_call"] == call]
            cases = [
                {"in.hold": h, "in.speed": s, "out.held": event.get("success"), "out.motor": event.get("data")}
                for h in asked or around("/stop/_request", when)
                for s in around("speed", when)
            ]
            found = {"held" if TRUE[name](c) else "excused" if c["in.speed"] >= 40 else "broken" for c in cases}
            judged += len(found) == 1
            broken |= {index} if found in ({"broken"}, {"excused"}) else set()
        assert {v.index for v in violations if v.clause == name} == broken, name
        assert tallies[name].judged == judged, name


def test_without_a_way_for_a_state_beside_a_service_the_plan_is_told(make_system: Callable[..., System]) -> None:
    system = make_system(BESIDE, FIELDS, answers={"by": "call"})
    found, _ = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert found.unmarked({"in.hold", "out.held"}, typed=True) == ""
    told = found.unmarked({"in.speed", "in.hold", "out.held"}, typed=True)
    assert told.startswith("in.speed is part of no call: pair the others by latency")


@pytest.mark.parametrize("by", ["order", "key", "call"])
def test_an_answer_before_its_input_is_undecided(by: str, make_system: Callable[..., System]) -> None:
    """Seeded fault: a publication at the start and a recording that is cut early shift the pairs by one."""
    topics = ["s", "r", "s", "r"]
    times = ["0.990", "1", "1.1", "5"]  # the first within `jitter`, the second not
    events: list[Event] = [
        {"topic": topic, "time": float(time), "id": k // 2, "_call": k // 2, "value": 1, "level": "low"}
        for k, (topic, time) in enumerate(zip(topics, times, strict=True))
    ]
    answers = {"order": ORDER, "key": KEY}.get(by, {"by": by})
    violations, tallies = judge(make_system(RCL, MAPPING, answers=answers), events)
    assert not violations
    assert (tallies["low"].decided, tallies["low"].order, tallies["low"].ages) == (1, 1, {})
    assert "came before its input" in tallies["low"].reason
