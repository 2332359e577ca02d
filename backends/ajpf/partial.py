"""Partial order reduction for several agents: independent turns are followed in one order instead of all.

AIL lets an agent run until something has changed for any agent, and then any agent that is awake: these *turns* are the
transitions here. A turn is *local* if it ends because the agent falls asleep or sends a message, draws no percepts, and
does not change the properties' atoms, from its first job to its last. From a state where any agent may be next, only
the turns of some agents are followed (an ample set: Clarke, Grumberg, Peled, "Model Checking", chapter 10) if

- these turns are local, and independent of everything that the other agents can do meanwhile: no message to one of
these agents or to a receiver of their messages, and no draw of percepts, which all agents perceive;
- they lead to states that were not known before, so that no agent is postponed for ever round a cycle. (Turns that only
end asleep make no cycle: if no agent ever sends anything, this need not be checked.)

Properties without "next" hold on the remaining runs if and only if they hold on all. One agent's intentions never
interleave in AIL, so that for one agent there is nothing to reduce.
"""

from __future__ import annotations

from array import array
from collections.abc import Container, Sequence
from dataclasses import dataclass

from avow.formulas.lasso import Lasso

from .beliefs import TooDeep
from .builtin import Crash
from .checker import Labels, Property, asked
from .explore import Graph, System
from .interpreter import PRINT, Semantics
from .mind import NONE
from .psl import Atom, Modality
from .society import Common, Society
from .syntax import Deed, DeedKind
from .terms import Struct, is_ground
from .tuning import TURN


@dataclass(frozen=True, slots=True)
class Turn:
    """A local turn: the state where it ends, and the receiver of its message, if any."""

    end: Common
    to: int | None


class Reduction:
    """A reduction for properties over `atoms`. Raises ValueError if they or the agents allow none."""

    def __init__(self, society: Society, atoms: Sequence[Atom]) -> None:
        environment = society.environment
        if environment.fair or any(atom.modality is Modality.PERCEPT for atom in atoms):
            raise ValueError("the draws are looked at")
        if society.semantics is Semantics.EDGE and environment.at_quiescence == "once":
            raise ValueError("who slept last has the last look")
        self.society = society
        self.silent = all(percept is None for _, group in environment.groups for percept in group)
        self.actions_show = any(atom.modality is Modality.DID for atom in atoms)
        numbered = [(1 << at, atom) for at, atom in enumerate(atoms)]
        self._labels = [
            Labels(agent, [(bit, atom) for bit, atom in numbered if atom.agent == agent.program.name])
            for agent in society.agents
        ]
        everybody = range(len(society.agents))
        self._senders = tuple(frozenset(at for at in everybody if self._may_send(at, to)) for to in everybody)
        self._drawers = frozenset(at for at in everybody if self._may_draw(at))
        self._sends = any(self._senders)

    def key(self, state: Common) -> Common:
        """The state without the parts that matter neither to any run from here on nor to the properties. (The agent
        that slept last has one more cycle at the end of a run; no property depends on it.)"""
        if state.changed and any(state.awake):
            state = state._replace(turn=0)
        if not self.actions_show:
            state = state._replace(last=NONE)
        if self.silent:
            state = state._replace(choice=self.society.world.before)
        return state._replace(drawn=False)

    def start(self) -> tuple[Common, ...]:
        return tuple(dict.fromkeys(map(self.key, self.society.start())))

    def successors(self, state: Common, known: Container[Common]) -> tuple[Common, ...]:
        """`known` are the states that were met so far. Raises Crash, TooDeep."""
        ample = self._ample(state, known)
        if ample is None:
            return tuple(dict.fromkeys(map(self.key, self.society.successors(state))))
        moves = (after for turn in ample for after in self.society.moves(state, turn))
        return tuple(dict.fromkeys(map(self.key, moves)))

    def _ample(self, state: Common, known: Container[Common]) -> tuple[int, ...] | None:
        """The agents whose turns suffice; None for all."""
        if not state.changed or not state.begun or state.over or sum(state.awake) < 2:
            return None
        turns = {place: self.turn(state, place) for place in self.society.turns(state)}
        best: tuple[int, ...] | None = None
        for place, turn in turns.items():
            if turn is not None:
                group = self._group(place, turns)
                if (
                    group is not None
                    and (best is None or len(group) < len(best))
                    and self._leads_on(group, turns, known)
                ):
                    best = group
        return best

    def _group(self, first: int, turns: dict[int, Turn | None]) -> tuple[int, ...] | None:
        """The awake agents among those that `first` depends on, directly or not; None if these are all, or one of their
        turns is not local."""
        group, open_ends = {first}, [first]
        while open_ends:
            place = open_ends.pop()
            more = set(self._senders[place])
            if place in turns:
                turn = turns[place]
                if turn is None:
                    return None
                if turn.to is not None:
                    more.add(turn.to)
            open_ends += more - group
            group |= more
        awake = tuple(place for place in turns if place in group)
        return None if len(awake) == len(turns) or not self._drawers <= group else awake

    def _leads_on(self, group: Sequence[int], turns: dict[int, Turn | None], known: Container[Common]) -> bool:
        ends = [turn.end for place in group if (turn := turns[place]) is not None]
        return not self._sends or not any(self.key(end) in known for end in ends)

    def turn(self, state: Common, place: int) -> Turn | None:
        """The agent's turn, if it is local."""
        shown = self._shown(state, place)
        seen: set[int] = set()
        now = state
        while now.minds[place] not in seen and len(seen) < TURN:
            seen.add(now.minds[place])
            deed = self._deed(now, place)
            if deed is not None and self._acts(deed) and not self._silently(deed):
                return None
            try:
                after = tuple(self.society.moves(now, place))
            except (Crash, TooDeep, RecursionError):
                return None
            if len(after) != 1 or self._shown(after[0], place) != shown:
                return None
            (now,) = after
            if now.changed:
                sent = deed is not None and deed.kind is DeedKind.SEND and isinstance(deed.term, Struct)
                return Turn(now, self.society.place(deed.term.args[0]) if sent else None)  # type: ignore[union-attr]
        return None

    def _deed(self, state: Common, place: int) -> Deed | None:
        agent = self.society.agents[place]
        return agent.next_deed(agent.core(state.minds[place]))

    def _shown(self, state: Common, place: int) -> int:
        """The properties' atoms that hold for the agent."""
        return self._labels[place].of(state.minds[place])

    def _silently(self, deed: Deed) -> bool:
        """Whether an action draws no percepts, and no property asks for actions."""
        return not self.actions_show and not self._draws(deed)

    @staticmethod
    def _acts(deed: Deed) -> bool:
        named = isinstance(deed.term, Struct) and deed.term.functor == PRINT
        return deed.kind is DeedKind.SEND or (deed.kind is DeedKind.ACTION and not named)

    def _draws(self, deed: Deed) -> bool:
        name = "send" if deed.kind is DeedKind.SEND else deed.term.functor if isinstance(deed.term, Struct) else ""
        return self._acts(deed) and name not in self.society.environment.quiet and not self.silent

    # What an agent may do, by its plans

    def _deeds(self, place: int) -> list[Deed]:
        return [deed for plan in self.society.agents[place].program.plans for deed in plan.deeds]

    def _may_draw(self, place: int) -> bool:
        return any(map(self._draws, self._deeds(place)))

    def _may_send(self, place: int, to: int) -> bool:
        receivers = [
            d.term.args[0] for d in self._deeds(place) if d.kind is DeedKind.SEND and isinstance(d.term, Struct)
        ]
        return any(not is_ground(receiver) or self.society.place(receiver) == to for receiver in receivers)


def reduction(system: System, properties: Sequence[Property]) -> Reduction | None:
    """A reduction that is sound for these properties, if any. Whether a forbidden formula is the answer to an occasion
    depends on all paths (`Checker.check`)."""
    if not isinstance(system, Society) or any(p.forbidden is not None for p in properties):
        return None
    try:
        return Reduction(system, asked(properties))
    except ValueError:
        return None


def unfolded(reduction: Reduction, graph: Graph, lasso: Lasso) -> tuple[Graph, Lasso]:
    """A run of the reduced graph with the parts that its states omit (`Reduction.key`): a graph of this run alone."""
    society, key = reduction.society, reduction.key

    def step(options: Sequence[Common], number: int) -> Common:
        return next(state for state in options if key(state) == graph.states[number])

    states = [step(society.start(), lasso.path[0])]
    for number in lasso.path[1:]:
        states.append(step(society.successors(states[-1]), number))
    heads = {states[lasso.loop]: lasso.loop}
    cycle = lasso.path[lasso.loop :]
    while (head := step(society.successors(states[-1]), cycle[0])) not in heads:
        heads[head] = len(states)
        states.append(head)
        for number in cycle[1:]:
            states.append(step(society.successors(states[-1]), number))
    offsets, targets = range(len(states) + 1), (*range(1, len(states)), heads[head])
    run = Graph(society, tuple(states), (0,), array("i", offsets), array("i", targets))
    return run, Lasso(tuple(range(len(states))), heads[head])
