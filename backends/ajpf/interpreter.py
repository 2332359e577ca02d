"""The Gwendolen reasoning cycle as a transition system: AIL's, as AJPF explores it.

A run is a sequence of jobs. A job either perceives, selects an intention and chooses a plan for its top event, or does
ONE deed. States are what there is after a job, which is where AJPF looks at its properties. Everything that a state
holds is a small integer for an interned part (a belief base, an intention), so that states hash fast and the work on a
part is done once.

Where something here surprises, AIL does so: percepts are queued as intentions `-p` and `+p` of their own; a subgoal
without a plan stands still under an event `-!g`; an initial goal enters the goal base with its first deed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from functools import cache
from typing import NamedTuple

from .environment import Choice, Environment
from .intentions import PERCEPTION, START, of_deed, of_event, post
from .mind import NONE, Done, Mind, Table
from .syntax import SENT, Deed, DeedKind, Event, Goal, GoalKind, Program, Sign, Struct, Term, plain, unify


class Semantics(StrEnum):
    """How percepts become events."""

    MCAPL = "mcapl"
    """AIL's rule "Perceive": each draw queues an intention for everything that was perceived, to drop it, and for
    everything that is drawn, to add it, also for what persists; ``*f`` wakes when a belief that unifies with f is
    itself added or dropped."""
    EDGE = "edge"
    """AIL's rule "Direct Perception with Events": what changes is believed at once, and is an event; and ``*f`` wakes
    when f has become derivable."""


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


class State(NamedTuple):
    """What there is after a job. All parts by their numbers."""

    beliefs: int
    goals: int
    """The goal base."""
    current: int
    """The current intention, or NONE."""
    queue: tuple[int, ...]
    planned: bool
    """The next job does the current intention's next deed; else it perceives."""
    last: int
    """The last action, or NONE."""
    choice: int
    """What the environment offers."""
    new: bool
    """The agent has yet to perceive it."""
    begun: bool
    """The first draw was made."""
    asleep: bool
    """The agent found nothing to do."""
    waited: bool
    """The environment drew because the agent had nothing to do, and no action has been done since."""
    over: bool
    """The run ended: it stays where it is."""
    drawn: bool
    """The environment has just drawn."""


PRINT = "print"
"""Not an action in the world: it neither draws percepts nor counts as the last action done."""


class Agent(Mind):
    """A program in its environment. `start` and `successors` span the state graph."""

    def __init__(
        self, program: Program, environment: Environment | World, semantics: Semantics, *, probed: bool = False
    ) -> None:
        """`probed`: the properties ask for percepts. AJPF then looks at the environment before the agent does, so that
        the first percepts are drawn by its look, and the agent perceives them once, not twice."""
        super().__init__(program)
        self.world = environment if isinstance(environment, World) else World(environment)
        self.environment = self.world.environment
        self.semantics = semantics
        self.probed = probed
        self._draws, self._offers = self.world.after, self.world.offers
        self._percepts = cache(self._perceptions)
        self._direct = cache(self._changes)

    # The state graph

    @property
    def agents(self) -> tuple[Agent, ...]:
        return (self,)

    def minds(self, state: State) -> tuple[State, ...]:
        """The state of each of `agents`."""
        return (state,)

    def believed(self, state: State) -> frozenset[Struct]:
        """All that is believed, without what the agent remembers of its own messages."""
        beliefs = self.beliefs.items[state.beliefs]
        return frozenset(b for b in beliefs.own | beliefs.perceived if b.functor != SENT)

    def did(self, state: State) -> tuple[int, Struct] | None:
        """Which of `agents` acted last, and its action."""
        return None if state.last == NONE else (0, self.actions.items[state.last])

    def start(self) -> tuple[State, ...]:
        return (self.first(),)

    def first(self) -> State:
        goals = [
            self.intentions.number(of_deed(START, Deed(DeedKind.ADD_GOAL, goal.term, goal.kind)))
            for goal in self.program.goals
        ]
        return State(
            beliefs=self.base(frozenset(self.program.beliefs), frozenset()),
            goals=self.goals.number(frozenset()),
            current=goals[0] if goals else self.empty,
            queue=tuple(goals[1:]),
            planned=False,
            last=NONE,
            choice=self.world.before,
            new=True,
            begun=not self.environment.at_start,
            asleep=False,
            waited=False,
            over=False,
            drawn=False,
        )

    def successors(self, state: State) -> tuple[State, ...]:
        """Never empty: a run that has ended stays where it is, and nothing is drawn any more."""
        if state.over:
            return (state._replace(drawn=False),)
        if state.planned:
            return self._deed(state)
        if state.asleep:
            return self._idle(state)
        if not state.begun:
            return tuple(self.cycle(state, draw, again=not self.probed) for draw in self.world.first())
        return (self.cycle(state._replace(drawn=False)),)

    def sees(self, state: State) -> tuple[Struct, ...]:
        """The percepts on offer that AJPF's P speaks of: those of an action, until the agent has perceived them."""
        return self._offers(state.choice) if state.new and state.begun and not state.over else ()

    # The first half of a cycle: perceive, select an intention, choose a plan

    def _idle(self, state: State) -> tuple[State, ...]:
        """There was nothing to do: the environment moves on, or the run is over."""
        when = self.environment.at_quiescence
        if when == "never" or state.waited:
            return (state._replace(over=True, drawn=False),)
        result = []
        for draw in self._draws(state.choice, ""):
            offer = self._offers(draw)
            new = state.new or bool(offer) or bool(self._offers(state.choice))
            after = self.cycle(state._replace(new=new, waited=when == "once"), draw)
            # Only a percept wakes the agent: without one it has this half of a cycle, and the run is over.
            result.append(after if offer or when == "repeatedly" else after._replace(over=True))
        return tuple(result)

    def cycle(self, state: State, draw: int = NONE, *, again: bool = False, letters: tuple[int, ...] = ()) -> State:
        """`draw` is what the environment has just drawn; `again`: it is perceived once more in the next cycle;
        `letters` are the intentions that messages make."""
        if draw != NONE:
            state = state._replace(choice=draw, begun=True, drawn=True, asleep=False)
        beliefs, current, queue = state.beliefs, state.current, state.queue
        if state.new:
            beliefs, current, queue = self._perceive(state)
        queue += letters
        state = state._replace(beliefs=beliefs, new=again)
        current, queue, asleep = self._select(current, queue)
        if current == NONE or asleep:
            return state._replace(current=NONE, queue=queue, asleep=asleep)
        if current == self.empty:
            return state._replace(current=current, queue=queue)
        chosen, goals = current, state.goals
        if self.intentions.items[current].frames[-1].deeds is None:
            chosen, goals = self.chosen(state.beliefs, goals, current)
        return state._replace(current=chosen, goals=goals, queue=queue, planned=chosen != self.empty)

    def _perceive(self, state: State) -> tuple[int, int, tuple[int, ...]]:
        if self.semantics is Semantics.MCAPL:
            found = self._percepts(state.beliefs, state.choice)
            return state.beliefs, state.current, state.queue + tuple(n for n in found if n not in state.queue)
        beliefs, posted, changed = self._direct(state.beliefs, state.choice)
        queue = self._wake(beliefs, state.queue, changed) + posted
        current = state.current
        if current not in (NONE, self.empty):
            (current,) = self._wake(beliefs, (current,), changed)
        return beliefs, current, queue

    def _perceptions(self, base: int, choice: int) -> tuple[int, ...]:
        """Intentions to drop all that is perceived, and to add all that is on offer."""
        old = (of_deed(PERCEPTION, Deed(DeedKind.DROP_BELIEF, p)) for p in self.beliefs.items[base].percepts)
        new = (of_deed(PERCEPTION, Deed(DeedKind.ADD_BELIEF, p)) for p in self._offers(choice))
        return tuple(self.intentions.number(intention) for intention in (*old, *new))

    def _changes(self, base: int, choice: int) -> tuple[int, tuple[int, ...], tuple[Term, ...]]:
        beliefs = self.beliefs.items[base]
        offered = self._offers(choice)
        gone = [p for p in beliefs.percepts if p not in offered]
        come = [p for p in offered if p not in beliefs.perceived]
        new = self.base(beliefs.own.difference(gone), (beliefs.perceived.difference(gone) | set(come)) - beliefs.own)
        events = [*(Event(Sign.DROP, p) for p in gone), *(Event(Sign.ADD, p) for p in come)]
        return new, tuple(self.intentions.number(of_event(e)) for e in events), (*gone, *come)

    def _select(self, current: int, queue: tuple[int, ...]) -> tuple[int, tuple[int, ...], bool]:
        """The next current intention, the others, and whether there is nothing to do."""
        intentions = self.intentions.items
        ready = [n for n in queue if intentions[n].waiting is None]
        if current in (NONE, self.empty):
            if not ready:
                return NONE, queue, True
            return ready[0], self._rest(ready, queue), False
        mine = intentions[current]
        if mine.locked:
            return current, queue, False
        if mine.waiting is not None:
            if not ready:
                return NONE, (*queue, current), True
            return ready[0], (*self._rest(ready, queue), current), False
        ready.append(current)
        return ready[0], self._rest(ready, queue), False

    def _rest(self, ready: list[int], queue: tuple[int, ...]) -> tuple[int, ...]:
        return (*ready[1:], *(n for n in queue if self.intentions.items[n].waiting is not None))

    # The second half: one deed

    def _deed(self, state: State) -> tuple[State, ...]:
        new, action = self.act(state)
        if action == NONE:
            return (new,)
        name = self.actions.items[action].functor
        new = new._replace(waited=False)
        if name == PRINT:
            return (new,)
        new = new._replace(last=action)
        if name in self.environment.quiet:
            return (new,)
        had = state.new or bool(self._offers(state.choice))
        return tuple(
            new._replace(choice=draw, new=had or bool(self._offers(draw)), drawn=True)
            for draw in self._draws(state.choice, name)
        )

    def act(self, state: State) -> tuple[State, int]:
        """The next deed of the current intention done, and the action that it was; what the world makes of that is not
        yet in the state."""
        done = self.done(state.beliefs, state.goals, state.current)
        deed = self.next_deed(state)
        if deed is not None and deed.kind in (DeedKind.DROP_GOAL, DeedKind.ADD_GOAL):
            done, queue = self._goal_deed(state, deed, done)
        else:
            queue = state.queue
        queue = self._wake(done.beliefs, queue, done.changed) + done.posted
        new = state._replace(
            beliefs=done.beliefs, goals=done.goals, current=done.intention, queue=queue, planned=False, drawn=False
        )
        return (self._suspend(new) if done.suspended else new), done.action

    def next_deed(self, state: State) -> Deed | None:
        """The deed that the next job does, if it does one."""
        deeds = self.intentions.items[state.current].frames[-1].deeds if state.planned else None
        return deeds[0] if deeds else None

    def _goal_deed(self, state: State, deed: Deed, done: Done) -> tuple[Done, tuple[int, ...]]:
        """Goals are added to, and dropped from, what all intentions are at. The answer has the queue in it."""
        intention = self.intentions.items[state.current]
        goal = Goal(deed.term, deed.goal)
        wanted = self.goals.items[state.goals]
        if deed.kind is DeedKind.DROP_GOAL:
            return self.drop_goal(state.beliefs, state.goals, intention, state.queue, goal)
        if deed.goal is GoalKind.PERFORM:
            number = self.number(post(intention, goal))
            return done._replace(goals=self.goals.number(wanted | {goal}), intention=number), state.queue
        beliefs = self.beliefs.items[state.beliefs]
        met = self.reasoner.derived(beliefs, goal.term)
        if met is not None:
            left = self.after(state.beliefs, state.goals, intention, met)
            elsewhere = any(
                unify(goal.term, other.term, {}) is not None
                for number in state.queue
                for other in self.intentions.items[number].goals()
            )
            return left._replace(goals=left.goals if elsewhere else self.without(left.goals, goal)), state.queue
        for other in sorted((g for g in wanted if g.kind is goal.kind), key=lambda g: plain(g.term)):
            found = unify(goal.term, other.term, {})
            if found is not None:  # some intention is at it already
                return self.after(state.beliefs, state.goals, intention, found), state.queue
        number = self.number(post(intention, goal))
        return done._replace(goals=self.goals.number(wanted | {goal}), intention=number), state.queue

    def _suspend(self, state: State) -> State:
        """The current intention waits; it stays the current one for now, unless nothing else can go on."""
        queue = self._sorted(state.queue)
        if any(self.intentions.items[n].waiting is None for n in queue):
            return state._replace(queue=queue)
        return state._replace(queue=self._sorted((*state.queue, state.current)), current=self.empty, asleep=True)

    def _sorted(self, queue: tuple[int, ...]) -> tuple[int, ...]:
        """Those that can go on in their order, then those that wait in theirs."""
        intentions = self.intentions.items
        ready = [n for n in queue if intentions[n].waiting is None]
        waiting = [n for n in queue if intentions[n].waiting is not None]
        return (*ready, *sorted(waiting, key=lambda n: intentions[n].weight))

    # Parts

    def _wake(self, base: int, queue: tuple[int, ...], changed: tuple[Term, ...]) -> tuple[int, ...]:
        """Those that waited for what has changed go on."""
        intentions = self.intentions.items
        if not changed or all(intentions[n].waiting is None for n in queue):
            return queue
        return tuple(
            self.intentions.number(replace(intentions[n], waiting=None)) if self._wakes(base, n, changed) else n
            for n in queue
        )

    def _wakes(self, base: int, number: int, changed: tuple[Term, ...]) -> bool:
        intention = self.intentions.items[number]
        if intention.waiting is None:
            return False
        if self.semantics is Semantics.MCAPL:
            return any(unify(intention.waiting, belief, {}) is not None for belief in changed)
        deeds = intention.frames[-1].deeds
        derivable = self.reasoner.derived(self.beliefs.items[base], intention.waiting) is not None
        return derivable is not (deeds is not None and deeds[0].kind is DeedKind.WAIT_NOT)
