"""Tuples as their items: ``out.w == (l, r)`` as two equations of numbers.

The solver's methods for arithmetic do not handle a formula with a tuple variable. Variables for its items have the same
meaning, and these methods handle them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from avow.base.tuning.sizes import REWRITTEN_DEPTH
from avow.formulas.formula import conjunction, disjunction, substitute
from avow.formulas.renaming import map_children
from avow.formulas.traversal import depth
from avow.formulas.values import Value
from avow.language.sorts import TupleSort
from avow.language.terms import Compare, In, Not, Quantified, SetTerm, Term, TupleTerm, Variable


@dataclass(frozen=True, slots=True)
class Untupled:
    """Formulas without some tuples. `parts` maps each to the tuple of the variables that represent its items."""

    formulas: Mapping[tuple[bool, str], Term]
    parts: Mapping[Variable, TupleTerm]

    def variables(self, originals: Iterable[Variable]) -> tuple[Variable, ...]:
        """The variables that represent the originals."""
        return tuple(v for original in originals for v in _leaves(self.parts.get(original, original)))

    def values(self, originals: Iterable[Variable], found: Mapping[Variable, Value]) -> dict[Variable, Value]:
        """The values of the original variables."""
        meant = {v: self.parts.get(v, v) for v in originals}
        return {v: _value(term, found) for v, term in meant.items() if found.keys() >= set(_leaves(term))}


def untupled(formulas: Mapping[tuple[bool, str], Term], variables: Iterable[Variable]) -> Untupled | None:
    """The formulas without these variables' tuples; None if none of the variables is a tuple."""
    parts = {v: made for v in variables if isinstance(made := _made(v), TupleTerm)}
    if not parts or any(depth(formula) > REWRITTEN_DEPTH for formula in formulas.values()):
        return None
    return Untupled({label: _split(substitute(formula, parts)) for label, formula in formulas.items()}, parts)


def _made(variable: Variable) -> Term:
    """A variable, or the tuple of variables that represent its items."""
    if not isinstance(variable.sort, TupleSort):
        return variable
    items = (Variable(variable.role, f"{variable.name} item {k}", s) for k, s in enumerate(variable.sort.items))
    return TupleTerm(tuple(map(_made, items)), variable.sort)


def _leaves(term: Term) -> list[Variable]:
    if isinstance(term, Variable):
        return [term]
    assert isinstance(term, TupleTerm)
    return [leaf for item in term.items for leaf in _leaves(item)]


def _value(term: Term, found: Mapping[Variable, Value]) -> Value:
    if isinstance(term, TupleTerm):
        return tuple(_value(item, found) for item in term.items)
    assert isinstance(term, Variable)
    return found[term]


def _split(term: Term) -> Term:
    """The same meaning: tuples are compared item by item, and quantified item by item."""
    match term:
        case Quantified(variables=variables) if any(isinstance(v.sort, TupleSort) for v in variables):
            made = {v: _made(v) for v in variables}
            apart = tuple(leaf for part in made.values() for leaf in _leaves(part))
            inner = substitute(term.body, {v: part for v, part in made.items() if isinstance(part, TupleTerm)})
            return replace(term, variables=apart, body=_split(inner))
        case Compare(operator="==" | "!=" as operator, left=TupleTerm() as left, right=TupleTerm() as right):
            pairs = zip(left.items, right.items, strict=True)
            same = conjunction(_split(Compare("==", one, other)) for one, other in pairs)
            return same if operator == "==" else Not(same)
        case In(item=TupleTerm() as item, collection=SetTerm(items=items)):
            return disjunction(_split(Compare("==", item, one)) for one in items)
        case _:  # compares no tuples itself, but its parts may
            return map_children(term, _split)
