"""How large a sort or term is once every name in it is written out.

Declarations share what they name (``A = B + B; B = C + C; …``), so a few lines can stand for a term that no later pass
could finish with. What is too large or too deep is therefore refused where it is declared or used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from avow.language.sorts import Sort, parts
from avow.language.terms import Term

_Part = TypeVar("_Part")


def extent(root: _Part, parts: Callable[[_Part], tuple[_Part, ...]]) -> tuple[int, int]:
    """How many parts there are, and how deep they go. Takes time for each shared part once, and never recurses."""
    known: dict[int, tuple[int, int]] = {}
    stack: list[tuple[_Part, bool]] = [(root, False)]
    while stack:
        part, ready = stack.pop()
        if id(part) in known:
            continue
        inner = parts(part)
        if ready or not inner:
            found = [known[id(p)] for p in inner]
            known[id(part)] = (1 + sum(size for size, _ in found), 1 + max((depth for _, depth in found), default=0))
        else:
            stack.append((part, True))
            stack += [(p, False) for p in inner]
    return known[id(root)]


def term_extent(term: Term) -> tuple[int, int]:
    """A term's parts and depth."""
    return extent(term, lambda part: part.children)


def sort_extent(sort: Sort) -> tuple[int, int]:
    """A sort's parts (an enumeration's elements do not count) and depth."""
    return extent(sort, parts)
