"""Unspecified types: some non-empty set of which nothing else is known, nor its number of elements.

A consequence of formulas holds for any such set (a solver's `unsat` covers all of them). But a solver that finds values
chooses the number of elements of a type ``{}``, and an implementation of the contract may not: the existence of such
values counts only if they exist for any number of elements. That is checked for few elements and for many: for each
number that `avow.base.tuning` names, and for more than these, in different types alike and independently.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

from avow.base.tuning.bounds import SIZES_COMBINED, SIZES_TRIED
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, disjunction
from avow.language.sorts import OpaqueSort
from avow.language.terms import TRUE, Compare, Not, Quantified, Quantifier, Role, Term, Variable
from avow.solving.questions import solve
from avow.solving.replay import opaque_sorts
from avow.solving.second import CONTRADICTED, doubted

_MORE = max(SIZES_TRIED) + 1
"""Represents at least so many."""


def in_every_size(
    assumptions: Mapping[str, Term], wanted: Mapping[str, Term], *, what: str, effort: int, seed: int = 0
) -> tuple[Verdict, str]:
    """Whether values satisfy all formulas for any number of elements of the unspecified types, among the numbers that
    the assumptions allow. `what` describes the values, for people: `refuted`, `unknown` and `error` (two solvers
    contradict each other) come with the reason; `proved` if no such type occurs."""
    together = {**assumptions, **wanted}
    sorts = sorted({sort for f in together.values() for sort in opaque_sorts(f)}, key=lambda sort: sort.name)
    verdict, reason = Verdict.PROVED, ""
    for sizes in _sizes(len(sorts)):
        types = {f"size of {sort.name}": _has(sort, size) for sort, size in zip(sorts, sizes, strict=True)}
        found = solve({**together, **types}, effort=effort, seed=seed, values="unused")
        if found.status == "sat":
            continue
        allowed = solve({**assumptions, **types}, effort=effort, seed=seed, values="unused").status
        where = _told(sorts, sizes)
        if allowed == "sat" and found.status == "unsat":
            if doubted(found, {**together, **types}):
                return Verdict.ERROR, CONTRADICTED
            return Verdict.REFUTED, f"nothing meets {what} where {where}"
        if allowed != "unsat" and verdict is Verdict.PROVED:
            verdict, reason = Verdict.UNKNOWN, f"it is open whether anything meets {what} where {where}"
    return verdict, reason


def _sizes(sorts: int) -> Iterator[tuple[int, ...]]:
    """The number of elements of each type: all equal, then each way of mixing them; for many types, one that differs
    from the rest."""
    if not sorts:
        return
    every = (*SIZES_TRIED, _MORE)
    yield from ((size,) * sorts for size in every)
    if len(every) ** sorts <= SIZES_COMBINED:
        yield from (sizes for sizes in product(every, repeat=sorts) if len(set(sizes)) > 1)
        return
    for one, rest in ((every[0], _MORE), (_MORE, every[0])):
        yield from (tuple(one if k == at else rest for k in range(sorts)) for at in range(sorts))


def _has(sort: OpaqueSort, size: int) -> Term:
    """The claim that the type has so many elements."""
    some = tuple(Variable(Role.BOUND, f"{sort.name} no {k}", sort) for k in range(size))
    other = Variable(Role.BOUND, f"{sort.name} any", sort)
    apart = [Not(Compare("==", a, b)) for k, a in enumerate(some) for b in some[:k]]
    all_of_them = disjunction([Compare("==", other, a) for a in some])
    whole = TRUE if size == _MORE else Quantified(Quantifier.FORALL, (other,), all_of_them)
    return Quantified(Quantifier.EXISTS, some, conjunction([*apart, whole]))


def _told(sorts: Sequence[OpaqueSort], sizes: Sequence[int]) -> str:
    return " and ".join(f"{sort.name} has {_counted(size)}" for sort, size in zip(sorts, sizes, strict=True))


def _counted(size: int) -> str:
    if size == _MORE:
        return f"at least {size} elements"
    return "just one element" if size == 1 else f"just {size} elements"
