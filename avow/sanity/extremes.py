"""The least and the greatest element of a finite part of a sequence: witnesses for "the minimum of the scan".

Only finitely many positions satisfy a guard with an upper bound. If there is one, then there is one at which a number
is least (greatest), and a first such position. No first-order term denotes it, but a constant with this property as its
axiom does; the remaining formulas then quantify positions only universally, which solvers decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import dataclass

from avow.formulas.formula import free_variables, substitute
from avow.language import terms as t
from avow.language.sorts import NATURAL, IntegerSort, NaturalSort, RealSort
from avow.language.subterms import subterms


@dataclass(frozen=True, slots=True)
class Extreme:
    """`constant` is the first (last) of the positions that satisfy the guard at which `measure` is least (greatest)."""

    constant: t.Variable
    position: t.Variable
    guard: t.Term
    measure: t.Term
    greatest: bool
    last: bool

    def axiom(self) -> t.Term:
        """The axiom that defines the constant, if some position satisfies the guard."""
        at = {self.position: self.constant}
        here = substitute(self.measure, at)
        low, high = (self.measure, here) if self.greatest else (here, self.measure)
        one, two = (self.constant, self.position) if self.last else (self.position, self.constant)
        best = t.Implies(
            self.guard,
            t.And((t.Compare("<=", low, high), t.Implies(t.Compare("<", one, two), t.Compare("<", low, high)))),
        )
        some = t.Quantified(t.Quantifier.EXISTS, (self.position,), self.guard)
        return t.Implies(
            some, t.And((substitute(self.guard, at), t.Quantified(t.Quantifier.FORALL, (self.position,), best)))
        )

    def exists(self, taken: Set[t.Variable]) -> bool:
        """Whether there is such a position for all inputs: the constant is new (not in `taken`), and the candidate
        positions are finitely many."""
        known = taken | free_variables(self.guard) | free_variables(self.measure)
        return (
            self.constant.sort == NATURAL
            and self.constant not in known
            and self.constant != self.position
            and isinstance(self.measure.sort, RealSort | IntegerSort | NaturalSort)
            and bounded(self.position, self.guard)
        )


def bounded(position: t.Variable, guard: t.Term) -> bool:
    """Whether one part of a guard shows that only finitely many natural numbers satisfy it."""
    if position.sort != NATURAL:
        return False
    match guard:
        case t.And(items=items):
            return any(bounded(position, item) for item in items)
        case (
            t.Compare(operator="<" | "<=", left=left, right=bound)
            | t.Compare(operator=">" | ">=", left=bound, right=left)
        ):
            return left == position and position not in free_variables(bound)
        case (
            t.Not(body=t.Compare(operator=">" | ">=", left=left, right=bound))
            | t.Not(body=t.Compare(operator="<" | "<=", left=bound, right=left))
        ):
            return left == position and position not in free_variables(bound)
        case t.In(item=item, collection=t.SequenceRange() | t.SequenceTerm() as collection):
            return item == position and position not in free_variables(collection)
        case _:  # it may be bounded nevertheless
            return False


def measures(position: t.Variable, demand: t.Term, outputs: Set[t.Variable]) -> Iterator[tuple[t.Term, bool, bool]]:
    """The numbers at a position with which a demand (in negation normal form) compares an output, whether the greatest
    one is decisive, and whether the last one is: a heuristic that only makes suggestions."""
    parts = list(subterms(demand))
    denied = {part.body for part in parts if isinstance(part, t.Not)}
    found: list[tuple[t.Term, bool]] = []
    for atom in parts:
        match atom:
            case t.Compare(operator="<" | "<=" | ">" | ">=" as operator, left=left, right=right):
                if free_variables(atom) & outputs:
                    less = (operator[0] == "<") != (atom in denied)
                    found += [*_numbers(position, left, outputs, less), *_numbers(position, right, outputs, not less)]
            case _:  # no ordering: no extreme is decisive
                continue
    last = (position, True) in found
    yield from ((measure, greatest, last) for measure, greatest in dict.fromkeys(found))


def _numbers(
    position: t.Variable, side: t.Term, outputs: Set[t.Variable], greatest: bool
) -> Iterator[tuple[t.Term, bool]]:
    """The largest numeric subterms that mention the position and no output."""
    known = free_variables(side)
    if position not in known:
        return
    if not known & outputs and isinstance(side.sort, RealSort | IntegerSort | NaturalSort):
        yield side, greatest
        return
    flips = isinstance(side, t.Negative) or (isinstance(side, t.Arithmetic) and side.operator == "-")
    for child in side.children:
        yield from _numbers(position, child, outputs, greatest != (flips and child == side.children[-1]))
