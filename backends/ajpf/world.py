"""What surrounds agents: what there is to perceive, and what can be drawn next."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from .environment import Choice, Environment
from .mind import Table
from .syntax import Struct, plain


class World:
    """An environment whose draws have numbers (`choices`)."""

    def __init__(self, environment: Environment) -> None:
        self.environment = environment
        self.choices: Table[Choice] = Table()
        self.before = self.choices.number(environment.before)
        self.after = cache(self._after)
        self.offers = cache(self._offers)

    def first(self) -> tuple[int, ...]:
        """The first draws."""
        return self._draws(self.environment.before, self.environment.start)

    def drawn(self, choice: int) -> tuple[Struct, ...]:
        """What is on offer, in the order of the environment's groups."""
        return self.environment.percepts(self.choices.items[choice])

    def _after(self, choice: int, action: str) -> tuple[int, ...]:
        """Everything that can be drawn after an action; the draw of an idle agent is that after ``""``."""
        return self._draws(self.choices.items[choice], self.environment.after.get(action, {}))

    def _draws(self, choice: Choice, narrowed: Mapping[str, tuple[int, ...]]) -> tuple[int, ...]:
        return tuple(self.choices.number(d) for d in self.environment.draws(choice, narrowed))

    def _offers(self, choice: int) -> tuple[Struct, ...]:
        """Percepts in the order in which they are taken up: that of their texts."""
        return tuple(sorted(set(self.environment.percepts(self.choices.items[choice])), key=plain))
