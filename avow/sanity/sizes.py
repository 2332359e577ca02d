"""Contracts over unspecified types, asked anew where such a type has as few elements as it may have.

A solver may choose how many elements a type ``{}`` has; whoever keeps the contract may not. That something meets
formulas counts only if something does however few there are.
"""

from __future__ import annotations

from collections.abc import Mapping

from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, disjunction
from avow.language.sorts import OpaqueSort
from avow.language.terms import Compare, Not, Quantified, Quantifier, Role, Term, Variable
from avow.solving.questions import opaque_sorts, solve
from avow.tuning.bounds import SIZES_TRIED


def in_small_types(
    assumptions: Mapping[str, Term], guarantees: Mapping[str, Term], *, effort: int, seed: int = 0
) -> tuple[Verdict, str]:
    """Whether inputs and outputs meet all formulas where each unspecified type has one element, and where each has two:
    unless the assumptions exclude that. `refuted` and `unknown` come with the reason."""
    together = {**assumptions, **guarantees}
    sorts = sorted({sort for f in together.values() for sort in opaque_sorts(f)}, key=lambda sort: sort.name)
    verdict, reason = Verdict.PROVED, ""
    for size in SIZES_TRIED if sorts else ():
        types = {f"size of {sort.name}": _has(sort, size) for sort in sorts}
        found = solve({**together, **types}, effort=effort, seed=seed, shown=False).status
        if found == "sat":
            continue
        allowed = solve({**assumptions, **types}, effort=effort, seed=seed, shown=False).status
        names = ", ".join(sort.name for sort in sorts)
        many = "just one element" if size == 1 else "just two elements"
        if allowed == "sat" and found == "unsat":
            return Verdict.REFUTED, f"nothing meets the guarantees where {names} has {many}"
        if allowed != "unsat":
            verdict, reason = Verdict.UNKNOWN, f"it is open whether anything meets them where {names} has {many}"
    return verdict, reason


def _has(sort: OpaqueSort, size: int) -> Term:
    """That the type has so many elements."""
    some = tuple(Variable(Role.BOUND, f"{sort.name} no {k}", sort) for k in range(size))
    other = Variable(Role.BOUND, f"{sort.name} any", sort)
    apart = [Not(Compare("==", a, b)) for k, a in enumerate(some) for b in some[:k]]
    whole = Quantified(Quantifier.FORALL, (other,), disjunction([Compare("==", other, a) for a in some]))
    return Quantified(Quantifier.EXISTS, some, conjunction([*apart, whole]))
