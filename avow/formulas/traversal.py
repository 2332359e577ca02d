"""Walking terms of any depth.

Contracts are external data: a formula nested ten thousand deep must not cause a RecursionError. A recursive
function is written as a generator that *yields* its recursive calls and returns its result; `run` keeps the stack.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

from avow.language.terms import Term

T = TypeVar("T")

Steps = Generator[Any, Any, T]
"""A recursive computation of a T that yields the `Steps` of its recursive calls and is sent their results."""


def run(steps: Steps[T]) -> T:
    """The result of a recursive computation, whatever its depth."""
    stack: list[Steps[Any]] = [steps]
    value: Any = None
    while stack:
        try:
            call = stack[-1].send(value)
        except StopIteration as done:
            stack.pop()
            value = done.value
        else:
            stack.append(call)
            value = None
    result: T = value
    return result


def each(calls: Iterable[Steps[T]]) -> Steps[list[T]]:
    """The results of several recursive calls, in order: ``found = yield from each(…)``."""
    found: list[T] = []
    for call in calls:
        found.append((yield call))
    return found


def depth(term: Term) -> int:
    """Levels of nesting; an atom has 1."""
    deepest = 0
    stack = [(term, 1)]
    while stack:
        current, level = stack.pop()
        deepest = max(deepest, level)
        stack.extend((child, level + 1) for child in current.children)
    return deepest


def transform(term: Term, function: Callable[[Term], Term]) -> Term:
    """Rebuild from the leaves up, applying `function` to every rebuilt subterm.

    It ignores scopes: a function that changes variables must itself distinguish free from bound ones.
    """

    def steps(current: Term) -> Steps[Term]:
        parts = yield from each(map(steps, current.children))
        return function(current.rebuild(tuple(parts)) if parts else current)

    return run(steps(term))
