"""Several agents in one environment, as AJPF schedules them: all may perceive the effects of one's actions, and they
send messages.

The scheduler is AIL's `ActionScheduler`: an agent runs until something has changed for any agent (an action or a draw
that brought percepts, a message, an agent that fell asleep or woke); then any agent that is awake may be next, in every
order. Percepts wake all agents, a message its receiver. One agent's jobs are the interpreter's own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple, TypeVar

from .environment import Environment
from .intentions import of_event
from .interpreter import PRINT, Agent, Semantics, World
from .mind import NONE, Table
from .syntax import RECEIVED, DeedKind, Event, Program, Sign
from .terms import Struct, Term, apart, name_of, plain

T = TypeVar("T")


class Common(NamedTuple):
    """The situation after a job. Minds (`interpreter.State`), actions and draws by their numbers, agents by their
    indices."""

    minds: tuple[int, ...]
    mail: tuple[tuple[int, ...], ...]
    """For each agent its unread messages, as intentions, in the order in which it will read them."""
    awake: tuple[bool, ...]
    turn: int
    """The agent whose job was the last."""
    changed: bool
    """Another agent may be next."""
    last: int
    """The last action and its agent, or NONE."""
    choice: int
    begun: bool
    waited: bool
    over: bool
    drawn: bool


class Society:
    """The agents of a system. `start` and `successors` span the state graph."""

    def __init__(
        self, programs: Sequence[Program], environment: Environment, semantics: Semantics, *, probed: bool = False
    ) -> None:
        self.world = World(environment)
        self.environment = environment
        self.semantics = semantics
        self.probed = probed
        self.agents = tuple(Agent(program, self.world, semantics, probed=probed) for program in programs)
        self._places = {program.name: place for place, program in enumerate(programs)}
        self._actions: Table[tuple[int, Struct]] = Table()
        self._cycled, self._acted = cache(self._after_cycle), cache(self._after_deed)

    def core(self, state: Common) -> Common:
        return state

    def minds(self, state: Common) -> tuple[int, ...]:
        """The state of each of `agents`."""
        return state.minds

    def did(self, state: Common) -> tuple[int, Struct] | None:
        """The index in `agents` of the agent that acted last, and its action."""
        return None if state.last == NONE else self._actions.all[state.last]

    def sees(self, state: Common) -> tuple[Struct, ...]:
        """The percepts on offer to which AJPF's P refers: until every agent has perceived them."""
        if (
            not state.begun
            or state.over
            or not any(a.core(mind).new for a, mind in zip(self.agents, state.minds, strict=True))
        ):
            return ()
        return self.world.offers(state.choice)

    def start(self) -> tuple[Common, ...]:
        first = self._first()
        looks = self._looks(first)
        return looks if len(looks) == 1 else (first,)

    def _looks(self, state: Common) -> tuple[Common, ...]:
        """If properties are about percepts, AJPF reads the environment before the first turn: that is the first draw.
        If there is no choice in it, the first state is the one after it."""
        if state.begun or not self.probed:
            return ()
        return tuple(state._replace(choice=draw, begun=True, drawn=True) for draw in self.world.first())

    def _first(self) -> Common:
        return Common(
            minds=tuple(agent.own(agent.first()) for agent in self.agents),
            mail=((),) * len(self.agents),
            awake=(True,) * len(self.agents),
            turn=0,
            changed=True,
            last=NONE,
            choice=self.world.before,
            begun=not self.environment.at_start,
            waited=False,
            over=False,
            drawn=False,
        )

    def successors(self, state: Common) -> tuple[Common, ...]:
        """Never empty: a run that has ended stays in its state, without further draws."""
        if state.over:
            return (state._replace(drawn=False),)
        if looks := self._looks(state):
            return looks
        if not any(state.awake):
            return tuple(dict.fromkeys(self._idle(state._replace(drawn=False))))
        return tuple(dict.fromkeys(after for turn in self._turns(state) for after in self._moves(state, turn)))

    def _turns(self, state: Common) -> tuple[int, ...]:
        """The agents whose job may be next: all that are awake, once something has changed for any agent."""
        return tuple(place for place, up in enumerate(state.awake) if up) if state.changed else (state.turn,)

    def _moves(self, state: Common, turn: int) -> Iterator[Common]:
        """The states after the next job of this agent."""
        return self._job(state._replace(changed=False, drawn=False, turn=turn))

    def _place(self, to: Term) -> int | None:
        """The index in `agents` of a message's receiver, if any."""
        return self._places.get(plain(name_of(to)))

    # Jobs of the agent whose turn it is

    def _job(self, state: Common) -> Iterator[Common]:
        if self.agents[state.turn].core(state.minds[state.turn]).planned:
            yield from self._deed(state)
        elif state.begun:
            yield self._cycle(state)
        else:
            for draw in self.world.first():
                after = self._cycle(state._replace(choice=draw, begun=True, drawn=True), again=True)
                yield after._replace(changed=after.changed or bool(self.world.offers(draw)))

    def _cycle(self, state: Common, *, again: bool = False) -> Common:
        """Perceive, read messages, select an intention, choose a plan."""
        place = state.turn
        mind, letters = state.minds[place], state.mail[place]
        new = self.agents[place].core(mind).new
        after = self._cycled(place, mind, state.choice if new else NONE, letters, again)
        if letters:
            state = state._replace(mail=_put(state.mail, place, ()))
        return self._done(state, *after)

    def _after_cycle(
        self, place: int, number: int, choice: int, letters: tuple[int, ...], again: bool
    ) -> tuple[int, bool]:
        """The agent's own state then, and whether it sleeps. `choice` is the draw that it perceives, if that is new."""
        agent = self.agents[place]
        after = agent.cycle(agent.altered(number, choice=choice), again=again, letters=letters)
        return agent.own(after), agent.core(after).asleep

    def _after_deed(self, place: int, number: int) -> tuple[int, bool, int]:
        """The agent's own state then, whether it sleeps, and its action."""
        agent = self.agents[place]
        after, action = agent.act(number)
        return agent.own(after), agent.core(after).asleep, action

    def _deed(self, state: Common) -> Iterator[Common]:
        place, agent = state.turn, self.agents[state.turn]
        number = state.minds[place]
        kept, asleep, action = self._acted(place, number)
        deed = agent.next_deed(agent.core(number))
        state = self._done(state, kept, asleep)
        if action == NONE or deed is None:
            yield state
            return
        done = agent.actions.all[action]
        state = state._replace(waited=False)
        if done.functor == PRINT:
            yield state
            return
        state = state._replace(last=self._actions.number((place, done)))
        if done.functor not in self.environment.quiet:
            states = [self._offered(state, draw) for draw in self.world.after(state.choice, done.functor)]
        else:
            states = [state]
        for drawn in states:
            yield self._delivered(drawn, place, deed.term) if deed.kind is DeedKind.SEND else drawn

    def _idle(self, state: Common) -> Iterator[Common]:
        """All agents sleep: the environment draws, or the run is over."""
        when = self.environment.at_quiescence
        if when == "never" or state.waited:
            yield state._replace(over=True)
            return
        for draw in self.world.after(state.choice, ""):
            after = self._offered(state._replace(waited=when == "once"), draw)
            if when == "repeatedly":
                after = after._replace(awake=(True,) * len(self.agents))
            if any(after.awake):
                for turn in range(len(self.agents)):
                    yield self._cycle(after._replace(turn=turn, changed=False))
            else:  # the agent that slept last has this half of a cycle, and the run is over
                yield self._cycle(after)._replace(over=True)

    # Parts

    def _done(self, state: Common, mind: int, asleep: bool) -> Common:
        state = state._replace(minds=_put(state.minds, state.turn, mind))
        if asleep:
            state = state._replace(awake=_put(state.awake, state.turn, False), changed=True)
        return state

    def _offered(self, state: Common, draw: int) -> Common:
        """A draw was made. All agents perceive again, if there were or are any percepts; percepts wake them."""
        now = self.world.offers(draw)
        if now or self.world.offers(state.choice):
            seen = (agent.altered(mind, new=True) for agent, mind in zip(self.agents, state.minds, strict=True))
            state = state._replace(minds=tuple(seen))
        state = state._replace(choice=draw, drawn=True)
        return state._replace(awake=(True,) * len(self.agents), changed=True) if now else state

    def _delivered(self, state: Common, sender: int, message: object) -> Common:
        """The message is delivered to its receiver, if there is such an agent. Equal messages are kept only once."""
        assert isinstance(message, Struct)
        to, force, content = message.args
        state = state._replace(changed=True)
        place = self._place(to)
        if place is None:
            return state
        agent = self.agents[place]
        names = (Struct(self.agents[sender].program.name), Struct(agent.program.name))
        term = Struct(RECEIVED, (*names, force, content))
        letter = agent.intentions.number(of_event(Event(Sign.ADD, apart(term, "''"))))
        mail = sorted({*state.mail[place], letter}, key=lambda n: _text(agent.intentions.all[n].frames[0].event.term))
        return state._replace(mail=_put(state.mail, place, tuple(mail)), awake=_put(state.awake, place, True))


def system(
    programs: Sequence[Program], environment: Environment, semantics: Semantics, *, probed: bool = False
) -> Agent | Society:
    """The agents of one system. The messages of a single agent go nowhere, not even to itself."""
    if len(programs) == 1:
        return Agent(programs[0], environment, semantics, probed=probed)
    return Society(programs, environment, semantics, probed=probed)


_FORCES = {"tell": "1", "perform": "2", "achieve": "3"}


def _text(message: object) -> str:
    """A message as AIL writes it: AIL sorts by these texts."""
    assert isinstance(message, Struct)
    sender, to, force, content = message.args
    return f"{plain(sender)},{plain(to)},{_FORCES[plain(force)]},{plain(content)})"


def _put(items: tuple[T, ...], place: int, item: T) -> tuple[T, ...]:
    return (*items[:place], item, *items[place + 1 :])
