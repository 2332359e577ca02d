"""Intentions: stacks of events, each with its remaining deeds, as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from .syntax import NULL, Deed, Event, Goal, GoalKind, Sign, show_event
from .terms import Bindings, Struct, Term, Var, apply, is_ground, rename, variables

START = Event(Sign.ADD, Struct(":start"))
"""The bottom event of an intention for an initial goal."""
PERCEPTION = Event(Sign.ADD, Struct(":perception"))
"""The event of an intention that handles one percept."""


@dataclass(frozen=True, slots=True)
class Frame:
    """An event and its remaining deeds; `deeds` is None until a plan is chosen."""

    event: Event
    deeds: tuple[Deed, ...] | None = None
    fresh: bool = False
    """A plan was chosen for it, and no deed of it is done: this matters when AIL counts the rows of an intention."""


@dataclass(frozen=True, slots=True)
class Intention:
    """A stack of frames, the bottom one first. `waiting` is the literal that suspended it; a `locked` intention stays
    the current one until it unlocks itself."""

    frames: tuple[Frame, ...]
    waiting: Term | None = None
    locked: bool = False

    @property
    def weight(self) -> tuple[int, str]:
        """The order of suspended intentions: by their number of rows, then by the text of their top event. AIL keeps
        the next deed of a frame in a row of its own once one has been done."""
        rows = sum(2 if f.deeds is not None and len(f.deeds) > 1 and not f.fresh else 1 for f in self.frames)
        return rows, show_event(self.frames[-1].event)

    def goals(self) -> tuple[Goal, ...]:
        """The goals of its events, the bottom one first."""
        return tuple(goal for frame in self.frames if (goal := goal_of(frame.event)) is not None)


EMPTY = Intention(())


def goal_of(event: Event) -> Goal | None:
    if not event.is_goal:
        return None
    return Goal(event.term, event.goal or GoalKind.PERFORM)


def of_event(event: Event) -> Intention:
    return Intention((Frame(event),))


def of_deed(event: Event, deed: Deed) -> Intention:
    return Intention((Frame(event, (deed,)),))


def bind(intention: Intention, bindings: Bindings) -> Intention:
    """The intention with its bound variables replaced, in all its frames."""
    return _changed(intention, lambda term: apply(term, bindings)) if bindings and intention.frames else intention


def _changed(intention: Intention, change: Callable[[Term], Term]) -> Intention:
    """The intention with all its terms mapped."""

    def changed(frame: Frame) -> Frame:
        event = replace(frame.event, term=change(frame.event.term))
        if frame.deeds is None:
            return Frame(event)
        deeds = tuple(replace(d, term=change(d.term)) if d.args else d for d in frame.deeds)
        return Frame(event, deeds, frame.fresh)

    return replace(intention, frames=tuple(map(changed, intention.frames)))


def tail(intention: Intention) -> tuple[Intention, Goal | None]:
    """The intention without its next deed. A frame is removed with its last deed, and the goal of a removed frame is
    returned too: it leaves the goal base."""
    top = intention.frames[-1]
    if top.deeds is not None and len(top.deeds) > 1:
        return replace(intention, frames=(*intention.frames[:-1], Frame(top.event, top.deeds[1:]))), None
    return replace(intention, frames=intention.frames[:-1]), goal_of(top.event)


def post(intention: Intention, goal: Goal) -> Intention:
    """The goal is posted. The deed that posts a goal to be performed becomes one that does nothing, which takes a turn
    of its own later; one that posts a goal to be achieved is examined again when that goal has been handled."""
    top = intention.frames[-1]
    assert top.deeds
    deeds = top.deeds if goal.kind is GoalKind.ACHIEVE else (NULL, *top.deeds[1:])
    return replace(intention, frames=(*intention.frames[:-1], Frame(top.event, deeds), Frame(event_of(goal))))


def event_of(goal: Goal, sign: Sign = Sign.ADD) -> Event:
    return Event(sign, goal.term, goal.kind, is_goal=True)


def canonical(intention: Intention) -> Intention:
    """Variables of reasoning rules, named apart at every use, get names that depend on the intention alone."""
    if all(is_ground(f.event.term) and all(is_ground(d.term) for d in f.deeds or ()) for f in intention.frames):
        return intention
    names: dict[str, Term] = {}
    for frame in intention.frames:
        for term in (frame.event.term, *(d.term for d in frame.deeds or ())):
            for name in variables(term):
                if "'" in name:
                    names.setdefault(name, Var(f"~{len(names)}"))
    if not names:
        return intention
    return _changed(intention, lambda term: rename(term, names))
