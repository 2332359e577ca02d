"""A running Gwendolen program: its percepts come from outside, and so do the results of its actions.

The reasoning cycle is that of `interpreter`, with which the properties are checked; here the percepts are given, not
drawn from alternatives.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from .environment import Environment
from .interpreter import PRINT, Agent, Semantics, World
from .mind import NONE, Table
from .parser import parse_fact, read_system
from .terms import Struct, plain
from .tuning import LIVE_JOBS


class Endless(RuntimeError):  # noqa: N818 - it says what the program is
    """The program neither acts nor comes to rest."""


class GivenPercepts(World):
    """The percepts, as they were given."""

    def __init__(self) -> None:
        self.shown: Table[tuple[Struct, ...]] = Table()
        self.shown.number(())
        super().__init__(Environment((), {}, {}, frozenset(), False, "repeatedly", ()))

    def _offers(self, choice: int) -> tuple[Struct, ...]:
        return self.shown.all[choice]


class Running:
    """The first agent of a file, running."""

    def __init__(self, path: Path | str) -> None:
        """Raises Rejected if the file is not a program."""
        self._world = GivenPercepts()
        self._agent = Agent(read_system(Path(path))[0], self._world, Semantics.MCAPL)
        self._state = self._agent.first()

    def perceive(self, percepts: Iterable[str]) -> tuple[str, tuple[str, ...]] | None:
        """Give all current percepts; the program continues until it acts (the action's name and arguments) or has
        nothing to do (None). Raises Endless, and ValueError if a text is not a percept."""
        found = []
        for text in percepts:
            fact = parse_fact(text)
            if fact is None:
                raise ValueError(f"{text!r} is no percept")
            found.append(fact)
        shown = tuple(sorted(set(found), key=plain))
        choice = self._world.shown.number(shown)
        if choice != self._agent.core(self._state).choice:
            self._state = self._agent.altered(self._state, choice=choice, new=True, asleep=False)
        for _ in range(LIVE_JOBS):
            now = self._agent.core(self._state)
            if not now.planned:
                if now.asleep and not now.new:
                    return None
                self._state = self._agent.cycle(self._state)
                continue
            self._state, action = self._agent.act(self._state)
            if action != NONE and (done := self._agent.actions.all[action]).functor != PRINT:
                self._state = self._agent.altered(self._state, last=action)
                return done.functor, tuple(plain(argument) for argument in done.args)
        raise Endless(f"{LIVE_JOBS} steps without an action")

    def believes(self, fact: str) -> bool:
        """Whether it believes a ground literal itself."""
        return parse_fact(fact) in self._agent.believed(self._state)
