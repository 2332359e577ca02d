"""What bounds a cluster: what the parts of a run on Dask cost, and a simulation of a large run with these costs.

    python benchmarks/cluster.py [OBLIGATIONS]        # default: 100000

Measured are processor seconds: of the client with an executor that answers at once, with few and with many nodes; of
the client, the scheduler and a worker, with all that it starts, over 500 obligations. What real answers cost the client
more counts for each job. The simulation (of discrete events) gives every process a core of its own: the client and the
scheduler serve one message at a time, each slot one job. `lost`: a worker is killed in the middle, and what it had
begun is begun again.
"""

from __future__ import annotations

import heapq
import itertools
import json
import os
import sys
import tempfile
import time
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from measured import cost  # noqa: E402
from scale.made import programs  # noqa: E402

GUARANTEES = 10
"""Of each node: its sanity is one job, its method another."""
JOBS = 101
"""Of 500 obligations: two of each node, and the composition."""
LATENCY = 0.001
"""Seconds for a message within a building's network."""

_CLIENT = """
import json, sys, time
from pathlib import Path
import avow.pipeline.tasks as tasks
from avow.backend_kit.protocol import Report
from avow.base.verdict import Outcome, Verdict
from avow.pipeline.remote import Remote, remote
from avow.pipeline.requests import Response, request_bytes, request_digest

answer, marks = None, []
class AtOnce:
    def offers(self):
        return {"here": frozenset()}
    def run(self, request):
        marks.append(time.process_time())
        outcomes = tuple(Outcome(name, Verdict.PROVED) for name in request.keys)
        response = Response(request_digest(request_bytes(request)), Report(outcomes, request.engine, "1"))
        marks.append(time.process_time())
        return response
there = remote(AtOnce())
cluster = None
if len(sys.argv) > 2:
    from avow.cli.verify import _cluster
    cluster, there = _cluster(sys.argv[2])
try:
    tasks.execute(Path(sys.argv[1]), ["verify"], cluster.slots + 1 if cluster else 2, None, there)
except SystemExit:
    pass
finally:
    if cluster:
        cluster.close()
end = time.process_time()
print("spent", json.dumps([marks[0], marks[-1], end] if marks else [0, 0, end]))
"""


@dataclass(frozen=True, slots=True)
class Costs:
    """Processor seconds, each on a core of its own."""

    start: float
    """Of the client, whatever the system."""
    node: float
    """Of the client before the first job, for each node."""
    job: float
    """Of the client for each job: its request, its records, its files."""
    end: float
    """Of the client after the last job, for each node."""
    scheduler: float
    """Of the scheduler for each job."""
    work: float
    """Of a worker for each job."""


def simulated(
    costs: Costs, nodes: int, workers: int, slots: int, lost: bool = False, ahead: int = 1
) -> tuple[float, float]:
    """Seconds of a run, and the share of them in which the workers' slots are busy.
    `ahead`: the jobs that the client prepares while all slots are busy."""
    jobs, place = 2 * nodes, workers * slots
    begun = costs.start + nodes * costs.node
    order = itertools.count()
    events: list[tuple[float, int, str, int]] = []
    free, ready = list(range(place)), deque[int]()
    client = scheduler = begun
    busy, done, asked, running = 0.0, 0, 0, dict[int, tuple[int, float]]()

    def post(when: float, what: str, number: int) -> None:
        heapq.heappush(events, (when, next(order), what, number))

    for number in range(min(jobs, place + ahead)):
        post(begun, "ask", number)
        asked += 1
    if lost:
        post(begun + jobs * max(costs.work / place, costs.job) / 2, "kill", 0)
    now = begun
    while done < jobs:
        now, _, what, number = heapq.heappop(events)
        match what:
            case "ask":  # half of a job's cost at the client is before it, half after it
                client = max(client, now) + costs.job / 2
                post(client + LATENCY, "schedule", number)
            case "schedule":
                scheduler = max(scheduler, now) + costs.scheduler
                post(scheduler + LATENCY, "ready", number)
            case "ready":
                ready.append(number)
            case "kill":
                free = [slot for slot in free if slot >= slots]
                place -= slots
                for number in [n for n, (slot, _) in running.items() if slot < slots]:
                    busy += now - running.pop(number)[1]
                    post(now + LATENCY, "schedule", number)
            case "worked" if number in running and running[number][1] + costs.work <= now + 1e-9:
                slot, since = running.pop(number)
                busy += now - since
                free.append(slot)
                post(now + LATENCY, "answered", number)
            case "answered":
                client = max(client, now) + costs.job / 2
                post(client, "done", number)
            case "done":
                done += 1
                if asked < jobs:
                    post(now, "ask", asked)
                    asked += 1
            case _:  # the answer of a job that was lost
                pass
        while free and ready:
            number = ready.popleft()
            running[number] = free.pop(), now
            post(now + costs.work, "worked", number)
    end = now + nodes * costs.end
    return end, busy / (workers * slots * end)


def client(folder: Path, nodes: int) -> tuple[float, float, float]:
    """Processor seconds of a run whose jobs are answered at once: before the first, among them, after the last."""
    programs(folder / "contracts" / "made", nodes, GUARANTEES)
    (folder / "dodo.py").write_text((ROOT / "dodo.py").read_text())
    first, last, end = _spent(folder)
    return first, last - first, end - last


def _spent(folder: Path, *url: str) -> list[float]:
    here = {"PYTHONPATH": str(ROOT)}
    found = cost([sys.executable, "-P", "-c", _CLIENT, folder, *url], folder, here)
    spent: list[float] = json.loads(found.output.rpartition("spent")[2])
    return spent


def on_dask(folder: Path, workers: int) -> tuple[float, float, float, float]:
    """Seconds on the clock, and processor seconds of the client, of the scheduler (without what it takes when idle) and
    of the workers."""
    from scale.machines import Machines  # needs the extra `cluster`

    machines = Machines()
    try:
        for _ in range(workers):
            machines.worker()
        with machines.cluster(workers):
            programs(folder / "contracts" / "made", 50, GUARANTEES)
            (folder / "dodo.py").write_text((ROOT / "dodo.py").read_text())
        idle = _ticks(machines.processes[0].pid)
        time.sleep(10)
        before = [_ticks(process.pid) for process in machines.processes]
        start = time.monotonic()
        *_, own = _spent(folder, machines.url)
        clock = time.monotonic() - start
        scheduler, *others = (_ticks(p.pid) - b for p, b in zip(machines.processes, before, strict=True))
        return clock, own, max(0.0, scheduler - (before[0] - idle) / 10 * clock), sum(others)
    finally:
        machines.close()


def _ticks(root: int) -> float:
    """Processor seconds of a process, of those that it started, and of those of them that ended."""
    stats = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        stats[int(entry.parent.name)] = int(fields[1]), sum(map(int, fields[11:15]))
    found, total = [root], 0
    while found:
        pid = found.pop()
        total += stats[pid][1]
        found += [child for child, (parent, _) in stats.items() if parent == pid]
    return total / os.sysconf("SC_CLK_TCK")


def measured(folder: Path, few: int = 50, many: int = 200) -> Costs:
    client(folder / "warm", few)
    first, second = client(folder / "few", few), client(folder / "many", many)
    for nodes, (begin, jobs, end) in ((few, first), (many, second)):
        print(
            f"client, answered at once, {nodes * GUARANTEES:5} obligations: {begin:6.2f} CPU s before the jobs,"
            f" {jobs:6.2f} s with {2 * nodes} jobs, {end:6.2f} s after",
            flush=True,
        )
    walls = []
    for workers in (1, 2):
        clock, own, scheduler, work = on_dask(folder / f"on{workers}", workers)
        walls.append(clock)
        print(
            f"500 obligations on Dask, workers: {workers}   {clock:7.2f} s on the clock; CPU s: client {own:.2f},"
            f" scheduler {scheduler:.2f}, workers {work:.2f}",
            flush=True,
        )
        if workers == 1:
            served, worked, more = scheduler / JOBS, work / JOBS, max(0.0, own - sum(first)) / JOBS
    print(f"    two workers on this machine of {os.cpu_count()} cores: {walls[0] / walls[1]:.2f} times one", flush=True)
    node = (second[0] - first[0]) / (many - few)
    start = max(0.0, second[0] - many * node)
    return Costs(start, node, second[1] / (2 * many) + more, second[2] / many, served, worked)


def main(obligations: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        found = measured(Path(name))
    print(found)
    one, two = (simulated(found, 50, workers, 1)[0] for workers in (1, 2))
    print(f"500 obligations, each process with a core: {one:.1f} s with one worker, {one / two:.2f} times with two")
    nodes = obligations // GUARANTEES
    for work in (found.work, 10.0):
        costs = replace(found, work=work)
        for workers in (1, 2, 5, 10, 50):
            seconds, busy = simulated(costs, nodes, workers, 4)
            print(
                f"{obligations:,} obligations, jobs of {work:.2f} s, {workers:2} workers of 4 slots: {seconds:7.0f} s,"
                f" slots busy {busy:4.0%}",
                flush=True,
            )
        lost, _ = simulated(costs, nodes, workers, 4, lost=True)
        print(f"    one of {workers} workers lost: {lost:7.0f} s", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
