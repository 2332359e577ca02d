"""What monitors cost, as the paper measures it: the time to each waypoint and back to the door, with and without them.

    python contracts/remote_inspection/robot/overhead.py [RUNS]         # processor time, on a bus (30)
    python contracts/remote_inspection/robot/overhead.py --ros1 RUNS    # the robot's own time, on ROS 1

On the bus the simulated time is the same; what differs is how long this machine takes for it. On ROS 1 each node is a
process, as is `avow monitor --live ros1`; the time is that of the messages in which navigation says that it is there.
"""

import argparse
import json
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

from avow.backends.rosmonitoring.session import session  # noqa: E402
from avow.backends.rosmonitoring.traces import parse_event  # noqa: E402
from avow.system.load import load_system  # noqa: E402


def run(system=None):
    """(processor time since the start at each arrival), and the simulated time."""
    running = session(system) if system is not None else None
    times = []
    started = time.process_time()

    def tap(topic, at, message):
        if running is not None:
            for violation in running.step(parse_event(json.dumps(event(topic, at, message)))):
                raise AssertionError(violation.text())
        if topic == "at":
            times.append(time.process_time() - started)

    bus = drive(tap=tap)
    return [*times, time.process_time() - started], bus.now


def watch():
    """On ROS 1: the time of each arrival since the first reading of the sensors, up to the door, as JSON."""
    from ros1 import Bus
    from wiring import DOOR

    bus = Bus("watch")
    started, times, phase = [], [], []
    bus.hear("sensors", lambda message: started or started.append(time.monotonic()))
    bus.hear("phase", lambda message: phase.append(message["phase"]))

    def arrived(message):
        if started:
            times.append(time.monotonic() - started[0])
        if phase and phase[-1] == "leaving" and message["posX"] == DOOR[0]:
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


def table(bare, watched, unit):
    print("arrival   bare          monitored     overhead")
    for k in range(min(map(len, [*bare, *watched]))):
        one, other = (statistics.mean(times[k] for times in all_) for all_ in (bare, watched))
        times = f"{one * unit[0]:10.2f} {unit[1]} {other * unit[0]:10.2f} {unit[1]}"
        print(f"{k:>5}   {times} {100 * (other / one - 1):8.2f} %")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=int, nargs="?", default=30)
    parser.add_argument("--ros1", action="store_true")
    parser.add_argument("--watch", action="store_true", help="be the node that takes the times")
    given = parser.parse_args()
    bare, watched = [], []
    if given.watch:
        watch()
    elif given.ros1:
        for _ in range(given.runs):
            bare.append(on_ros_1(monitored=False)[0])
            times, spent = on_ros_1(monitored=True)
            watched.append(times)
        table(bare, watched, (1, "s "))
        print(f"processor time of the monitor and of the node that takes the times: {spent:.1f} s in the last run")
    else:
        system = load_system(HERE)
        run(), run(system)
        for _ in range(given.runs):
            times, simulated = run()
            bare.append(times)
            watched.append(run(system)[0])
        table(bare, watched, (1000, "ms"))
        one, other = (statistics.mean(times[-1] for times in all_) for all_ in (bare, watched))
        share = 100 * (other - one) / simulated
        print(f"of the {simulated:.1f} s of the mission the monitors need {(other - one) * 1000:.0f} ms: {share:.2f} %")


if __name__ == "__main__":
    main()
