"""Flattening of ``and`` and ``or`` of any kind: one rule for terms, properties of agents, and RML conditions."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Any, TypeVar

T = TypeVar("T", bound=Hashable)


def joined(items: Iterable[T], kind: Any, unit: T, zero: T, *, once: bool = False) -> T:
    """A junction of the items. An item that is itself of the `kind` is replaced by its `items`, at any depth; the
    `unit` is left out; the result is `zero` if an item is. `once`: each item once."""
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
