"""What monitors cost, as the paper measures it: the time to each waypoint and back to the door, with and without them.

    python contracts/remote_inspection/robot/overhead.py [RUNS] [--write FILE]         # on a bus (30)
    python contracts/remote_inspection/robot/overhead.py --ros1 RUNS [--write FILE]    # the robot's own time, on ROS 1

On the bus, the time is the simulated one and what the processor has taken until then, as if all took turns on one
processor: without monitors, with those of each node, with all. On ROS 1 each node is a process, as is `avow monitor
--live ros1` with all monitors; the time is that of the messages in which navigation says that it is there. `--write`
keeps the times of every run, as the plan's `overhead` takes them.
"""

import argparse
import csv
import json
import math
import os
import resource
import signal
import socket
import statistics
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from drive import drive, event  # noqa: E402
from wiring import NODES, PLACES  # noqa: E402

from avow.backends.rosmonitoring.overhead import ALL, NONE  # noqa: E402
from avow.backends.rosmonitoring.session import session  # noqa: E402
from avow.backends.rosmonitoring.traces import parse_event  # noqa: E402
from avow.system.load import load_system  # noqa: E402


def place(message):
    """The waypoint at which a message says that the rover is."""
    at = message["posX"], message["posY"]
    number = min(PLACES, key=lambda number: math.dist(PLACES[number], at))
    return f"WP{number}" if number else "the door"


def run(system=None, nodes=()):
    """Place → the time of the first arrival there: the simulated one, and what the processor has taken until then."""
    running = session(system, nodes) if system is not None else None
    times = {}
    started = time.process_time()

    def tap(topic, at, message):
        if running is not None:
            for violation in running.step(parse_event(json.dumps(event(topic, at, message)))):
                raise AssertionError(violation.text())
        if topic == "at":
            times.setdefault(place(message), at + time.process_time() - started)

    drive(tap=tap)
    return times


def watch():
    """On ROS 1: the time of each arrival since the first reading of the sensors, up to the door, as JSON."""
    from ros1 import Bus

    bus = Bus("watch")
    started, times, phase = [], {}, []
    bus.hear("sensors", lambda message: started or started.append(time.monotonic()))
    bus.hear("phase", lambda message: phase.append(message["phase"]))

    def arrived(message):
        if started:
            times.setdefault(place(message), time.monotonic() - started[0])
        if phase and phase[-1] == "leaving" and place(message) == "the door":
            bus.rospy.signal_shutdown("it is back")

    bus.hear("at", arrived)
    print("ready", flush=True)
    bus.rospy.spin()
    print(json.dumps(times), flush=True)


def on_ros_1(monitored):
    """The times of one mission on ROS 1, and the seconds of processor that the monitor took."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    master = {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    robot = [sys.executable, str(HERE / "ros1.py"), "--port", str(port)]
    command = [sys.executable, "-m", "avow", "monitor", str(HERE), "--live", f"ros1:{master['ROS_MASTER_URI']}"]
    started = [subprocess.Popen(["rosmaster", "--core", "-p", str(port)], env={**os.environ, **master})]
    monitor = None
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        while socket.socket().connect_ex(("127.0.0.1", port)) != 0:
            time.sleep(0.05)
        watching = subprocess.Popen(
            [sys.executable, __file__, "--watch"], env={**os.environ, **master}, stdout=subprocess.PIPE, text=True
        )
        started.append(watching)
        watching.stdout.readline()
        if monitored:
            monitor = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            time.sleep(5)  # it is there before the robot is
        started.append(subprocess.Popen([*robot, "--master"], env={**os.environ, **master}))
        times = json.loads(watching.communicate(timeout=300)[0].splitlines()[-1])
        spent = 0.0
        if monitor is not None:
            monitor.send_signal(signal.SIGINT)
            monitor.communicate(timeout=60)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    finally:
        for process in reversed(started):
            process.send_signal(signal.SIGINT)
        for process in started:
            process.wait(timeout=30)
    return times, spent


def table(found):
    """Without monitors, and with each sort of them: mean times to each place."""
    print(f"{'':<10}" + "".join(f"{sort:>20}" for sort in found))
    for at in found[NONE][0]:
        means = [statistics.mean(times[at] for times in runs) for runs in found.values()]
        print(f"{at:<10}" + "".join(f"{mean:10.3f} s{100 * (mean / means[0] - 1):+6.2f} %" for mean in means))


def write(path, found):
    places = list(found[NONE][0])
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["monitors", *places])
        for sort, runs in found.items():
            rows.writerows([sort, *(f"{times[at]:.5g}" for at in places)] for times in runs)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=int, nargs="?", default=30)
    parser.add_argument("--ros1", action="store_true")
    parser.add_argument("--write", type=Path, help="keep the times of every run, as a table")
    parser.add_argument("--watch", action="store_true", help="be the node that takes the times")
    given = parser.parse_args()
    if given.watch:
        watch()
        return
    found = {}
    if given.ros1:
        for _ in range(given.runs):
            found.setdefault(NONE, []).append(on_ros_1(monitored=False)[0])
            times, spent = on_ros_1(monitored=True)
            found.setdefault(ALL, []).append(times)
        table(found)
        print(f"processor time of the monitor and of the node that takes the times: {spent:.1f} s in the last run")
    else:
        system = load_system(HERE)
        sorts = {NONE: (), **{name: (system, [name]) for name in NODES}, ALL: (system,)}
        run(), run(system)
        for _ in range(given.runs):
            for sort, what in sorts.items():
                found.setdefault(sort, []).append(run(*what))
        table(found)
    if given.write is not None:
        write(given.write, found)


if __name__ == "__main__":
    main()
