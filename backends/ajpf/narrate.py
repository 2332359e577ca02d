"""A run of an agent in words: by the same interpreter whose every run is checked."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from typing import Any

from .explore import System
from .interpreter import Agent, State
from .mind import NONE
from .syntax import NULL, DeedKind, show_deed, show_event
from .terms import show


@dataclass(frozen=True, slots=True)
class NarratedStep:
    """One step of a run. `what` is a sentence; the others are texts of terms."""

    agent: str
    """The agent whose step it is; empty if there is only one agent."""
    what: str
    offered: tuple[str, ...] | None = None
    """The environment's latest draw; None if it did not draw."""
    believed: tuple[str, ...] = ()
    believed_no_more: tuple[str, ...] = ()
    action: str | None = None
    waiting: int = 0
    """How many other intentions there are."""

    def lines(self) -> Iterator[str]:
        who = f"{self.agent}: " if self.agent else ""
        yield who + re.sub(r"\^\d+", "", self.what)  # the interpreter numbers the variables of nested plans
        if self.believed:
            yield f"  believes {', '.join(self.believed)}"
        if self.believed_no_more:
            yield f"  no longer believes {', '.join(self.believed_no_more)}"
        if self.offered is not None:
            yield f"  there is to perceive: {', '.join(self.offered) or 'nothing'}"


def narrated(system: System, seed: int, steps: int) -> Iterator[NarratedStep]:
    """At most so many steps of one run; if the environment has a choice, the seed decides. Raises Crash, TooDeep."""
    rng = Random(seed)
    state: Any = system.start()[0]
    for _ in range(steps):
        after: Any = rng.choice(system.successors(state))
        if system.core(after).over:
            yield NarratedStep("", "there is nothing to do: the run is over")
            return
        yield _told(system, state, after)
        state = after


def _told(system: System, state: Any, following: Any) -> NarratedStep:
    seen = system.core(following)
    place = seen.turn
    agent, old, new = system.agents[place], system.minds(state)[place], system.minds(following)[place]
    had, has, before, after = agent.believed(old), agent.believed(new), agent.state(old), agent.state(new)
    action = None
    did = system.did(following)
    if did is not None and before.planned and _deed(agent, before).startswith("does "):
        action = show(did[1])
    return NarratedStep(
        agent.program.name if len(system.agents) > 1 else "",
        _deed(agent, before) if before.planned else _choice(agent, before, after),
        tuple(map(show, system.world.drawn(seen.choice))) if seen.drawn else None,
        tuple(sorted(map(show, has - had))),
        tuple(sorted(map(show, had - has))),
        action,
        len(after.queue),
    )


def _deed(agent: Agent, state: State) -> str:
    top = agent.intentions.all[state.current].frames[-1]
    if not top.deeds:
        return f"has no plan for {show_event(top.event)}: it stands still"
    deed = top.deeds[0]
    match deed.kind:
        case DeedKind.NULL:
            return "goes on after a goal"
        case DeedKind.ACTION | DeedKind.SEND:
            return f"does {show_deed(deed)}"
        case DeedKind.WAIT | DeedKind.WAIT_NOT:
            return f"looks whether to wait: {show_deed(deed)}"
        case _:  # actions, and changes of beliefs and goals
            return f"carries out {show_deed(deed)}"


def _choice(agent: Agent, before: State, after: State) -> str:
    if after.current == NONE:
        return "has nothing to do"
    if not after.planned:
        gone = [n for n in (before.current, *before.queue) if n not in (NONE, agent.empty, *after.queue)]
        event = show_event(agent.intentions.all[gone[0]].frames[-1].event) if gone else "an event"
        return f"finds no deeds for {event}, and drops it"
    old = {before.current, *before.queue}
    intention = agent.intentions.all[after.current]
    top = intention.frames[-1]
    event = show_event(top.event)
    if event.startswith("+:"):
        if after.current in old and top.deeds == (NULL,):
            return "goes on after a goal that it started with"
        word = {"+:start": "takes up a goal that it starts with", "+:perception": "takes up a percept"}[event]
        return f"{word}: {', '.join(map(show_deed, top.deeds or ()))}"
    if after.current in old:
        return f"goes on with {event}"
    if top.deeds is None:
        return f"finds no plan for {show_event(intention.frames[-2].event)}"
    return f"answers {event}: {', '.join(map(show_deed, top.deeds))}"
