"""No false alarm: correct nodes at asynchronous rates, in every form of record and by every way to pair answers.

A sensor answers at 100 Hz, a guard at some 37 Hz, each after a few milliseconds; messages are recorded up to 5 ms late,
each topic by itself, so that answers come before what they answer, except where answers go by arrival. The nightly runs
have 10^6 events each.
"""

from __future__ import annotations

import heapq
import itertools
import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.backends.rosmonitoring.session import session
from avow.system.load import load_system

pytest.importorskip("rosbags")

SAMPLE = "std_msgs/Header header\nuint32 id\nfloat64 value\n"
PLAIN = """
node sensor {
  inputs( r : REAL )
  outputs( s : REAL )
  topics( lab/Sample /r matches(in.r), lab/Sample /s matches(out.s) )
  assume sane ( 0 <= in.r <= 200 )
  // more is assumed here
  guarantee high ( in.r >= 100 -> out.s >= 100 )
  guarantee low ( in.r < 100 -> out.s < 100 )
"""
MEMORY = """
  guarantee risen ( rose(in.r >= 100) -> out.s >= 100 )
  guarantee kept ( held[3 steps](in.r >= 100) -> held[3 steps](out.s >= 100) )
  guarantee few ( counted(out.s >= 100 since out.s < 100) <= 400 )
"""
ALIVE = "assume alive ( once[100 ms](arrived(in.r)) )"
SECONDS = """
  guarantee prompt ( rose(in.r >= 100) -> within[50 ms](out.s >= 100) )
  guarantee steps ( steps(at most 100 ms) )
"""
GUARD = """
}
node guard {
  inputs( q : REAL )
  outputs( w : REAL )
  topics( lab/Sample /q matches(in.q), lab/Sample /w matches(out.w) )
  guarantee bounded ( in.q > 5 -> out.w <= 1 )
  guarantee free ( in.q <= 5 -> out.w == 7 )
}
"""
CALLED = """
node gripper {
  inputs( hold : BOOL )
  outputs( held : BOOL )
  topics( std_srvs/SetBool_Request /grip matches(in.hold), std_srvs/SetBool_Response /grip matches(out.held) )
  guarantee obeys ( out.held <=> in.hold )
}
"""
ARRIVAL = {"by": "arrival", "because": "recorded in the order of cause"}
MODES: dict[str, tuple[str, dict[str, Any]]] = {
    "arrival": ("", ARRIVAL),
    "memory": (MEMORY, ARRIVAL),
    "seconds": (SECONDS, ARRIVAL),
    "order": ("", {"by": "order", "because": "every link stood"}),
    "key": ("", {"by": "key", "input": "id", "output": "id"}),
    "stamp": ("", {"by": "stamp"}),
    "latency": ("", {"latency": "10 ms", "jitter": "5 ms", "because": "as it is recorded"}),
}
FORMS = ("jsonl", "ros1", "SQLITE3", "MCAP")
Said = tuple[int, str, float, int]
"""When it was recorded in microseconds, the topic, the value, the number among its topic's."""


def said(count: int, caused: bool) -> Iterator[Said]:
    """So many messages; `caused`: recorded in the order of cause."""
    rng = random.Random(count)
    late = 0 if caused else 5_000

    def exchange(into: str, out: str, period: int, most: float, answer: Any) -> Iterator[Iterator[Said]]:
        readings: list[Said] = []
        answers: list[Said] = []
        for k in itertools.count():
            at = 100_000 + k * period + rng.randrange(2_000)
            value = round(rng.uniform(0, most), 3)
            readings.append((at + rng.randrange(late + 1), into, value, k))
            answers.append((at + rng.randrange(1_000, 4_000) + rng.randrange(late + 1), out, answer(value), k))
            if len(readings) == 100:
                yield heapq.merge(readings, answers)
                readings, answers = [], []

    sensor = exchange("/r", "/s", 11_000, 200, lambda value: value)
    guard = exchange("/q", "/w", 27_013, 10, lambda value: 0.5 if value > 5 else 7.0)
    flow = heapq.merge(*(itertools.chain.from_iterable(one) for one in (sensor, guard)))
    return itertools.islice(flow, count)


def bag(path: Path, form: str, flow: Iterator[Said]) -> Path:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store: Any = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    kind = "lab/msg/Sample"
    store.register(get_types_from_msg(SAMPLE, kind))
    make, head, time = (store.types[n] for n in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    path = path.with_suffix(".bag") if form == "ros1" else path
    writer: Any = Writer1(path) if form == "ros1" else Writer2(path, version=9, storage_plugin=StoragePlugin[form])
    serialize = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
    with writer:
        to = {topic: writer.add_connection(topic, kind, typestore=store) for topic in ("/r", "/s", "/q", "/w")}
        for at, topic, value, number in flow:
            more = {"seq": number} if form == "ros1" else {}
            header = head(stamp=time(sec=number, nanosec=7), frame_id="", **more)
            writer.write(to[topic], at * 1000, serialize(make(header=header, id=number, value=value), kind))
    return path


def lines(path: Path, flow: Iterator[Said]) -> Path:
    with path.open("w", encoding="utf-8") as file:
        for at, topic, value, number in flow:
            header = {"seq": number, "stamp": {"secs": number, "nsecs": 7}, "frame_id": ""}
            event = {"topic": topic, "time": at / 1_000_000, "header": header, "id": number, "value": value}
            file.write(json.dumps(event) + "\n")
    return path


def plan(folder: Path, contract: str, answers: dict[str, Any], nodes: tuple[str, ...], distro: str) -> None:
    folder.mkdir()
    (folder / "system.rcl").write_text(contract, encoding="utf-8")
    (folder / "lab/msg").mkdir(parents=True)
    (folder / "lab/msg/Sample.msg").write_text(SAMPLE, encoding="utf-8")
    mapping = {"sensor": {"in.r": "value", "out.s": "value"}, "guard": {"in.q": "value", "out.w": "value"}}
    methods = {n: {"methods": [{"rosmonitoring": {"answers": answers, "mapping": mapping.get(n, {})}}]} for n in nodes}
    text = {"contract": "system.rcl", "messages": ["lab"], "ros": {"distro": distro}, "nodes": methods}
    (folder / "plan.yaml").write_text(json.dumps(text), encoding="utf-8")


ALWAYS = [(2_000, *case) for case in zip(MODES, itertools.cycle(FORMS), strict=False)]
CASES = some(ALWAYS, 4, slow=3)
CASES += [pytest.param(1_000_000, *case, marks=pytest.mark.nightly) for case in itertools.product(MODES, FORMS)]


@pytest.mark.parametrize(("count", "mode", "form"), CASES)
def test_correct_nodes_are_told_of_nothing(count: int, mode: str, form: str, tmp_path: Path) -> None:
    more, answers = MODES[mode]
    contract = PLAIN.replace("// more is assumed here", ALIVE if mode == "seconds" else "") + more + GUARD
    plan(tmp_path / "lab", contract, answers, ("sensor", "guard"), "noetic" if form == "ros1" else "humble")
    flow = said(count, answers is ARRIVAL)
    trace = lines(tmp_path / "run.jsonl", flow) if form == "jsonl" else bag(tmp_path / "run", form, flow)
    running = session(load_system(tmp_path / "lab"), (), trace)
    assert [violation.text() for _, violation in running.run(trace)] == []
    assert running.events == count
    judged = {f"{m.setup.node.name}.{name}": (t.judged, t.order) for m, name, _, t in running.clauses()}
    assert len(judged) == 5 + more.count("guarantee") + (mode == "seconds")
    for name, (decided, open_) in judged.items():
        # by latency, an answer between two readings of different kind is undecided
        assert decided + open_ > (count // 3 if name.startswith("sensor") else count // 8), name
        assert decided > count // 30, name
        assert mode == "latency" or not open_, name


@pytest.mark.parametrize("count", [2_000, pytest.param(1_000_000, marks=pytest.mark.nightly)])
def test_calls_that_overtake_each_other_are_told_of_nothing(count: int, tmp_path: Path) -> None:
    plan(tmp_path / "lab", CALLED, {"by": "call"}, ("gripper",), "humble")
    rng = random.Random(1)
    trace = tmp_path / "run.jsonl"
    with trace.open("w", encoding="utf-8") as file:
        for k in range(count // 4):
            calls = [(f"c{2 * k + j}", rng.random() < 0.5) for j in range(2)]
            parts = [(word, "_request", {"data": hold}) for word, hold in calls]
            parts += [(word, "_response", {"success": hold, "message": ""}) for word, hold in reversed(calls)]
            for j, (word, part, fields) in enumerate(parts):
                event = {"topic": f"/grip/{part}", "time": round(k / 10 + j / 100, 2), "_call": word, **fields}
                file.write(json.dumps(event) + "\n")
    running = session(load_system(tmp_path / "lab"))
    assert [violation.text() for _, violation in running.run(trace)] == []
    (tally,) = (tally for _, _, _, tally in running.clauses())
    assert (tally.judged, tally.order) == (count // 4 * 2, 0)
