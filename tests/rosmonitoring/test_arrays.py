"""Arrays and raw messages are judged as the engine judges each of their events."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from avow.backends.rosmonitoring.batch import Batch, of_arrays, of_messages
from avow.backends.rosmonitoring.columns import Columns
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.traces import read_trace
from avow.backends.rosmonitoring.watched import Tally
from avow.ros.bags import recorded
from avow.system.plan import System
from rosmonitoring.test_columns import Counting, setup_of

pytest.importorskip("rosbags")

RCL = """
context {{ Level : {{low, high}}; }}
node n {{
  inputs( r : REAL )
  outputs( s : REAL, m : Level )
  topics( sensor_msgs/Temperature /r matches(in.r), sensor_msgs/Range /s matches(out.s),
          std_msgs/UInt8 /m matches(out.m) )
  {assumed}
  guarantee g ( {g} )
  guarantee alone ( {alone} )
  guarantee level ( {level} )
}}
"""
MAPPING = {
    "in.r": "temperature",
    "out.s": "range",
    "out.m": {"field": "data", "values": {"0": "low", "1": "high"}},
}
ANSWERS: dict[str, dict[str, Any]] = {
    "arrival": {"by": "arrival", "because": "one process"},
    "stamp": {"by": "stamp"},
    "order": {"by": "order", "because": "every link stood"},
    "latency": {"latency": "20 ms", "jitter": "5 ms", "because": "measured"},
}
NUMBERS = (0.1, 2.5, -3.0, 100.0)


def formula(rng: random.Random) -> str:
    def atom(name: str) -> str:
        return f"{name} {rng.choice(('<', '<=', '>=', '>', '==', '!='))} {rng.choice(NUMBERS)}"

    both = [f"{atom('in.r')} -> {atom('out.s')}", f"{atom('in.r')} or {atom('out.s')} or {atom('out.s')}"]
    return rng.choice([*both, *both, "out.s + in.r <= 104", "not (in.r < 2.5 and out.s > 100)"])


def number(rng: random.Random) -> float:
    near = rng.choice(NUMBERS)
    choices = (near, math.nextafter(near, 9e9), math.nextafter(near, -9e9), rng.uniform(-5, 110), rng.uniform(-5, 3))
    return rng.choice(choices) if rng.random() < 0.99 else rng.choice((math.nan, math.inf, -math.inf, 1e39))


def flow(rng: random.Random, count: int) -> Iterator[tuple[str, int, Mapping[str, Any]]]:
    """(topic, time in nanoseconds, fields) in the order of time; some stamps are missing, doubled, or late."""
    clock = 10**9
    for k in range(count):
        stamp = {"sec": k, "nanosec": rng.choice((0, 0, 0, 7))}
        for topic in ("r", "s", "m"):
            if rng.random() < 0.97:
                clock += rng.choice((0, 10**6, 10**7, 2 * 10**7))
                if topic == "m":
                    yield "/m", clock, {"data": rng.choice((0, 0, 1, 1, 1, 2 * (rng.random() < 0.05)))}
                else:
                    field = "temperature" if topic == "r" else "range"
                    yield f"/{topic}", clock, {"stamp": stamp, field: number(rng)}


def arrays_of(events: list[tuple[str, int, Mapping[str, Any]]]) -> dict[str, dict[str, Any]]:
    topics: dict[str, dict[str, Any]] = {}
    for topic in ("/r", "/s", "/m"):
        some = [(time, fields) for of, time, fields in events if of == topic]
        topics[topic] = {"time": np.array([time / 1e9 for time, _ in some])}
        for name, form in (("temperature", "f8"), ("range", "f4"), ("data", "u1")):
            if some and name in some[0][1]:
                with np.errstate(over="ignore"):
                    topics[topic][name] = np.array([fields[name] for _, fields in some]).astype(form)
        if topic != "/m":
            for part in ("sec", "nanosec"):
                topics[topic][f"header.stamp.{part}"] = np.array([fields["stamp"][part] for _, fields in some])
    return topics


def bag_of(path: Path, form: str, events: list[tuple[str, int, Mapping[str, Any]]], rng: random.Random) -> Path:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store: Any = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    path = path.with_suffix(".bag") if form == "ros1" else path
    kinds = {"/r": "sensor_msgs/msg/Temperature", "/s": "sensor_msgs/msg/Range", "/m": "std_msgs/msg/UInt8"}
    writer: Any = Writer1(path) if form == "ros1" else Writer2(path, version=9, storage_plugin=StoragePlugin[form])
    wordy, counts, lossy = rng.random() < 0.5, dict.fromkeys(kinds, 0), rng.random() < 0.2
    with writer:
        to = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for topic, time, fields in events:
            counts[topic] += 1 + (lossy and rng.random() < 0.02)
            name = "sensor" if not wordy or rng.random() < 0.9 else "s" * rng.randrange(9)
            if topic == "/m":
                message = store.types[kinds[topic]](fields["data"])
            else:
                stamp = store.types["builtin_interfaces/msg/Time"](**fields["stamp"])
                header = store.types["std_msgs/msg/Header"](*([counts[topic]] if form == "ros1" else []), stamp, name)
                parts = [fields["temperature"], 0.0] if topic == "/r" else [0, 0.0, 0.0, 0.0, fields["range"]]
                with np.errstate(over="ignore"):
                    parts[-1] = float(np.float32(parts[-1])) if topic == "/s" else parts[-1]
                count_of = len(store.fielddefs[kinds[topic]][1]) - 1 - len(parts)
                message = store.types[kinds[topic]](header, *parts, *([0.0] * count_of))
            serialize = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
            writer.write(to[topic], time, serialize(message, kinds[topic]))
    return path


def to_the_nanosecond(tallies: Mapping[str, Tally]) -> dict[str, Tally]:
    """Ages are shown to people only, and are differences of times in seconds."""
    return {n: replace(t, ages={k: round(age, 9) for k, age in t.ages.items()}) for n, t in tallies.items()}


def alike(system: System, batches: Iterator[Batch], events: list[Any]) -> tuple[int, int]:
    """The numbers of violations, and of events that were only counted."""
    found = setup_of(system)
    plain, fast = Monitor(found), Counting(found)
    Counting.steps = 0
    expected = [(k, v) for k, event in enumerate(events, start=1) for v in plain.step(event, k)]
    got = [(line, v) for line, several in Columns([fast]).batches(batches) for v in several]
    assert got == expected
    assert fast.finish() == plain.finish()
    assert to_the_nanosecond(fast.tallies) == to_the_nanosecond(plain.tallies)
    assert (fast.events, fast.backwards, fast.values) == (plain.events, plain.backwards, plain.values)
    assert fast.timing.passages == plain.timing.passages
    if plain.pairing is not None and fast.pairing is not None:
        assert {**fast.pairing.answered} == {**plain.pairing.answered}
    return len(got), fast.events - Counting.steps


@pytest.mark.slow
@pytest.mark.parametrize("answers", [*ANSWERS])
@pytest.mark.parametrize("form", ["arrays", "ros1", "SQLITE3", "MCAP"])
def test_random_contracts_and_traces_are_judged_alike(
    form: str, answers: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    rng = random.Random(form + answers)
    broken = quiet = 0
    for at in range(6):
        assumed = rng.choice(("", "assume a ( in.r <= 100 )"))
        level = rng.choice(("out.m == high or out.m == low", "out.m == high"))
        alone = rng.choice(("out.s <= 100", "out.s != 0.1"))
        text = RCL.format(assumed=assumed, g=formula(rng), alone=alone, level=level)
        gaps = rng.choice(({}, {"nan": "none", "inf": "none", "elsewhere": 3}))
        mapping = {**MAPPING, "in.r": {"field": "temperature", **gaps}}
        distro = "noetic" if form == "ros1" else "humble"
        system = make_system(text, mapping, answers=ANSWERS[answers], plan={"ros": {"distro": distro}})
        events = list(flow(rng, 150))
        if form == "arrays":
            topics = arrays_of(events)
            ordered = [batch.event(k) for batch in of_arrays(topics) for k in range(len(batch.times))]
            assert len(ordered) == len(events)
            found, passed = alike(system, of_arrays(topics), ordered)
        else:
            bag = bag_of(tmp_path / f"bag{at}", form, events, rng)
            ordered = [one.event for one in read_trace(bag)]
            found, passed = alike(system, of_messages(recorded(bag)), ordered)
        broken += found
        quiet += passed
    assert broken > 20
    assert quiet > 100


def test_a_session_judges_arrays(make_system: Callable[..., System]) -> None:
    text = RCL.format(assumed="", g="in.r >= 0 -> out.s <= 2.5", alone="out.s >= 0", level="out.m == high")
    system = make_system(text, MAPPING, answers=ANSWERS["arrival"], plan={"ros": {"distro": "humble"}})
    running = session(system)
    times = np.arange(1000) / 10
    readings = np.where(np.arange(1000) == 700, 3.0, 2.5)
    arrays = {"/r": {"time": times, "temperature": np.ones(1000)}, "/s": {"time": times + 0.01, "range": readings}}
    found = list(running.arrays(arrays))
    assert [(line, violation.clause, violation.index) for line, violation in found] == [(1402, "g", 1402)]
    assert running.events == 2000
    assert [clause["judged"] for clause in running.summary()["nodes"][0]["clauses"]] == [1000, 1000, 0]
