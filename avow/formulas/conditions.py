"""The conditions under which a formula demands something, derived from its meaning and not from its connectives.

``a -> b``, ``not a or b``, ``not (a and not b)`` and ``b or not a`` demand b under a; ``a <=> b`` and its equivalents
demand b under a, and ``not b`` under ``not a``: if both are about outputs, b under a and a under b. The formula is
split into disjunctions, each under the universal quantifiers around it. The condition of a disjunction is the negation
of its items about inputs only, and of the denials among the other items if an item is left that is not a denial: the
demand.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from avow.base.records import dataclass
from avow.base.tuning.bounds import DISJUNCTIONS_MADE
from avow.base.tuning.sizes import CONDITION_DEPTH
from avow.formulas.formula import conjunction, free_variables, negation
from avow.formulas.renaming import rename_apart
from avow.formulas.traversal import depth
from avow.language import terms as t
from avow.language.definedness import demanded, with_value
from avow.language.operators import definition
from avow.language.sorts import BOOL, BoolSort


@dataclass(frozen=True, slots=True)
class Condition:
    """Something is demanded if all `parts` hold for some values of the `outer` variables."""

    outer: tuple[t.Variable, ...]
    parts: tuple[t.Term, ...]

    @property
    def formula(self) -> t.Term:
        """The formula that the condition occurs."""
        whole = with_value(conjunction(self.parts))
        free = free_variables(whole)
        used = tuple(v for v in self.outer if v in free)
        return t.Quantified(t.Quantifier.EXISTS, used, whole) if used else whole


def conditions(formula: t.Term) -> tuple[Condition, ...]:
    """Every condition under which the formula demands something, each once; empty if it always demands everything."""
    if depth(formula) > CONDITION_DEPTH:
        return ()
    found: dict[Condition, None] = {}
    for clause in _clauses(rename_apart(demanded(formula)), True):
        parts = _parts(clause)
        if parts:
            found.setdefault(Condition(clause.outer, parts))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Clause:
    """One disjunction."""

    outer: tuple[t.Variable, ...]
    items: tuple[t.Term, ...]


def _parts(clause: _Clause) -> tuple[t.Term, ...]:
    given = [item for item in clause.items if _of_inputs(item)]
    rest = [item for item in clause.items if item not in given]
    if not given or not rest:
        given, rest = [], list(clause.items)
    denials = [item for item in rest if _is_denial(item)]
    if len(denials) < len(rest):
        given += denials
    return tuple(dict.fromkeys(part for item in given if (part := _denied(item)) != t.TRUE))


def _of_inputs(term: t.Term) -> bool:
    return all(v.role is not t.Role.OUTPUT for v in free_variables(term))


def _is_denial(item: t.Term) -> bool:
    return isinstance(item, t.Not) or (isinstance(item, t.Compare) and item.operator == "!=")


def _denied(item: t.Term) -> t.Term:
    if isinstance(item, t.Compare) and item.operator == "!=":
        return t.Compare("==", item.left, item.right)
    return negation(item)


def _clauses(term: t.Term, positive: bool, halve: bool = True) -> Iterator[_Clause]:
    """The disjunctions whose conjunction is the term, or its negation. Bound names are distinct. An equivalence within
    another is not split (`halve`): each split would double the size."""
    match term:
        case t.Not(body=body):
            yield from _clauses(body, not positive, halve)
        case t.And(items=items) if positive:
            for item in items:
                yield from _clauses(item, True, halve)
        case t.Or(items=items) if not positive:
            for item in items:
                yield from _clauses(item, False, halve)
        case t.Or(items=items) | t.And(items=items):
            yield from _joined([(item, positive) for item in items], halve)
        case t.Implies(left=left, right=right) if positive:
            yield from _joined([(left, False), (right, True)], halve)
        case t.Implies(left=left, right=right):
            yield from _clauses(left, True, halve)
            yield from _clauses(right, False, halve)
        case t.Iff(left=left, right=right) if halve:
            yield from _halves(left, right, positive)
        case t.Operation(sort=BoolSort()) if halve and (defined := definition(term)) is not None:
            yield from _clauses(defined, positive, halve)
        case t.Conditional(condition=condition, then=then, otherwise=otherwise) if halve:
            yield from _joined([(condition, False), (then, positive)], False)
            yield from _joined([(condition, True), (otherwise, positive)], False)
        case t.Compare(operator="==" | "!=" as operator, left=left, right=right) if halve and left.sort == BOOL:
            yield from _halves(left, right, positive is (operator == "=="))
        case t.Quantified(quantifier=quantifier, variables=variables, body=body) if quantifier is (
            t.Quantifier.FORALL if positive else t.Quantifier.EXISTS
        ):
            for clause in _clauses(body, positive, halve):
                yield _Clause((*variables, *clause.outer), clause.items)
        case _:  # demanded as a whole
            yield _Clause((), (term if positive else negation(term),))


def _halves(left: t.Term, right: t.Term, same: bool) -> Iterator[_Clause]:
    for one in (False, True):
        yield from _joined([(left, one), (right, same is not one)], False)


def _joined(parts: list[tuple[t.Term, bool]], halve: bool) -> Iterator[_Clause]:
    """The disjunction of some terms. A conjunction among them is distributed over the others only if it has parts about
    inputs and parts about outputs: ``(a or b) -> c`` has one condition."""
    choices: list[list[_Clause]] = []
    for term, positive in parts:
        found = (
            list(_clauses(term, positive, halve)) if not _of_inputs(term) or not _is_junction(term, positive) else []
        )
        mixed = len({all(map(_of_inputs, clause.items)) for clause in found}) > 1
        whole = _Clause((), (term if positive else negation(term),))
        choices.append(found if len(found) == 1 or mixed else [whole])
    count = 1
    for some in choices:
        count *= len(some)
    if count > DISJUNCTIONS_MADE:
        choices = [[_Clause((), (term if positive else negation(term),))] for term, positive in parts]
    for chosen in product(*choices):
        items = tuple(dict.fromkeys(item for clause in chosen for item in clause.items))
        if not any(negation(item) in items for item in items):  # otherwise it is a tautology
            yield _Clause(tuple(v for clause in chosen for v in clause.outer), items)


def _is_junction(term: t.Term, positive: bool) -> bool:
    """Whether it is a conjunction under this sign; one about inputs only remains one condition."""
    match term:
        case t.Not(body=body):
            return _is_junction(body, not positive)
        case t.And():
            return positive
        case t.Or() | t.Implies():
            return not positive
        case t.Iff():
            return True
    return False
