"""The Gwendolen reasoning cycle as a transition system: AIL's, as AJPF explores it.

A run is a sequence of jobs. A job either perceives, selects an intention and chooses a plan for its top event, or does
ONE deed. A state is the situation after a job, which is when AJPF evaluates its properties. Everything that a state
holds is a small integer for an interned part (a belief base, an intention), so that states hash fast and each part is
processed once.

Surprising behaviour here is AIL's: percepts are queued as intentions `-p` and `+p` of their own; a subgoal without a
plan stays blocked under an event `-!g`; an initial goal enters the goal base with its first deed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from functools import cache, lru_cache
from typing import Any, NamedTuple

from .environment import Choice, Environment
from .intentions import PERCEPTION, START, of_deed, of_event, post
from .mind import NONE, Done, Mind, Table
from .syntax import SENT, Deed, DeedKind, Event, Goal, GoalKind, Program, Sign
from .terms import Struct, plain, unify
from .tuning import RECENT


class Semantics(StrEnum):
    """How percepts become events."""

    MCAPL = "mcapl"
    """AIL's rule "Perceive": each draw queues an intention to drop each old percept, and one to add each drawn percept,
    also if it persists; ``*f`` wakes when a belief that unifies with f is itself added or dropped."""
    EDGE = "edge"
    """AIL's rule "Direct Perception with Events": a change is believed at once, and is an event; and ``*f`` wakes when
    f has become derivable."""


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
        """The percepts on offer, in the order of the environment's groups."""
        return self.environment.percepts(self.choices.all[choice])

    def _after(self, choice: int, action: str) -> tuple[int, ...]:
        """Every possible draw after an action; the draw of an idle agent is that after ``""``."""
        return self._draws(self.choices.all[choice], self.environment.after.get(action, {}))

    def _draws(self, choice: Choice, narrowed: Mapping[str, tuple[int, ...]]) -> tuple[int, ...]:
        return tuple(self.choices.number(d) for d in self.environment.draws(choice, narrowed))

    def _offers(self, choice: int) -> tuple[Struct, ...]:
        """Percepts in the order in which they are handled: that of their texts."""
        return tuple(sorted(set(self.environment.percepts(self.choices.all[choice])), key=plain))


class State(NamedTuple):
    """The situation after a job. All parts are given by their numbers. A core is a State with an empty queue."""

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
    """The draw that the environment offers."""
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

    # As in a system of several agents (`society.Common`)

    @property
    def turn(self) -> int:
        return 0

    @property
    def awake(self) -> tuple[bool, ...]:
        return (not self.asleep,)

    @property
    def changed(self) -> bool:
        return False


BITS = 32
"""The bits of a state's number for its queue."""
QUEUE = (1 << BITS) - 1

PRINT = "print"
"""Not an action on the environment: it neither draws percepts nor counts as the last action done."""


class Agent(Mind):
    """A program in its environment. `start` and `successors` span the state graph."""

    def __init__(
        self, program: Program, environment: Environment | World, semantics: Semantics, *, probed: bool = False
    ) -> None:
        """`probed`: the properties ask for percepts. AJPF then reads the environment before the agent does, so that its
        reading draws the first percepts, and the agent perceives them once, not twice."""
        super().__init__(program)
        self.world = environment if isinstance(environment, World) else World(environment)
        self.environment = self.world.environment
        self.semantics = semantics
        self.probed = probed
        self._draws, self._offers = self.world.after, self.world.offers
        self.cores: Table[State] = Table()
        self.queues: Table[tuple[int, ...]] = Table()
        self._percepts, self._direct = cache(self._perceptions), cache(self._changes)
        recent = lru_cache(RECENT)
        self._perceived, self._planned = recent(self._perceive), recent(self._choose_plan)
        self._woken = cache(self._after_change)
        self._effects, self._outcomes, self._owned = recent(self._effect), recent(self._outcome), recent(self._own)

    # The state graph

    @property
    def agents(self) -> tuple[Agent, ...]:
        return (self,)

    def numbered(self, state: State) -> int:
        return self.cores.number(state._replace(queue=())) << BITS | self.queues.number(state.queue)

    def state(self, number: int) -> State:
        """The state that has the number."""
        return self.core(number)._replace(queue=self.queues.all[number & QUEUE])

    def core(self, number: int) -> State:
        """The state without its queue."""
        return self.cores.all[number >> BITS]

    def altered(self, number: int, **fields: Any) -> int:
        """The number of the state with other values of some fields other than the queue."""
        return self.cores.number(self.core(number)._replace(**fields)) << BITS | number & QUEUE

    def minds(self, number: int) -> tuple[int, ...]:
        """The state of each of `agents`."""
        return (number,)

    def believed(self, number: int) -> frozenset[Struct]:
        """All beliefs, without the agent's memory of its own messages."""
        beliefs = self.beliefs.all[self.core(number).beliefs]
        return frozenset(b for b in beliefs.own | beliefs.perceived if b.functor != SENT)

    def did(self, number: int) -> tuple[int, Struct] | None:
        """The index in `agents` of the agent that acted last, and its action."""
        last = self.core(number).last
        return None if last == NONE else (0, self.actions.all[last])

    def start(self) -> tuple[int, ...]:
        return (self.first(),)

    def first(self) -> int:
        goals = [
            self.intentions.number(of_deed(START, Deed(DeedKind.ADD_GOAL, goal.term, goal.kind)))
            for goal in self.program.goals
        ]
        first = State(
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
        return self.numbered(first)

    def successors(self, number: int) -> tuple[int, ...]:
        """Never empty: a run that has ended stays in its state, without further draws."""
        now = self.cores.all[number >> BITS]
        if now.over:
            return (self.altered(number, drawn=False),)
        if now.planned:
            after, action = self.act(number)
            if action == NONE:
                return (after,)
            return tuple([core << BITS | after & QUEUE for core in self._outcomes(after >> BITS, action)])
        if now.asleep:
            return self._idle(number)
        if not now.begun:
            return tuple(self.cycle(number, draw, again=not self.probed) for draw in self.world.first())
        return (self.cycle(number),)

    def sees(self, number: int) -> tuple[Struct, ...]:
        """The percepts on offer to which AJPF's P refers: those of an action, until the agent has perceived them."""
        now = self.core(number)
        return self._offers(now.choice) if now.new and now.begun and not now.over else ()

    # The first half of a cycle: perceive, select an intention, choose a plan

    def _idle(self, number: int) -> tuple[int, ...]:
        """The agent has nothing to do: the environment draws, or the run is over."""
        when, now = self.environment.at_quiescence, self.core(number)
        if when == "never" or now.waited:
            return (self.altered(number, over=True, drawn=False),)
        result = []
        for draw in self._draws(now.choice, ""):
            offer = self._offers(draw)
            new = now.new or bool(offer) or bool(self._offers(now.choice))
            after = self.cycle(self.altered(number, new=new, waited=when == "once"), draw)
            # Only a percept wakes the agent: without one it has this half of a cycle, and the run is over.
            result.append(after if offer or when == "repeatedly" else self.altered(after, over=True))
        return tuple(result)

    def cycle(self, number: int, draw: int = NONE, *, again: bool = False, letters: tuple[int, ...] = ()) -> int:
        """`draw` is the environment's latest draw; `again`: it is perceived once more in the next cycle; `letters` are
        the intentions that messages create."""
        core, queue = number >> BITS, self.queues.all[number & QUEUE]
        state, posted, changed = self._perceived(core, draw)
        if self.semantics is Semantics.MCAPL:
            queue += tuple([n for n in posted if n not in queue]) if posted else ()
        else:
            queue = self._wake(state.beliefs, queue, changed) + posted
        current, queue, asleep = self._select(state.current, queue + letters)
        return self._planned(core, draw, again, current, asleep) << BITS | self.queues.number(queue)

    def _perceive(self, core: int, draw: int) -> tuple[State, tuple[int, ...], tuple[int, ...]]:
        """The core with the percepts, the intentions that are posted for them, and the changes."""
        state = self.cores.all[core]._replace(drawn=draw != NONE)
        if draw != NONE:
            state = state._replace(choice=draw, begun=True, asleep=False)
        if not state.new:
            return state, (), ()
        if self.semantics is Semantics.MCAPL:
            return state, self._percepts(state.beliefs, state.choice), ()
        beliefs, posted, changed = self._direct(state.beliefs, state.choice)
        current = state.current
        if current not in (NONE, self.empty):
            (current,) = self._wake(beliefs, (current,), changed)
        return state._replace(beliefs=beliefs, current=current), posted, changed

    def _choose_plan(self, core: int, draw: int, again: bool, current: int, asleep: bool) -> int:
        """The core once this intention is the current one."""
        state = self._perceived(core, draw)[0]._replace(new=again)
        if current == NONE or asleep:
            return self.cores.number(state._replace(current=NONE, asleep=asleep))
        chosen, goals = current, state.goals
        if current != self.empty and self.intentions.all[current].frames[-1].deeds is None:
            chosen, goals = self.chosen(state.beliefs, goals, current)
        return self.cores.number(state._replace(current=chosen, goals=goals, planned=chosen != self.empty))

    def _perceptions(self, base: int, choice: int) -> tuple[int, ...]:
        """Intentions to drop all percepts, and to add all that are on offer."""
        old = (of_deed(PERCEPTION, Deed(DeedKind.DROP_BELIEF, p)) for p in self.beliefs.all[base].percepts)
        new = (of_deed(PERCEPTION, Deed(DeedKind.ADD_BELIEF, p)) for p in self._offers(choice))
        return tuple(self.intentions.number(intention) for intention in (*old, *new))

    def _changes(self, base: int, choice: int) -> tuple[int, tuple[int, ...], tuple[int, ...]]:
        beliefs = self.beliefs.all[base]
        offered = self._offers(choice)
        gone = [p for p in beliefs.percepts if p not in offered]
        come = [p for p in offered if p not in beliefs.perceived]
        new = self.base(beliefs.own.difference(gone), (beliefs.perceived.difference(gone) | set(come)) - beliefs.own)
        events = [*(Event(Sign.DROP, p) for p in gone), *(Event(Sign.ADD, p) for p in come)]
        posted = tuple(self.intentions.number(of_event(e)) for e in events)
        return new, posted, tuple(map(self.terms.number, (*gone, *come)))

    def _select(self, current: int, queue: tuple[int, ...]) -> tuple[int, tuple[int, ...], bool]:
        """The next current intention, the others, and whether there is nothing to do."""
        intentions = self.intentions.all
        if current not in (NONE, self.empty):
            if intentions[current].locked:
                return current, queue, False
            queue = (*queue, current)
        ready = [n for n in queue if intentions[n].waiting is None]
        if not ready:
            return NONE, queue, True
        if len(ready) == len(queue):
            return queue[0], queue[1:], False
        return ready[0], (*ready[1:], *[n for n in queue if intentions[n].waiting is not None]), False

    # The second half: one deed

    def _outcome(self, core: int, action: int) -> tuple[int, ...]:
        """The possible cores after the agent has done the action."""
        state, name = self.cores.all[core], self.actions.all[action].functor
        if name == PRINT or name in self.environment.quiet:
            last = state.last if name == PRINT else action
            return (self.cores.number(state._replace(waited=False, last=last)),)
        had = state.new or bool(self._offers(state.choice))
        drawn = (
            state._replace(waited=False, last=action, choice=d, new=had or bool(self._offers(d)), drawn=True)
            for d in self._draws(state.choice, name)
        )
        return tuple(map(self.cores.number, drawn))

    def act(self, number: int) -> tuple[int, int]:
        """The state after the next deed of the current intention, and the action that it was; the environment's
        reaction is not yet in the state."""
        queue = self.queues.all[number & QUEUE]
        done, core = self._effects(number >> BITS)
        if core == NONE:
            done, queue = self._goal_deed(self.state(number), done)
            core = self._after_deed(number >> BITS, done)
        queue = self._wake(done.beliefs, queue, done.changed) + done.posted
        if done.suspended:  # it stays the current one for now, unless no other can continue
            if all(self.intentions.all[n].waiting is not None for n in queue):
                queue = (*queue, done.intention)
                core = self.cores.number(self.cores.all[core]._replace(current=self.empty, asleep=True))
            queue = self._sorted(queue)
        return core << BITS | self.queues.number(queue), done.action

    def _effect(self, core: int) -> tuple[Done, int]:
        """The effect of the next deed, and the core after it; NONE if that depends on the queue, as with goals."""
        state = self.cores.all[core]
        done, deed = self.done(state.beliefs, state.goals, state.current), self.next_deed(state)
        on_goals = deed is not None and deed.kind in (DeedKind.DROP_GOAL, DeedKind.ADD_GOAL)
        return done, NONE if on_goals else self._after_deed(core, done)

    def _after_deed(self, core: int, done: Done) -> int:
        after = self.cores.all[core]._replace(
            beliefs=done.beliefs, goals=done.goals, current=done.intention, planned=False, drawn=False
        )
        return self.cores.number(after)

    def next_deed(self, state: State) -> Deed | None:
        """The deed that the next job does, if it does one."""
        deeds = self.intentions.all[state.current].frames[-1].deeds if state.planned else None
        return deeds[0] if deeds else None

    def _goal_deed(self, state: State, done: Done) -> tuple[Done, tuple[int, ...]]:
        """Goals are added to, and dropped from, those of all intentions. The result includes the queue."""
        intention, deed = self.intentions.all[state.current], self.next_deed(state)
        assert deed is not None
        goal = Goal(deed.term, deed.goal)
        wanted = self.goals.all[state.goals]
        if deed.kind is DeedKind.DROP_GOAL:
            return self.drop_goal(state.beliefs, state.goals, intention, state.queue, goal)
        if deed.goal is not GoalKind.PERFORM:
            met = self.reasoner.derived(self.beliefs.all[state.beliefs], goal.term)
            if met is not None:
                left = self.after(state.beliefs, state.goals, intention, met)
                elsewhere = any(
                    unify(goal.term, other.term, {}) is not None
                    for number in state.queue
                    for other in self.intentions.all[number].goals()
                )
                return left._replace(goals=left.goals if elsewhere else self.without(left.goals, goal)), state.queue
            for other in sorted((g for g in wanted if g.kind is goal.kind), key=lambda g: plain(g.term)):
                found = unify(goal.term, other.term, {})
                if found is not None:  # some intention has it already
                    return self.after(state.beliefs, state.goals, intention, found), state.queue
        number = self.number(post(intention, goal))
        return done._replace(goals=self.goals.number(wanted | {goal}), intention=number), state.queue

    def _sorted(self, queue: tuple[int, ...]) -> tuple[int, ...]:
        """The intentions that can continue in their order, then those that wait in theirs."""
        intentions = self.intentions.all
        ready = [n for n in queue if intentions[n].waiting is None]
        waiting = [n for n in queue if intentions[n].waiting is not None]
        return (*ready, *sorted(waiting, key=lambda n: intentions[n].weight))

    # Parts

    def own(self, number: int) -> int:
        """The state without the environment's and the scheduler's parts."""
        return self._owned(number >> BITS) << BITS | number & QUEUE

    def _own(self, core: int) -> int:
        own = self.cores.all[core]._replace(last=NONE, choice=NONE, begun=True, asleep=False, waited=False, over=False)
        return self.cores.number(own._replace(drawn=False))

    def _wake(self, base: int, queue: tuple[int, ...], changed: tuple[int, ...]) -> tuple[int, ...]:
        """The intentions that waited for the changes continue."""
        return tuple([self._woken(base, n, changed) for n in queue]) if changed else queue

    def _after_change(self, base: int, number: int, changed: tuple[int, ...]) -> int:
        intention = self.intentions.all[number]
        if intention.waiting is None:
            return number
        if self.semantics is Semantics.MCAPL:
            wakes = any(unify(intention.waiting, self.terms.all[term], {}) is not None for term in changed)
        else:
            deeds = intention.frames[-1].deeds
            derivable = self.reasoner.derived(self.beliefs.all[base], intention.waiting) is not None
            wakes = derivable is not (deeds is not None and deeds[0].kind is DeedKind.WAIT_NOT)
        return self.intentions.number(replace(intention, waiting=None)) if wakes else number
