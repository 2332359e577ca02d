"""How fast an agent's state space is explored, against a plain search of as many states.

    python benchmarks/agents.py

Processor seconds and megabytes of a process for each program, in which garbage is collected as rarely as in a
job's. The exit code is 1 where a million states, with the check of a property, take `MOST` times as long as the plain
search, or `MEGABYTES`.
"""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
import tempfile
import time
from collections import deque
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT)]

from avow.backends.ajpf.checker import Checker, Property  # noqa: E402
from avow.backends.ajpf.environment import read_environment  # noqa: E402
from avow.backends.ajpf.explore import explore  # noqa: E402
from avow.backends.ajpf.interpreter import Semantics  # noqa: E402
from avow.backends.ajpf.parser import parse_system  # noqa: E402
from avow.backends.ajpf.psl_parser import instantiate, parse_psl  # noqa: E402
from avow.backends.ajpf.society import system  # noqa: E402
from avow.base.tuning.running import COLLECTED_IN_WORKS  # noqa: E402

HEAD = "GWENDOLEN\n"
AGENT = ":name: {0}\n:Initial Beliefs:\n:Initial Goals:\n{1}\n:Plans:\n{2}\n"


MOST = 20
MEGABYTES = 550
STATES = 1_000_000


def plain() -> float:
    """Seconds for as many tuples, with four successors each, breadth first."""
    before = time.process_time()
    seen = {(0,) * 8}
    queue = deque(seen)
    while len(seen) < STATES:
        state = queue.popleft()
        for k in range(4):
            after = (*state[1:], (state[0] + k) % 8)
            if after not in seen:
                seen.add(after)
                queue.append(after)
    return time.process_time() - before


def made(folder: Path, agents: str, draws: str):
    (folder / "e.yaml").write_text(draws)
    return system(parse_system(HEAD + agents, "agents.gwen"), read_environment(folder / "e.yaml"), Semantics.MCAPL)


def wanted(text: str) -> Property:
    return Property("f", instantiate(parse_psl(text), {}))


def percepts(count: int) -> str:
    names = ", ".join(f'"p({i})"' for i in range(count))
    return f"draws: {{at_start: true, at_quiescence: repeatedly}}\npercepts: {{x: [{names}, nothing]}}\n"


def falls_behind() -> str:
    """An agent with percepts always on offer, which falls behind them."""
    plans = (f"+p({i}) : {{ True }} <- +k({i}), -k({(i + 1) % 4}), *k({(i + 2) % 4}), go({i});\n" for i in range(4))
    return AGENT.format("ag", "", "".join(plans))


def pursues_goals(count: int = 28) -> str:
    """An agent that takes up a goal for each percept, and subgoals for it."""
    plans = (f"+p({i}) : {{ True }} <- +!serve({i}) [perform];\n" for i in range(count))
    serve = "+!serve(X) [perform] : { ~B k(X) } <- +k(X), +!drop(X) [perform], go(X);\n"
    drop = "+!drop(X) [perform] : { B k(X) } <- -k(X);\n+!serve(X) [perform] : { B k(X) } <- go(X);\n"
    return AGENT.format("ag", "", "".join(plans) + serve + drop)


def waits_and_acts(count: int = 7) -> str:
    """An agent that believes what it perceives, and acts once it knows enough."""
    plans = (f"+p({i}) : {{ B k({(i + 1) % count}) }} <- +k({i}), go({i});\n" for i in range(count))
    first = (
        f"+p({i}) : {{ ~B k({(i + 1) % count}) }} <- -k({i}), +k({(i + 2) % count}), go({i});\n" for i in range(count)
    )
    return AGENT.format("ag", "", "".join(plans) + "".join(first))


def million(folder: Path, name: str, agents: str, count: int) -> tuple[float, int]:
    """Seconds to explore a million states and check a property, and the peak of memory in megabytes."""
    agent = made(folder, agents, percepts(count))
    before = time.process_time()
    graph = explore(agent, states=STATES, seconds=600)
    explored = time.process_time() - before
    p = wanted("[] (B(ag, k(0)) -> (<> D(ag, go(0))))")
    holds = Checker(graph, [p]).check(p).holds
    taken = time.process_time() - before
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"{name}: {len(graph)} states: {explored:.1f} s; with a property ({holds}): {taken:.1f} s, {megabytes} MB")
    return taken, megabytes


PROGRAMS = {
    "falls behind": (falls_behind, 4),
    "pursues goals": (pursues_goals, 28),
    "waits and acts": (waits_and_acts, 7),
}
"""Each with the number of its percepts."""


def main() -> int:
    """Each program in a process of its own, as memory is a process' peak."""
    if len(sys.argv) > 1:
        gc.set_threshold(COLLECTED_IN_WORKS)
        with tempfile.TemporaryDirectory() as folder:
            program, count = PROGRAMS[sys.argv[1]]
            taken, megabytes = million(Path(folder), sys.argv[1], program(), count)
        return int(taken >= MOST * plain() or megabytes >= MEGABYTES)
    print(f"a plain search of as many: {plain():.1f} s")
    return max(subprocess.run([sys.executable, __file__, name]).returncode for name in PROGRAMS)


if __name__ == "__main__":
    raise SystemExit(main())
