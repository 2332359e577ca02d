"""Runs repeated by the real AIL: our lasso as a scripted environment, with the same draws.

AIL runs the program as it is, without AJPF, in seconds. It reports each action and draw, with the agent's beliefs at
that time; our run gives the expected report. If they differ, one of the two interpreters is wrong.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.base.process import ToolMissing
from avow.formulas.lasso import Lasso
from avow.isolation.outside import Outside

from .ajpf_tool import BRIEF, Installation, prepare
from .explore import Graph, System
from .files import system_files
from .interpreter import PRINT
from .java import MARK, RUNS, Script, runs_class
from .options import Setup
from .syntax import DeedKind
from .terms import plain
from .tuning import REPLAY_MILLISECONDS, REPLAY_START, SAMPLED_STEPS

_VARIABLE = re.compile(r"(?<![A-Za-z0-9_.\"])[A-Z_~][A-Za-z0-9_]*(?:[\^'~][0-9']*)*")


Run = tuple[Graph, Lasso]


@dataclass(frozen=True, slots=True)
class Moment:
    """An action, or a draw without one (`why` is then start or idle), and the beliefs at that time."""

    why: str
    beliefs: tuple[str, ...]

    def text(self) -> str:
        return _VARIABLE.sub("_", f"{self.why}\t{'; '.join(self.beliefs)}")


def expected(graph: Graph, lasso: Lasso) -> tuple[tuple[Moment, ...], Script]:
    """The expected report of the run, its loop unrolled twice, and the choices of the environment and the scheduler on
    it."""
    system = graph.system
    path = [*lasso.path, *lasso.path[lasso.loop :], lasso.path[lasso.loop]]
    moments, draws, turns = [], [], []
    first = system.core(graph.states[path[0]])
    if first.drawn:
        moments.append(_told(system, graph.states[path[0]], "start"))
        draws.append(system.world.choices.all[first.choice])
    for at in range(len(path) - 1):
        before, after = (system.core(graph.states[path[n]]) for n in (at, at + 1))
        if before.over or (after.over and not after.drawn):
            break
        if len(system.agents) > 1 and (before.changed or not any(before.awake)) and (before.begun or not system.probed):
            turns.append(system.agents[after.turn].program.name)
        moment = _moment(system, graph.states[path[at]], graph.states[path[at + 1]])
        if moment is not None:
            moments.append(moment)
            if after.drawn:
                draws.append(system.world.choices.all[after.choice])
    return tuple(moments), Script(tuple(draws), tuple(turns), system.probed)


def _moment(system: System, state: Any, following: Any) -> Moment | None:
    before, after = system.core(state), system.core(following)
    if before.over or after.over:
        return None
    place = after.turn
    agent = system.agents[place]
    mind = agent.core(system.minds(state)[place])
    if not mind.planned:
        return _told(system, state, "start" if any(before.awake) else "idle") if after.drawn else None
    deed = agent.next_deed(mind)
    did = system.did(following)
    if deed is None or deed.kind not in (DeedKind.ACTION, DeedKind.SEND) or did is None:
        return None
    if plain(deed.term).partition("(")[0] == PRINT:
        return None
    return _told(system, state, _named(system, place) + plain(did[1]))


def _named(system: System, place: int) -> str:
    return f"{system.agents[place].program.name}: " if len(system.agents) > 1 else ""


def _told(system: System, state: Any, why: str) -> Moment:
    minds = zip(system.agents, system.minds(state), strict=True)
    texts = [_named(system, at) + plain(b) for at, (agent, mind) in enumerate(minds) for b in agent.believed(mind)]
    return Moment(why, tuple(sorted(texts)))


@dataclass(frozen=True, slots=True)
class Replayed:
    """What AIL made of a run. `difference`: it does another one; `fault`: it could not be run."""

    difference: str | None = None
    fault: str = ""
    log: str = ""


def replay(
    installation: Installation, setup: Setup, runs: Sequence[Run], folder: Path, outside: Outside
) -> tuple[Replayed, ...]:
    """Each run, repeated by AIL: one Java process does all. `outside` records what it reads."""
    asked = [expected(graph, lasso) for graph, lasso in runs]
    files = system_files(setup, "agent", scripted=True)
    try:
        wrong, output = _run(installation, files, [script for _, script in asked], folder, outside)
    except ToolMissing as error:
        wrong, output = str(error), ""
    if wrong is not None:
        return tuple(Replayed(fault=wrong) for _ in asked)
    logs = re.split(rf"^{MARK}run .*$", output, flags=re.MULTILINE)[1 : len(asked) + 1]
    done = [Replayed(_difference(moments, log), log=log) for (moments, _), log in zip(asked, logs, strict=False)]
    lost = Replayed(fault=f"Java ended before the run: {output.strip()[-200:]}")
    return (*done, *[lost] * (len(asked) - len(logs)))


def sampled(graph: Graph, runs: int) -> Iterator[Lasso]:
    """Random runs (the same each time), each until a state repeats."""
    chance = random.Random(0)
    for _ in range(runs):
        path, places = [chance.choice(graph.initial)], dict[int, int]()
        while len(path) <= SAMPLED_STEPS:
            places[path[-1]] = len(path) - 1
            after = graph.after(path[-1])
            if not after:
                break
            following = chance.choice(after)
            if following in places:
                yield Lasso(tuple(path), places[following])
                break
            path.append(following)


def _run(
    installation: Installation, files: Mapping[str, str], scripts: Sequence[Script], folder: Path, outside: Outside
) -> tuple[str | None, str]:
    """Why the scripts cannot be run, and what AIL prints of them. Raises ToolMissing."""
    wrong = prepare(installation, folder, {**files, f"{RUNS}.java": runs_class()}, outside)
    if wrong is not None:
        return wrong, ""
    names = [f"{at}.txt" for at in range(len(scripts))]
    for name, script in zip(names, scripts, strict=True):
        (folder / name).write_text(script.text(), encoding="utf-8")
    command = [installation.java, *BRIEF, "-cp", installation.class_path("."), RUNS, str(REPLAY_MILLISECONDS)]
    seconds = REPLAY_START + len(scripts) * REPLAY_MILLISECONDS / 1000
    done = outside.run([*command, *names], cwd=folder, seconds=seconds, env={"AJPF_HOME": str(installation.home)})
    return None, f"{done.stdout}\n{done.stderr}"


def _difference(moments: Sequence[Moment], output: str) -> str | None:
    lines = [_VARIABLE.sub("_", line.removeprefix(MARK)) for line in output.splitlines() if line.startswith(MARK)]
    for at, moment in enumerate(moments):
        ours = moment.text()
        theirs = lines[at] if at < len(lines) else "nothing more"
        if ours != theirs:
            return f"moment {at + 1}: our run has '{_short(ours)}', AIL's '{_short(theirs)}'"
    return None


def _short(text: str) -> str:
    text = text.replace("\t", ", believing ")
    return text if len(text) <= 300 else text[:300] + "…"
