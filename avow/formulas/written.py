"""Values as terms, and as text in the contract's notation: ``in.status = red, in.at = {(0, 0)}``."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from avow.formulas.values import Data, Element, Value, show
from avow.language import sorts as s
from avow.language.terms import Construct, EnumValue, Literal, Role, Term, TupleTerm, Variable


def value_term(value: Value, sort: s.Sort) -> Term:
    """The term for a value. The sort must have literals in RCL: no function, sequence or unspecified type."""
    match sort, value:
        case s.EnumSort(), Element(name=name):
            return EnumValue(name, sort)
        case s.DataSort(), Data(constructor=constructor, arguments=arguments):
            parameters = sort.constructor(constructor).parameters
            return Construct(constructor, tuple(map(value_term, arguments, parameters)), sort)
        case s.TupleSort(items=items), tuple():
            return TupleTerm(tuple(map(value_term, value, items)), sort)
        case s.BoolSort(), bool():
            return Literal(value, sort)
        case ((s.IntegerSort() | s.NaturalSort()), int()):
            return Literal(value, sort)
        case s.RealSort(), (Fraction() | int()):
            return Literal(Fraction(value), sort)
        case s.StringSort(), str():
            return Literal(value, sort)
    raise AssertionError(f"{value} of {sort}")


_ORDER = {Role.INPUT: 0, Role.OUTPUT: 1, Role.BOUND: 2}


def show_values(values: Mapping[Variable, Value]) -> tuple[tuple[str, str], ...]:
    """(name, value) pairs, inputs first, then outputs, by name."""
    ordered = sorted(values.items(), key=lambda pair: (_ORDER[pair[0].role], pair[0].name))
    return tuple((variable.qualified, show(value)) for variable, value in ordered)
