"""What stands in a term, in reading order, however deep it is."""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.remembered import by_identity
from avow.language.terms import History, Role, Term, Variable


def subterms(term: Term) -> Iterator[Term]:
    """The term and everything in it."""
    stack = [term]
    while stack:
        current = stack.pop()
        yield current
        stack.extend(reversed(current.children))


@by_identity(50_000)
def histories(term: Term) -> tuple[History, ...]:
    """What in a term speaks of other steps than this one, in reading order; none in a term of one step."""
    return tuple(part for part in subterms(term) if isinstance(part, History))


def timed(term: Term) -> History | None:
    """What in a term has a limit in seconds, so that also the time between steps counts; None where nothing has."""
    return next((part for part in histories(term) if part.limit is not None and not part.limit.steps), None)


def ports_of(term: Term) -> tuple[Variable, ...]:
    """The inputs and outputs that a term mentions, each once."""
    return tuple(
        dict.fromkeys(part for part in subterms(term) if isinstance(part, Variable) and part.role is not Role.BOUND)
    )
