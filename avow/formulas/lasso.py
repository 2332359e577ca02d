"""Infinite runs of explicit graphs: strongly connected components, and the search for a run that an automaton accepts,
given as a path with a loop (a lasso). Runs are infinite: a path to a state without successors is not a run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import cache
from typing import Generic

from avow.base.graphs import strong_components
from avow.base.records import dataclass
from avow.formulas.ltl import A, Automaton

Successors = Callable[[int], Sequence[int]]


@dataclass(frozen=True, slots=True)
class Fair:
    """A strong fairness assumption over labels: a run that meets all of `asking` infinitely often meets `granting`
    infinitely often."""

    asking: int
    granting: int


@dataclass(frozen=True, slots=True)
class Lasso:
    """A run: `path`, whose last state returns to the one at `loop`."""

    path: tuple[int, ...]
    loop: int

    @property
    def prefix(self) -> tuple[int, ...]:
        """The states before the loop."""
        return self.path[: self.loop]

    @property
    def cycle(self) -> tuple[int, ...]:
        """The states repeated for ever."""
        return self.path[self.loop :]


def accepted_run(
    initial: Iterable[int],
    following: Successors,
    label_of: Callable[[int], int],
    automaton: Automaton[A],
    fair: Sequence[Fair] = (),
    tick: Callable[[], None] | None = None,
) -> Lasso | None:
    """A fair run of a graph that the automaton accepts, or None if there is none.

    The leaves of the automaton are the low bits of the labels. The whole product is explored and decomposed, and each
    component is reduced by the fairness assumptions until it is fair or empty. `tick` is called for every state of the
    product; an exception from it ends the search.
    """
    width = len(automaton.positive)

    @cache
    def nodes(label: int) -> tuple[int, ...]:
        pairs = zip(automaton.positive, automaton.negative, strict=True)
        return tuple(n for n, (yes, no) in enumerate(pairs) if label & yes == yes and not label & no)

    @cache
    def ways(node: int, label: int) -> tuple[int, ...]:
        fitting = set(nodes(label))
        return tuple(n for n in automaton.successors[node] if n in fitting)

    @cache
    def successors(product: int) -> list[int]:
        if tick is not None:
            tick()
        state, node = divmod(product, width)
        return [target * width + way for target in following(state) for way in ways(node, label_of(target))]

    roots = [state * width + node for state in initial for node in automaton.initial if node in nodes(label_of(state))]

    search = _Search(successors, lambda product: label_of(product // width), fair, automaton)
    for component in strong_components(roots, successors):
        core = search.fair_core(component)
        if core is not None:
            return search.lasso(roots, core)
    return None


@dataclass(frozen=True, slots=True)
class Monitor:
    """Whether some continuation of a prefix can still be accepted (bad prefixes: Kupferman and Vardi,
    "Model checking of safety properties", FMSD 2001). `live`: nodes of the automaton from which some run is accepted.
    """

    automaton: Automaton[object]
    live: frozenset[int]

    def begin(self) -> frozenset[int]:
        return self.live.intersection(self.automaton.initial)

    def at(self, nodes: frozenset[int], label: int) -> frozenset[int]:
        """The nodes that match the step that is read."""
        positive, negative = self.automaton.positive, self.automaton.negative
        return frozenset(n for n in nodes if label & positive[n] == positive[n] and not label & negative[n])

    def after(self, nodes: frozenset[int]) -> frozenset[int]:
        """The nodes that may come next; if empty, every run with this prefix is rejected."""
        return frozenset(t for n in nodes for t in self.automaton.successors[n] if t in self.live)


def monitor(automaton: Automaton[A]) -> Monitor:
    """The monitor that detects bad prefixes of the property whose runs the automaton accepts."""
    ahead = automaton.successors
    live: set[int] = set()
    for part in strong_components(range(len(ahead)), ahead.__getitem__):  # a component after those reachable from it
        members = set(part)
        endless = len(part) > 1 or part[0] in ahead[part[0]]
        accepted = endless and all(members & accepting for accepting in automaton.accepting)
        if accepted or any(target in live for node in part for target in ahead[node]):
            live |= members
    return Monitor(automaton, frozenset(live))  # type: ignore[arg-type]


def rejected_prefix(
    initial: Iterable[int],
    following: Successors,
    label_of: Callable[[int], int],
    wanted: Monitor,
    tick: Callable[[], None] | None = None,
) -> tuple[int, ...] | None:
    """A shortest path through a graph after which no continuation is accepted, or None if there is none."""
    before: dict[tuple[int, frozenset[int]], tuple[int, frozenset[int]] | None] = {}
    queue = deque[tuple[int, frozenset[int]]]()

    def meet(state: int, nodes: frozenset[int], earlier: tuple[int, frozenset[int]] | None) -> None:
        place = (state, wanted.at(nodes, label_of(state)))
        if place not in before:
            before[place] = earlier
            queue.append(place)

    for state in initial:
        meet(state, wanted.begin(), None)
    while queue:
        if tick is not None:
            tick()
        place = queue.popleft()
        state, nodes = place
        if not nodes:
            way = [state]
            while (earlier := before[place]) is not None:
                place = earlier
                way.append(place[0])
            return tuple(reversed(way))
        later = wanted.after(nodes)
        for target in following(state):
            meet(target, later, place)
    return None


@dataclass(frozen=True, slots=True)
class _Search(Generic[A]):
    """The search for a lasso in the product of a graph and an automaton; a state of the product is a state of the graph
    times the automaton's width, plus a node."""

    successors: Successors
    label: Callable[[int], int]
    fair: Sequence[Fair]
    automaton: Automaton[A]

    @property
    def width(self) -> int:
        return len(self.automaton.positive)

    def meets(self, product: int, wanted: int) -> bool:
        return self.label(product) & wanted == wanted

    def fair_core(self, component: list[int]) -> set[int] | None:
        """A strongly connected part in which every acceptance set is met and every fairness assumption can be met."""
        work, width = [component], self.width
        while work:
            part = work.pop()
            members = set(part)
            if len(part) == 1 and part[0] not in self.successors(part[0]):
                continue
            at = {product % width for product in part}
            if not all(at & accepting for accepting in self.automaton.accepting):
                continue
            unfair = [
                f
                for f in self.fair
                if any(self.meets(p, f.asking) for p in part) and not any(self.meets(p, f.granting) for p in part)
            ]
            if not unfair:
                return members
            rest = {p for p in part if not any(self.meets(p, f.asking) for f in unfair)}
            work += strong_components(rest, self.within(rest))
        return None

    def within(self, part: Collection[int]) -> Successors:
        return lambda product: [target for target in self.successors(product) if target in part]

    def lasso(self, roots: Sequence[int], core: set[int]) -> Lasso:
        """A short path to the core, then a cycle in it that meets everything that must be met."""
        stem = _path(roots, core.__contains__, self.successors)
        entry = stem[-1]
        round_trip = [entry]
        inside = self.within(core)
        wanted: list[Callable[[int], bool]] = [
            lambda p, accepting=accepting: p % self.width in accepting  # type: ignore[misc]
            for accepting in self.automaton.accepting
        ]
        wanted += [
            lambda p, f=f: self.meets(p, f.granting)  # type: ignore[misc]
            for f in self.fair
            if any(self.meets(p, f.granting) for p in core)
        ]
        for meets in wanted:
            if not any(map(meets, round_trip)):
                round_trip += _path([round_trip[-1]], meets, inside)[1:]
        back = _path(inside(round_trip[-1]), lambda p: p == entry, inside)
        whole = stem[:-1] + round_trip + back[:-1]
        return Lasso(tuple(p // self.width for p in whole), len(stem) - 1)


def _path(sources: Sequence[int], meets: Callable[[int], bool], successors: Successors) -> list[int]:
    """The shortest path from a source to a node that `meets`; one must exist."""
    before: dict[int, int] = dict.fromkeys(sources, -1)
    queue = deque(before)
    while queue:
        node = queue.popleft()
        if meets(node):
            path = [node]
            while before[path[-1]] != -1:
                path.append(before[path[-1]])
            return path[::-1]
        for target in successors(node):
            if target not in before:
                before[target] = node
                queue.append(target)
    raise AssertionError("unreachable")
