"""The reachable states of an agent, within bounds."""

from __future__ import annotations

import resource
import time
from array import array
from dataclasses import dataclass

from avow.backends.ajpf.interpreter import Agent, State

MAX_STATES = 2_000_000


class Unfinished(Exception):  # noqa: N818 - it names a state, not a fault
    """The bounds were met before all states were; `reason` is a clause for people."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Graph:
    """States by their numbers. The successors of s are ``targets[offsets[s]:offsets[s + 1]]``, never none."""

    agent: Agent
    states: tuple[State, ...]
    initial: tuple[int, ...]
    offsets: array[int]
    targets: array[int]

    def __len__(self) -> int:
        return len(self.states)

    @property
    def transitions(self) -> int:
        return len(self.targets)


def explore(
    agent: Agent, *, states: int = MAX_STATES, seconds: float = 60.0, megabytes: int = 4096
) -> Graph:
    """Every reachable state, breadth first. Raises Unfinished (and beliefs.TooDeep)."""
    deadline = time.monotonic() + seconds
    memory = _memory() + megabytes
    numbers: dict[State, int] = {}
    found: list[State] = []
    offsets, targets = array("q", [0]), array("q")

    def number(state: State) -> int:
        known = numbers.get(state)
        if known is None:
            known = numbers[state] = len(found)
            found.append(state)
        return known

    initial = tuple(dict.fromkeys(number(state) for state in agent.start()))
    at = 0
    successors = agent.successors
    while at < len(found):
        for state in successors(found[at]):
            targets.append(number(state))
        offsets.append(len(targets))
        at += 1
        if at & 1023 == 0:
            if len(found) > states:
                raise Unfinished(f"more than {states} states")
            if _memory() > memory:
                raise Unfinished(f"{len(found)} states fill {megabytes} MB")
            if time.monotonic() > deadline:
                raise Unfinished(f"{at} of at least {len(found)} states explored in {seconds:g} s")
    if len(found) > states:
        raise Unfinished(f"more than {states} states")
    return Graph(agent, tuple(found), initial, offsets, targets)


def _memory() -> float:
    """The most memory that this process has had so far, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
