"""What monitors cost: processor time to each waypoint, with and without them, over some runs (the paper's experiment).

    python contracts/remote_inspection/robot/overhead.py [RUNS]        # default 30

The simulated time is the same; what differs is how long this machine takes for it.
"""

import json
import statistics
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
    """(waypoint, processor time since the start) for each arrival."""
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


def main():
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    system = load_system(HERE)
    run(), run(system)
    bare, watched = [], []
    for _ in range(runs):
        times, simulated = run()
        bare.append(times)
        watched.append(run(system)[0])
    print("arrival   bare      monitored   overhead")
    for k in range(len(bare[0])):
        one, other = (statistics.mean(times[k] for times in all_) for all_ in (bare, watched))
        print(f"{k:>5}   {one * 1000:8.1f} ms {other * 1000:8.1f} ms   {100 * (other / one - 1):6.0f} %")
    one, other = (statistics.mean(times[-1] for times in all_) for all_ in (bare, watched))
    share = 100 * (other - one) / simulated
    print(f"of the {simulated:.1f} s of the mission the monitors need {(other - one) * 1000:.0f} ms: {share:.2f} %")


if __name__ == "__main__":
    main()
