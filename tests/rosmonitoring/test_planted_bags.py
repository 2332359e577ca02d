"""Bags of all three forms, with nodes at rates of their own, a message type of their own, and one fault each: it is
found at its event and blamed on whose it is; of bags without one nothing is told."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault
from avow.system.load import load_system
from avow.system.plan import System

from .conftest import one_by_one

pytest.importorskip("rosbags")

RATE = "std_msgs/Header header\nfloat32 value\nuint8 LOW=0\nuint8 HIGH=2\nuint8 level\n"
RCL = """
context { Level : {low, high}; }
node sensor {
  inputs( r : REAL )
  outputs( value : REAL, level : Level )
  topics( lab_msgs/Rate /geiger matches(in.r), lab_msgs/Rate /rate matches(out.value),
          lab_msgs/Rate /rate matches(out.level) )
  assume positive ( in.r >= 0 )
  guarantee same ( out.value == in.r )
  guarantee label ( out.level == high <=> in.r >= 50 )
  guarantee nonneg ( out.value >= 0 )
}
node guard {
  inputs( value : REAL )
  outputs( slow : BOOL )
  topics( lab_msgs/Rate /rate matches(in.value), lab_msgs/Stop /guard/stop matches(out.slow) )
  assume nonneg ( in.value >= 0 )
  guarantee stops ( out.slow <=> in.value >= 50 )
}
"""
METHODS = {
    "sensor": {"in.r": "value", "out.value": "value", "out.level": "level"},
    "guard": {"in.value": "value", "out.slow": "stop"},
}
FAULTS = ("none", "value", "label", "stop", "negative", "environment", "nan", "inf", "silence", "jump", "lost", "twice")
Said = tuple[float, str, dict[str, Any], int]
"""When, on which topic, what, and with which number."""


def make(folder: Path, form: str) -> System:
    (folder / "msgs/lab_msgs/msg").mkdir(parents=True, exist_ok=True)
    (folder / "msgs/lab_msgs/msg/Rate.msg").write_text(RATE, encoding="utf-8")
    (folder / "msgs/lab_msgs/msg/Stop.msg").write_text("std_msgs/Header header\nbool stop\n", encoding="utf-8")
    (folder / "s.rcl").write_text(RCL, encoding="utf-8")
    nodes = {}
    for (name, mapping), fresh in zip(METHODS.items(), ("in.r", "in.value"), strict=True):
        options = {"answers": {"by": "stamp"}, "fresh": {fresh: "2 s"}, "mapping": mapping}
        nodes[name] = {"methods": [{"rosmonitoring": options}]}
    plan = {"messages": ["msgs"], "ros": {"distro": "noetic" if form == "ros1" else "humble"}, "nodes": nodes}
    (folder / "plan.yaml").write_text(json.dumps(plan), encoding="utf-8")
    return load_system(folder)


def run(rng: random.Random, fault: str, length: int) -> tuple[list[Said], int]:
    """The messages in the order of their times, and the number of the message at fault."""
    when = rng.randint(length // 3, length // 2)
    said: list[Said] = []
    ahead, wrong = 0.0, -1
    for k in range(length):
        time = k / 50 + ahead
        value = float(rng.choice((rng.randint(0, 49), rng.randint(50, 99))))
        if k == when:
            value = {"environment": -3.0, "nan": float("nan"), "inf": float("inf")}.get(fault, value)
            ahead += {"jump": 60.0, "silence": 3.0}.get(fault, 0.0)
            time += ahead
        told = {"value": value, "level": 2 if value >= 50 else 0}
        slow = value >= 50
        if k == when:
            if fault in ("environment", "nan", "inf", "silence", "jump", "lost", "twice"):
                wrong = 3 * k
            elif fault == "stop":
                slow, wrong = not slow, 3 * k + 2
            elif fault != "none":
                change = {"value": {"value": value + 1}, "label": {"level": 2 - told["level"]}}
                told |= change.get(fault, {"value": -value - 1})
                wrong = 3 * k + 1
                slow = told["value"] >= 50
        said.append((time, "/geiger", {"value": value, "level": 0}, 3 * k))
        said.append((time + rng.uniform(-0.002, 0.004), "/rate", told, 3 * k + 1))
        if k % 5 == 0 or k == when:  # it has a rate of its own, and a delay
            said.append((time + rng.uniform(0.0, 0.03), "/guard/stop", {"stop": slow}, 3 * k + 2))
    if fault == "lost":
        said = [one for one in said if one[3] != 3 * when + 1]
    if fault == "twice":
        said += [(time + 0.001, *rest) for time, *rest in said if rest[-1] == 3 * when]  # type: ignore[misc]
    return sorted(said, key=lambda one: one[0]), wrong


def write(path: Path, form: str, said: list[Said]) -> Path:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(RATE, "lab_msgs/msg/Rate"))
    store.register(get_types_from_msg("std_msgs/Header header\nbool stop\n", "lab_msgs/msg/Stop"))
    types: Any = store.types
    kinds = {"/geiger": "lab_msgs/msg/Rate", "/rate": "lab_msgs/msg/Rate", "/guard/stop": "lab_msgs/msg/Stop"}

    def message(topic: str, what: dict[str, Any], number: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=number // 3, nanosec=7)
        more = {"seq": number // 3 if topic != "/guard/stop" else 0} if form == "ros1" else {}
        return types[kinds[topic]](header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **more), **what)

    if form == "ros1":
        path = path.with_suffix(".bag")
    writer: Any = Writer1(path) if form == "ros1" else Writer2(path, version=9, storage_plugin=StoragePlugin[form])
    with writer:
        open_ = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for time, topic, what, number in said:
            serialize = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
            raw = serialize(message(topic, what, number), kinds[topic])
            writer.write(open_[topic], int((time + 1) * 1e9), raw)
    return path


def expected(fault: str, at: int, said: list[Said]) -> Iterator[tuple[Fault, str, str, int]]:
    """What has to be told: the kind, the node, the clause, the event."""
    number = {which: k for k, (_, _, _, which) in enumerate(said, start=1)}
    event = number.get(at, 0)
    answer = number.get(at + 1, 0)
    match fault:
        case "value":
            yield Fault.GUARANTEE, "sensor", "same", event
        case "label":
            yield Fault.GUARANTEE, "sensor", "label", event
        case "stop":
            yield Fault.GUARANTEE, "guard", "stops", event
        case "negative":
            yield from ((Fault.GUARANTEE, "sensor", name, event) for name in ("same", "nonneg"))
            yield Fault.PROVIDER, "guard", "nonneg", event
        case "environment":
            yield Fault.ASSUMPTION, "sensor", "positive", event
            yield Fault.EXCUSED, "sensor", "nonneg", answer
            yield Fault.PROVIDER, "guard", "nonneg", answer
        case "nan" | "inf":
            yield Fault.MAPPING, "sensor", "in.r", event
            yield Fault.MAPPING, "sensor", "out.value", answer
            yield Fault.MAPPING, "guard", "in.value", answer
        case "silence" | "jump":
            first = min(event, answer)
            yield Fault.SILENT, "sensor", "in.r", first
            yield Fault.SILENT, "guard", "in.value", first
        case _:  # nothing is wrong
            return


@pytest.mark.parametrize(
    ("form", "fault", "seed"),
    some([(f, fault, s) for f in ("ros1", "SQLITE3", "MCAP") for s in range(3) for fault in FAULTS], 4, slow=25),
)
def test_a_fault_is_found_and_blamed_on_whose_it_is(tmp_path: Path, form: str, fault: str, seed: int) -> None:
    system = make(tmp_path, form)
    rng = random.Random(f"{form}{fault}{seed}")
    said, wrong = run(rng, fault, 60)
    bag = write(tmp_path / "run", form, said)
    running = session(system, (), bag)
    found = [violation for _, violation in running.run(bag)]
    assert {(v.fault, v.node, v.clause, v.index) for v in found} == set(expected(fault, wrong, said))
    followed = [v for v in found if v.fault is Fault.PROVIDER]
    for violation in followed:
        assert violation.cause.startswith("sensor.positive" if fault == "environment" else "sensor.")
    if fault in ("none", "value", "label", "stop", "negative", "environment"):
        assert all(tally.decided == tally.published for *_, tally in running.clauses())
    alone = session(system, (), bag)
    assert list(one_by_one(alone, bag)) == found
    assert alone.summary() == running.summary()


@pytest.mark.parametrize("form", [pytest.param(form, marks=pytest.mark.slow) for form in ("ros1", "SQLITE3")])
def test_nothing_is_told_of_a_long_clean_bag(tmp_path: Path, form: str) -> None:
    system = make(tmp_path, form)
    said, _ = run(random.Random(7), "none", 5_000)
    bag = write(tmp_path / "run", form, said)
    running = session(system, (), bag)
    assert [violation for _, violation in running.run(bag)] == []
    assert running.events == len(said)
    assert [*running.unmonitored()] == []
