"""Labelled graphs: strongly connected components, stutter reduction, and the search for a fair accepting lasso."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from .automaton import Automaton

Successors = Callable[[int], Sequence[int]]


@dataclass(frozen=True, slots=True)
class Kripke:
    """States by numbers, their successors, and a label for each: a bit set. Runs are endless: one that comes to a state
    without successors is none."""

    initial: tuple[int, ...]
    successors: Sequence[Sequence[int]]
    labels: Sequence[int]

    def __len__(self) -> int:
        return len(self.labels)


@dataclass(frozen=True, slots=True)
class Fair:
    """A strong fairness assumption over labels: whoever meets all of `asking` for ever, meets `granting` for ever."""

    asking: int
    granting: int


@dataclass(frozen=True, slots=True)
class Lasso:
    """A run: `path`, whose last state returns to the one at `loop`."""

    path: tuple[int, ...]
    loop: int


def components(roots: Iterable[int], successors: Successors) -> Iterator[list[int]]:
    """Tarjan's strongly connected components, each after those that it can reach; found as they are asked for."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    on_stack: set[int] = set()
    stack: list[int] = []
    for root in roots:
        if root in index:
            continue
        index[root] = low[root] = len(index)
        stack.append(root)
        on_stack.add(root)
        work = [(root, iter(successors(root)))]
        while work:
            node, rest = work[-1]
            for target in rest:
                if target not in index:
                    index[target] = low[target] = len(index)
                    stack.append(target)
                    on_stack.add(target)
                    work.append((target, iter(successors(target))))
                    break
                if target in on_stack and index[target] < low[node]:
                    low[node] = index[target]
            else:
                work.pop()
                if work and low[node] < low[work[-1][0]]:
                    low[work[-1][0]] = low[node]
                if low[node] == index[node]:
                    component = []
                    while True:
                        member = stack.pop()
                        on_stack.discard(member)
                        component.append(member)
                        if member == node:
                            break
                    yield component


def reduce(graph: Kripke) -> Kripke:
    """A smaller graph with the same runs up to stuttering (and up to nothing else: endless stuttering stays).

    States of one label that reach each other become one with a loop; a state whose only way leads to a state of its
    own label becomes that state. Properties without "next" do not see the difference.
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
    # Components come after those that they reach along equal labels, so "only way leads to its own label" is known.
    for component in components(range(len(labels)), alike):
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
    return _reachable(Kripke(initial, successors_now, new_labels))


def _reachable(graph: Kripke) -> Kripke:
    order: dict[int, int] = {s: i for i, s in enumerate(graph.initial)}
    queue = list(graph.initial)
    for node in queue:
        for target in graph.successors[node]:
            if target not in order:
                order[target] = len(order)
                queue.append(target)
    return Kripke(
        tuple(range(len(graph.initial))),
        [tuple(order[t] for t in graph.successors[node]) for node in queue],
        [graph.labels[node] for node in queue],
    )


def find_lasso(graph: Kripke, automaton: Automaton, fair: Sequence[Fair] = ()) -> Lasso | None:
    """A fair run of the graph that the automaton accepts, or None if there is none.

    The leaves of the automaton are the low bits of the labels. The product is explored whole, decomposed, and each
    component cut down by the fairness assumptions until it is fair or gone.
    """
    width = len(automaton.positive)
    matching: dict[int, tuple[int, ...]] = {}

    def nodes(label: int) -> tuple[int, ...]:
        found = matching.get(label)
        if found is None:
            pairs = zip(automaton.positive, automaton.negative, strict=True)
            found = tuple(n for n, (yes, no) in enumerate(pairs) if label & yes == yes and not label & no)
            matching[label] = found
        return found

    allowed: dict[tuple[int, int], tuple[int, ...]] = {}

    def successors(product: int) -> list[int]:
        state, node = divmod(product, width)
        result = []
        following = automaton.successors[node]
        for target in graph.successors[state]:
            label = graph.labels[target]
            key = (node, label)
            ways = allowed.get(key)
            if ways is None:
                fitting = set(nodes(label))
                ways = allowed[key] = tuple(n for n in following if n in fitting)
            base = target * width
            for way in ways:
                result.append(base + way)
        return result

    roots = [
        state * width + node
        for state in graph.initial
        for node in automaton.initial
        if node in nodes(graph.labels[state])
    ]
    cache: dict[int, list[int]] = {}

    def cached(product: int) -> list[int]:
        found = cache.get(product)
        if found is None:
            found = cache[product] = successors(product)
        return found

    def label(product: int) -> int:
        return graph.labels[product // width]

    good = []
    for component in components(roots, cached):
        core = _fair_core(component, cached, label, fair, automaton, width)
        if core is not None:
            good.append(core)
            break
    if not good:
        return None
    return _lasso(roots, good[0], cached, label, fair, automaton, width)


def _fair_core(
    component: list[int],
    successors: Successors,
    label: Callable[[int], int],
    fair: Sequence[Fair],
    automaton: Automaton,
    width: int,
) -> set[int] | None:
    """A strongly connected part in which every acceptance set is met and every fairness assumption can be."""
    work = [component]
    while work:
        part = work.pop()
        members = set(part)
        if len(part) == 1 and part[0] not in successors(part[0]):
            continue
        at = {product % width for product in part}
        if not all(at & accepting for accepting in automaton.accepting):
            continue
        unfair = [
            f
            for f in fair
            if any(label(p) & f.asking == f.asking for p in part)
            and not any(label(p) & f.granting == f.granting for p in part)
        ]
        if not unfair:
            return members
        rest = {p for p in part if not any(label(p) & f.asking == f.asking for f in unfair)}
        work += components(rest, lambda p, rest=rest: [t for t in successors(p) if t in rest])  # type: ignore[misc]
    return None


def _lasso(
    roots: Sequence[int],
    core: set[int],
    successors: Successors,
    label: Callable[[int], int],
    fair: Sequence[Fair],
    automaton: Automaton,
    width: int,
) -> Lasso:
    """A short way to the core, then a round through it that meets everything that must be met."""
    stem = _path(roots, core.__contains__, successors)
    entry = stem[-1]
    round_trip = [entry]

    def inside(product: int) -> list[int]:
        return [t for t in successors(product) if t in core]

    wanted: list[Callable[[int], bool]] = [
        lambda p, accepting=accepting: p % width in accepting  # type: ignore[misc]
        for accepting in automaton.accepting
    ]
    wanted += [
        lambda p, f=f: label(p) & f.granting == f.granting  # type: ignore[misc]
        for f in fair
        if any(label(p) & f.granting == f.granting for p in core)
    ]
    for meets in wanted:
        if not any(map(meets, round_trip)):
            round_trip += _path([round_trip[-1]], meets, inside)[1:]
    back = _path(inside(round_trip[-1]), lambda p: p == entry, inside)
    whole = stem[:-1] + round_trip + back[:-1]
    return Lasso(tuple(p // width for p in whole), len(stem) - 1)


def _path(sources: Sequence[int], meets: Callable[[int], bool], successors: Successors) -> list[int]:
    """The shortest path from a source to something wanted; there is one."""
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
