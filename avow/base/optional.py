"""Several answers, each of which may be missing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def complete(answers: Iterable[T | None]) -> list[T] | None:
    """All of them; None if one is missing."""
    found: list[T] = []
    for answer in answers:
        if answer is None:
            return None
        found.append(answer)
    return found
