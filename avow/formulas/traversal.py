"""The depth of a term, and rebuilding it. A formula is nested at most `NESTING` levels deep, so that passes recurse."""

from __future__ import annotations

from collections.abc import Callable

from avow.language.terms import Term


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

    parts = tuple(transform(child, function) for child in term.children)
    return function(term.rebuild(parts) if parts else term)
