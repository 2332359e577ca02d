"""What typed terms mean, by the book and by enumeration; no code is shared with Avow's own evaluation.

Values are Python's: truth values, strings (also for members of an enumeration), numbers, ``("go", "red")`` for data,
tuples for tuples and sequences, dictionaries from arguments to values for functions.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from itertools import chain, product
from typing import Any

from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    SequenceSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
)

Values = dict[Variable, Any]

_COMPARISONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_OPERATIONS: Mapping[str, Callable[[Any, Any], Any]] = {"+": operator.add, "-": operator.sub, "*": operator.mul}


def domain(sort: Sort) -> list[Any]:
    """All values of a finite sort; of an infinite one, some simple values, in the order of size."""
    match sort:
        case BoolSort():
            return [False, True]
        case EnumSort(members=members):
            return list(members)
        case NaturalSort():
            return [0, 1, 2, 3]
        case IntegerSort():
            return [-2, -1, 0, 1, 2, 3]
        case RealSort():
            return [Fraction(0), Fraction(1, 2), Fraction(1), Fraction(2), Fraction(7, 3)]
        case StringSort():
            return ["", "a", "zz"]
        case DataSort(constructors=constructors):
            return [(c.name, *items) for c in constructors for items in product(*map(domain, c.parameters))]
        case TupleSort(items=items):
            return list(product(*map(domain, items)))
        case SequenceSort(item=item):
            return _sequences(domain(item))
        case FunctionSort(parameters=parameters, result=result):
            points = list(product(*map(domain, parameters)))
            return [dict(zip(points, values, strict=True)) for values in product(domain(result), repeat=len(points))]
    raise AssertionError(sort)


def _sequences(items: list[Any]) -> list[Any]:
    """All of up to one element (up to two, of two values), and one that is longer."""
    most = 2 if len(items) <= 2 else 1
    short = chain.from_iterable(product(items, repeat=length) for length in range(most + 1))
    return [*short, (items[0],) * (most + 1)]


def is_finite(sort: Sort) -> bool:
    match sort:
        case BoolSort() | EnumSort():
            return True
        case DataSort(constructors=constructors):
            return all(is_finite(p) for c in constructors for p in c.parameters)
        case TupleSort(items=items):
            return all(map(is_finite, items))
        case FunctionSort(parameters=parameters, result=result):
            return all(map(is_finite, (*parameters, result)))
        case _:
            return False


class Enumeration:
    """Values of terms. What a partial operation yields outside its domain is unspecified: here the `unspecified`-th of
    the values in `domain`, and `strayed` tells that one was asked for."""

    def __init__(self, unspecified: int = 0) -> None:
        self.unspecified = unspecified
        self.strayed = False

    def holds(self, formula: Term, values: Values) -> bool:
        found = self.value(formula, values)
        assert isinstance(found, bool)
        return found

    def value(self, term: Term, values: Values) -> Any:
        match term:
            case Literal(value=value):
                return value if isinstance(value, bool | str) else Fraction(value)
            case EnumValue(name=name):
                return name
            case Variable():
                return values[term]
            case Widen(term=inner):
                return self.value(inner, values)
            case Not(body=body):
                return not self.value(body, values)
            case And(items=items):
                return all(self.value(item, values) for item in items)
            case Or(items=items):
                return any(self.value(item, values) for item in items)
            case Implies(left=left, right=right):
                return not self.value(left, values) or self.value(right, values)
            case Iff(left=left, right=right):
                return self.value(left, values) == self.value(right, values)
            case Compare(operator=sign, left=left, right=right):
                return _COMPARISONS[sign](self.value(left, values), self.value(right, values))
            case In(item=item, collection=collection):
                return self.value(item, values) in self._members(collection, values)
            case Quantified():
                return self._quantified(term, values)
            case _:
                return self._built(term, values)

    def _built(self, term: Term, values: Values) -> Any:
        match term:
            case Apply(function=function, arguments=arguments):
                return self.value(function, values)[tuple(self.value(a, values) for a in arguments)]
            case Construct(constructor=constructor, arguments=arguments):
                return (constructor, *(self.value(a, values) for a in arguments))
            case TupleTerm(items=items) | SequenceTerm(items=items):
                return tuple(self.value(item, values) for item in items)
            case SequenceRange():
                return tuple(self._members(term, values))
            case Index(sequence=sequence, index=index):
                items, at = self.value(sequence, values), self.value(index, values)
                return items[int(at)] if 0 <= at < len(items) else self._stray(term.sort)
            case Length(sequence=sequence):
                return len(self.value(sequence, values))
            case Negative(term=inner):
                return -self.value(inner, values)
            case Arithmetic(operator=sign, left=left, right=right):
                one, other = self.value(left, values), self.value(right, values)
                if sign == "/":
                    return Fraction(one) / other if other else self._stray(term.sort)
                return _OPERATIONS[sign](one, other)
            case Conditional(condition=condition, then=then, otherwise=otherwise):
                return self.value(then if self.holds(condition, values) else otherwise, values)
            case Operation(operator=name, arguments=arguments):
                return _builtin(name, [self.value(a, values) for a in arguments])
        raise AssertionError(term)

    def _stray(self, sort: Sort) -> Any:
        self.strayed = True
        return domain(sort)[self.unspecified]

    def _members(self, collection: Term, values: Values) -> list[Any]:
        match collection:
            case SetTerm(items=items):
                return [self.value(item, values) for item in items]
            case SequenceRange(low=low, high=high):
                return list(range(int(self.value(low, values)), int(self.value(high, values)) + 1))
            case _:
                return list(self.value(collection, values))

    def _quantified(self, term: Quantified, values: Values) -> bool:
        found = (self.holds(term.body, {**values, **chosen}) for chosen in self._choices(term, values))
        match term.quantifier:
            case Quantifier.FORALL:
                return all(found)
            case Quantifier.EXISTS:
                return any(found)
            case Quantifier.UNIQUE:
                return sum(found) == 1

    def _choices(self, term: Quantified, values: Values) -> Iterator[Values]:
        ranges = []
        for variable in term.variables:
            if is_finite(variable.sort):
                ranges.append(domain(variable.sort))
            else:
                members = self._members(_range_of(variable, term), values)
                ranges.append(list(dict.fromkeys(members)))
        for choice in product(*ranges):
            yield dict(zip(term.variables, choice, strict=True))


def _builtin(name: str, given: list[Any]) -> Any:
    match name:
        case "xor":
            return (given[0] or given[1]) and not (given[0] and given[1])
        case "abs":
            return given[0] if given[0] >= 0 else -given[0]
        case "min":
            return sorted(given)[0]
        case "max":
            return sorted(given)[-1]
    assert name in ("mod", "div"), f"the enumeration does not know {name}: describe it in {__file__}"
    whole, divisor = given
    quotient = next(q for q in chain.from_iterable((k, -k) for k in range(10**6)) if 0 <= whole - q * divisor < divisor)
    return quotient if name == "div" else whole - quotient * divisor


def _range_of(variable: Variable, term: Quantified) -> Term:
    """The collection that the body restricts a variable of an infinite sort to."""
    stack = [term.body]
    while stack:
        match stack.pop():
            case In(item=Variable() as item, collection=collection) if item == variable:
                return collection
            case And(items=items):
                stack.extend(reversed(items))
            case Implies(left=left) if term.quantifier is Quantifier.FORALL:
                stack.append(left)
    raise AssertionError(f"{variable.name} ranges over too much")
