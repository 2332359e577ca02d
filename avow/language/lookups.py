"""Total functions that a contract looks up by their value, as if some arguments had none.

RCL's functions are total: ``REAL x REAL --> NATURAL`` gives every place a number. A
formula such as ``not exists(x, y in REAL | in.number(x, y) == i + 1)`` uses it in reverse, as a numbering of some
places. It then means less than it seems to: it cannot express "this place has no number", and several places may have
the same number. A relation (``REAL x REAL x NATURAL --> BOOL``) can express both.
"""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.records import dataclass
from avow.language.sorts import FunctionSort, IntegerSort, NaturalSort, OpaqueSort, RealSort, StringSort, components
from avow.language.subterms import subterms
from avow.language.terms import And, Apply, Compare, Not, Or, Quantified, Quantifier, Role, Term, Variable

_NAMES = (NaturalSort, IntegerSort, StringSort, OpaqueSort)
"""Sorts whose values can name things; a REAL is a measure, an element of an enumeration a state."""
_ENDLESS = (RealSort, *_NAMES)


@dataclass(frozen=True, slots=True)
class Lookup:
    """``exists(x, y in REAL | in.number(x, y) == i + 1)``: `place` tests which arguments of `function` have a value."""

    function: Variable
    place: Quantified


def lookups(formula: Term) -> Iterator[Lookup]:
    """Every place in the formula that tests which arguments of an input or output have a given value, where that is a
    total function from infinitely many arguments to names of things."""
    for part in subterms(formula):
        if isinstance(part, Quantified):
            function = _asked(part)
            if function is not None:
                yield Lookup(function, part)


def _asked(quantified: Quantified) -> Variable | None:
    """The function for which the quantified formula tests which arguments have a value; None if another part of it
    mentions the arguments (it then bounds them, probably on purpose)."""
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
    """Whether the function gives names to infinitely many things. A function compared only with constants (``count(t)
    == 0`` at some step t) may be a history: it counts only if its arguments are a continuum."""
    sort = function.sort
    if not isinstance(sort, FunctionSort) or not isinstance(sort.result, _NAMES):
        return False
    parts = set(components(*sort.parameters))
    if any(isinstance(part, RealSort) for part in parts):
        return True
    return any(isinstance(part, _ENDLESS) for part in parts) and bool(_variables(value))
