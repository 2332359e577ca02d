"""The same nodes on ROS 1: a master, the world, and each node as a process of its own, until Ctrl-C.

    python contracts/remote_inspection/robot/ros1.py [--port 11311] [--seconds N] [--fault NAME] [--source X,Y,STRENGTH]
                                                     [--sensor FILE] [--enforce]

Needs Debian's python3-rospy and python3-rosmaster. To watch: avow monitor contracts/remote_inspection/robot --live ros1

`--sensor`: the radiation sensor in C++, built by (Debian: libroscpp-dev)

    g++ contracts/remote_inspection/robot/nodes/radiation_sensor.cpp -o FILE $(pkg-config --cflags --libs roscpp)
"""

import argparse
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
sys.path.append("/usr/lib/python3/dist-packages")  # where Debian has rospy; last, so that nothing else is taken there

import faults  # noqa: E402
from bus import TICK  # noqa: E402
from drive import parameters  # noqa: E402
from wiring import NODES, Simulation  # noqa: E402

FILTERED = {"agent": ("/command",)}
"""As in the plan: what these say there comes to the monitor first."""


def one(name, fault=None, sources=None):
    """Be one node, or the world."""
    import rospy
    from ros_nodes import Bus

    bus = Bus(name, faults.SAID.get(fault))
    chosen = parameters(fault, sources)
    if name != "world":
        NODES[name](bus, chosen[name])
        rospy.spin()
        return
    world = Simulation(bus, TICK, chosen)
    rate = rospy.Rate(1 / TICK)
    while not rospy.is_shutdown():
        world.tick()
        rate.sleep()


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def command(name, given):
    """What starts a node, or the world."""
    if name == "radiationSensor" and given.sensor is not None:
        values = parameters(given.fault)[name]
        if given.fault == "mislabel":  # what is said is not changed on its way: the node is wrong itself
            values["orange"] = values["red"]
        return [str(given.sensor.resolve()), *(f"_{key}:={value}" for key, value in values.items())]
    found = [sys.executable, __file__, "--node", name]
    found += ["--fault", given.fault] if given.fault is not None else []
    found += [f"{topic}:={topic}_mon" for topic in FILTERED.get(name, ()) if given.enforce]
    return found + [f"--source={','.join(map(str, source))}" for source in given.source or ()]


def everything(given):
    environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{given.port}", "ROS_IP": "127.0.0.1"}
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: the nodes end too
    started = []
    try:
        if not given.master:
            started.append(subprocess.Popen(["rosmaster", "--core", "-p", str(given.port)], env=environment))
        while not answers(given.port):
            time.sleep(0.05)
        for name in (*NODES, "world"):
            started.append(subprocess.Popen(command(name, given), env=environment))
        time.sleep(given.seconds if given.seconds is not None else 10**8)
    except KeyboardInterrupt:
        pass
    finally:
        for process in reversed(started):
            process.terminate()
        for process in started:
            process.wait(timeout=20)


def place(text):
    """X,Y,STRENGTH of a source of radiation."""
    x, y, strength = map(float, text.split(","))
    return x, y, strength


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--port", type=int, default=11311)
    parser.add_argument("--master", action="store_true", help="there is a master at that port")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--fault", choices=faults.NAMES)
    parser.add_argument("--source", type=place, action="append", help="radiation there, instead of at waypoint 7")
    parser.add_argument("--sensor", type=Path, help="the radiation sensor that was built from C++")
    parser.add_argument("--node", choices=(*NODES, "world"), help="be this one, and start nothing else")
    parser.add_argument(
        "--enforce", action="store_true", help="what is filtered is remapped, for a monitor with --enforce"
    )
    given = parser.parse_args([word for word in sys.argv[1:] if ":=" not in word])
    if given.node is not None:
        one(given.node, given.fault, given.source)
    else:
        everything(given)


if __name__ == "__main__":
    main()
