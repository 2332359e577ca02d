"""The reachable states of an agent, within bounds."""

from __future__ import annotations

import resource
import time
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .beliefs import TooDeep
from .builtin import Crash
from .interpreter import Agent
from .mind import Table
from .society import Society
from .tuning import INTENTIONS, STATES

System = Agent | Society
"""A transition system over states of its own type. The core of a state records whether the environment has just drawn
(`drawn`), the percepts on offer (`choice`) and whether the run is over."""


@dataclass(frozen=True, slots=True)
class Graph:
    """States by their numbers; `after` has their successors."""

    system: System
    states: Sequence[Any]
    initial: tuple[int, ...]
    offsets: array[int]
    targets: array[int]
    unfinished: str | None = None
    """Why states are missing: the unexplored ones have no successors. A run within the explored part is still a run of
    the agent."""

    def __len__(self) -> int:
        return len(self.states)

    def after(self, state: int) -> array[int]:
        """The state's successors."""
        return self.targets[self.offsets[state] : self.offsets[state + 1]]

    @property
    def transitions(self) -> int:
        return len(self.targets)


def _backlog(system: System, newest: Sequence[Any]) -> str:
    minds = ((agent, mind) for state in newest for agent, mind in zip(system.agents, system.minds(state), strict=True))
    most = max(len(agent.state(mind).queue) for agent, mind in minds)
    if most < INTENTIONS:
        return ""
    return (
        f", with up to {most} intentions at once: each action draws percepts, and the agent falls behind them. Guards "
        "can keep it from acting again on what it knows; with `semantics: edge`, only changes are events, and the "
        "environment file can say what an action leaves as it is (`after: {action: {group: [keep]}}`)"
    )


def explore(
    system: System,
    *,
    states: int = STATES,
    seconds: float = 60.0,
    megabytes: int = 4096,
) -> Graph:
    """Every reachable state, breadth first, within the bounds (`Graph.unfinished`)."""
    deadline = time.monotonic() + seconds
    memory = _memory() + megabytes
    table: Table[Any] = Table()
    found = table.all
    offsets, targets = array("i", [0]), array("i")

    initial = tuple(dict.fromkeys(map(table.number, system.start())))
    at = 0
    unfinished = None
    while at < len(found):
        if len(found) > states:
            unfinished = f"more than {states} states"
        elif at & 1023 == 0 and time.monotonic() > deadline:
            unfinished = f"{at} of at least {len(found)} states explored in {seconds:g} s"
        elif at & 1023 == 0 and _memory() > memory:
            unfinished = f"{len(found)} states fill {megabytes} MB"
        if unfinished is not None:
            unfinished += _backlog(system, found[-1_000:])
            break
        try:
            reached = system.successors(found[at])
        except (TooDeep, RecursionError):
            unfinished = "the agent's terms or reasoning rules nest too deeply, or ask for too much"
            break
        except Crash as error:
            unfinished = f"the agent ends with an error of its own: {error}"
            break
        targets.extend(map(table.number, reached))
        offsets.append(len(targets))
        at += 1
    offsets.extend([len(targets)] * (len(found) - at))
    return Graph(system, found, initial, offsets, targets, unfinished)


def _memory() -> float:
    """The most memory that this process has had so far, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
