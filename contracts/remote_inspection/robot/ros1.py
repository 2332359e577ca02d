"""The same nodes on ROS 1: a master, the world, and each node as a process of its own, until Ctrl-C.

    python contracts/remote_inspection/robot/ros1.py [--port 11311] [--seconds N]

Needs Debian's python3-rospy and python3-rosmaster. To watch: avow monitor contracts/remote_inspection/robot --live ros1
"""

import argparse
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
sys.path.append("/usr/lib/python3/dist-packages")  # where Debian has rospy; last, so that nothing else is taken there

from bus import TICK  # noqa: E402
from wiring import FIELDS, NODES, TYPE, Simulation  # noqa: E402

DEFINITION = (HERE / "msg/rover/msg/Snapshot.msg").read_text(encoding="utf-8")


class Bus:
    """The calls of `bus.Bus`, by rospy; every topic is latched, as the plan supposes."""

    def __init__(self, name):
        import genpy.dynamic
        import rospy

        self.rospy = rospy
        self.kind = genpy.dynamic.generate_dynamic(TYPE, DEFINITION)[TYPE]
        self.lock = threading.Lock()
        self.spoken = {}
        rospy.init_node(name)

    def announce(self, topic):
        self.spoken[topic] = self.rospy.Publisher(f"/{topic}", self.kind, queue_size=100, latch=True)

    def hear(self, topic, act):
        def heard(message):
            with self.lock:
                act({field: getattr(message, field) for field in FIELDS[topic]})

        self.rospy.Subscriber(f"/{topic}", self.kind, heard, queue_size=100)

    def say(self, topic, message):
        self.spoken[topic].publish(self.kind(**message))


def one(name):
    """Be one node, or the world."""
    bus = Bus(name)
    if name != "world":
        NODES[name](bus)
        bus.rospy.spin()
        return
    world = Simulation(bus, TICK)
    rate = bus.rospy.Rate(1 / TICK)
    while not bus.rospy.is_shutdown():
        world.tick()
        rate.sleep()


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def everything(port, seconds):
    environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    started = [subprocess.Popen(["rosmaster", "--core", "-p", str(port)], env=environment)]
    try:
        while not answers(port):
            time.sleep(0.05)
        for name in (*NODES, "world"):
            started.append(subprocess.Popen([sys.executable, __file__, "--node", name], env=environment))
        time.sleep(seconds if seconds is not None else 10**8)
    except KeyboardInterrupt:
        pass
    finally:
        for process in reversed(started):
            process.terminate()
        for process in started:
            process.wait(timeout=20)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--port", type=int, default=11311)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--node", choices=(*NODES, "world"), help="be this one, and start nothing else")
    given = parser.parse_args()
    if given.node is not None:
        one(given.node)
    else:
        everything(given.port, given.seconds)


if __name__ == "__main__":
    main()
