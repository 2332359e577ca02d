"""An agent's mental state, in interned parts, and the effect on it of choosing a plan or doing one deed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple, TypeVar, assert_never

from .beliefs import Beliefs, Reasoner, renamed_condition
from .builtin import COMPUTING, Crash, compute, computed
from .intentions import EMPTY, PERCEPTION, Frame, Intention, bind, canonical, goal_of, of_event, tail
from .syntax import RECEIVED, SENT, DeedKind, Event, Goal, GoalKind, Plan, Program, Sign
from .terms import Bindings, Struct, Term, Var, apart, is_ground, name_of, plain, unify

T = TypeVar("T")
NONE = -1


class Table(dict[T, int]):
    """Numbers for values, in order of appearance; the value of a number is in `all`. A known number is found without a
    call of a Python function."""

    def __init__(self) -> None:
        super().__init__()
        self.all: list[T] = []

    number = dict[T, int].__getitem__

    def __missing__(self, item: T) -> int:
        number = self[item] = len(self.all)
        self.all.append(item)
        return number


class Done(NamedTuple):
    """The effect of one deed, as far as it depends only on beliefs, goals and the intention."""

    beliefs: int
    goals: int
    intention: int
    posted: tuple[int, ...] = ()
    changed: tuple[int, ...] = ()
    """Beliefs added or dropped, by their numbers."""
    action: int = NONE
    suspended: bool = False


class Mind:
    """Belief bases, goal bases, intentions and actions by their numbers; and the steps between them."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.reasoner = Reasoner.of(program.rules)
        self.beliefs: Table[Beliefs] = Table()
        self.goals: Table[frozenset[Goal]] = Table()
        self.intentions: Table[Intention] = Table()
        self.actions: Table[Struct] = Table()
        self.terms: Table[Term] = Table()
        self.empty = self.intentions.number(EMPTY)
        self.uses_goals = any(c.is_goal for plan in program.plans for c in plan.guard)
        self._triggers = _trigger_index(program.plans)
        self.base = cache(self._base)
        self.chosen, self.done = cache(self.choose), cache(self.effect)

    # Plans

    def choose(self, base: int, goals: int, number: int) -> tuple[int, int]:
        intention = self.intentions.all[number]
        event, below = intention.frames[-1].event, intention.frames[:-1]
        suffix = f"^{len(intention.frames)}"
        for plan in self._triggered(event):
            kind = _kind_met(plan.event, event) if event.is_goal else None
            if event.is_goal and kind is None:
                continue
            bindings = unify(apart(plan.event.term, suffix), event.term, {})
            if bindings is None:
                continue
            guard = tuple(renamed_condition(c, suffix) for c in plan.guard)
            met = self.reasoner.first_way(self.beliefs.all[base], guard, bindings, self._wanted(goals))
            if met is None:
                continue
            if not plan.deeds:
                left = bind(replace(intention, frames=below), met)
                gone = goal_of(event) if event.sign is Sign.ADD else None
                return self.number(left), self.without(goals, gone)
            deeds = tuple(replace(d, term=apart(d.term, suffix)) if d.args else d for d in plan.deeds)
            top = Frame(replace(event, goal=kind), deeds, fresh=True)
            return self.number(bind(replace(intention, frames=(*below, top)), met)), goals
        if not below and not (event.is_goal and event.sign is Sign.DROP):
            return self.empty, goals
        if event.is_goal and event.sign is Sign.ADD:
            problem = Frame(replace(event, sign=Sign.DROP))
            return self.number(replace(intention, frames=(*intention.frames, problem))), goals
        return number, goals

    def _triggered(self, event: Event) -> Sequence[Plan]:
        """The plans that an event may trigger, in file order. The addition of a belief with a free variable triggers
        none: AIL annotates the belief with its source, and a term with variables, unlike a ground one, unifies only
        with a trigger of the same annotations, which a program cannot write. (A message is not annotated.)"""
        key = _key(event)
        is_belief = not event.is_goal and key[2] != RECEIVED
        if is_belief and event.sign is Sign.ADD and not is_ground(event.term):
            return ()
        return self._triggers.get(key, ())

    # Deeds

    def effect(self, base: int, goals: int, number: int) -> Done:
        intention = self.intentions.all[number]
        top = intention.frames[-1]
        if not top.deeds:  # an event -!g that no plan handles
            return Done(base, goals, number)
        deed, beliefs = top.deeds[0], self.beliefs.all[base]
        term = computed(deed.term)
        match deed.kind:
            case DeedKind.SEND:
                to, force, content = term.args if isinstance(term, Struct) else ()
                sent = Struct(SENT, (name_of(to), Struct(self.program.name), force, content))
                action = self.actions.number(Struct("send", (content, to)))
                base = self.base(beliefs.own | {sent}, beliefs.perceived)
                event = self.intentions.number(of_event(Event(Sign.ADD, sent)))
                return self.after(base, goals, intention, {}, (event,), action=action)
            case DeedKind.ACTION:
                done = _named(term)
                action = self.actions.number(done)
                bindings = compute(done) if done.functor in COMPUTING else {}
                return self.after(base, goals, intention, bindings, action=action)
            case DeedKind.ADD_BELIEF:
                return self._add_belief(goals, intention, beliefs, base, _named(term))
            case DeedKind.DROP_BELIEF:
                return self._drop_belief(goals, intention, beliefs, term)
            case DeedKind.WAIT | DeedKind.WAIT_NOT:
                met = self.reasoner.derived(beliefs, term)
                if deed.kind is DeedKind.WAIT_NOT:
                    met = {} if met is None else None
                if met is not None:
                    return self.after(base, goals, intention, met)
                return Done(base, goals, self.number(replace(intention, waiting=term)), suspended=True)
            case DeedKind.LOCK | DeedKind.UNLOCK:
                locked = replace(intention, locked=deed.kind is DeedKind.LOCK)
                return self.after(base, goals, locked, {})
            case DeedKind.ADD_GOAL | DeedKind.DROP_GOAL | DeedKind.NULL:  # goals need the queue
                return self.after(base, goals, intention, {})
            case _:
                assert_never(deed.kind)

    def after(
        self,
        base: int,
        goals: int,
        intention: Intention,
        bindings: Bindings,
        posted: tuple[int, ...] = (),
        changed: tuple[int, ...] = (),
        action: int = NONE,
    ) -> Done:
        """The deed is done."""
        left, gone = tail(intention)
        return Done(base, self.without(goals, gone), self.number(bind(left, bindings)), posted, changed, action)

    def _add_belief(self, goals: int, intention: Intention, beliefs: Beliefs, base: int, belief: Struct) -> Done:
        known = self.reasoner.derived(beliefs, belief) is not None
        new = base
        if belief not in beliefs:
            if intention.frames[0].event == PERCEPTION:
                new = self.base(beliefs.own, beliefs.perceived | {belief})
            else:
                new = self.base(beliefs.own | {belief}, beliefs.perceived)
        posted = () if known else (self.intentions.number(of_event(Event(Sign.ADD, belief))),)
        return self.after(new, goals, intention, {}, posted, (self.terms.number(belief),))

    def _drop_belief(self, goals: int, intention: Intention, beliefs: Beliefs, term: Term) -> Done:
        gone = beliefs.matching(term) if isinstance(term, Struct) else ()
        new = self.base(beliefs.own.difference(gone), beliefs.perceived.difference(gone))
        event = self.intentions.number(of_event(Event(Sign.DROP, term)))
        bindings = (unify(term, apart(gone[0], "''"), {}) if gone else None) or {}
        return self.after(new, goals, intention, bindings, (event,) * len(gone), (self.terms.number(term),))

    def drop_goal(
        self, base: int, goals: int, intention: Intention, queue: tuple[int, ...], goal: Goal
    ) -> tuple[Done, tuple[int, ...]]:
        """The goal is dropped from the intention that drops it, with all frames above it and the deed that posted it,
        else from all others; the goals of the intention that it was dropped from last are dropped too."""
        goals = self.without(goals, goal)
        cut = _cut(intention, goal)
        if cut is not None:
            lost = intention.goals()
            left, gone = tail(cut)
        else:
            lost = ()
            others = []
            for number in queue:
                other = self.intentions.all[number]
                short = _cut(other, goal)
                if short is not None:
                    lost = other.goals()
                    other, gone = tail(replace(short, waiting=None))
                    goals = self.without(goals, gone)
                    number = self.number(other)
                elif goal.kind is GoalKind.PERFORM and other.frames and _posts(other, goal):
                    other, gone = tail(other)
                    goals = self.without(goals, gone)
                    number = self.number(other)
                if number != self.empty:
                    others.append(number)
            queue = tuple(others)
            left, gone = tail(intention)
        goals = self.without(goals, gone)
        for other_goal in lost:
            goals = self.without(goals, other_goal)
        return Done(base, goals, self.number(left)), queue

    # Parts

    def number(self, intention: Intention) -> int:
        if not intention.frames:
            return self.empty
        return self.intentions.number(canonical(intention))

    def _base(self, own: frozenset[Struct], perceived: frozenset[Struct]) -> int:
        return self.beliefs.number(Beliefs.of(own, perceived))

    def without(self, goals: int, goal: Goal | None) -> int:
        if goal is None or goal not in self.goals.all[goals]:
            return goals
        return self.goals.number(self.goals.all[goals] - {goal})

    def _wanted(self, goals: int) -> tuple[Goal, ...]:
        return tuple(sorted(self.goals.all[goals], key=lambda g: plain(g.term))) if self.uses_goals else ()


def _kind_met(trigger: Event, event: Event) -> GoalKind | None:
    """The kind that the event's goal has for a plan with this trigger; None if the plan does not fit. AIL matches a
    ground event against a trigger with variables term by term, whatever their kinds, and continues with the plan's. A
    trigger without a kind is one to perform, then one to achieve."""
    if is_ground(event.term) and not is_ground(trigger.term):
        return trigger.goal or GoalKind.PERFORM
    return event.goal if trigger.goal in (None, event.goal) else None


def _key(event: Event) -> tuple[Sign, bool, str, int]:
    if isinstance(event.term, Var):
        raise Crash("a goal is no more than a variable when it is posted")
    return event.sign, event.is_goal, event.term.functor, len(event.term.args)


def _trigger_index(plans: Iterable[Plan]) -> dict[tuple[Sign, bool, str, int], list[Plan]]:
    """Plans by their triggers, in file order."""
    index: dict[tuple[Sign, bool, str, int], list[Plan]] = {}
    for plan in plans:
        index.setdefault(_key(plan.event), []).append(plan)
    return index


def _cut(intention: Intention, goal: Goal) -> Intention | None:
    """The intention below the first frame with the goal. If only the goal's kind or the event's sign differ, all of the
    intention; None if no frame fits."""
    for at, frame in enumerate(intention.frames):
        event = frame.event
        if event.is_goal and event.sign is Sign.ADD and event.goal is goal.kind and _fits(goal, event.term):
            return replace(intention, frames=intention.frames[:at])
    return intention if any(_fits(goal, other.term) for other in intention.goals()) else None


def _fits(goal: Goal, term: Term) -> bool:
    return unify(goal.term, term, {}) is not None


def _posts(intention: Intention, goal: Goal) -> bool:
    """Whether its next deed posts the goal."""
    deeds = intention.frames[-1].deeds
    return bool(deeds) and deeds[0].kind is DeedKind.ADD_GOAL and unify(goal.term, deeds[0].term, {}) is not None  # type: ignore[index]


def _named(term: Term) -> Struct:
    """A term that enters the belief base or the environment is not a mere variable."""
    return term if isinstance(term, Struct) else Struct("_")
