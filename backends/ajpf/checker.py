"""Model checking of properties on an explored state graph, made smaller up to stuttering; vacuity; runs that refute."""

from __future__ import annotations

import functools
import time
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from avow.base.graphs import strong_components
from avow.formulas.lasso import Fair, Lasso, accepted_run
from avow.formulas.ltl import Automaton

from .explore import Graph, System
from .intentions import Frame
from .interpreter import BITS, QUEUE, Agent
from .mind import NONE
from .psl import TRUE, Atom, Formula, Modality, Not, about_acts, atoms, automaton_of, compiled, conjunction
from .syntax import DeedKind, Sign
from .tautology import Laws, is_valid, standing
from .terms import Struct, Term, named_apart, unify
from .tuning import NEARBY


@dataclass(frozen=True, slots=True)
class Kripke:
    """States by numbers, their successors, and a label for each: a bit set. Runs are infinite: a path to a state
    without successors is not a run."""

    initial: tuple[int, ...]
    successors: Sequence[Sequence[int]]
    labels: Sequence[int]

    def __len__(self) -> int:
        return len(self.labels)


def shortened(graph: Graph, labels: Sequence[int]) -> Kripke:
    """The graph without states whose only successor is a later state with the same label: most states are such, as an
    agent decides very little between two draws."""
    offsets, targets = graph.offsets, graph.targets
    ends = array("i", range(len(graph)))
    for state in range(len(graph) - 1, -1, -1):
        first = offsets[state]
        if offsets[state + 1] == first + 1 and (target := targets[first]) > state and labels[target] == labels[state]:
            ends[state] = ends[target]
    initial = dict.fromkeys(ends[state] for state in graph.initial)
    return _reachable(initial, lambda state: {ends[target] for target in graph.after(state)}, labels)


def reduce(graph: Kripke) -> Kripke:
    """A smaller graph with the same runs up to stuttering (and up to nothing else: endless stuttering stays).

    States of one label that reach each other become one with a loop; a state whose only successor has the same label
    becomes that state. Properties without "next" do not distinguish the two graphs.
    """
    labels, successors = graph.labels, graph.successors

    def alike(node: int) -> list[int]:
        label = labels[node]
        return [t for t in successors[node] if labels[t] == label]

    number = [-1] * len(labels)
    new_successors: list[tuple[int, ...]] = []
    new_labels: list[int] = []
    seen: dict[tuple[int, bool, tuple[int, ...]], int] = {}
    pending: list[tuple[int, list[int], bool]] = []
    # Components come after those that they reach along equal labels, so "only successor has its label" is known.
    for component in strong_components(range(len(labels)), alike):
        label = labels[component[0]]
        members = set(component)
        loop = len(component) > 1 or component[0] in successors[component[0]]
        outside = [t for node in component for t in successors[node] if t not in members]
        same = {number[t] for t in outside if labels[t] == label}
        different = any(labels[t] != label for t in outside)
        if not loop and not different and len(same) == 1:
            target = next(iter(same))
        else:
            target = len(pending)
            pending.append((label, outside, loop))
        for node in component:
            number[node] = target
    merged = list(range(len(pending)))
    for at, (label, outside, loop) in enumerate(pending):
        targets = sorted({number[t] for t in outside} | ({at} if loop else set()))
        key = (label, loop, tuple(t for t in targets if t != at))
        known = seen.setdefault(key, at)
        merged[at] = known
        new_labels.append(label)
        new_successors.append(tuple(targets))
    initial = tuple(dict.fromkeys(merged[number[s]] for s in graph.initial))
    successors_now = [tuple(dict.fromkeys(merged[t] for t in targets)) for targets in new_successors]
    return _reachable(initial, successors_now.__getitem__, new_labels)


def _reachable(initial: Iterable[int], after: Callable[[int], Iterable[int]], labels: Sequence[int]) -> Kripke:
    order = {state: at for at, state in enumerate(initial)}
    first, queue = tuple(order.values()), list(order)
    for state in queue:
        for target in after(state):
            if target not in order:
                order[target] = len(order)
                queue.append(target)
    return Kripke(first, [tuple(order[t] for t in after(state)) for state in queue], [labels[s] for s in queue])


def find_lasso(graph: Kripke, automaton: Automaton[Formula], fair: Sequence[Fair] = ()) -> Lasso | None:
    """A fair run of the graph that the automaton accepts, or None if there is none."""
    following, labels = graph.successors.__getitem__, graph.labels.__getitem__
    return accepted_run(graph.initial, following, labels, automaton, fair)


class OutOfTime(Exception):  # noqa: N818 - it names a state, not a fault
    """The time for checking is over."""


@dataclass(frozen=True, slots=True)
class Property:
    """A formula to check. `trigger` is given if it has the shape ``[] (trigger -> consequent)``, for vacuity."""

    key: str
    """Its name in a .psl file: ASCII letters, digits and ``_``."""
    formula: Formula
    trigger: Formula | None = None
    goal: Formula | None = None
    """The formula that must follow the trigger, without its "eventually"."""
    about: str = ""
    """The instance in words: ``i = 3``."""
    forbidden: Formula | None = None
    """The formula that must not hold once the trigger is met, from ``[] (trigger -> [] ~forbidden)``."""
    indecisive: str = ""
    """Why a run on which it fails refutes nothing, if it does not."""


@dataclass(frozen=True, slots=True)
class Result:
    key: str
    holds: bool
    vacuous: bool
    """The trigger is never met."""
    immediate: bool
    """Wherever the trigger is met, so is the goal, at once: nothing had to happen."""
    valid: bool = False
    """It holds for every agent with these reasoning rules and lasting beliefs, whatever its plans are: the table turned
    the claim into a tautology."""
    answered: bool = False
    """The forbidden formula is the agent's answer to the trigger (`Checker._answered`)."""
    excluded: bool = False
    """It fails on a run that the fairness assumptions exclude, and from some state no fair run goes on."""


@dataclass
class Checker:
    """Checks many properties on one graph; the graph is labelled and reduced once."""

    graph: Graph
    properties: Sequence[Property]
    atoms: tuple[Atom, ...] = ()
    labels: list[int] = field(default_factory=list)
    """For each state: the bits of `atoms`, above them two bits for each fairness assumption (drawn; granted)."""
    places: dict[Atom, int] = field(default_factory=dict)
    reduced: Kripke = field(init=False)
    laws: Laws = field(init=False)

    def __post_init__(self) -> None:
        self.atoms = _asked(self.properties)
        system = self.graph.system
        percepts = [p for _, group in system.environment.groups for p in group if p is not None]
        self.laws = standing([agent.program for agent in system.agents], percepts)
        self.places = {atom: at for at, atom in enumerate(self.atoms)}
        self.labels = label_states(self.graph.system, self.graph.states, self.atoms)
        self.reduced = reduce(shortened(self.graph, self.labels))
        while len(smaller := reduce(self.reduced)) < 0.95 * len(self.reduced):
            self.reduced = smaller

    def check(self, wanted: Property, deadline: float | None = None) -> Result:
        """Raises OutOfTime, ltl.TooLarge."""
        if deadline is not None and time.monotonic() > deadline:
            raise OutOfTime
        automaton, fair, labels = self._projected(wanted, self.reduced.labels)
        small = reduce(Kripke(self.reduced.initial, self.reduced.successors, labels))
        holds = find_lasso(small, automaton, fair) is None
        valid = holds and is_valid(wanted.formula, self.laws)
        vacuous = immediate = False
        if wanted.trigger is not None:
            met = self._where(wanted.trigger)
            vacuous = not met and self.graph.unfinished is None
            if wanted.goal is not None and met:
                unmet = conjunction((wanted.trigger, Not(wanted.goal)))
                immediate = not self._where(unmet)
        answered = not holds and self._answered(wanted)
        excluded = holds and bool(fair) and not self.always_fair and find_lasso(small, automaton) is not None
        return Result(wanted.key, holds, vacuous, immediate and not valid, valid, answered, excluded)

    @functools.cached_property
    def always_fair(self) -> bool:
        """Whether a fair run goes on from every reachable state; otherwise the fairness assumptions exclude states, not
        only runs (Abadi and Lamport, "An old-fashioned recipe for real time": they are not machine closed)."""
        anything, fair, labels = self._projected(Property("", Not(TRUE)), self.reduced.labels)
        graph = Kripke(self.reduced.initial, self.reduced.successors, labels)
        last: set[int] = set()  # states from which no other component is reached
        for component in strong_components(graph.initial, graph.successors.__getitem__):
            members = set(component)
            if all(members.issuperset(graph.successors[state]) for state in component):
                last.add(component[0])
        return all(find_lasso(Kripke((state,), graph.successors, labels), anything, fair) is not None for state in last)

    def _answered(self, wanted: Property) -> bool:
        """Whether there is an occasion (the trigger is met, and was not just before) to which the forbidden formula is
        the answer: on every path, it holds when the agent next acts or the environment next draws. An action done
        before the occasion is no answer to it; a formula that held before may hold only until then. A trigger about an
        action is met by that action only: an older one may have been done for other inputs."""
        if wanted.trigger is None or wanted.forbidden is None or self.graph.unfinished is not None:
            return False
        graph, labels, core = self.graph, self.labels, self.graph.system.core
        states = graph.states
        meant, banned = compiled(wanted.trigger, self.places), compiled(wanted.forbidden, self.places)
        needs_act, stale = about_acts(wanted.forbidden), about_acts(wanted.trigger)

        def acted(state: int, target: int) -> bool:
            return bool(core(states[target]).last != core(states[state]).last)

        def waiting(state: int) -> list[int]:
            return [t for t in graph.after(state) if not acted(state, t) and not core(states[t]).drawn]

        triggered = [meant(label) for label in labels]
        occasions = {s for s in graph.initial if triggered[s]}
        met = ((s, t) for s in range(len(graph)) if not triggered[s] for t in graph.after(s) if triggered[t])
        occasions.update(t for s, t in met if acted(s, t) or not stale)
        good: set[int] = set()
        for component in strong_components(occasions, waiting):
            state = component[0]
            still = set(waiting(state))
            if len(component) == 1 and state not in still and still <= good and graph.after(state):
                ends = [t for t in graph.after(state) if t not in still]
                if all(banned(labels[t]) and (acted(state, t) or not needs_act) for t in ends):
                    good.add(state)
        return not good.isdisjoint(occasions)

    def lasso(self, refuted: Property) -> Lasso | None:
        """A run of the agent itself on which the property fails; if possible, one among the states found first."""
        automaton, fair, labels = self._projected(refuted, self.labels)
        graph, few = self.graph, range(NEARBY)

        def nearby(state: int) -> list[int]:
            return [target for target in graph.after(state) if target in few]

        found = accepted_run(graph.initial, nearby, labels.__getitem__, automaton, fair)
        if found is None and len(graph) > len(few):
            found = accepted_run(graph.initial, graph.after, labels.__getitem__, automaton, fair)
        return found

    def _where(self, formula: Formula) -> frozenset[int]:
        """The labels of reachable states at which the formula holds."""
        return frozenset(filter(compiled(formula, self.places), set(self.reduced.labels)))

    def _projected(self, wanted: Property, labels: Sequence[int]) -> tuple[Automaton[Formula], list[Fair], list[int]]:
        automaton = automaton_of(Not(wanted.formula))
        low, base = len(automaton.leaves), len(self.atoms)
        tests = [compiled(leaf, self.places) for leaf in automaton.leaves]
        new: dict[int, int] = {}
        for label in set(labels):
            bits = (label >> base) << low
            for at, test in enumerate(tests):
                if test(label):
                    bits |= 1 << at
            new[label] = bits
        fair = [
            Fair(1 << (low + 2 * at), 1 << (low + 2 * at + 1)) for at in range(len(self.graph.system.environment.fair))
        ]
        return automaton, fair, [new[label] for label in labels]


def label_states(system: System, states: Iterable[Any], wanted: Sequence[Atom]) -> list[int]:
    """For each state the bits of the atoms that hold in it, above them two bits for each fairness assumption."""
    numbered = [(1 << at, atom) for at, atom in enumerate(wanted)]
    names = {agent.program.name: place for place, agent in enumerate(system.agents)}
    labels = [
        _Labels(agent, [(bit, atom) for bit, atom in numbered if atom.agent == name])
        for name, agent in zip(names, system.agents, strict=True)
    ]
    done = [(bit, names[a.agent], named_apart(a.term)) for bit, a in numbered if a.modality is Modality.DID]
    perceived = [(bit, named_apart(a.term)) for bit, a in numbered if a.modality is Modality.PERCEPT]
    fair = [(1 << (len(wanted) + 2 * at), f.percept) for at, f in enumerate(system.environment.fair)]
    last: dict[int, int] = {}

    @cache
    def drawn(choice: int) -> int:
        return _of_draw(system.world.offers(choice), fair)

    def label(state: Any) -> int:
        bits = 0
        for own, mind in zip(labels, system.minds(state), strict=True):
            bits |= own.of(mind)
        now = system.core(state)
        if done:
            if now.last not in last:
                last[now.last] = _of_last(system.did(state), done)
            bits |= last[now.last]
        if perceived:
            offered = system.sees(state)
            bits |= sum(bit for bit, term in perceived if any(unify(term, p, {}) is not None for p in offered))
        if fair and now.drawn:
            bits |= drawn(now.choice)
        return bits

    if not isinstance(system, Agent) or labels[0].intended:
        return list(map(label, states))
    of_core = cache(lambda core: label(core << BITS))  # without atoms about intentions, the queue does not matter
    return [of_core(state >> BITS) for state in states]


def _of_last(did: tuple[int, Struct] | None, done: Sequence[tuple[int, int, Term]]) -> int:
    if did is None:
        return 0
    return sum(bit for bit, place, term in done if place == did[0] and unify(term, did[1], {}) is not None)


def _of_draw(offered: Sequence[Struct], fair: Sequence[tuple[int, Struct]]) -> int:
    return sum(bit | (bit << 1 if percept in offered else 0) for bit, percept in fair)


class _Labels:
    """The atoms that hold for one agent's beliefs, goals and intentions, as bits."""

    def __init__(self, agent: Agent, numbered: Sequence[tuple[int, Atom]]) -> None:
        self.agent = agent
        mental = (Modality.INTENDS, Modality.INTENDS_TO_DO)
        self.believed = [(bit, named_apart(a.term)) for bit, a in numbered if a.modality is Modality.BELIEVES]
        self.wanted = [(bit, named_apart(a.term)) for bit, a in numbered if a.modality is Modality.WANTS]
        self.intended = [(bit, a.modality, named_apart(a.term)) for bit, a in numbered if a.modality in mental]
        self.by_beliefs, self.by_goals = cache(self._of_beliefs), cache(self._of_goals)
        self.by_intention, self.by_core = cache(self._of_intention), cache(self._of_core)

    def of(self, mind: int) -> int:
        bits = self.by_core(mind >> BITS)
        if self.intended:
            for number in self.agent.queues.all[mind & QUEUE]:
                bits |= self.by_intention(number)
        return bits

    def _of_core(self, number: int) -> int:
        core = self.agent.cores.all[number]
        bits = self.by_beliefs(core.beliefs) if self.believed else 0
        if self.wanted:
            bits |= self.by_goals(core.goals)
        return bits | self.by_intention(core.current) if self.intended else bits

    def _of_beliefs(self, number: int) -> int:
        agent = self.agent
        beliefs = agent.beliefs.all[number]
        holds = ((bit, agent.reasoner.derived(beliefs, term)) for bit, term in self.believed)
        return sum(bit for bit, found in holds if found is not None)

    def _of_goals(self, number: int) -> int:
        goals = self.agent.goals.all[number]
        return sum(bit for bit, term in self.wanted if any(unify(term, g.term, {}) is not None for g in goals))

    def _of_intention(self, number: int) -> int:
        return 0 if number == NONE else _mental(self.agent.intentions.all[number].frames, self.intended)


def _mental(frames: Iterable[Frame], wanted: Sequence[tuple[int, Modality, Term]]) -> int:
    bits = 0
    for frame in frames:
        is_goal = frame.event.is_goal and frame.event.sign is Sign.ADD
        for bit, modality, term in wanted:
            if modality is Modality.INTENDS_TO_DO:
                hits = any(d.kind is DeedKind.ACTION and unify(term, d.term, {}) is not None for d in frame.deeds or ())
            else:
                hits = is_goal and unify(term, frame.event.term, {}) is not None
                hits = hits and frame.deeds is not None
            if hits:
                bits |= bit
    return bits


def _asked(properties: Iterable[Property]) -> tuple[Atom, ...]:
    """The atoms of the properties, their triggers, goals and forbidden formulas."""
    parts = (f for p in properties for f in (p.formula, p.trigger, p.goal, p.forbidden) if f is not None)
    return tuple(dict.fromkeys(atom for f in parts for atom in atoms(f)))


def asks_for_percepts(wanted: Property) -> bool:
    """Whether a property observes the environment (`interpreter.Agent`, "probed")."""
    return any(atom.modality is Modality.PERCEPT for atom in atoms(wanted.formula))
