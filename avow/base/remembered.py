"""Answers about frozen data, kept while they are few: a question about the very same object is not worked out twice."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def by_identity(most: int) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorates a pure function of frozen arguments. Which objects they are is compared, not what they say: to compare
    a deep formula costs as much as to work it out again. Of more than `most` answers none is kept."""

    def decorated(function: Callable[P, T]) -> Callable[P, T]:
        known: dict[tuple[int, ...], tuple[object, T]] = {}
        """The arguments are kept with the answer: while they are alive, no other object has their place."""

        @wraps(function)
        def asked(*args: P.args, **kwargs: P.kwargs) -> T:
            assert not kwargs
            key = tuple(map(id, args))
            found = known.get(key)
            if found is None:
                if len(known) >= most:
                    known.clear()
                found = known[key] = (args, function(*args, **kwargs))
            return found[1]

        return asked

    return decorated
