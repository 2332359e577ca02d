"""How fast an agent's state space is explored, against a plain search of as many states.

    python benchmarks/agents.py

Processor seconds and megabytes of this process. The exit code is 1 where a million states, with the check of a
property, take `MOST` times as long as the plain search, or `MEGABYTES`.
"""

from __future__ import annotations

import resource
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

HEAD = "GWENDOLEN\n"
AGENT = ":name: {0}\n:Initial Beliefs:\n:Initial Goals:\n{1}\n:Plans:\n{2}\n"


MOST = 20
MEGABYTES = 400
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


def million(folder: Path) -> bool:
    """An agent with percepts always on offer, which falls behind them."""
    plans = "".join(
        f"+p({i}) : {{ True }} <- +k({i}), -k({(i + 1) % 4}), *k({(i + 2) % 4}), go({i});\n" for i in range(4)
    )
    percepts = ", ".join(f'"p({i})"' for i in range(4))
    draws = f"draws: {{at_start: true, at_quiescence: repeatedly}}\npercepts: {{x: [{percepts}, nothing]}}\n"
    agent = made(folder, AGENT.format("ag", "", plans), draws)
    search = plain()
    before = time.process_time()
    graph = explore(agent, states=STATES, seconds=600)
    explored = time.process_time() - before
    p = wanted("[] (B(ag, k(0)) -> (<> D(ag, go(0))))")
    holds = Checker(graph, [p]).check(p).holds
    taken = time.process_time() - before
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"{len(graph)} states: {explored:.1f} s; with a property ({holds}): {taken:.1f} s, {megabytes} MB")
    print(f"a plain search of as many: {search:.1f} s; that is {taken / search:.0f} times as long")
    return taken < MOST * search and megabytes < MEGABYTES


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        return 0 if million(Path(folder)) else 1


if __name__ == "__main__":
    raise SystemExit(main())
