"""Start the rover.

    python contracts/remote_inspection/robot/drive.py [--fault NAME] [--record FILE] [--seconds N] [--unmonitored]
                                                      [--enforce]

All nodes on a bus of this process, in simulated time, under the monitors of their contracts. Code 1 where something was
broken. No ROS is needed; `ros1.py` starts the same nodes on ROS 1.
"""

import argparse
import json
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import faults  # noqa: E402
from bus import TICK, Bus  # noqa: E402
from wiring import DEFINITION, FIELDS, NODES, PARAMETERS, TYPE, Simulation  # noqa: E402


class Faulty(Bus):
    """A bus on which what one node says may be changed or lost."""

    def __init__(self, change=None):
        super().__init__()
        self.change = change

    def say(self, topic, message):
        changed = self.change(topic, message, self.now) if self.change else message
        if changed is not None:
            super().say(topic, changed)


def parameters(fault=None, sources=None):
    found = {name: dict(values) for name, values in PARAMETERS.items()}
    for node, values in faults.PARAMETERS.get(fault, {}).items():
        found[node] |= values
    if sources is not None:
        found["world"]["sources"] = sources
    return found


def drive(fault=None, seconds=400.0, tap=None, sources=None):
    """Run until the rover is back at the door, or time is up; the bus, as it then is."""
    bus = Faulty(faults.SAID.get(fault))
    if tap is not None:
        bus.tap(tap)
    chosen = parameters(fault, sources)
    for bus.speaker, start in NODES.items():
        start(bus, chosen[bus.speaker])
    bus.speaker = "world"
    world = Simulation(bus, TICK, chosen)
    done = []
    bus.hear("at", lambda message: done.append(message["posX"]))
    phase = []
    bus.hear("phase", lambda message: phase.append(message["phase"]))

    def tick():
        world.tick()
        return not (phase and phase[-1] == "leaving" and done and done[-1] == chosen["world"]["start"][0])

    bus.run(tick, seconds)
    return bus


def event(topic, at, message):
    return {"topic": topic, "time": at, **{field: message[field] for field in FIELDS[topic]}}


def written(path, events, publishers):
    """Write events as JSON lines or, by the file's name, as a ROS 1 bag with the messages' definition, as `rosbag
    record` would on a graph. The same events, the same bag."""
    if path.suffix != ".bag":
        path.write_text("".join(json.dumps(one) + "\n" for one in events), encoding="utf-8")
        return
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    kind = TYPE.replace("/", "/msg/")
    store.register(get_types_from_msg(DEFINITION, kind))
    make = store.types[kind]
    path.unlink(missing_ok=True)
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.BZ2)
    nothing = {"command": "", "posX": 0.0, "posY": 0.0, "id": 0, "radiation": 0.0, "level": "", "phase": ""}
    to = {}
    with writer:
        for one in events:
            topic, at = one["topic"], one["time"]
            if topic not in to:
                by = f"/{publishers[topic.removesuffix('_mon')]}"
                to[topic] = writer.add_connection(f"/{topic}", kind, typestore=store, callerid=by, latching=1)
            message = make(**{**nothing, **{name: one[name] for name in nothing if name in one}})
            writer.write(to[topic], round(at * 1e9), store.serialize_ros1(message, kind))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fault", choices=faults.NAMES)
    parser.add_argument("--record", type=Path, help="write every message: JSON lines, or a ROS 1 bag (.bag)")
    parser.add_argument("--seconds", type=float, default=400.0)
    parser.add_argument("--enforce", action="store_true", help="what would break a guarantee is not delivered")
    parser.add_argument("--unmonitored", action="store_true")
    given = parser.parse_args()
    from avow.backends.rosmonitoring.session import filtered, raw, session
    from avow.backends.rosmonitoring.traces import parse_event
    from avow.system.load import load_system

    running = None if given.unmonitored else session(load_system(HERE))
    gates = filtered(monitor.setup for monitor in running.monitors) if given.enforce else ()
    said = []
    found = []

    def tap(topic, at, message):
        line = json.dumps(event(topic, at, message))
        if topic in gates:
            said.append(event(topic, at, message) | {"topic": raw(topic)})
            new, on = running.offer(parse_event(line))
            passed = on is not None
        else:
            new, passed = ([] if running is None else running.step(parse_event(line))), True
        if passed:
            said.append(event(topic, at, message))
        for violation in new:
            found.append(violation)
            if len(found) <= 10:
                print(violation.text())
        return passed

    started = time.process_time()
    bus = drive(given.fault, given.seconds, tap)
    if running is not None:
        found += running.finish()
    if given.record is not None:
        written(given.record, said, bus.publishers)
    spent = time.process_time() - started
    if running is not None and running.withheld:
        print(f"withheld: {', '.join(f'{topic} {count}' for topic, count in running.withheld.items())}")
    print(f"{len(said)} messages, {bus.now:.1f} s simulated in {spent:.2f} s: {len(found)} violations")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
