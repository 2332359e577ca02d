"""Linear temporal logic to generalised Büchi automata, by the tableau of Gerth, Peled, Vardi and Wolper (1995).

Formulas are kept in negation normal form over *leaves*: state predicates by their numbers. A node of the automaton may
be at a state where all its positive leaves hold and none of its negative ones; a run is accepted when it meets each
acceptance set again and again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from .psl import (
    Always,
    And,
    Atom,
    Eventually,
    Formula,
    Implies,
    Not,
    Or,
    Release,
    Truth,
    Until,
    is_temporal,
)

MAX_NODES = 5_000

Nnf = tuple[object, ...]
"""``("true",)``, ``("false",)``, ``("leaf", n, positive)``, ``("and" | "or" | "until" | "release", left, right)``."""

_TRUE: Nnf = ("true",)
_FALSE: Nnf = ("false",)


class TooLarge(Exception):  # noqa: N818 - it names what happened
    """The automaton has more nodes than are worth building."""


@dataclass(frozen=True, slots=True)
class Automaton:
    """Node n: `positive[n]` and `negative[n]` are bit sets of leaves; `accepting` are bit sets of nodes' numbers, one
    for each acceptance set; `leaves` are the state predicates."""

    leaves: tuple[Formula, ...]
    positive: tuple[int, ...]
    negative: tuple[int, ...]
    successors: tuple[tuple[int, ...], ...]
    initial: tuple[int, ...]
    accepting: tuple[frozenset[int], ...]


@dataclass(slots=True)
class _Node:
    incoming: set[int]
    new: list[Nnf]
    old: set[Nnf]
    next: set[Nnf]


def build(formula: Formula) -> Automaton:
    """The automaton that accepts just the runs on which the formula holds. Raises TooLarge."""
    leaves: dict[Formula, int] = {}
    goal = _nnf(formula, True, leaves)
    nodes: list[_Node] = []
    known: dict[tuple[frozenset[Nnf], frozenset[Nnf]], int] = {}
    start = -1
    stack = [_Node({start}, [goal], set(), set())]
    while stack:
        node = stack.pop()
        if not node.new:
            key = (frozenset(node.old), frozenset(node.next))
            at = known.get(key)
            if at is not None:
                nodes[at].incoming |= node.incoming
                continue
            at = known[key] = len(nodes)
            nodes.append(node)
            if len(nodes) > MAX_NODES:
                raise TooLarge
            stack.append(_Node({at}, list(node.next), set(), set()))
            continue
        item = node.new.pop()
        if item in node.old:
            stack.append(node)
            continue
        stack.extend(_expand(node, item))
    return _finish(nodes, start, goal, tuple(leaves))


def _expand(node: _Node, item: Nnf) -> tuple[_Node, ...]:
    match item[0]:
        case "false":
            return ()
        case "true":
            return (node,)
        case "leaf":
            if ("leaf", item[1], not item[2]) in node.old:
                return ()
            node.old.add(item)
            return (node,)
        case "and":
            node.old.add(item)
            node.new += [item[1], item[2]]  # type: ignore[list-item]
            return (node,)
    _, left, right = item
    assert isinstance(left, tuple)
    assert isinstance(right, tuple)
    node.old.add(item)
    other = _Node(set(node.incoming), list(node.new), set(node.old), set(node.next))
    if item[0] == "or":
        node.new.append(left)
        other.new.append(right)
    elif item[0] == "until":
        node.new.append(left)
        node.next.add(item)
        other.new.append(right)
    else:
        node.new.append(right)
        node.next.add(item)
        other.new += [left, right]
    return (node, other)


def _finish(nodes: list[_Node], start: int, goal: Nnf, leaves: tuple[Formula, ...]) -> Automaton:
    successors: list[list[int]] = [[] for _ in nodes]
    initial = []
    for at, node in enumerate(nodes):
        for source in sorted(node.incoming):
            if source == start:
                initial.append(at)
            else:
                successors[source].append(at)
    untils: dict[Nnf, None] = {}
    _collect(goal, untils)
    accepting = tuple(
        frozenset(at for at, node in enumerate(nodes) if until not in node.old or _fulfilled(until[2], node.old))
        for until in untils
    )
    return Automaton(
        leaves,
        tuple(_bits(node, True) for node in nodes),
        tuple(_bits(node, False) for node in nodes),
        tuple(map(tuple, successors)),
        tuple(initial),
        accepting,
    )


def _fulfilled(right: object, old: set[Nnf]) -> bool:
    return right == _TRUE or right in old


def _collect(item: object, untils: dict[Nnf, None]) -> None:
    if isinstance(item, tuple):
        if item[0] == "until":
            untils[item] = None
        for part in item[1:]:
            _collect(part, untils)


def _bits(node: _Node, positive: bool) -> int:
    bits = 0
    for item in node.old:
        if item[0] == "leaf" and item[2] is positive:
            number = item[1]
            assert isinstance(number, int)
            bits |= 1 << number
    return bits


def _nnf(formula: Formula, positive: bool, leaves: dict[Formula, int]) -> Nnf:
    """Maximal parts without temporal operators become leaves."""
    if isinstance(formula, Truth):
        return _TRUE if formula.value is positive else _FALSE
    if isinstance(formula, Not):
        return _nnf(formula.body, not positive, leaves)
    if not is_temporal(formula):
        return ("leaf", leaves.setdefault(formula, len(leaves)), positive)
    match formula:
        case And(items=items):
            return _fold("and" if positive else "or", [_nnf(i, positive, leaves) for i in items])
        case Or(items=items):
            return _fold("or" if positive else "and", [_nnf(i, positive, leaves) for i in items])
        case Implies(left=left, right=right):
            sides = [_nnf(left, not positive, leaves), _nnf(right, positive, leaves)]
            return _fold("or" if positive else "and", sides)
        case Always(body=body):
            inner = _nnf(body, positive, leaves)
            return ("release", _FALSE, inner) if positive else ("until", _TRUE, inner)
        case Eventually(body=body):
            inner = _nnf(body, positive, leaves)
            return ("until", _TRUE, inner) if positive else ("release", _FALSE, inner)
        case Until(left=left, right=right) | Release(left=left, right=right):
            until = isinstance(formula, Until) is positive
            return ("until" if until else "release", _nnf(left, positive, leaves), _nnf(right, positive, leaves))
    raise AssertionError(formula)


def _fold(operator: str, items: list[Nnf]) -> Nnf:
    unit, zero = (_TRUE, _FALSE) if operator == "and" else (_FALSE, _TRUE)
    if zero in items:
        return zero
    items = [item for item in items if item != unit]
    if not items:
        return unit
    result = items[-1]
    for item in reversed(items[:-1]):
        result = (operator, item, result)
    return result


def compiled(formula: Formula, places: Mapping[Atom, int]) -> Callable[[int], bool]:
    """A formula without temporal operators as a test of a state's label, a bit set of atoms."""
    match formula:
        case Atom():
            bit = 1 << places[formula]
            return lambda label: bool(label & bit)
        case Truth(value=value):
            return lambda label: value
        case Not(body=body):
            inner = compiled(body, places)
            return lambda label: not inner(label)
        case And(items=items):
            tests = [compiled(i, places) for i in items]
            return lambda label: all(test(label) for test in tests)
        case Or(items=items):
            tests = [compiled(i, places) for i in items]
            return lambda label: any(test(label) for test in tests)
        case Implies(left=left, right=right):
            first, second = compiled(left, places), compiled(right, places)
            return lambda label: not first(label) or second(label)
    raise AssertionError(formula)
