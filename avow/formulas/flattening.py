"""``and`` and ``or`` flattened, of whatever kind: one rule for terms, properties of agents, and RML conditions."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar

T = TypeVar("T", bound=Hashable)


def flattened(
    items: Iterable[T], within: Callable[[T], Sequence[T] | None], unit: T, zero: T, *, once: bool = False
) -> list[T] | None:
    """The parts of a junction: for one that is a junction of the same kind (`within` gives its parts) its own, however
    deep, and without the `unit`, which changes nothing. None where the `zero` is among them, which decides it.
    `once`: each part once."""
    found: list[T] = []
    stack = list(items)
    stack.reverse()
    while stack:
        item = stack.pop()
        inner = within(item)
        if inner is not None:
            stack.extend(reversed(inner))
        elif item == zero:
            return None
        elif item != unit:
            found.append(item)
    return list(dict.fromkeys(found)) if once else found
