"""Typed terms as closures over a list of slots, without quantifiers (`Compiler.quantifier`); no syntax is walked."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from itertools import product
from typing import Any, assert_never

from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.tuning.bounds import VALUES_ENUMERATED
from avow.formulas import values
from avow.formulas.values import Data, Element, FunctionValue, Value
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.enclosures import NotEvaluable
from avow.language.operators import OPERATORS, implementation

__all__ = ["Code", "Compiler", "Domains", "Env", "NotEvaluable", "combinations", "finite_values", "member_of"]

Env = list[Any]
Code = Callable[[Env], Any]
Domains = Mapping[s.Sort, Sequence[Value]]


def finite_values(sort: s.Sort, domains: Domains | None = None) -> tuple[Value, ...] | None:
    """Every value of a sort, or None if they are infinitely many, unspecified or too many to enumerate."""
    if domains and sort in domains:
        return tuple(domains[sort])
    match sort:
        case s.BoolSort():
            return (False, True)
        case s.EnumSort(members=members):
            return tuple(Element(member) for member in members)
        case s.TupleSort(items=items):
            return combinations(items, domains)
        case s.DataSort(constructors=constructors):
            found: list[Value] = []
            for constructor in constructors:
                if any(isinstance(p, s.DataSort) for p in constructor.parameters):
                    return None
                arguments = combinations(constructor.parameters, domains)
                if arguments is None:
                    return None
                found.extend(Data(constructor.name, a) for a in arguments)
            return tuple(found)
        case _:  # infinitely many, or unspecified
            return None


def combinations(
    sorts: Sequence[s.Sort], domains: Domains | None = None, most: int = VALUES_ENUMERATED
) -> tuple[tuple[Value, ...], ...] | None:
    """Every combination of values of some sorts, or None if one has infinitely many values, or there are too many."""
    ranges = complete(finite_values(sort, domains) for sort in sorts)
    return None if ranges is None or math.prod(map(len, ranges)) > most else tuple(product(*ranges))


@dataclass(slots=True)
class Compiler:
    """Slots for the variables of one term, and the closures for its parts. Bound names are unique in the term."""

    domains: Domains
    quantifier: Callable[[Compiler, t.Quantified], Code]
    """The closure for a quantified formula, whose variables have slots. It is given, since the two recurse: a
    quantifier's body is a term, and a term may contain quantifiers."""
    free: dict[str, int] = field(default_factory=dict)
    bound: dict[str, int] = field(default_factory=dict)
    size: int = 0
    known: dict[int, tuple[t.Term, Code]] = field(default_factory=dict)
    """Keyed by identity; a term is kept with its closure, so that its id is not reused."""

    def slot(self, variable: t.Variable) -> int:
        """The variable's index in the environment; a bound name that no quantifier binds is a free one."""
        name = variable.qualified
        if name in self.bound:
            return self.bound[name]
        if name not in self.free:
            self.free[name] = self.new_slot()
        return self.free[name]

    def bind(self, variable: t.Variable) -> int:
        if variable.name not in self.bound:
            self.bound[variable.name] = self.new_slot()
        return self.bound[variable.name]

    def new_slot(self) -> int:
        self.size += 1
        return self.size - 1

    def code(self, term: t.Term) -> Code:
        """The closure for a term, the same for the same object: planning asks for a part more than once, and clauses
        with memory share parts. Comparing terms by structure would cost their whole size at each of their parts."""
        found = self.known.get(id(term))
        if found is None:
            found = self.known[id(term)] = (term, self._code(term))
        return found[1]

    def _code(self, term: t.Term) -> Code:
        match term:
            case t.Literal(value=value, sort=sort):
                constant: Any = (
                    Fraction(value) if isinstance(sort, s.RealSort) and not isinstance(value, str) else value
                )
                return lambda env: constant
            case t.EnumValue(name=name):
                element = Element(name)
                return lambda env: element
            case t.Variable():
                return operator.itemgetter(self.slot(term))
            case t.Construct() | t.TupleTerm() | t.SequenceTerm() | t.SetTerm():
                return self._built(term)
            case t.Apply():
                return self._apply(term)
            case t.Index():
                return self._index(term)
            case t.Item() | t.Length() | t.Widen() | t.Negative() | t.Not():
                return self._unary(term)
            case t.Argument():
                raise NotEvaluable("an argument of a value's constructor is asked for")
            case t.SequenceRange():
                return self._range(term)
            case t.Arithmetic():
                return self._arithmetic(term)
            case t.Operation(operator=name, arguments=arguments):
                codes, act = tuple(map(self.code, arguments)), implementation(OPERATORS[name].evaluate)
                return lambda env: act(*[c(env) for c in codes])
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                test, yes, no = self.code(condition), self.code(then), self.code(otherwise)
                return lambda env: yes(env) if test(env) else no(env)
            case t.Compare():
                return self._compare(term)
            case t.In():
                return self._member(term)
            case t.And(items=items):
                return _all(tuple(map(self.code, items)))
            case t.Or(items=items):
                return _any(tuple(map(self.code, items)))
            case t.Implies(left=left, right=right):
                return _any((self.code(t.Not(left)), self.code(right)))
            case t.Iff(left=left, right=right):
                one, other = self.code(left), self.code(right)
                return lambda env: one(env) == other(env)
            case t.Quantified():
                for variable in term.variables:
                    self.bind(variable)
                return self.quantifier(self, term)
            case t.History(operator=name):
                raise NotEvaluable(f"`{name}` speaks of other steps")
            case _:
                assert_never(term)

    def _built(self, term: t.Construct | t.TupleTerm | t.SequenceTerm | t.SetTerm) -> Code:
        codes = tuple(map(self.code, term.children))
        match term:
            case t.Construct(constructor=constructor):
                return lambda env: Data(constructor, tuple([c(env) for c in codes]))
            case t.TupleTerm():
                return lambda env: tuple([c(env) for c in codes])
            case t.SequenceTerm() | t.SetTerm():
                return lambda env: values.SequenceValue(tuple([c(env) for c in codes]))

    def _unary(self, term: t.Item | t.Length | t.Widen | t.Negative | t.Not) -> Code:
        inner = self.code(*term.children)
        match term:
            case t.Item(position=position):
                return lambda env: inner(env)[position]
            case t.Length():
                return lambda env: len(inner(env).items)
            case t.Widen():
                return lambda env: Fraction(inner(env))
            case t.Negative():
                return lambda env: -inner(env)
            case t.Not():
                return lambda env: not inner(env)

    def _apply(self, term: t.Apply) -> Code:
        function = self.code(term.function)
        codes = tuple(map(self.code, term.arguments))
        if len(codes) == 1:
            only = codes[0]

            def one(env: Env) -> Any:
                value: FunctionValue = function(env)
                return value.table.get((only(env),), value.default)

            return one

        def many(env: Env) -> Any:
            value: FunctionValue = function(env)
            return value.table.get(tuple([c(env) for c in codes]), value.default)

        return many

    def _index(self, term: t.Index) -> Code:
        sequence, index = self.code(term.sequence), self.code(term.index)

        def run(env: Env) -> Any:
            items, at = sequence(env).items, index(env)
            if not 0 <= at < len(items):
                raise NotEvaluable(f"position {at} is outside a sequence of length {len(items)}")
            return items[at]

        return run

    def _range(self, term: t.SequenceRange) -> Code:
        low, high = self.code(term.low), self.code(term.high)

        def run(env: Env) -> Any:
            start, end = low(env), high(env)
            if end - start >= VALUES_ENUMERATED:
                raise NotEvaluable("the sequence is too long to write out")
            return values.SequenceValue(tuple(range(start, end + 1)))

        return run

    def _arithmetic(self, term: t.Arithmetic) -> Code:
        left, right = self.code(term.left), self.code(term.right)
        act = implementation(OPERATORS[term.operator].evaluate)
        return lambda env: act(left(env), right(env))

    def _compare(self, term: t.Compare) -> Code:
        left, right = self.code(term.left), self.code(term.right)
        if isinstance(term.left.sort, s.FunctionSort):
            ranges = [finite_values(sort) for sort in term.left.sort.parameters]
            size = None if None in ranges else math.prod(len(r) for r in ranges if r is not None)
            wanted = term.operator == "=="
            return lambda env: _same_function(left(env), right(env), size) is wanted
        act = implementation(OPERATORS[term.operator].evaluate)
        return lambda env: act(left(env), right(env))

    def _member(self, term: t.In) -> Code:
        item = self.code(term.item)
        match term.collection:
            case t.SetTerm(items=items) | t.SequenceTerm(items=items):
                codes = tuple(self.code(t.Compare("==", term.item, each)) for each in items)
                if all(isinstance(each, t.EnumValue) for each in items):
                    names = frozenset(Element(each.name) for each in items if isinstance(each, t.EnumValue))
                    return lambda env: item(env) in names
                return _any(codes)
            case t.SequenceRange(low=low, high=high):
                start, end = self.code(low), self.code(high)
                return lambda env: start(env) <= item(env) <= end(env)
            case collection:
                whole = self.code(collection)
                return lambda env: item(env) in whole(env).items


def _all(codes: tuple[Code, ...]) -> Code:
    """Conjunction: false as soon as one part is, even if another cannot be evaluated."""

    def run(env: Env) -> bool:
        doubt: NotEvaluable | None = None
        for code in codes:
            try:
                if not code(env):
                    return False
            except NotEvaluable as reason:
                doubt = doubt or reason
        if doubt is not None:
            raise doubt
        return True

    return run


def _any(codes: tuple[Code, ...]) -> Code:
    """Disjunction: true as soon as one part is, even if another cannot be evaluated."""

    def run(env: Env) -> bool:
        doubt: NotEvaluable | None = None
        for code in codes:
            try:
                if code(env):
                    return True
            except NotEvaluable as reason:
                doubt = doubt or reason
        if doubt is not None:
            raise doubt
        return False

    return run


def _same_function(left: FunctionValue, right: FunctionValue, size: int | None) -> bool:
    """Extensional equality; `size` is the number of points, None if infinite."""
    points = left.table.keys() | right.table.keys()
    if any(left.table.get(p, left.default) != right.table.get(p, right.default) for p in points):
        return False
    return left.default == right.default or (size is not None and len(points) >= size)


def member_of(sort: s.Sort, domains: Domains) -> Callable[[Any], bool] | None:
    """The test that a value found elsewhere is in a variable's range, or None if every such value is."""
    if sort in domains:
        known = frozenset(domains[sort])
        return lambda value: value in known
    match sort:
        case s.NaturalSort():
            return lambda value: value.__class__ is int and value >= 0
        case s.IntegerSort():
            return lambda value: value.__class__ is int
        case s.TupleSort(items=items):
            return _members(items, domains)
        case s.DataSort(constructors=constructors):
            made = {c.name: test for c in constructors if (test := _members(c.parameters, domains)) is not None}
            return (lambda value: made.get(value.constructor, lambda _: True)(value.arguments)) if made else None
        case s.SequenceSort(item=item):
            each = member_of(item, domains)
            return None if each is None else lambda value: all(map(each, value.items))
        case (
            s.BoolSort()
            | s.RealSort()
            | s.StringSort()
            | s.EnumSort()
            | s.OpaqueSort()
            | s.FunctionSort()
            | s.SetSort()
        ):
            return None  # a value found for such a variable has its sort
        case _:
            assert_never(sort)


def _members(sorts: Sequence[s.Sort], domains: Domains) -> Callable[[Any], bool] | None:
    tests = [(k, test) for k, sort in enumerate(sorts) if (test := member_of(sort, domains)) is not None]
    return (lambda values: all(test(values[k]) for k, test in tests)) if tests else None
