"""How fast the monitors are, against plain `json.loads` over the same lines in the same run.

    python benchmarks/monitor.py [EVENTS]        # default 100000

The trace is the case study's nominal run, again and again, with a fresh reading each time, so that the engine cannot
reuse answers more than a real run would let it. Also measured: whether the cost of an event grows with the trace.
"""

from __future__ import annotations

import json
import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from avow.backends.rosmonitoring.session import Session, session  # noqa: E402
from avow.backends.rosmonitoring.traces import parse_event  # noqa: E402
from avow.system.load import load_system  # noqa: E402

TRACE = ROOT / "contracts/remote_inspection/traces/nominal.jsonl"
LAP = len(TRACE.read_text(encoding="utf-8").splitlines())


def lines(count: int) -> list[str]:
    rng = random.Random(1)
    nominal = TRACE.read_text(encoding="utf-8").splitlines()
    found: list[str] = []
    while len(found) < count:
        for line in nominal:
            event = json.loads(line)
            if event["topic"] == "r" and event["radiation"] < 119:
                event["radiation"] = rng.randrange(30, 1190) / 10
            found.append(json.dumps(event))
    return found[:count]


def timed(name: str, count: int, action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    seconds = time.perf_counter() - start
    print(f"  {name:<44} {count / seconds:>12,.0f} events/s")
    return seconds


def parse_all(rows: list[str]) -> None:
    for row in rows:
        json.loads(row)


def monitor_all(running: Session, rows: list[str]) -> None:
    for at, row in enumerate(rows):
        if at % LAP == 0:  # the mission begins anew
            for monitor in running.monitors:
                monitor.restart()
        for violation in running.step(parse_event(row)):
            raise AssertionError(violation.text())


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    from rosmonitoring.conftest import write_case

    with tempfile.TemporaryDirectory() as folder:
        system = load_system(write_case(Path(folder)))
        rows = lines(count)
        print(f"{count} events")
        timed("json.loads alone", count, lambda: parse_all(rows))
        for node in system.contract.nodes:
            running = session(system, [node.name])
            timed(f"{node.name}: all its clauses", count, lambda running=running: monitor_all(running, rows))  # type: ignore[misc]
        running = session(system)
        half = len(rows) // 2 // LAP * LAP
        first = timed("all four nodes, first half", half, lambda: monitor_all(running, rows[:half]))
        second = timed("all four nodes, second half", len(rows) - half, lambda: monitor_all(running, rows[half:]))
        print(f"  the second half took {second / (len(rows) - half) * half / first:.2f} times as long as the first")


if __name__ == "__main__":
    main()
