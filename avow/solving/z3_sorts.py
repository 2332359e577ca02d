"""Sorts and concrete values in a Z3 context: the lower half of the translation (`avow.solving.translation`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any, assert_never

from avow.base.diagnostics import Span
from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value
from avow.language.sorts import (
    INTEGER,
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
from avow.solving.z3_module import z3

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


def _whole(sort: Sort) -> Sort:
    """The sort with INTEGER for NATURAL inside tuples and sequences: RCL compares ``(1, n)`` with ``(1, i)``, so that
    both must be of one Z3 sort. Which of its values are naturals, `member` says. A record is the tuple of its items."""
    match sort:
        case NaturalSort():
            return INTEGER
        case TupleSort(items=items):
            return TupleSort(tuple(map(_whole, items)))
        case SequenceSort(item=item):
            return SequenceSort(_whole(item))
    return sort


class Sorts:
    """The Z3 sorts of one context, which of their values are members of RCL's sorts, and concrete values.

    `beside` another one, its context and sorts are used, and nothing else of it: a context costs more than most
    questions.
    """

    def __init__(self, beside: Sorts | None = None) -> None:
        self.context: Any = beside.context if beside else z3.Context()
        self._sorts: dict[Sort, Any] = beside._sorts if beside else {}
        self._names: dict[str, Sort] = beside._names if beside else {}
        self._opaque: dict[tuple[str, int], Expr] = {}
        self._count = 0
        self._counted: list[int] = beside._counted if beside else [0]

    @property
    def steps(self) -> int:
        """Z3's steps in this context, as last counted."""
        return self._counted[0]

    @steps.setter
    def steps(self, count: int) -> None:
        self._counted[0] = count

    # -- sorts ---------------------------------------------------------------------------------------------------------

    def sort(self, sort: Sort) -> Any:
        """The Z3 sort of values of `sort`; of a function sort, an array sort. Raises Unsupported."""
        sort = _whole(sort)
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
                        (f"{name}.{constructor.name}.{k}", self.field(parameter))
                        for k, parameter in enumerate(constructor.parameters)
                    ]
                    datatype.declare(f"{name}.{constructor.name}", *fields)
                return datatype.create()
            case OpaqueSort():
                return z3.DeclareSort(f"sort.{self._sort_name(sort.name, sort)}", ctx=self.context)
            case TupleSort(items=items):
                name = self._sort_name("tuple", sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                fields = [(f"{name}.{k}", self.field(item)) for k, item in enumerate(items)]
                datatype.declare(f"{name}.of", *fields)
                return datatype.create()
            case SequenceSort(item=item):
                return z3.SeqSort(self.field(item))
            case FunctionSort(parameters=parameters, result=result):
                return z3.ArraySort(*(self.field(p) for p in parameters), self.field(result))
            case SetSort():
                raise Unsupported("a set outside the right-hand side of `in`")

    def field(self, sort: Sort) -> Any:
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
                return self.all_of(self.member(item, datatype.accessor(0, k)(expr)) for k, item in enumerate(items))
            case DataSort(constructors=constructors):
                datatype = self.sort(sort)
                cases = []
                for c, constructor in enumerate(constructors):
                    inside = self.all_of(
                        self.member(parameter, datatype.accessor(c, k)(expr))
                        for k, parameter in enumerate(constructor.parameters)
                    )
                    if inside is not None:
                        cases.append(z3.Implies(datatype.recognizer(c)(expr), inside))
                return self.all_of(cases)
            case SequenceSort(item=item):
                at = self.fresh("k", IntegerSort())
                inside = self.member(item, expr[at])
                if inside is None:
                    return None
                return z3.ForAll([at], z3.Implies(z3.And(at >= 0, at < z3.Length(expr)), inside))
            case FunctionSort():
                return self.function_member(sort, lambda *arguments: z3.Select(expr, *arguments))
            case BoolSort() | RealSort() | IntegerSort() | StringSort() | EnumSort() | OpaqueSort() | SetSort():
                # every value of its Z3 sort is one of it
                return None
            case _:
                assert_never(sort)

    def clamped(self, expr: Expr, sort: Sort) -> Expr:
        """The expression where it is a value of the sort, else some value of the sort that depends on it alone."""
        match sort:
            case NaturalSort():
                return z3.If(expr >= 0, expr, z3.IntVal(0, self.context))
            case TupleSort(items=items) if self.member(sort, expr) is not None:
                datatype = self.sort(sort)
                parts = (self.clamped(datatype.accessor(0, k)(expr), item) for k, item in enumerate(items))
                return datatype.constructor(0)(*parts)
            case DataSort(constructors=constructors) if self.member(sort, expr) is not None:
                datatype, value = self.sort(sort), expr
                for c, constructor in enumerate(constructors):
                    fields = enumerate(constructor.parameters)
                    made = (self.clamped(datatype.accessor(c, k)(expr), parameter) for k, parameter in fields)
                    value = z3.If(datatype.recognizer(c)(expr), datatype.constructor(c)(*made), value)
                return value
            case SequenceSort() if (inside := self.member(sort, expr)) is not None:
                return z3.If(inside, expr, z3.Empty(self.sort(sort)))
            case FunctionSort() | SetSort():
                raise Unsupported("a function or set as part of another value")
            case (
                BoolSort() | RealSort() | IntegerSort() | StringSort() | EnumSort() | OpaqueSort()
                | TupleSort() | DataSort() | SequenceSort()
            ):  # fmt: skip
                return expr  # every value of its Z3 sort is one of it
            case _:
                assert_never(sort)

    def function_member(self, sort: FunctionSort, function: Callable[..., Expr]) -> Expr | None:
        arguments = [self.fresh("k", parameter) for parameter in sort.parameters]
        inside = self.member(sort.result, function(*arguments))
        if inside is None:
            return None
        allowed = self.all_of(self.member(p, a) for p, a in zip(sort.parameters, arguments, strict=True))
        return z3.ForAll(arguments, inside if allowed is None else z3.Implies(allowed, inside))

    def all_of(self, conditions: Iterable[Expr | None]) -> Expr | None:
        given = [condition for condition in conditions if condition is not None]
        if not given:
            return None
        return given[0] if len(given) == 1 else z3.And(given)

    def true(self) -> Expr:
        return z3.BoolVal(True, self.context)

    def fresh(self, name: str, sort: Sort) -> Expr:
        """A new constant that no other question knows."""
        self._count += 1
        return z3.Const(f"{name}!{self._count}", self.sort(sort))

    def real(self, value: Fraction) -> Expr:
        return z3.RealVal(f"{value.numerator}/{value.denominator}", self.context)

    def string(self, value: str, span: Span | None = None) -> Expr:
        # Z3 reads \u{…} in its literals: everything that is not plain is written so, the backslash too.
        if any(ord(character) > _MAX_CHARACTER for character in value):
            raise Unsupported("a string with a character beyond U+2FFFF", span)
        plain = (c if " " <= c <= "~" and c != "\\" else f"\\u{{{ord(c):x}}}" for c in value)
        return z3.SeqRef(z3.Z3_mk_string(self.context.ref(), "".join(plain)), self.context)

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
                return self.sequence([z3.Unit(self.value(v, item)) for v in value.items], sort)
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

    def sequence(self, units: Sequence[Expr], sort: SequenceSort) -> Expr:
        if not units:
            return z3.Empty(self.sort(sort))
        return units[0] if len(units) == 1 else z3.Concat(*units)
