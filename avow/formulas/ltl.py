"""Linear temporal logic over any atoms: negation normal form, and generalised Büchi automata by the tableau of Gerth,
Peled, Vardi and Wolper ("Simple on-the-fly automatic verification of linear temporal logic", PSTV 1995).

A node of the automaton matches a state in which all its positive atoms hold and none of its negative ones; a run is
accepted if it meets each acceptance set infinitely often. `avow.formulas.lasso` searches a graph for such a run.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from typing import Generic, TypeVar, assert_never

from avow.base.records import dataclass
from avow.base.tuning.bounds import AUTOMATON_NODES

A = TypeVar("A", bound=Hashable)


class TooLarge(Exception):  # noqa: N818 - it names what happened
    """The automaton has more than `AUTOMATON_NODES` nodes."""


@dataclass(frozen=True, slots=True)
class Lit(Generic[A]):
    """An atom, or its negation."""

    atom: A
    positive: bool


@dataclass(frozen=True, slots=True)
class Both(Generic[A]):
    items: tuple[Normal[A], ...]


@dataclass(frozen=True, slots=True)
class Either(Generic[A]):
    items: tuple[Normal[A], ...]


@dataclass(frozen=True, slots=True)
class Next(Generic[A]):
    body: Normal[A]


@dataclass(frozen=True, slots=True)
class Until(Generic[A]):
    left: Normal[A]
    right: Normal[A]


@dataclass(frozen=True, slots=True)
class Release(Generic[A]):
    """`right` holds up to and including the step at which `left` holds, or for ever."""

    left: Normal[A]
    right: Normal[A]


Normal = Lit[A] | Both[A] | Either[A] | Next[A] | Until[A] | Release[A]


def join(items: Iterable[Normal[A]], both: bool) -> Normal[A]:
    """``and`` (or ``or``) of all the items, nested in pairs from the right, without neutral items."""
    kind, other = (Both, Either) if both else (Either, Both)
    kept = [item for item in items if item != kind(())]
    if other(()) in kept:
        return other(())
    result: Normal[A] = kept[-1] if kept else kind(())
    for item in reversed(kept[:-1]):
        result = kind((item, result))
    return result


def always(body: Normal[A], positive: bool = True) -> Normal[A]:
    """``always``; its dual if the body is already negated."""
    return Release(Either(()), body) if positive else Until(Both(()), body)


def eventually(body: Normal[A], positive: bool = True) -> Normal[A]:
    """``eventually``; its dual if the body is already negated."""
    return always(body, not positive)


def until(left: Normal[A], right: Normal[A], positive: bool = True) -> Normal[A]:
    """``until``; its dual if the sides are already negated."""
    return Until(left, right) if positive else Release(left, right)


def children(formula: Normal[A]) -> tuple[Normal[A], ...]:
    """The direct parts, in reading order."""
    match formula:
        case Lit():
            return ()
        case Both(items=items) | Either(items=items):
            return items
        case Next(body=body):
            return (body,)
        case Until(left=left, right=right) | Release(left=left, right=right):
            return (left, right)
        case _:
            assert_never(formula)


def parts(formula: Normal[A]) -> Iterator[Normal[A]]:
    """The formula and everything in it, in reading order."""
    stack = [formula]
    while stack:
        current = stack.pop()
        yield current
        stack.extend(reversed(children(current)))


@dataclass(frozen=True, slots=True)
class Automaton(Generic[A]):
    """Node n: `positive[n]` and `negative[n]` are bit sets of leaves; `accepting` has the node numbers of each
    acceptance set; `leaves` are the atoms."""

    leaves: tuple[A, ...]
    positive: tuple[int, ...]
    negative: tuple[int, ...]
    successors: tuple[tuple[int, ...], ...]
    initial: tuple[int, ...]
    accepting: tuple[frozenset[int], ...]


@dataclass(slots=True)
class _Node:
    """A node, in the paper's terms; formulas are given by their numbers."""

    incoming: set[int]
    new: list[int]
    old: set[int]
    next: set[int]


_START = -1


def build(goal: Normal[A]) -> Automaton[A]:
    """The automaton that accepts exactly the runs on which the formula holds. Raises TooLarge."""
    numbers: dict[Normal[A], int] = {}
    for part in parts(goal):
        numbers.setdefault(part, len(numbers))
    formulas = list(numbers)
    inner = [[numbers[child] for child in children(part)] for part in formulas]
    opposite = [numbers.get(Lit(p.atom, not p.positive)) if isinstance(p, Lit) else None for p in formulas]

    def expand(node: _Node, item: int) -> tuple[_Node, ...]:
        """The node with one more formula that holds; several nodes if it can hold in several ways."""
        below = inner[item]
        match formulas[item]:
            case Both(items=()):
                return (node,)
            case Either(items=()):
                return ()
            case Lit():
                if opposite[item] in node.old:
                    return ()
                node.old.add(item)
                return (node,)
            case Both():
                node.old.add(item)
                node.new += below
                return (node,)
            case Next():
                node.old.add(item)
                node.next.add(below[0])
                return (node,)
            case Either():
                node.old.add(item)
                others = [_Node(set(node.incoming), [*node.new, b], set(node.old), set(node.next)) for b in below[1:]]
                node.new.append(below[0])
                return (node, *others)
            case Until() | Release() as formula:
                node.old.add(item)
                other = _Node(set(node.incoming), list(node.new), set(node.old), set(node.next))
                left, right = below
                node.next.add(item)
                if isinstance(formula, Until):
                    node.new.append(left)
                    other.new.append(right)
                else:
                    node.new.append(right)
                    other.new += [left, right]
                return (node, other)
            case _ as never:
                assert_never(never)

    nodes: list[_Node] = []
    known: dict[tuple[frozenset[int], frozenset[int]], int] = {}
    stack = [_Node({_START}, [numbers[goal]], set(), set())]
    while stack:
        node = stack.pop()
        if node.new:
            item = node.new.pop()
            stack.extend((node,) if item in node.old else expand(node, item))
            continue
        key = (frozenset(node.old), frozenset(node.next))
        at = known.get(key)
        if at is not None:
            nodes[at].incoming |= node.incoming
            continue
        at = known[key] = len(nodes)
        nodes.append(node)
        if len(nodes) > AUTOMATON_NODES:
            raise TooLarge
        stack.append(_Node({at}, list(node.next), set(), set()))
    return _finished(nodes, formulas, inner)


def _finished(nodes: list[_Node], formulas: list[Normal[A]], inner: list[list[int]]) -> Automaton[A]:
    successors: list[list[int]] = [[] for _ in nodes]
    initial = []
    for at, node in enumerate(nodes):
        for source in sorted(node.incoming):
            if source == _START:
                initial.append(at)
            else:
                successors[source].append(at)
    leaves: dict[A, int] = {}
    for part in formulas:
        if isinstance(part, Lit):
            leaves.setdefault(part.atom, len(leaves))

    def bits(node: _Node, positive: bool) -> int:
        found = (formulas[item] for item in node.old)
        return sum(1 << leaves[p.atom] for p in found if isinstance(p, Lit) and p.positive is positive)

    def met(item: int, node: _Node) -> bool:
        return item not in node.old or formulas[inner[item][1]] == Both(()) or inner[item][1] in node.old

    untils = [item for item, part in enumerate(formulas) if isinstance(part, Until)]
    return Automaton(
        tuple(leaves),
        tuple(bits(node, True) for node in nodes),
        tuple(bits(node, False) for node in nodes),
        tuple(map(tuple, successors)),
        tuple(initial),
        tuple(frozenset(at for at, node in enumerate(nodes) if met(item, node)) for item in untils),
    )
