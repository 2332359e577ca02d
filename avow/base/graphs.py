"""Directed graphs: reachability, strongly connected components, and cycles within them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

N = TypeVar("N", bound=Hashable)


def reached(roots: Iterable[N], successors: Callable[[N], Iterable[N]]) -> dict[N, None]:
    """The roots and all nodes reachable from them, each once, in the order of discovery."""
    found = dict.fromkeys(roots)
    stack = [*found]
    while stack:
        for node in successors(stack.pop()):
            if node not in found:
                found[node] = None
                stack.append(node)
    return found


def strong_components(roots: Iterable[N], successors: Callable[[N], Iterable[N]]) -> Iterator[list[N]]:
    """Tarjan's strongly connected components, each after those that it can reach; computed lazily."""
    index: dict[N, int] = {}
    low: dict[N, int] = {}
    on_stack: set[N] = set()
    stack: list[N] = []
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


def components(nodes: Iterable[N], arcs: Iterable[tuple[N, N]]) -> tuple[tuple[N, ...], ...]:
    """Strongly connected components of a complete graph structure, sources of arcs before their targets; nodes within
    one in the given order. Arcs to or from other nodes are ignored."""
    names = tuple(nodes)
    successors: dict[N, list[N]] = {name: [] for name in names}
    for source, target in arcs:
        if source in successors and target in successors:
            successors[source].append(target)
    position = {name: k for k, name in enumerate(names)}
    found = [tuple(sorted(c, key=position.__getitem__)) for c in strong_components(names, successors.__getitem__)]
    return tuple(reversed(found))


def cycle_in(component: Sequence[str], arcs: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """A cycle within a component, or an empty tuple if there is none."""
    return next(iter(cycles_in(component, arcs)), ())


def cycles_in(component: Sequence[str], arcs: Iterable[tuple[str, str]]) -> tuple[tuple[str, ...], ...]:
    """Short cycles within a component that together cover every node on a cycle; shortest first."""
    inside = set(component)
    successors: dict[str, list[str]] = {name: [] for name in component}
    for source, target in arcs:
        if source in inside and target in inside and target not in successors[source]:
            successors[source].append(target)
    found: list[tuple[str, ...]] = []
    covered: set[str] = set()
    for start in component:
        path = _shortest(start, successors) if start not in covered and len(found) < 50 else ()
        if path:
            found.append(path)
            covered.update(path)
    return tuple(sorted(found, key=len))


def _shortest(start: str, successors: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    before: dict[str, str] = {}
    frontier = [start]
    while frontier:
        following: list[str] = []
        for name in frontier:
            for successor in successors[name]:
                if successor == start:
                    path = [name]
                    while path[-1] != start:
                        path.append(before[path[-1]])
                    return tuple(reversed(path))
                if successor not in before:
                    before[successor] = name
                    following.append(successor)
        frontier = following
    return ()
