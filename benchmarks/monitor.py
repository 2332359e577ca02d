"""How fast recorded traces are judged, against plain Python over the same lines in the same run.

    python benchmarks/monitor.py [EVENTS]        # default 300000

`threshold`: one output, one bound, a fresh reading at each event. `agent`: the case study's agent over laps of the
nominal run, which breaks its contract from the second lap on. `rover`: all four nodes over one mission with a fresh
reading each time. `answers`: a threshold on each answer, which is paired with its input in each of the ways; for these,
plain Python keeps the inputs by their number. The bags hold the threshold's readings, or answers with stamps; beside
them, rosbags alone yields the messages. `arrays`: the threshold over 40 times as many readings that are arrays already,
against numpy and a loop. Processor time, so that company on the machine matters less; memory is the process' peak.
"""

from __future__ import annotations

import json
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from rosmonitoring.missions import mission  # noqa: E402

from avow.backends.rosmonitoring.session import session  # noqa: E402
from avow.system.load import load_system  # noqa: E402
from avow.system.plan import System  # noqa: E402

NOMINAL = ROOT / "contracts/remote_inspection/traces/nominal.jsonl"
THRESHOLD = """
node sensor {
  inputs( t : REAL )
  outputs( v : REAL )
  topics( std_msgs/Float64 v matches(out.v) )
  guarantee low ( out.v <= 120 )
}
"""


def readings(count: int) -> Iterator[str]:
    rng = random.Random(1)
    for at in range(count):
        yield json.dumps({"topic": "v", "time": round(at / 100, 2), "data": round(rng.uniform(0, 119), 3)})


def laps(count: int) -> Iterator[str]:
    nominal = [json.loads(line) for line in NOMINAL.read_text(encoding="utf-8").splitlines()]
    lap = nominal[-1]["time"]
    for at in range(count):
        event = nominal[at % len(nominal)]
        yield json.dumps({**event, "time": round(event["time"] + at // len(nominal) * lap, 2)})


ANSWERS = """
node sensor {
  inputs( r : REAL )
  outputs( v : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 v matches(out.v) )
  guarantee high ( in.r >= 100 -> out.v >= 100 )
}
"""


ANSWERED = {
    "order": "{by: order, because: all links stand}",
    "key": "{by: key, input: id, output: id}",
    "stamp": "{by: stamp}",
    "latency": "{latency: 2 ms, jitter: 1 ms, because: measured}",
}


def answers(count: int) -> Iterator[str]:
    for at, event in enumerate(map(json.loads, readings(count // 2))):
        who = {"id": at, "header": {"stamp": {"secs": at, "nsecs": 0}}}
        yield json.dumps({**event, "topic": "r", **who})
        yield json.dumps({**event, "time": round(event["time"] + 0.002, 3), **who})


def plain_answers(path: Path) -> int:
    """The same for answers, by their number."""
    broken, inputs = 0, {}
    with path.open(encoding="utf-8") as file:
        for line in file:
            event = json.loads(line)
            if event["topic"] == "r":
                inputs[event["id"]] = event["data"]
            elif inputs.pop(event["id"]) >= 100 and event["data"] < 100:
                broken += 1
    return broken


def bag(path: Path, count: int, form: str) -> Path:
    """The threshold's readings: `form` is ros1, SQLITE3 or MCAP."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store: Any = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    kind = "std_msgs/msg/Float64"
    serialize = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
    writer: Any = Writer1(path) if form == "ros1" else Writer2(path, version=9, storage_plugin=StoragePlugin[form])
    with writer:
        to = writer.add_connection("/v", kind, typestore=store)
        for event in map(json.loads, readings(count)):
            message = store.types[kind](data=event["data"])
            writer.write(to, int(event["time"] * 1e9) + 10**9, serialize(message, kind))
    return path


def stamped(path: Path, count: int) -> Path:
    """Answers, and what they answered, with the same stamps: a ROS 2 bag."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store: Any = get_typestore(Stores.ROS2_HUMBLE)
    kind, rng = "sensor_msgs/msg/Temperature", random.Random(1)
    time_, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        to = [writer.add_connection(topic, kind, typestore=store) for topic in ("/r", "/v")]
        for at in range(count // 2):
            message = store.types[kind](header(time_(at, 0), "sensor"), round(rng.uniform(0, 119), 3), 0.0)
            for k, connection in enumerate(to):
                writer.write(connection, 10**9 + at * 10**7 + k * 2 * 10**6, store.serialize_cdr(message, kind))
    return path


def unread(path: Path) -> int:
    """A bag's messages, of which nothing is read: rosbags alone."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        for _ in reader.readers[0].messages():
            pass
    return 0


def loop(readings: list[float]) -> int:
    broken = 0
    for reading in readings:
        if reading > 120:
            broken += 1
    return broken


def written(path: Path, lines: Iterator[str]) -> Path:
    with path.open("w", encoding="utf-8") as file:
        file.writelines(line + "\n" for line in lines)
    return path


def plain(path: Path) -> int:
    """What anybody would write in ten minutes for the threshold."""
    broken = 0
    with path.open(encoding="utf-8") as file:
        for line in file:
            event = json.loads(line)
            if event["topic"] == "v" and event["data"] > 120:
                broken += 1
    return broken


def judged(system: System, nodes: list[str], path: Path) -> int:
    running = session(system, nodes)
    return sum(1 for _ in running.run(path))


def timed(name: str, count: int, action: Callable[[], int]) -> None:
    start = time.process_time()
    found = action()
    seconds = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"  {name:<44} {count / seconds:>12,.0f} events/s, {found:,} found, {peak} MB")


def single(folder: Path, contract: str, options: str) -> System:
    """A system of one node, `sensor`."""
    folder.mkdir()
    (folder / "system.rcl").write_text(contract, encoding="utf-8")
    method = f"{{rosmonitoring: {options}}}"
    plan = f"contract: system.rcl\nros: {{distro: noetic}}\nnodes: {{sensor: {{methods: [{method}]}}}}\n"
    (folder / "plan.yaml").write_text(plan, encoding="utf-8")
    return load_system(folder)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300_000
    from rosmonitoring.conftest import write_case

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        threshold, rover = single(folder / "one", THRESHOLD, "{mapping: {}}"), load_system(write_case(folder))
        mapping = "mapping: {in.r: data, out.v: data}"
        paired = {by: single(folder / by, ANSWERS, f"{{answers: {how}, {mapping}}}") for by, how in ANSWERED.items()}
        print(f"{count} events")
        values = written(folder / "v.jsonl", readings(count))
        timed("threshold: json.loads and an if", count, lambda: plain(values))
        timed("threshold", count, lambda: judged(threshold, [], values))
        run = written(folder / "laps.jsonl", laps(count))
        timed("agent, whose contract is broken", count, lambda: judged(rover, ["agent"], run))
        fine = written(folder / "mission.jsonl", (json.dumps(event) for event in mission(count)))
        timed("agent, nothing broken", count, lambda: judged(rover, ["agent"], fine))
        timed("all four nodes of the rover, nothing broken", count, lambda: judged(rover, [], fine))
        asked = written(folder / "answers.jsonl", answers(count))
        timed("answers by their number: json.loads and an if", count, lambda: plain_answers(asked))
        for by, system in paired.items():
            timed(f"answers by {by}, each a fresh reading", count, partial(judged, system, [], asked))
        for form, name in (("ros1", "v.bag"), ("SQLITE3", "v2"), ("MCAP", "v3")):
            record = bag(folder / name, count, form)
            timed(f"rosbags alone, a bag ({form})", count, partial(unread, record))
            timed(f"threshold, a bag ({form})", count, partial(judged, threshold, [], record))
        mapping = "mapping: {in.r: temperature, out.v: temperature}"
        contract = ANSWERS.replace("std_msgs/Float64", "sensor_msgs/Temperature")
        answered = single(folder / "stamped", contract, f"{{answers: {{by: stamp}}, {mapping}}}")
        record = stamped(folder / "v4", count)
        timed("rosbags alone, answers (SQLITE3)", count, partial(unread, record))
        timed("answers by stamp, a bag (SQLITE3)", count, partial(judged, answered, [], record))
    many = 40 * count
    data = np.random.default_rng(1).uniform(0, 119, many)
    arrays = {"v": {"time": np.arange(many) / 100, "data": data}}
    timed("arrays: numpy", many, lambda: int(np.count_nonzero(data > 120)))
    timed("arrays: a loop over a list", many // 10, partial(loop, data[: many // 10].tolist()))
    timed("arrays: threshold", many, lambda: sum(1 for _ in session(threshold).arrays(arrays)))


if __name__ == "__main__":
    main()
