"""A run that refutes, done again by the real AIL: our lasso as a scripted environment, with the same draws.

AIL runs the program as it is, without AJPF, in seconds. It tells each action and draw, with what the agent believes
then; our run says what should be told. Where they part, one of the two interpreters is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from avow.base.process import ToolMissing
from avow.formulas.lasso import Lasso
from avow.isolation.outside import Outside

from .ajpf_tool import BRIEF, Answer, Installation, Said, prepare
from .asking import keep, key, recall
from .explore import Graph, System
from .files import system_files
from .interpreter import PRINT
from .java import CLASS, MARK, SCRIPT, Script
from .options import Setup
from .syntax import DeedKind, plain
from .tuning import REPLAY_SECONDS

_VARIABLE = re.compile(r"(?<![A-Za-z0-9_.\"])[A-Z_~][A-Za-z0-9_]*(?:[\^'~][0-9']*)*")


@dataclass(frozen=True, slots=True)
class Moment:
    """An action, or a draw where there is none (`why` is then start or idle), and what is believed at that time."""

    why: str
    beliefs: tuple[str, ...]

    def text(self) -> str:
        return _VARIABLE.sub("_", f"{self.why}\t{'; '.join(self.beliefs)}")


def expected(graph: Graph, lasso: Lasso) -> tuple[tuple[Moment, ...], Script]:
    """What the run tells, its loop gone through twice, and what the environment and the scheduler choose on it."""
    system = graph.system
    path = [*lasso.path, *lasso.path[lasso.loop :], lasso.path[lasso.loop]]
    moments, draws, turns = [], [], []
    first = graph.states[path[0]]
    if first.drawn:
        moments.append(_told(system, first, "start"))
        draws.append(system.world.choices.items[first.choice])
    for at in range(len(path) - 1):
        before, after = graph.states[path[at]], graph.states[path[at + 1]]
        if before.over or (after.over and not after.drawn):
            break
        if len(system.agents) > 1 and (before.changed or not any(before.awake)) and (before.begun or not system.probed):
            turns.append(system.agents[after.turn].program.name)
        moment = _moment(system, before, after)
        if moment is not None:
            moments.append(moment)
            if after.drawn:
                draws.append(system.world.choices.items[after.choice])
    return tuple(moments), Script(tuple(draws), tuple(turns), system.probed)


def _moment(system: System, before: Any, after: Any) -> Moment | None:
    if before.over or after.over:
        return None
    place = after.turn if len(system.agents) > 1 else 0
    agent, mind = system.agents[place], system.minds(before)[place]
    if not mind.planned:
        asleep = before.asleep if len(system.agents) == 1 else not any(before.awake)
        return _told(system, before, "idle" if asleep else "start") if after.drawn else None
    deed = agent.next_deed(mind)
    did = system.did(after)
    if deed is None or deed.kind not in (DeedKind.ACTION, DeedKind.SEND) or did is None:
        return None
    if plain(deed.term).partition("(")[0] == PRINT:
        return None
    return _told(system, before, _named(system, place) + plain(did[1]))


def _named(system: System, place: int) -> str:
    return f"{system.agents[place].program.name}: " if len(system.agents) > 1 else ""


def _told(system: System, state: Any, why: str) -> Moment:
    minds = zip(system.agents, system.minds(state), strict=True)
    texts = [_named(system, at) + plain(b) for at, (agent, mind) in enumerate(minds) for b in agent.believed(mind)]
    return Moment(why, tuple(sorted(texts)))


def replay(
    installation: Installation, setup: Setup, graph: Graph, lasso: Lasso, folder: Path, outside: Outside
) -> Answer:
    """Whether AIL does our run (holds) or another (violated, with the difference); an error where it cannot be run.

    In `folder` the environment's class is compiled once for all runs of the setup, and `outside` knows what was looked
    at for all of them. What AIL told of a run that agreed is kept (`asking`)."""
    moments, script = expected(graph, lasso)
    files = system_files(setup, "agent", scripted=True)
    asked = key({**files, SCRIPT: script.text()}, "replay", installation.mark())
    told = recall(asked) or _run(installation, files, script, folder, outside)
    if told.said is Said.ERROR:
        return told
    if (difference := _difference(moments, told.log)) is not None:
        return replace(told, said=Said.VIOLATED, reason=difference)
    keep(asked, told)  # anything else may come of the machine, and is tried again
    return told


def _run(
    installation: Installation, files: Mapping[str, str], script: Script, folder: Path, outside: Outside
) -> Answer:
    wrong, output = None, ""
    try:
        if not (folder / f"{CLASS}.class").is_file():
            wrong = prepare(installation, folder, files, outside)
        if wrong is None:
            (folder / SCRIPT).write_text(script.text(), encoding="utf-8")
            command = [installation.java, *BRIEF, "-cp", installation.class_path("."), "ail.mas.AIL", "agent.ail"]
            env = {"AJPF_HOME": str(installation.home)}
            done = outside.run(command, cwd=folder, seconds=REPLAY_SECONDS, env=env)
            output = f"{done.stdout}\n{done.stderr}"
    except ToolMissing as error:
        wrong = str(error)
    said = Said.HOLDS if wrong is None else Said.ERROR
    return Answer(said, wrong or "", log=output, observed=outside.observed())


def _difference(moments: Sequence[Moment], output: str) -> str | None:
    told = [_VARIABLE.sub("_", line.removeprefix(MARK)) for line in output.splitlines() if line.startswith(MARK)]
    for at, moment in enumerate(moments):
        ours = moment.text()
        theirs = told[at] if at < len(told) else "nothing more"
        if ours != theirs:
            return f"moment {at + 1}: our run has '{_short(ours)}', AIL's '{_short(theirs)}'"
    return None


def _short(text: str) -> str:
    text = text.replace("\t", ", believing ")
    return text if len(text) <= 300 else text[:300] + "…"
