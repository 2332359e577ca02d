"""A system's derivations, with what is computed for them once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from avow.calculus.derivation import Goal, Settled, SideCondition
from avow.calculus.discharge import Answers, Bounds, settle
from avow.calculus.meaning import Meanings
from avow.calculus.rules import WHOLE, derive
from avow.calculus.scenario import world
from avow.calculus.transition import Machine
from avow.calculus.variables import Frame, frame
from avow.system.plan import System


@dataclass(slots=True)
class Composition:
    """A system's derivations: of each goal of the plan, and of the whole system."""

    frame: Frame
    goals: tuple[Goal, ...]
    meanings: Meanings
    _answers: dict[str, Answers] = field(default_factory=dict)
    _machine: Machine | None = None

    def goal(self, name: str) -> Goal:
        return next(goal for goal in self.goals if goal.name == name)

    def settled(self, goal: Goal, bounds: Bounds) -> Answers:
        """The goal's side conditions, settled once."""
        if goal.name not in self._answers:
            self._answers[goal.name] = settle(self.frame, goal, bounds)
        return self._answers[goal.name]

    def known(self, goal: Goal) -> Mapping[SideCondition, Settled]:
        """The side conditions of a goal that have been settled; none if it was not asked for."""
        answers = self._answers.get(goal.name)
        return answers.settled if answers is not None else {}

    def machine(self, seed: int = 0) -> Machine:
        """The composed contracts as a transition system, made once. Raises CannotRun."""
        if self._machine is None:
            self._machine = Machine(world(self.frame), seed)
        return self._machine

    @property
    def whole(self) -> Goal:
        """The derivation over every node: the plan's own, or the one named ``whole``."""
        everything = set(self.frame.graph.nodes)
        return next((goal for goal in self.goals if set(goal.nodes) == everything), self.goals[-1])


def compose(system: System) -> Composition:
    """The derivations of a system. Pure. Raises Rejected for a plan whose formulas are wrong."""
    built = frame(system)
    goals = [derive(built, goal) for goal in system.plan.compose]
    everything = set(built.graph.nodes)
    if not any(set(goal.nodes) == everything for goal in goals) and WHOLE not in [goal.name for goal in goals]:
        goals.append(derive(built))
    return Composition(built, tuple(goals), Meanings(built))


def argument(composition: Composition, goal: str, key: str) -> str:
    """The plan's reason for a hypothesis of a goal, or nothing."""
    for entry in composition.frame.system.plan.compose:
        if entry.name == goal and isinstance(entry.options.data, dict):
            given = entry.options.data.get(key)
            if isinstance(given, dict):
                signed = ", ".join(str(given[part]) for part in ("who", "date") if given.get(part))
                return str(given["because"]) + (f" ({signed})" if signed else "")
    return ""
