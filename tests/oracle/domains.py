"""Values for the reference evaluator (`reference.meaning`): some of each type, and Avow's own as it has them."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import chain, product
from typing import Any

from reference.meaning import Step, Table, is_finite, members

from avow.formulas.values import Data, Element, FunctionValue, SequenceValue
from avow.language import sorts as s
from avow.language.contract import Clause
from avow.language.terms import Term, Variable


def as_written(clause: Clause) -> Term:
    """What the reference reads of a clause: without the conditions that the checker adds for its having a value."""
    return clause.formula if clause.written is None else clause.written


def plain(value: Any) -> Any:
    """A value of Avow's as the oracle has it."""
    match value:
        case Element(name=name):
            return name
        case Data(constructor=name, arguments=arguments):
            return (name, *map(plain, arguments))
        case SequenceValue(items=items) | tuple(items):
            return tuple(map(plain, items))
        case FunctionValue(table=table, default=default):
            return Table({tuple(map(plain, at)): plain(v) for at, v in table.items()}, plain(default))
        case bool() | str():
            return value
    return Fraction(value)


def domain(sort: s.Sort) -> list[Any]:
    """All values of a finite sort; of an infinite one, some simple values, in the order of size."""
    if is_finite(sort):
        return members(sort)
    match sort:
        case s.NaturalSort():
            return [0, 1, 2, 3]
        case s.IntegerSort():
            return [-2, -1, 0, 1, 2, 3]
        case s.RealSort():
            return [Fraction(0), Fraction(1, 2), Fraction(1), Fraction(2), Fraction(7, 3)]
        case s.StringSort():
            return ["", "a", "zz"]
        case s.DataSort(constructors=constructors):
            return [(c.name, *items) for c in constructors for items in product(*map(domain, c.parameters))]
        case s.TupleSort(items=items):
            return list(product(*map(domain, items)))
        case s.SequenceSort(item=item):
            return _sequences(domain(item))
        case s.FunctionSort(parameters=parameters, result=result):
            points = list(product(*map(domain, parameters)))
            return [dict(zip(points, values, strict=True)) for values in product(domain(result), repeat=len(points))]
    raise AssertionError(sort)


def _sequences(items: list[Any]) -> list[Any]:
    """All of up to one element (up to two, of two values), and one that is longer."""
    most = 2 if len(items) <= 2 else 1
    short = chain.from_iterable(product(items, repeat=length) for length in range(most + 1))
    return [*short, (items[0],) * (most + 1)]


def situations(variables: Iterable[Variable]) -> list[Step]:
    """Every choice of values for some variables."""
    listed = list(variables)
    names = [v.qualified for v in listed]
    return [dict(zip(names, chosen, strict=True)) for chosen in product(*(domain(v.sort) for v in listed))]
