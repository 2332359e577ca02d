"""A run that refutes, done again by the real AIL: our lasso as a scripted environment, with the same draws.

AIL runs the program as it is, without AJPF, in seconds. It tells each action and draw, with what the agent believes
then; our run says what should be told. Where they part, one of the two interpreters is wrong.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from avow.base.process import ToolMissing, run

from .ajpf_tool import Installation, prepare
from .environment import Choice
from .explore import Graph
from .interpreter import PRINT, Agent, State
from .java import CLASS, MARK, environment_class
from .mind import NONE
from .options import Setup
from .printer import program_text
from .structure import Lasso
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


def expected(graph: Graph, lasso: Lasso) -> tuple[tuple[Moment, ...], tuple[Choice, ...]]:
    """What the run tells, its loop gone through twice, and what the environment draws on it."""
    agent = graph.agent
    path = [*lasso.path, *lasso.path[lasso.loop :], lasso.path[lasso.loop]]
    moments, draws = [], []
    for at in range(len(path) - 1):
        before, after = graph.states[path[at]], graph.states[path[at + 1]]
        moment = _moment(agent, before, after)
        if moment is not None:
            moments.append(moment)
            if after.drawn:
                draws.append(agent.choices.items[after.choice])
    return tuple(moments), tuple(draws)


def _moment(agent: Agent, before: State, after: State) -> Moment | None:
    if before.over or after.over:
        return None
    if not before.planned:
        return _told(agent, before, "idle" if before.asleep else "start") if after.drawn else None
    top = agent.intentions.items[before.current].frames[-1]
    if not top.deeds or top.deeds[0].kind not in (DeedKind.ACTION, DeedKind.SEND) or after.last == NONE:
        return None
    deed = top.deeds[0].term
    if plain(deed).partition("(")[0] == PRINT:
        return None
    return _told(agent, before, plain(agent.actions.items[after.last]))


def _told(agent: Agent, state: State, why: str) -> Moment:
    beliefs = agent.beliefs.items[state.beliefs]
    texts = (plain(b) for b in beliefs.own | beliefs.perceived if not b.functor.startswith("."))
    return Moment(why, tuple(sorted(texts)))


def replay(installation: Installation, setup: Setup, graph: Graph, lasso: Lasso) -> tuple[str | None, str]:
    """How AIL's run differs from ours, None where it does not; and AIL's output. Raises Unable."""
    moments, draws = expected(graph, lasso)
    files = {
        "agent.gwen": program_text(setup.program),
        "agent.ail": f"env = {CLASS}\nmas.file = agent.gwen\nmas.builder = gwendolen.GwendolenMASBuilder\n",
        f"{CLASS}.java": environment_class(setup.environment, script=draws, probed=graph.agent.probed),
    }
    with tempfile.TemporaryDirectory(prefix="avow-ail-") as temporary:
        folder = Path(temporary)
        wrong = prepare(installation, folder, files)
        if wrong is not None:
            raise Unable(wrong)
        command = [installation.java, "-cp", installation.class_path("."), "ail.mas.AIL", "agent.ail"]
        try:
            done = run(command, cwd=folder, seconds=REPLAY_SECONDS, env={"AJPF_HOME": str(installation.home)})
        except ToolMissing as error:
            raise Unable(str(error)) from None
    told = [line.removeprefix(MARK) for line in done.stdout.splitlines() if line.startswith(MARK)]
    return _difference(moments, [_VARIABLE.sub("_", line) for line in told]), done.stdout + done.stderr


class Unable(Exception):  # noqa: N818 - it names a state, not a fault
    """AIL could not be run; the text says why."""


def _difference(moments: Sequence[Moment], told: Sequence[str]) -> str | None:
    for at, moment in enumerate(moments):
        ours = moment.text()
        theirs = told[at] if at < len(told) else "nothing more"
        if ours != theirs:
            return f"moment {at + 1}: our run has '{_short(ours)}', AIL's '{_short(theirs)}'"
    return None


def _short(text: str) -> str:
    text = text.replace("\t", ", believing ")
    return text if len(text) <= 300 else text[:300] + "…"
