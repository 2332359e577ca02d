"""The subterms of a term, in reading order and at any depth; and the size of a term."""

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


# --- how large it is --------------------------------------------------------------------------------------------------

# Declarations share the values that they name (`A = B + B; B = C + C; …`), so a few lines can denote a term too large
# for any later pass. A clause that is too large or too deep once every name in it is expanded is therefore refused.


def term_extent(term: Term) -> tuple[int, int]:
    """A term's parts, and their depth. Visits each shared part once, and never recurses."""
    known: dict[int, tuple[int, int]] = {}
    stack: list[tuple[Term, bool]] = [(term, False)]
    while stack:
        part, ready = stack.pop()
        if id(part) in known:
            continue
        inner = part.children
        if ready or not inner:
            found = [known[id(p)] for p in inner]
            known[id(part)] = (1 + sum(size for size, _ in found), 1 + max((depth for _, depth in found), default=0))
        else:
            stack.append((part, True))
            stack += [(p, False) for p in inner]
    return known[id(term)]
