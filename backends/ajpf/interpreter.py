"""The Gwendolen reasoning cycle as a transition system (design: page "AJPF and Gwendolen", "the subset").

One cycle: perceive; take the next intention; choose a plan for its top event; execute ONE deed. States are observed
after perception and after each deed, which is where AJPF looks at its properties too. Everything that a state holds is
a small integer for an interned part (a belief base, an intention), so that states hash fast and the work on a part is
done once.

Choices of our own, where the semantics that we follow leaves room, or where stutter-equivalence allows: events that no
plan can ever take up are not queued; an unplanned event is dropped within the cycle that takes up the next intention; a
dropped subgoal's intention goes on with its next deed; a goal without a written kind is performed; an achieve goal is
tried again until it is believed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from typing import Generic, NamedTuple, TypeVar

from .beliefs import Beliefs, Reasoner, rename_term
from .environment import Choice, Environment
from .syntax import (
    Bindings,
    Deed,
    DeedKind,
    Event,
    Goal,
    GoalKind,
    Plan,
    Program,
    Sign,
    Struct,
    Term,
    Var,
    apply,
    unify,
    variables,
)

T = TypeVar("T")
NONE = -1


class Semantics(StrEnum):
    """How percepts become events."""

    MCAPL = "mcapl"
    """Each draw drops and adds again what persists, so that its events fire again; ``*f`` wakes when a belief that
    unifies with f is itself added or removed."""
    EDGE = "edge"
    """Events for changes only; ``*f`` wakes when f has become derivable."""


@dataclass(frozen=True, slots=True)
class Frame:
    """An event and what is left to do about it; `deeds` is None until a plan is chosen."""

    event: Event
    deeds: tuple[Deed, ...] | None = None


@dataclass(frozen=True, slots=True)
class Intention:
    """A stack of frames, the bottom one first. `waiting` is the literal that suspended it."""

    frames: tuple[Frame, ...]
    waiting: Term | None = None


class State(NamedTuple):
    """All parts by their numbers."""

    beliefs: int
    active: tuple[int, ...]
    suspended: tuple[int, ...]
    running: int
    """The intention that executed a deed last and is not finished, or NONE."""
    last: int
    """The last action, or NONE."""
    choice: int
    """What the environment offers."""
    drawn: bool
    """The offer is new: not perceived yet."""
    waited: bool
    """It was drawn because the agent had nothing to do, and no action has been done since."""


PRINT = "print"
"""Not an action in the world: it neither draws percepts nor counts as the last action done."""


class _Effect(NamedTuple):
    """What one deed does, as far as it depends on beliefs and the intention alone."""

    beliefs: int
    intention: int
    suspended: bool
    posted: tuple[int, ...]
    changed: tuple[Struct, ...]
    action: int


class Table(Generic[T]):
    """Numbers for things, in order of appearance."""

    def __init__(self) -> None:
        self.items: list[T] = []
        self._numbers: dict[T, int] = {}

    def number(self, item: T) -> int:
        found = self._numbers.get(item)
        if found is None:
            found = self._numbers[item] = len(self.items)
            self.items.append(item)
        return found


class Agent:
    """A program in its environment. `start` and `successors` span the state graph."""

    def __init__(self, program: Program, environment: Environment, semantics: Semantics, *, fine: bool = False) -> None:
        """`fine` observes also the moment between the choice of a plan and its first deed, for claims on intentions."""
        self.fine = fine
        self.program = program
        self.environment = environment
        self.semantics = semantics
        self.reasoner = Reasoner.of(program.rules)
        self.beliefs: Table[Beliefs] = Table()
        self.intentions: Table[Intention] = Table()
        self.actions: Table[Struct] = Table()
        self.choices: Table[Choice] = Table()
        self.uses_goals = any(c.is_goal for plan in program.plans for c in plan.guard)
        self._triggers = _trigger_index(program.plans)
        self._effects: dict[tuple[int, int], _Effect] = {}
        self._percepts: dict[tuple[int, int], tuple[int, tuple[int, ...], tuple[Struct, ...]]] = {}
        self._plans: dict[tuple[int, int, tuple[Term, ...]], int] = {}
        self._awake: dict[tuple[int, int], bool] = {}
        self._bases: dict[tuple[frozenset[Struct], frozenset[Struct]], int] = {}
        self._draws = cache(self._draws_after)

    # The state graph

    def start(self) -> tuple[State, ...]:
        base = self._base(frozenset(self.program.beliefs), frozenset())
        active = tuple(
            self.intentions.number(Intention((Frame(Event(Sign.ADD, goal.term, goal.kind, is_goal=True)),)))
            for goal in self.program.goals
        )
        before = self.choices.number(self.environment.before)
        state = State(base, active, (), NONE, NONE, before, drawn=False, waited=False)
        if not self.environment.at_start:
            return (state,)
        draws = self.environment.draws(self.environment.before, self.environment.start)
        return tuple(state._replace(choice=self.choices.number(draw), drawn=True) for draw in draws)

    def successors(self, state: State) -> tuple[State, ...]:
        """Never empty: a run that has ended stays where it is."""
        if state.drawn:
            return (self._perceive(state),)
        active = state.active if state.running == NONE else (*state.active, state.running)
        for at, head in enumerate(active):
            intention = self._planned(state, head, active[at:])
            if intention != NONE:
                rest = active[at + 1 :]
                if self.fine and intention != head:
                    return (state._replace(active=(intention, *rest), running=NONE),)
                return self._execute(state, intention, rest)
        return self._rest(state)

    def goals(self, state: State) -> tuple[Term, ...]:
        """The goal base: the goals that some intention is at."""
        running = () if state.running == NONE else (state.running,)
        return self._goals((*state.active, *state.suspended, *running))

    # Perception

    def _perceive(self, state: State) -> State:
        beliefs, posted, changed = self._perceived(state.beliefs, state.choice)
        active = state.active + posted
        woken, asleep = self._wake(beliefs, state.suspended, changed)
        return state._replace(beliefs=beliefs, active=active + woken, suspended=asleep, drawn=False)

    def _perceived(self, base: int, choice: int) -> tuple[int, tuple[int, ...], tuple[Struct, ...]]:
        key = (base, choice)
        found = self._percepts.get(key)
        if found is None:
            beliefs = self.beliefs.items[base]
            offered = self.environment.percepts(self.choices.items[choice])
            again = self.semantics is Semantics.MCAPL
            dropped = [b for b in sorted(beliefs.perceived, key=repr) if again or b not in offered]
            added = [p for p in offered if again or p not in beliefs.perceived]
            events = [Event(Sign.DROP, b) for b in dropped] + [Event(Sign.ADD, p) for p in added]
            changed = tuple(dict.fromkeys([*dropped, *added]))
            new = self._base(beliefs.own, frozenset(offered))
            found = self._percepts[key] = (new, self._post(events), changed)
        return found

    def _draws_after(self, choice: int, action: str) -> tuple[int, ...]:
        narrowed = self.environment.after.get(action, {})
        draws = self.environment.draws(self.choices.items[choice], narrowed)
        return tuple(self.choices.number(draw) for draw in draws)

    def _rest(self, state: State) -> tuple[State, ...]:
        """There is nothing to do: the environment moves on, or the run is over."""
        idle = state._replace(active=(), running=NONE)
        when = self.environment.at_quiescence
        if when == "never" or (when == "once" and state.waited):
            return (idle,)
        return tuple(
            idle._replace(choice=draw, drawn=True, waited=when == "once") for draw in self._draws(state.choice, "")
        )

    # Intentions

    def _planned(self, state: State, number: int, queue: tuple[int, ...]) -> int:
        """The intention with a plan for its top event; NONE where all its events had to be dropped."""
        goals = self._goals((*queue, *state.suspended)) if self.uses_goals else ()
        key = (state.beliefs, number, goals)
        found = self._plans.get(key)
        if found is None:
            found = self._plans[key] = self._choose(state.beliefs, number, goals)
        return found

    def _choose(self, base: int, number: int, goals: tuple[Term, ...]) -> int:
        beliefs = self.beliefs.items[base]
        frames = self.intentions.items[number].frames
        while frames and frames[-1].deeds is None:
            event = frames[-1].event
            for plan in self._candidates(event):
                suffix = f"^{len(frames)}"
                bindings = unify(_own(plan.event.term, suffix), event.term, {})
                if bindings is None:
                    continue
                guard = tuple(c if c.term is None else replace(c, term=_own(c.term, suffix)) for c in plan.guard)
                met = next(self.reasoner.holds(beliefs, guard, bindings, goals), None)
                if met is not None:
                    deeds = tuple(replace(d, term=_own(d.term, suffix)) for d in plan.deeds)
                    frames = self._settle(_bind((*frames[:-1], Frame(event, deeds)), met), beliefs)
                    break
            else:
                frames = self._settle(frames[:-1], beliefs)
        return self.intentions.number(Intention(frames)) if frames else NONE

    def _candidates(self, event: Event) -> Iterable[Plan]:
        if not isinstance(event.term, Struct):
            return ()
        return self._triggers.get((event.sign, event.is_goal, event.term.functor, len(event.term.args)), ())

    def _settle(self, frames: tuple[Frame, ...], beliefs: Beliefs) -> tuple[Frame, ...]:
        """Without the frames on top that have nothing left to do; an achieve goal not yet believed is tried again."""
        while frames and frames[-1].deeds == ():
            event = frames[-1].event
            if event.is_goal and event.sign is Sign.ADD and event.goal is GoalKind.ACHIEVE:
                met = next(self.reasoner.believes(beliefs, event.term, {}), None)
                if met is None:
                    return (*frames[:-1], Frame(event))
                frames = _bind(frames[:-1], met)
            else:
                frames = frames[:-1]
        return frames

    # Deeds

    def _execute(self, state: State, number: int, rest: tuple[int, ...]) -> tuple[State, ...]:
        top = self.intentions.items[number].frames[-1]
        if top.deeds is None:  # an achieve goal whose plan did nothing: it is tried again in the next cycle
            return (state._replace(active=rest, running=number),)
        deed = top.deeds[0]
        if deed.kind is DeedKind.DROP_GOAL:
            return (self._drop_goal(state, number, rest),)
        if deed.kind is DeedKind.ADD_GOAL and deed.goal is GoalKind.ACHIEVE:
            others = self._goals((*rest, number, *state.suspended))
            if any(unify(deed.term, goal, {}) is not None for goal in others):
                done = self._advance(number, {}, state.beliefs)  # another intention is at it already
                return (state._replace(active=rest, running=done),)
        key = (state.beliefs, number)
        effect = self._effects.get(key)
        if effect is None:
            effect = self._effects[key] = self._effect(state.beliefs, number, deed)
        woken, asleep = self._wake(effect.beliefs, state.suspended, effect.changed)
        new = State(
            effect.beliefs,
            rest + effect.posted + woken,
            (*asleep, effect.intention) if effect.suspended else asleep,
            NONE if effect.suspended else effect.intention,
            state.last,
            state.choice,
            drawn=False,
            waited=state.waited,
        )
        if effect.action == NONE:
            return (new,)
        name = self.actions.items[effect.action].functor
        if name == PRINT:
            return (new._replace(waited=False),)
        new = new._replace(last=effect.action, waited=False)
        if name in self.environment.quiet:
            return (new,)
        return tuple(new._replace(choice=draw, drawn=True) for draw in self._draws(state.choice, name))

    def _effect(self, base: int, number: int, deed: Deed) -> _Effect:
        beliefs = self.beliefs.items[base]
        term = deed.term
        match deed.kind:
            case DeedKind.ACTION:
                action = self.actions.number(_ground_name(term))
                return _Effect(base, self._advance(number, {}, base), False, (), (), action)
            case DeedKind.ADD_BELIEF:
                belief = _ground_name(term)
                if belief in beliefs.own:
                    return _Effect(base, self._advance(number, {}, base), False, (), (), NONE)
                posted = () if belief in beliefs else self._post([Event(Sign.ADD, belief)])
                new = self._base(beliefs.own | {belief}, beliefs.perceived)
                return _Effect(new, self._advance(number, {}, new), False, posted, (belief,), NONE)
            case DeedKind.DROP_BELIEF:
                gone = beliefs.matching(term) if isinstance(term, Struct) else ()
                new = self._base(beliefs.own.difference(gone), beliefs.perceived.difference(gone))
                posted = self._post([Event(Sign.DROP, b) for b in gone])
                return _Effect(new, self._advance(number, {}, new), False, posted, gone, NONE)
            case DeedKind.WAIT:
                met = next(self.reasoner.believes(beliefs, term, {}), None)
                if met is not None:
                    return _Effect(base, self._advance(number, met, base), False, (), (), NONE)
                asleep = replace(self.intentions.items[number], waiting=term)
                return _Effect(base, self.intentions.number(asleep), True, (), (), NONE)
            case _:
                return _Effect(base, self._push_goal(number, Goal(term, deed.goal), base), False, (), (), NONE)

    def _advance(self, number: int, bindings: Bindings, base: int) -> int:
        """The intention after its next deed."""
        frames = self.intentions.items[number].frames
        top = frames[-1]
        assert top.deeds
        rest = _bind((*frames[:-1], Frame(top.event, top.deeds[1:])), bindings)
        settled = self._settle(rest, self.beliefs.items[base])
        return self.intentions.number(Intention(settled)) if settled else NONE

    def _push_goal(self, number: int, goal: Goal, base: int) -> int:
        if goal.kind is GoalKind.ACHIEVE:
            met = next(self.reasoner.believes(self.beliefs.items[base], goal.term, {}), None)
            if met is not None:
                return self._advance(number, met, base)
        frames = self.intentions.items[number].frames
        top = frames[-1]
        assert top.deeds
        event = Event(Sign.ADD, goal.term, goal.kind, is_goal=True)
        # The frame below stays, even with nothing left to do: its event is open until the goal is dealt with.
        stack = (*frames[:-1], Frame(top.event, top.deeds[1:]), Frame(event))
        return self.intentions.number(Intention(stack))

    def _drop_goal(self, state: State, number: int, rest: tuple[int, ...]) -> State:
        """Every intention loses its unifying goals and what stands on them; the loss is an event."""
        top = self.intentions.items[number].frames[-1]
        assert top.deeds
        pattern = top.deeds[0].term
        lost: dict[Event, None] = {}

        def without(at: int) -> int:
            intention = self.intentions.items[at]
            for place, frame in enumerate(intention.frames):
                event = frame.event
                wanted = event.is_goal and event.sign is Sign.ADD
                if wanted and unify(pattern, event.term, {}) is not None:
                    lost[replace(event, sign=Sign.DROP)] = None
                    left = self._settle(intention.frames[:place], self.beliefs.items[state.beliefs])
                    return self.intentions.number(Intention(left)) if left else NONE
            return at

        advanced = self._advance(number, {}, state.beliefs)
        running = without(advanced) if advanced != NONE else NONE
        active = [n for n in map(without, rest) if n != NONE]
        asleep = [n for n in map(without, state.suspended) if n != NONE]
        still = tuple(n for n in asleep if self.intentions.items[n].waiting is not None)
        active += [n for n in asleep if self.intentions.items[n].waiting is None]
        return state._replace(active=(*active, *self._post(lost)), suspended=still, running=running)

    # Parts

    def _base(self, own: frozenset[Struct], perceived: frozenset[Struct]) -> int:
        key = (own, perceived)
        found = self._bases.get(key)
        if found is None:
            found = self._bases[key] = self.beliefs.number(Beliefs.of(own, perceived))
        return found

    def _post(self, events: Iterable[Event]) -> tuple[int, ...]:
        """New intentions for those events that some plan may take up."""
        return tuple(
            self.intentions.number(Intention((Frame(event),)))
            for event in events
            if any(unify(_own(plan.event.term, "^"), event.term, {}) is not None for plan in self._candidates(event))
        )

    def _wake(
        self, base: int, suspended: tuple[int, ...], changed: tuple[Struct, ...]
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Those that wake, ready to go on, and those that sleep on."""
        if not suspended or not changed:
            return (), suspended
        woken, asleep = [], []
        for number in suspended:
            intention = self.intentions.items[number]
            assert intention.waiting is not None
            if self.semantics is Semantics.MCAPL:
                wakes = any(unify(intention.waiting, belief, {}) is not None for belief in changed)
            else:
                wakes = self._derivable(base, number)
            if wakes:
                woken.append(self.intentions.number(replace(intention, waiting=None)))
            else:
                asleep.append(number)
        return tuple(woken), tuple(asleep)

    def _derivable(self, base: int, number: int) -> bool:
        found = self._awake.get((base, number))
        if found is None:
            waiting = self.intentions.items[number].waiting
            assert waiting is not None
            way = next(self.reasoner.believes(self.beliefs.items[base], waiting, {}), None)
            found = self._awake[base, number] = way is not None
        return found

    def _goals(self, numbers: tuple[int, ...]) -> tuple[Term, ...]:
        goals = {
            frame.event.term: None
            for number in numbers
            for frame in self.intentions.items[number].frames
            if frame.event.is_goal and frame.event.sign is Sign.ADD
        }
        return tuple(sorted(goals, key=repr))


def _trigger_index(plans: Iterable[Plan]) -> dict[tuple[Sign, bool, str, int], list[Plan]]:
    """Plans by what triggers them, in file order. A kind of goal written in a trigger is not held against the goal's:
    AIL unifies the goals' terms, and a program that has one goal in both kinds is outside the subset."""
    index: dict[tuple[Sign, bool, str, int], list[Plan]] = {}
    for plan in plans:
        term = plan.event.term
        assert isinstance(term, Struct)
        index.setdefault((plan.event.sign, plan.event.is_goal, term.functor, len(term.args)), []).append(plan)
    return index


def _own(term: Term, suffix: str) -> Term:
    """The term with the variables of one use of a plan."""
    names = set(variables(term))
    return rename_term(term, {name: Var(name + suffix) for name in names}) if names else term


def _bind(frames: tuple[Frame, ...], bindings: Bindings) -> tuple[Frame, ...]:
    if not bindings:
        return frames
    return tuple(
        Frame(
            replace(frame.event, term=apply(frame.event.term, bindings)),
            None if frame.deeds is None else tuple(replace(d, term=apply(d.term, bindings)) for d in frame.deeds),
        )
        for frame in frames
    )


def _ground_name(term: Term) -> Struct:
    """The term as it enters the belief base or the world: an unbound variable stays visible as ``_``."""
    if isinstance(term, Var):
        return Struct("_")
    return Struct(term.functor, tuple(_ground_name(arg) for arg in term.args))
