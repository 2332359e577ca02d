"""Total functions that a contract looks up by their value, as if some arguments had none.

RCL's functions are total: ``REAL x REAL --> NATURAL`` gives every place a number. A
formula such as ``not exists(x, y in REAL | in.number(x, y) == i + 1)`` uses it the other way round, as a numbering of
some places. It then means less than it seems to: "this place has no number" cannot be said, and no place need be the
only one with its number. A relation (``REAL x REAL x NATURAL --> BOOL``) can say both.
"""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.records import dataclass
from avow.language.sorts import FunctionSort, IntegerSort, NaturalSort, OpaqueSort, RealSort, StringSort, components
from avow.language.subterms import subterms
from avow.language.terms import And, Apply, Compare, Not, Or, Quantified, Quantifier, Role, Term, Variable

_NAMES = (NaturalSort, IntegerSort, StringSort, OpaqueSort)
"""Sorts of which values are names of things; a REAL is a measure, an element of an enumeration a state."""
_ENDLESS = (RealSort, *_NAMES)


@dataclass(frozen=True, slots=True)
class Lookup:
    """``exists(x, y in REAL | in.number(x, y) == i + 1)``: `place` asks which arguments of `function` have a value."""

    function: Variable
    place: Quantified


def lookups(formula: Term) -> Iterator[Lookup]:
    """Every place in the formula that asks which arguments of an input or output, a total function from infinitely many
    arguments to names of things, have a given value."""
    for part in subterms(formula):
        if isinstance(part, Quantified):
            function = _asked(part)
            if function is not None:
                yield Lookup(function, part)


def _asked(quantified: Quantified) -> Variable | None:
    """The function of which the quantified formula asks which arguments have a value: nothing else in it speaks of
    them (a formula that does bounds them, and may know what it does)."""
    bound = set(quantified.variables)
    speaking = [part for part in _operands(quantified.body) if bound & _variables(part)]
    if len(speaking) != 1:
        return None
    comparison, is_equal = speaking[0], True
    if isinstance(comparison, Not):
        comparison, is_equal = comparison.body, False
    if not isinstance(comparison, Compare) or comparison.operator not in ("==", "!="):
        return None
    is_equal = is_equal == (comparison.operator == "==")
    if is_equal == (quantified.quantifier is Quantifier.FORALL):
        return None
    for applied, value in ((comparison.left, comparison.right), (comparison.right, comparison.left)):
        if isinstance(applied, Apply) and isinstance(applied.function, Variable) and not bound & _variables(value):
            function = applied.function
            if function.role is not Role.BOUND and set(applied.arguments) == bound and _names_things(function, value):
                return function
    return None


def _variables(term: Term) -> set[Variable]:
    return {part for part in subterms(term) if isinstance(part, Variable)}


def _operands(body: Term) -> Iterator[Term]:
    """The formula's operands, through `and` and `or`."""
    stack = [body]
    while stack:
        part = stack.pop()
        if isinstance(part, And | Or):
            stack.extend(reversed(part.items))
        else:
            yield part


def _names_things(function: Variable, value: Term) -> bool:
    """Whether the function gives names to infinitely many things. One that is asked for constants only (``count(t) ==
    0`` at some step t) may be a history: unless its arguments are a continuum, that is no sign."""
    sort = function.sort
    if not isinstance(sort, FunctionSort) or not isinstance(sort.result, _NAMES):
        return False
    parts = set(components(*sort.parameters))
    if any(isinstance(part, RealSort) for part in parts):
        return True
    return any(isinstance(part, _ENDLESS) for part in parts) and bool(_variables(value))
