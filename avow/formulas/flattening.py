"""``and`` and ``or`` flattened, of whatever kind: one rule for terms, properties of agents, and RML conditions."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Any, TypeVar

T = TypeVar("T", bound=Hashable)


def joined(items: Iterable[T], kind: Any, unit: T, zero: T, *, once: bool = False) -> T:
    """A junction of the items: of one that is itself of the `kind`, its own `items`, however deep; without the `unit`,
    which changes nothing; the `zero` where it is among them, which decides it. `once`: each item once."""
    found: list[T] = []
    stack = list(items)
    stack.reverse()
    while stack:
        item = stack.pop()
        if isinstance(item, kind):
            stack.extend(reversed(item.items))
        elif item == zero:
            return zero
        elif item != unit:
            found.append(item)
    if once:
        found = list(dict.fromkeys(found))
    if not found:
        return unit
    made: T = found[0] if len(found) == 1 else kind(tuple(found))
    return made
