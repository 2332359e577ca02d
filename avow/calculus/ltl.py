"""Linear temporal logic over an explicit graph of steps: is there a run that breaks the property, and which?

The negated property, in negation normal form, is unfolded along the graph: each node of the product is a step with the
formulas that must hold from there on. A run breaks the property if it goes round for ever without postponing any
`until` for ever (generalized Büchi acceptance, read off the strongly connected components).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from avow.solving.limits import now
from avow.system.graph import components
from avow.system.temporal import Operator, Property, State


@dataclass(frozen=True, slots=True)
class Lit:
    """A state formula, or its negation."""

    state: State
    positive: bool


@dataclass(frozen=True, slots=True)
class Both:
    items: tuple[Normal, ...]


@dataclass(frozen=True, slots=True)
class Either:
    items: tuple[Normal, ...]


@dataclass(frozen=True, slots=True)
class Next:
    body: Normal


@dataclass(frozen=True, slots=True)
class Until:
    left: Normal
    right: Normal


@dataclass(frozen=True, slots=True)
class Release:
    """`right` holds up to and including the step at which `left` does, or for ever."""

    left: Normal
    right: Normal


Normal = Lit | Both | Either | Next | Until | Release

TRUE = Both(())
FALSE = Either(())


def normal(formula: Property, positive: bool = True) -> Normal:
    """Negation normal form, of the formula or of its negation."""
    if isinstance(formula, State):
        return Lit(formula, positive)
    parts = formula.parts
    match formula.operator:
        case Operator.NOT:
            return normal(parts[0], not positive)
        case Operator.AND | Operator.OR:
            items = tuple(normal(part, positive) for part in parts)
            return Both(items) if (formula.operator is Operator.AND) == positive else Either(items)
        case Operator.IMPLIES:
            items = (normal(parts[0], not positive), normal(parts[1], positive))
            return Either(items) if positive else Both(items)
        case Operator.IFF:
            one, other = parts
            same = Both((normal(one), normal(other, positive)))
            opposite = Both((normal(one, False), normal(other, not positive)))
            return Either((same, opposite))
        case Operator.NEXT:
            return Next(normal(parts[0], positive))
        case Operator.ALWAYS:
            body = normal(parts[0], positive)
            return Release(FALSE, body) if positive else Until(TRUE, body)
        case Operator.EVENTUALLY:
            body = normal(parts[0], positive)
            return Until(TRUE, body) if positive else Release(FALSE, body)
        case Operator.UNTIL:
            left, right = normal(parts[0], positive), normal(parts[1], positive)
            return Until(left, right) if positive else Release(left, right)


def demands_progress(formula: Property) -> bool:
    """Whether the property wants something to happen at some time: then a system that stops breaks it."""
    stack: list[Normal] = [normal(formula)]
    while stack:
        current = stack.pop()
        match current:
            case Until():
                return True
            case Both(items=items) | Either(items=items):
                stack.extend(items)
            case Release(left=left, right=right):
                stack += [left, right]
            case Next(body=body):
                stack.append(body)
            case Lit():
                pass
    return False


@dataclass(frozen=True, slots=True)
class Lasso:
    """A run: `prefix`, then `cycle` for ever (indexes of steps)."""

    prefix: tuple[int, ...]
    cycle: tuple[int, ...]


Obligations = frozenset[Normal]
_Node = tuple[int, Obligations]
_Edge = tuple[_Node, frozenset[Until]]


class TooLong(Exception):  # noqa: N818 - it names what happened
    """No answer within the time for it."""


def violation(
    formula: Property,
    initial: Iterable[int],
    successors: Callable[[int], Sequence[int]],
    holds: Callable[[int, State], bool],
    deadline: float | None = None,
) -> Lasso | None:
    """A run of the graph that breaks the property, or None. Every step must have a successor for a run to count.

    `deadline` is in seconds of `avow.solving.limits.now`; raises TooLong after it.
    """
    negated = normal(formula, positive=False)

    @cache
    def unfolded(step: int, obligations: Obligations) -> tuple[tuple[Obligations, frozenset[Until]], ...]:
        return tuple(dict.fromkeys(_unfold(obligations, lambda state: holds(step, state))))

    edges: dict[_Node, list[_Edge]] = {}
    origin: dict[_Node, _Node | None] = {}
    queue: deque[_Node] = deque()
    for step in initial:
        node = (step, frozenset({negated}))
        if node not in origin:
            origin[node] = None
            queue.append(node)
    while queue:
        if deadline is not None and len(edges) % 500 == 0 and now() > deadline:
            raise TooLong
        node = queue.popleft()
        step, obligations = node
        following: list[_Edge] = []
        for left, postponed in unfolded(step, obligations):
            for successor in successors(step):
                target = (successor, left)
                following.append((target, postponed))
                if target not in origin:
                    origin[target] = node
                    queue.append(target)
        edges[node] = following
    return _fair(edges, origin)


def _unfold(obligations: Obligations, holds: Callable[[State], bool]) -> Iterable[tuple[Obligations, frozenset[Until]]]:
    """What must hold from the next step on, in each way of meeting the obligations now; and what is postponed."""
    work: list[tuple[tuple[Normal, ...], frozenset[Normal], frozenset[Until]]] = [
        (tuple(obligations), frozenset(), frozenset())
    ]
    while work:
        todo, later, postponed = work.pop()
        if not todo:
            yield later, postponed
            continue
        first, rest = todo[0], todo[1:]
        match first:
            case Lit(state=state, positive=positive):
                if holds(state) == positive:
                    work.append((rest, later, postponed))
            case Both(items=items):
                work.append((items + rest, later, postponed))
            case Either(items=items):
                work.extend(((item, *rest), later, postponed) for item in items)
            case Next(body=body):
                work.append((rest, later | {body}, postponed))
            case Until(left=left, right=right):
                work.append(((right, *rest), later, postponed))
                work.append(((left, *rest), later | {first}, postponed | {first}))
            case Release(left=left, right=right):
                work.append(((left, right, *rest), later, postponed))
                work.append(((right, *rest), later | {first}, postponed))


def _fair(edges: Mapping[_Node, Sequence[_Edge]], origin: Mapping[_Node, _Node | None]) -> Lasso | None:
    arcs = [(node, target) for node, following in edges.items() for target, _ in following]
    for component in components(edges, arcs):
        inside = set(component)
        within = [(node, t, postponed) for node in component for t, postponed in edges[node] if t in inside]
        if not within:
            continue
        untils = {u for _, _, postponed in within for u in postponed}
        goals = [next(((n, t) for n, t, p in within if u not in p), None) for u in untils]
        if any(goal is None for goal in goals):
            continue
        wanted = [goal for goal in goals if goal is not None] or [within[0][:2]]
        links: dict[_Node, list[_Node]] = {}
        for node, target, _ in within:
            links.setdefault(node, []).append(target)
        start = wanted[0][0]
        cycle: list[_Node] = [start]
        for source, target in wanted:
            cycle += _path(cycle[-1], source, links)[1:]
            cycle.append(target)
        cycle += _path(cycle[-1], start, links)[1:]
        prefix: list[_Node] = []
        back = origin[start]
        while back is not None:
            prefix.append(back)
            back = origin[back]
        return Lasso(tuple(n[0] for n in reversed(prefix)), tuple(n[0] for n in cycle[:-1]))
    return None


def _path(source: _Node, target: _Node, links: Mapping[_Node, Sequence[_Node]]) -> list[_Node]:
    before: dict[_Node, _Node | None] = {source: None}
    queue = deque([source])
    while queue and target not in before:
        node = queue.popleft()
        for following in links.get(node, ()):
            if following not in before:
                before[following] = node
                queue.append(following)
    path: list[_Node] = []
    current: _Node | None = target
    while current is not None:
        path.append(current)
        current = before[current]
    return path[::-1]
