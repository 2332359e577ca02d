"""THE translation of typed terms to Z3: everything that asks Z3 a question goes through here.

Each `Translator` owns a `z3.Context`, so that threads do not meet. NATURAL is Int, relativised: a quantifier over it
(or over a sort that contains it) ranges over its members only, and `background` says so of free variables.
A free function-typed variable is an uninterpreted function; a bound one an array. What lies outside a partial
operation (division by zero, an element beyond a sequence's end) is unspecified: no interpretation of it is chosen
here, so that what is proved holds under each (`avow.logic.smt` takes care that satisfiability is judged likewise).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import z3

from avow.diagnostics import Span
from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
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
from avow.logic.traversal import Steps, run
from avow.logic.values import Data, Element, FunctionValue, Opaque, Value
from avow.logic.values import Sequence as SequenceValue

Expr = Any
"""A Z3 expression (the z3 package is not typed)."""

Meaning = Any
"""What a free variable stands for, if not for itself: an expression, or for a function a callable on expressions."""

_MAX_CHARACTER = 0x2FFFF
"""The largest code point of an SMT-LIB string."""


class Unsupported(Exception):  # noqa: N818 - it names what happened
    """A construct that the translation cannot express; the answer to the question is then `unknown`."""

    def __init__(self, what: str, span: Span | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.span = span


class Translator:
    """Sorts, variables and terms in one Z3 context; the same variable always becomes the same Z3 symbol."""

    def __init__(self) -> None:
        self.context = z3.Context()
        self._sorts: dict[Sort, Any] = {}
        self._constants: dict[Variable, Expr] = {}
        self._functions: dict[Variable, Any] = {}
        self._opaque: dict[tuple[str, int], Expr] = {}
        self._count = 0
        self._names: dict[str, Sort] = {}

    # -- sorts ---------------------------------------------------------------------------------------------------------

    def sort(self, sort: Sort) -> Any:
        """The Z3 sort of values of `sort`; of a function sort, an array sort. Raises Unsupported."""
        if sort not in self._sorts:
            self._sorts[sort] = self._make_sort(sort)
        return self._sorts[sort]

    def _make_sort(self, sort: Sort) -> Any:
        match sort:
            case BoolSort():
                return z3.BoolSort(self.context)
            case RealSort():
                return z3.RealSort(self.context)
            case IntegerSort() | NaturalSort():
                return z3.IntSort(self.context)
            case StringSort():
                return z3.StringSort(self.context)
            case EnumSort(members=members):
                name = self._sort_name(sort.name, sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                for member in members:
                    datatype.declare(f"{name}.{member}")
                return datatype.create()
            case DataSort(constructors=constructors):
                name = self._sort_name(sort.name, sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                for constructor in constructors:
                    fields = [
                        (f"{name}.{constructor.name}.{k}", self._field(parameter))
                        for k, parameter in enumerate(constructor.parameters)
                    ]
                    datatype.declare(f"{name}.{constructor.name}", *fields)
                return datatype.create()
            case OpaqueSort():
                return z3.DeclareSort(f"sort.{self._sort_name(sort.name, sort)}", ctx=self.context)
            case TupleSort(items=items):
                name = self._sort_name("tuple", sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                fields = [(f"{name}.{k}", self._field(item)) for k, item in enumerate(items)]
                datatype.declare(f"{name}.of", *fields)
                return datatype.create()
            case SequenceSort(item=item):
                return z3.SeqSort(self._field(item))
            case FunctionSort(parameters=parameters, result=result):
                return z3.ArraySort(*(self._field(p) for p in parameters), self._field(result))
            case SetSort():
                raise Unsupported("a set outside the right-hand side of `in`")

    def _field(self, sort: Sort) -> Any:
        if isinstance(sort, FunctionSort | SetSort):
            # Array equality would compare functions on arguments that are not members (negative naturals).
            raise Unsupported("a function or set as part of another value")
        return self.sort(sort)

    def _sort_name(self, name: str, sort: Sort) -> str:
        candidate = name
        while self._names.setdefault(candidate, sort) != sort:
            candidate += "_"
        return candidate

    def member(self, sort: Sort, expr: Expr) -> Expr | None:
        """That a Z3 value is a value of the sort (its naturals are not negative); None where every one is."""
        match sort:
            case NaturalSort():
                return expr >= 0
            case TupleSort(items=items):
                datatype = self.sort(sort)
                return self._all(self.member(item, datatype.accessor(0, k)(expr)) for k, item in enumerate(items))
            case DataSort(constructors=constructors):
                datatype = self.sort(sort)
                cases = []
                for c, constructor in enumerate(constructors):
                    inside = self._all(
                        self.member(parameter, datatype.accessor(c, k)(expr))
                        for k, parameter in enumerate(constructor.parameters)
                    )
                    if inside is not None:
                        cases.append(z3.Implies(datatype.recognizer(c)(expr), inside))
                return self._all(cases)
            case SequenceSort(item=item):
                at = self.fresh("k", IntegerSort())
                inside = self.member(item, expr[at])
                if inside is None:
                    return None
                return z3.ForAll([at], z3.Implies(z3.And(at >= 0, at < z3.Length(expr)), inside))
            case FunctionSort():
                return self._function_member(sort, lambda *arguments: z3.Select(expr, *arguments))
            case _:
                return None

    def _function_member(self, sort: FunctionSort, function: Callable[..., Expr]) -> Expr | None:
        arguments = [self.fresh("k", parameter) for parameter in sort.parameters]
        inside = self.member(sort.result, function(*arguments))
        if inside is None:
            return None
        allowed = self._all(self.member(p, a) for p, a in zip(sort.parameters, arguments, strict=True))
        return z3.ForAll(arguments, inside if allowed is None else z3.Implies(allowed, inside))

    def _all(self, conditions: Iterable[Expr | None]) -> Expr | None:
        given = [condition for condition in conditions if condition is not None]
        if not given:
            return None
        return given[0] if len(given) == 1 else z3.And(given)

    def true(self) -> Expr:
        return z3.BoolVal(True, self.context)

    # -- variables -----------------------------------------------------------------------------------------------------

    def fresh(self, name: str, sort: Sort) -> Expr:
        """A new constant that no other question knows."""
        self._count += 1
        return z3.Const(f"{name}!{self._count}", self.sort(sort))

    def variable(self, variable: Variable) -> Expr:
        """The constant that stands for a free variable that is not a function."""
        if variable not in self._constants:
            self._constants[variable] = z3.Const(variable.qualified, self.sort(variable.sort))
        return self._constants[variable]

    def function(self, variable: Variable) -> Any:
        """The uninterpreted function that stands for a free function-typed variable."""
        if variable not in self._functions:
            sort = variable.sort
            assert isinstance(sort, FunctionSort)
            signature = [*(self._field(p) for p in sort.parameters), self._field(sort.result)]
            self._functions[variable] = z3.Function(variable.qualified, *signature)
        return self._functions[variable]

    def background(
        self, variables: Iterable[Variable], meanings: Mapping[Variable, Meaning] | None = None
    ) -> list[Expr]:
        """What is true by typing of free variables: naturals are not negative, wherever they occur."""
        facts = []
        for variable in sorted(variables, key=lambda v: (v.qualified, repr(v.sort))):
            if isinstance(variable.sort, FunctionSort):
                fact = self._function_member(variable.sort, self._callable(variable, {}, meanings or {}))
            else:
                fact = self.member(variable.sort, self._value_of(variable, {}, meanings or {}))
            if fact is not None:
                facts.append(fact)
        return facts

    # -- terms ---------------------------------------------------------------------------------------------------------

    def term(
        self,
        term: Term,
        meanings: Mapping[Variable, Meaning] | None = None,
        bound: Mapping[Variable, Expr] | None = None,
    ) -> Expr:
        """The Z3 expression of a term. `meanings` replaces free variables, `bound` gives bound variables of an outer
        quantifier. Raises Unsupported."""
        return run(self._term(term, dict(bound or {}), meanings or {}))

    def _term(self, term: Term, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]) -> Steps[Expr]:
        match term:
            case Literal():
                return self._literal(term)
            case EnumValue(name=name, sort=enum):
                return self.sort(enum).constructor(enum.members.index(name))()
            case Variable():
                return self._value_of(term, bound, meanings)
            case Apply(function=function, arguments=terms):
                if not isinstance(function, Variable):
                    raise Unsupported("the application of something other than a variable", term.span)
                arguments = yield self._terms(terms, bound, meanings)
                apply = self._callable(function, bound, meanings)
                sort = function.sort
                assert isinstance(sort, FunctionSort)
                return apply(*(self._fit(a, p) for a, p in zip(arguments, sort.parameters, strict=True)))
            case Construct(constructor=name, arguments=terms, sort=data):
                arguments = yield self._terms(terms, bound, meanings)
                index = next(k for k, c in enumerate(data.constructors) if c.name == name)
                parameters = data.constructors[index].parameters
                fitted = [self._fit(a, p) for a, p in zip(arguments, parameters, strict=True)]
                return self.sort(data).constructor(index)(*fitted)
            case TupleTerm(items=items, sort=tuple_sort):
                arguments = yield self._terms(items, bound, meanings)
                fitted = [self._fit(a, s) for a, s in zip(arguments, tuple_sort.items, strict=True)]
                return self.sort(tuple_sort).constructor(0)(*fitted)
            case Widen(term=inner):
                value = yield self._term(inner, bound, meanings)
                return self._real(value)
            case Negative(term=inner):
                value = yield self._term(inner, bound, meanings)
                return -value
            case Arithmetic(operator=operator, left=left, right=right):
                one, other = yield self._terms((left, right), bound, meanings)
                return self._arithmetic(operator, one, other)
            case Not(body=body):
                value = yield self._term(body, bound, meanings)
                return z3.Not(value)
            case And(items=items):
                values = yield self._terms(items, bound, meanings)
                return z3.And(values) if values else self.true()
            case Or(items=items):
                values = yield self._terms(items, bound, meanings)
                return z3.Or(values) if values else z3.Not(self.true())
            case Implies(left=left, right=right):
                one, other = yield self._terms((left, right), bound, meanings)
                return z3.Implies(one, other)
            case Iff(left=left, right=right):
                one, other = yield self._terms((left, right), bound, meanings)
                return one == other
            case Compare():
                result = yield self._compare(term, bound, meanings)
                return result
            case In():
                result = yield self._in(term, bound, meanings)
                return result
            case Quantified():
                result = yield self._quantified(term, bound, meanings)
                return result
            case SequenceTerm(items=items, sort=sequence):
                values = yield self._terms(items, bound, meanings)
                units = [z3.Unit(self._fit(value, sequence.item)) for value in values]
                return self._sequence(units, sequence)
            case Length(sequence=SequenceRange(low=low, high=high)):
                one, other = yield self._terms((low, high), bound, meanings)
                return z3.If(other >= one, other - one + 1, z3.IntVal(0, self.context))
            case Length(sequence=sequence_term):
                value = yield self._term(sequence_term, bound, meanings)
                return z3.Length(value)
            case Index(sequence=sequence_term, index=index_term):
                value, at = yield self._terms((sequence_term, index_term), bound, meanings)
                return value[at]
            case SequenceRange(low=low, high=high, sort=sequence):
                return self._range(low, high, sequence, term.span)
            case SetTerm():
                raise Unsupported("a set outside the right-hand side of `in`", term.span)

    def _terms(
        self, terms: Iterable[Term], bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]
    ) -> Steps[list[Expr]]:
        values = []
        for term in terms:
            value = yield self._term(term, bound, meanings)
            values.append(value)
        return values

    def _value_of(
        self, variable: Variable, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]
    ) -> Expr:
        if isinstance(variable.sort, FunctionSort) and variable not in bound:
            raise Unsupported("a function as a value", variable.span)
        for scope in (bound, meanings):
            if variable in scope:
                return scope[variable]
        return self.variable(variable)

    def _callable(
        self, variable: Variable, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]
    ) -> Callable[..., Expr]:
        if variable in bound:
            array = bound[variable]
            return lambda *arguments: z3.Select(array, *arguments)
        if variable in meanings:
            meaning: Callable[..., Expr] = meanings[variable]
            return meaning
        function: Callable[..., Expr] = self.function(variable)
        return function

    def _compare(
        self, term: Compare, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]
    ) -> Steps[Expr]:
        if isinstance(term.left.sort, FunctionSort):
            if not (isinstance(term.left, Variable) and isinstance(term.right, Variable)):
                raise Unsupported("the comparison of functions that are not variables", term.span)
            same = self._same_function(
                term.left.sort, *(self._callable(side, bound, meanings) for side in (term.left, term.right))
            )
            return same if term.operator == "==" else z3.Not(same)
        left, right = yield self._terms((term.left, term.right), bound, meanings)
        if left.sort() != right.sort():
            left, right = self._real(left), self._real(right)
        match term.operator:
            case "==":
                return left == right
            case "!=":
                return left != right
            case "<":
                return left < right
            case "<=":
                return left <= right
            case ">":
                return left > right
            case ">=":
                return left >= right
        raise Unsupported(f"the comparison {term.operator}", term.span)

    def _same_function(self, sort: FunctionSort, one: Callable[..., Expr], other: Callable[..., Expr]) -> Expr:
        arguments = [self.fresh("k", parameter) for parameter in sort.parameters]
        equal = one(*arguments) == other(*arguments)
        allowed = self._all(self.member(p, a) for p, a in zip(sort.parameters, arguments, strict=True))
        return z3.ForAll(arguments, equal if allowed is None else z3.Implies(allowed, equal))

    def _in(self, term: In, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]) -> Steps[Expr]:
        item = yield self._term(term.item, bound, meanings)
        match term.collection:
            case SetTerm(items=items) | SequenceTerm(items=items):
                values = yield self._terms(items, bound, meanings)
                equal = [self._equal(item, value) for value in values]
                return z3.Or(equal) if equal else z3.Not(self.true())
            case SequenceRange(low=low, high=high):
                one, other = yield self._terms((low, high), bound, meanings)
                return z3.And(one <= item, item <= other)
            case collection:
                sequence = yield self._term(collection, bound, meanings)
                assert isinstance(collection.sort, SequenceSort)
                return z3.Contains(sequence, z3.Unit(self._fit(item, collection.sort.item)))

    def _quantified(
        self, term: Quantified, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]
    ) -> Steps[Expr]:
        constants = [self.fresh(variable.name, variable.sort) for variable in term.variables]
        inner = {**bound, **dict(zip(term.variables, constants, strict=True))}
        body = yield self._term(term.body, inner, meanings)
        members = [self.member(v.sort, c) for v, c in zip(term.variables, constants, strict=True)]
        allowed = self._all(members)
        if term.quantifier is Quantifier.FORALL:
            return z3.ForAll(constants, body if allowed is None else z3.Implies(allowed, body))
        within = body if allowed is None else z3.And(allowed, body)
        exists = z3.Exists(constants, within)
        if term.quantifier is Quantifier.EXISTS:
            return exists
        if any(isinstance(variable.sort, FunctionSort) for variable in term.variables):
            raise Unsupported("unique existence of a function", term.span)
        others = [self.fresh(variable.name, variable.sort) for variable in term.variables]
        again = z3.substitute(within, *zip(constants, others, strict=True))
        equal = z3.And([one == other for one, other in zip(constants, others, strict=True)])
        return z3.And(exists, z3.ForAll([*constants, *others], z3.Implies(z3.And(within, again), equal)))

    def _range(self, low: Term, high: Term, sort: SequenceSort, span: Span | None) -> Expr:
        if not (isinstance(low, Literal) and isinstance(high, Literal)):
            raise Unsupported("a range between bounds that are not numbers, as a value", span)
        first, last = int(low.value), int(high.value)
        if last - first > 1000:
            raise Unsupported("a range of more than 1000 numbers, as a value", span)
        return self._sequence([z3.Unit(z3.IntVal(k, self.context)) for k in range(first, last + 1)], sort)

    def _sequence(self, units: Sequence[Expr], sort: SequenceSort) -> Expr:
        if not units:
            return z3.Empty(self.sort(sort))
        return units[0] if len(units) == 1 else z3.Concat(*units)

    # -- atoms and arithmetic ------------------------------------------------------------------------------------------

    def _literal(self, literal: Literal) -> Expr:
        value = literal.value
        match literal.sort:
            case RealSort() if not isinstance(value, bool | str):
                return self.real(Fraction(value))
            case StringSort():
                return self.string(str(value), literal.span)
            case _ if isinstance(value, bool):
                return z3.BoolVal(value, self.context)
            case _ if isinstance(value, Fraction) and value.denominator != 1:
                return self.real(value)
            case _:
                return z3.IntVal(int(value), self.context)

    def real(self, value: Fraction) -> Expr:
        return z3.RealVal(f"{value.numerator}/{value.denominator}", self.context)

    def string(self, value: str, span: Span | None = None) -> Expr:
        # Z3 reads \u{…} in its literals: everything that is not plain is written so, the backslash too.
        if any(ord(character) > _MAX_CHARACTER for character in value):
            raise Unsupported("a string with a character beyond U+2FFFF", span)
        plain = (c if " " <= c <= "~" and c != "\\" else f"\\u{{{ord(c):x}}}" for c in value)
        return z3.SeqRef(z3.Z3_mk_string(self.context.ref(), "".join(plain)), self.context)

    def _real(self, expr: Expr) -> Expr:
        return z3.simplify(z3.ToReal(expr)) if z3.is_int_value(expr) else z3.ToReal(expr) if z3.is_int(expr) else expr

    def _fit(self, expr: Expr, sort: Sort) -> Expr:
        return self._real(expr) if isinstance(sort, RealSort) else expr

    def _equal(self, left: Expr, right: Expr) -> Expr:
        return left == right if left.sort() == right.sort() else self._real(left) == self._real(right)

    def _arithmetic(self, operator: str, left: Expr, right: Expr) -> Expr:
        if operator == "/" or left.sort() != right.sort():
            left, right = self._real(left), self._real(right)
        match operator:
            case "+":
                return left + right
            case "-":
                return left - right
            case "*":
                return left * right
            case "/":
                return left / right
        raise Unsupported(f"the operator {operator}")

    # -- concrete values -----------------------------------------------------------------------------------------------

    def value(self, value: Value, sort: Sort) -> Meaning:
        """A concrete value of a sort, as a meaning for a variable of that sort. Raises Unsupported."""
        match sort:
            case FunctionSort() if isinstance(value, FunctionValue):
                return self._table(value, sort)
            case RealSort() if isinstance(value, int | Fraction):
                return self.real(Fraction(value))
            case BoolSort():
                return z3.BoolVal(bool(value), self.context)
            case IntegerSort() | NaturalSort() if isinstance(value, int):
                return z3.IntVal(value, self.context)
            case StringSort() if isinstance(value, str):
                return self.string(value)
            case EnumSort(members=members) if isinstance(value, Element):
                return self.sort(sort).constructor(members.index(value.name))()
            case DataSort(constructors=constructors) if isinstance(value, Data):
                index = next(k for k, c in enumerate(constructors) if c.name == value.constructor)
                parameters = constructors[index].parameters
                fields = [self.value(a, p) for a, p in zip(value.arguments, parameters, strict=True)]
                return self.sort(sort).constructor(index)(*fields)
            case TupleSort(items=items) if isinstance(value, tuple):
                return self.sort(sort).constructor(0)(*(self.value(v, s) for v, s in zip(value, items, strict=True)))
            case SequenceSort(item=item) if isinstance(value, SequenceValue):
                return self._sequence([z3.Unit(self.value(v, item)) for v in value.items], sort)
            case OpaqueSort(name=name) if isinstance(value, Opaque):
                key = (name, value.index)
                if key not in self._opaque:
                    self._opaque[key] = z3.Const(f"{name}#{value.index}", self.sort(sort))
                return self._opaque[key]
        raise Unsupported(f"the value {value} of a {type(sort).__name__}")

    def add_elements(self, sort: OpaqueSort, more: int) -> None:
        """Name further elements of an unspecified sort: at least one in all, and `more` than the values did."""
        used = [index for name, index in self._opaque if name == sort.name]
        first = max(used, default=-1) + 1
        for index in range(first, first + more + (not used)):
            self.value(Opaque(sort.name, index), sort)

    def opaque_facts(self) -> list[Expr]:
        """That the elements of unspecified sorts named by `value` are different, and all that there are.

        An unspecified sort may have any elements: a concrete situation fixes which.
        """
        by_sort: dict[str, list[Expr]] = {}
        for (name, _), constant in self._opaque.items():
            by_sort.setdefault(name, []).append(constant)
        facts = []
        for constants in by_sort.values():
            self._count += 1
            any_one = z3.Const(f"o!{self._count}", constants[0].sort())
            facts.append(z3.ForAll([any_one], z3.Or([any_one == constant for constant in constants])))
            if len(constants) > 1:
                facts.append(z3.Distinct(constants))
        return facts

    def _table(self, value: FunctionValue, sort: FunctionSort) -> Callable[..., Expr]:
        points = [
            ([self.value(a, p) for a, p in zip(point, sort.parameters, strict=True)], self.value(result, sort.result))
            for point, result in value.table.items()
        ]
        default = self.value(value.default, sort.result)
        return self.table(points, default)

    def table(self, points: Sequence[tuple[Sequence[Expr], Expr]], default: Expr) -> Callable[..., Expr]:
        """The function with these results at these points (the first that fits) and the default elsewhere."""

        def function(*arguments: Expr) -> Expr:
            result = default
            for point, value in reversed(points):
                here = z3.And([a == p for a, p in zip(arguments, point, strict=True)])
                result = z3.If(here, value, result)
            return result

        return function
