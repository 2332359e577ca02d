"""A Gwendolen program that runs: what is perceived comes from outside, and so does what becomes of its actions.

The reasoning cycle is that of `interpreter`, which the properties are checked with; here the world is not drawn from
alternatives but told.
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


class _Told(World):
    """What there is to perceive, as it was told."""

    def __init__(self) -> None:
        self.shown: Table[tuple[Struct, ...]] = Table()
        self.shown.number(())
        super().__init__(Environment((), {}, {}, frozenset(), False, "repeatedly", ()))

    def _offers(self, choice: int) -> tuple[Struct, ...]:
        return self.shown.all[choice]


class Running:
    """The first agent of a file, at work."""

    def __init__(self, path: Path | str) -> None:
        """Raises Rejected where the file is no program."""
        self._world = _Told()
        self._agent = Agent(read_system(Path(path))[0], self._world, Semantics.MCAPL)
        self._state = self._agent.first()

    def perceive(self, percepts: Iterable[str]) -> tuple[str, tuple[str, ...]] | None:
        """All that there is to perceive now; the program goes on until it acts (the action's name and arguments) or has
        nothing to do (None). Raises Endless, and ValueError for what is no percept."""
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
