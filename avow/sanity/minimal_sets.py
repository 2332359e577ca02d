"""All minimal sets of labels that have a property which every larger set has too.

Seeds are maximal sets about which nothing is known; one with the property is made smaller to a minimal set, one without
it settles all its subsets (Liffiton, Previti, Malik and Marques-Silva, "Fast, flexible MUS enumeration", 2016).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from avow.solving.z3_module import z3


class UndecidedError(Exception):
    """Whether a set has the property was not found out."""


@dataclass(frozen=True, slots=True)
class MinimalSets:
    """The sets, smallest first, and whether there are no others and none of them could be smaller."""

    sets: tuple[frozenset[str], ...]
    complete: bool


def minimal_sets(
    labels: Sequence[str],
    core: Callable[[frozenset[str]], frozenset[str] | None],
    *,
    most: int,
    ended: Callable[[], bool],
) -> MinimalSets:
    """`core` says of a set which of its subsets it found to have the property, or None where it has not; it raises
    `UndecidedError`. At most so many sets are looked for, until `ended`."""
    known = _Known(labels)
    found: list[frozenset[str]] = []
    complete = True
    while (seed := known.seed()) is not None:
        if ended() or len(found) >= most:
            complete = False
            break
        try:
            having = core(seed)
        except UndecidedError:
            known.without(seed)
            complete = False
            continue
        if having is None:
            known.lack(seed)
            continue
        for label in labels:
            if label not in having or len(having) == 1:
                continue
            try:
                if not ended():
                    having = core(having - {label}) or having
                else:
                    complete = False
            except UndecidedError:
                complete = False
        found.append(having)
        known.have(having)
    order = {label: k for k, label in enumerate(labels)}
    found.sort(key=lambda chosen: (len(chosen), sorted(order[label] for label in chosen)))
    return MinimalSets(tuple(found), complete)


class _Known:
    """The sets about which something is known, as clauses over a Boolean for each label."""

    def __init__(self, labels: Sequence[str]) -> None:
        context = z3.Context()
        self._solver = z3.Solver(ctx=context)
        self._chosen = {label: z3.Bool(f"{k}", context) for k, label in enumerate(labels)}

    def seed(self) -> frozenset[str] | None:
        """A set of which nothing is known though something is of every larger one; None if there is none."""
        seed: set[str] = set()
        if self._solver.check() != z3.sat:
            return None
        seed |= self._true()
        for label in self._chosen:
            if label not in seed and self._solver.check(*(self._chosen[k] for k in (*seed, label))) == z3.sat:
                seed |= self._true()
        return frozenset(seed)

    def _true(self) -> set[str]:
        model = self._solver.model()
        return {label for label, chosen in self._chosen.items() if z3.is_true(model.eval(chosen))}

    def lack(self, labels: Collection[str]) -> None:
        self._solver.add(z3.Or([v for label, v in self._chosen.items() if label not in labels] or [self._false()]))

    def have(self, labels: Collection[str]) -> None:
        self._solver.add(z3.Or([z3.Not(self._chosen[label]) for label in labels] or [self._false()]))

    def without(self, labels: Collection[str]) -> None:
        """This set alone is not asked about again."""
        self._solver.add(z3.Or([z3.Not(v) if label in labels else v for label, v in self._chosen.items()]))

    def _false(self) -> object:
        return z3.BoolVal(False, self._solver.ctx)
