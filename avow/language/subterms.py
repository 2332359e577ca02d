"""The subterms of a term, in reading order and at any depth."""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.remembered import by_identity
from avow.language.terms import History, Past, Role, Term, Variable


def subterms(term: Term) -> Iterator[Term]:
    """The term and everything in it."""
    stack = [term]
    while stack:
        current = stack.pop()
        yield current
        stack.extend(reversed(current.children))


def distinct_parts(term: Term) -> Iterator[Term]:
    """The term and everything in it; a part that is shared, as the value of a constant is, comes once."""
    met: set[int] = set()
    stack = [term]
    while stack:
        current = stack.pop()
        if id(current) not in met:
            met.add(id(current))
            yield current
            stack.extend(current.children)


@by_identity(50_000)
def histories(term: Term) -> tuple[History, ...]:
    """The subterms that refer to other steps than this one, in reading order; empty for a term of one step."""
    return tuple(part for part in subterms(term) if isinstance(part, History))


def timed(term: Term) -> History | None:
    """A subterm with a limit in seconds, so that the time between steps matters; None if there is none."""
    return next((part for part in histories(term) if part.limit is not None and not part.limit.steps), None)


def counts_steps(term: Term) -> bool:
    """Whether the number of steps matters: `previous`, `next`, `counted`, or a limit in steps."""
    counting = (Past.PREVIOUS, Past.NEXT, Past.COUNTED)
    return any(h.operator in counting or (h.limit is not None and h.limit.steps) for h in histories(term))


def ports_of(term: Term) -> tuple[Variable, ...]:
    """The inputs and outputs that a term mentions, each once."""
    return tuple(
        dict.fromkeys(part for part in subterms(term) if isinstance(part, Variable) and part.role is not Role.BOUND)
    )
