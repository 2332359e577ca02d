"""Sorts and concrete values in a Z3 context: the lower half of the translation (`avow.solving.translation`)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, assert_never

from avow.base.diagnostics import Span
from avow.base.tuning.bounds import QUESTIONS_KEPT
from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value
from avow.language import sorts as s
from avow.language.terms import Builtin, Term, Variable
from avow.solving.z3_module import z3

Expr = Any
"""A Z3 expression (the z3 package is not typed)."""

Meaning = Any
"""The meaning of a free variable that does not represent itself: an expression, or for a function a callable."""

_MAX_CHARACTER = 0x2FFFF
"""The largest code point of an SMT-LIB string."""


class Unsupported(Exception):  # noqa: N818 - it names what happened
    """A construct that the translation cannot express; the answer to the question is then `unknown`."""

    def __init__(self, what: str, span: Span | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.span = span


def _whole(sort: s.Sort) -> s.Sort:
    """The sort with INTEGER for NATURAL inside tuples and sequences: RCL compares ``(1, n)`` with ``(1, i)``, so that
    both must have one Z3 sort. `member` tests which of its values are naturals. A record is the tuple of its items."""
    match sort:
        case s.NaturalSort():
            return s.INTEGER
        case s.TupleSort(items=items):
            return s.TupleSort(tuple(map(_whole, items)))
        case s.SequenceSort(item=item):
            return s.SequenceSort(_whole(item))
    return sort


@dataclass(slots=True, eq=False)
class Session:
    """A Z3 context, with its sorts, constants and formulas: each is made once."""

    context: Any = field(default_factory=lambda: z3.Context())
    sorts: dict[s.Sort, Any] = field(default_factory=dict)
    names: dict[str, s.Sort] = field(default_factory=dict)
    constants: dict[Variable, Any] = field(default_factory=dict)
    """Free variables as constants, or as functions."""
    formulas: dict[int, tuple[Term, Expr]] = field(default_factory=dict)
    """By the formula's identity, as formulas are deep."""
    roots: dict[tuple[str | int, ...], Root] = field(default_factory=dict)
    """By the operation, and the identities of the expressions that it is applied to."""
    beside: dict[tuple[int, int], Expr] = field(default_factory=dict)
    """What is known of two roots together."""
    stated: set[int] = field(default_factory=set)
    """The identities of facts of roots that questions had: they are many, and reading them finds no other root."""
    steps: int = 0
    """Z3's steps in the context, as last counted."""


@dataclass(slots=True, eq=False)
class Root:
    """Constants for values of an operation that Z3 has not: a square root; a sine and a cosine; an angle."""

    operations: tuple[Builtin, ...]
    arguments: tuple[Expr, ...]
    constants: tuple[Expr, ...]
    fact: Expr
    """What is known of them: the definition of a square root, and bounds of the others."""

    @property
    def is_bounded(self) -> bool:
        """Whether only bounds are known."""
        return self.operations != (Builtin.SQRT,)

    @property
    def parts(self) -> tuple[Expr, ...]:
        return *self.arguments, *self.constants


_session: ContextVar[Session | None] = ContextVar("session", default=None)


@contextmanager
def new_session() -> Iterator[None]:
    """Within the block all questions of this thread are asked in one new Z3 context, each with its own solver.

    A context takes 16 MB and 8 ms, more than most questions. A solver's behaviour depends a little on the other
    contents of its context. A session is therefore for questions that are always asked together, in the same order (the
    claims of a node), and no longer: otherwise an answer could depend on earlier questions.
    """
    before = _session.set(Session())
    try:
        yield
    finally:
        _session.reset(before)


@contextmanager
def same_session() -> Iterator[None]:
    """The current session, or a new one for the block."""
    if _session.get() is not None:
        yield
        return
    with new_session():
        yield


class _Kept(threading.local):
    """Each thread's session."""

    session: Session | None = None
    questions = 0


_kept = _Kept()


@contextmanager
def kept_session() -> Iterator[None]:
    """A session that lasts for many blocks: for any number of easy questions, each with a single answer."""
    if _kept.session is None or _kept.questions >= QUESTIONS_KEPT:
        _kept.session, _kept.questions = Session(), 0
    _kept.questions += 1
    before = _session.set(_kept.session)
    try:
        yield
    finally:
        _session.reset(before)


class Sorts:
    """The Z3 sorts of a session, membership of their values in RCL's sorts, and concrete values."""

    def __init__(self) -> None:
        self.session = _session.get() or Session()
        self.context: Any = self.session.context
        self._opaque: dict[tuple[str, int], Expr] = {}
        self._count = 0

    # -- sorts ---------------------------------------------------------------------------------------------------------

    def sort(self, sort: s.Sort) -> Any:
        """The Z3 sort of values of `sort`; for a function sort, an array sort. Raises Unsupported."""
        sort = _whole(sort)
        if sort not in self.session.sorts:
            self.session.sorts[sort] = self._make_sort(sort)
        return self.session.sorts[sort]

    def _make_sort(self, sort: s.Sort) -> Any:
        match sort:
            case s.BoolSort():
                return z3.BoolSort(self.context)
            case s.RealSort():
                return z3.RealSort(self.context)
            case s.IntegerSort() | s.NaturalSort():
                return z3.IntSort(self.context)
            case s.StringSort():
                return z3.StringSort(self.context)
            case s.EnumSort(members=members):
                name = self._sort_name(sort.name, sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                for member in members:
                    datatype.declare(f"{name}.{member}")
                return datatype.create()
            case s.DataSort(constructors=constructors):
                name = self._sort_name(sort.name, sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                for constructor in constructors:
                    fields = [
                        (f"{name}.{constructor.name}.{k}", self.field(parameter))
                        for k, parameter in enumerate(constructor.parameters)
                    ]
                    datatype.declare(f"{name}.{constructor.name}", *fields)
                return datatype.create()
            case s.OpaqueSort():
                return z3.DeclareSort(f"sort.{self._sort_name(sort.name, sort)}", ctx=self.context)
            case s.TupleSort(items=items):
                name = self._sort_name("tuple", sort)
                datatype = z3.Datatype(f"sort.{name}", ctx=self.context)
                fields = [(f"{name}.{k}", self.field(item)) for k, item in enumerate(items)]
                datatype.declare(f"{name}.of", *fields)
                return datatype.create()
            case s.SequenceSort(item=item):
                return z3.SeqSort(self.field(item))
            case s.FunctionSort(parameters=parameters, result=result):
                return z3.ArraySort(*(self.field(p) for p in parameters), self.field(result))
            case s.SetSort():
                raise Unsupported("a set outside the right-hand side of `in`")

    def field(self, sort: s.Sort) -> Any:
        if isinstance(sort, s.FunctionSort | s.SetSort):
            # Array equality would compare functions on arguments that are not members (negative naturals).
            raise Unsupported("a function or set as part of another value")
        return self.sort(sort)

    def _sort_name(self, name: str, sort: s.Sort) -> str:
        candidate = name
        while self.session.names.setdefault(candidate, sort) != sort:
            candidate += "_"
        return candidate

    def member(self, sort: s.Sort, expr: Expr) -> Expr | None:
        """That a Z3 value is a value of the sort (its naturals are not negative); None if every one is."""
        match sort:
            case s.NaturalSort():
                return expr >= 0
            case s.TupleSort(items=items):
                datatype = self.sort(sort)
                return self.all_of(self.member(item, datatype.accessor(0, k)(expr)) for k, item in enumerate(items))
            case s.DataSort(constructors=constructors):
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
            case s.SequenceSort(item=item):
                at = self.fresh("k", s.IntegerSort())
                inside = self.member(item, expr[at])
                if inside is None:
                    return None
                return z3.ForAll([at], z3.Implies(z3.And(at >= 0, at < z3.Length(expr)), inside))
            case s.FunctionSort():
                return self.function_member(sort, lambda *arguments: z3.Select(expr, *arguments))
            case (
                s.BoolSort()
                | s.RealSort()
                | s.IntegerSort()
                | s.StringSort()
                | s.EnumSort()
                | s.OpaqueSort()
                | s.SetSort()
            ):
                # every value of its Z3 sort is one of it
                return None
            case _:
                assert_never(sort)

    def clamped(self, expr: Expr, sort: s.Sort) -> Expr:
        """The expression if it is a value of the sort, otherwise some value of the sort that depends only on it."""
        match sort:
            case s.NaturalSort():
                return z3.If(expr >= 0, expr, z3.IntVal(0, self.context))
            case s.TupleSort(items=items) if self.member(sort, expr) is not None:
                datatype = self.sort(sort)
                parts = (self.clamped(datatype.accessor(0, k)(expr), item) for k, item in enumerate(items))
                return datatype.constructor(0)(*parts)
            case s.DataSort(constructors=constructors) if self.member(sort, expr) is not None:
                datatype, value = self.sort(sort), expr
                for c, constructor in enumerate(constructors):
                    fields = enumerate(constructor.parameters)
                    made = (self.clamped(datatype.accessor(c, k)(expr), parameter) for k, parameter in fields)
                    value = z3.If(datatype.recognizer(c)(expr), datatype.constructor(c)(*made), value)
                return value
            case s.SequenceSort() if (inside := self.member(sort, expr)) is not None:
                return z3.If(inside, expr, z3.Empty(self.sort(sort)))
            case s.FunctionSort() | s.SetSort():
                raise Unsupported("a function or set as part of another value")
            case (
                s.BoolSort() | s.RealSort() | s.IntegerSort() | s.StringSort() | s.EnumSort() | s.OpaqueSort()
                | s.TupleSort() | s.DataSort() | s.SequenceSort()
            ):  # fmt: skip
                return expr  # every value of its Z3 sort is one of it
            case _:
                assert_never(sort)

    def function_member(self, sort: s.FunctionSort, function: Callable[..., Expr]) -> Expr | None:
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

    def fresh(self, name: str, sort: s.Sort) -> Expr:
        """A new constant that occurs in no other question."""
        self._count += 1
        return z3.Const(f"{name}!{self._count}", self.sort(sort))

    def root(self, square: Expr) -> Expr:
        """A constant for the square root of an expression; `root_facts` say which number it is."""
        roots, key = self.session.roots, (Builtin.SQRT, square.get_id())
        if key not in roots:
            found = z3.Real(f"sqrt!{len(roots)}", self.context)
            fact = z3.Implies(square >= 0, z3.And(found >= 0, found * found == square))
            roots[key] = Root((Builtin.SQRT,), (square,), (found,), fact)
        return roots[key].constants[0]

    def root_facts(self, exprs: Iterable[Expr]) -> list[Root]:
        """The roots that occur in expressions, and in each other's facts, which belong to every question about them. An
        inner root comes before an outer one."""
        stated = self.session.stated
        waiting, found = [expr for expr in exprs if expr.get_id() not in stated], set[int]()
        while waiting and self.session.roots:
            inside = {part.get_id() for part in parts_of(waiting)} - found
            waiting = [part for root in self.session.roots.values() if _among(root, inside) for part in root.arguments]
            found |= inside
        return [root for root in self.session.roots.values() if _among(root, found)]

    def real(self, value: Fraction) -> Expr:
        return z3.RealVal(f"{value.numerator}/{value.denominator}", self.context)

    def string(self, value: str, span: Span | None = None) -> Expr:
        # Z3 reads \u{…} in its literals: all other than plain characters are written so, including the backslash.
        if any(ord(character) > _MAX_CHARACTER for character in value):
            raise Unsupported("a string with a character beyond U+2FFFF", span)
        plain = (c if " " <= c <= "~" and c != "\\" else f"\\u{{{ord(c):x}}}" for c in value)
        return z3.SeqRef(z3.Z3_mk_string(self.context.ref(), "".join(plain)), self.context)

    # -- concrete values -----------------------------------------------------------------------------------------------

    def value(self, value: Value, sort: s.Sort) -> Meaning:
        """A concrete value of a sort, as a meaning for a variable of that sort. Raises Unsupported."""
        match sort:
            case s.FunctionSort() if isinstance(value, FunctionValue):
                return self._table(value, sort)
            case s.RealSort() if isinstance(value, int | Fraction):
                return self.real(Fraction(value))
            case s.BoolSort():
                return z3.BoolVal(bool(value), self.context)
            case s.IntegerSort() | s.NaturalSort() if isinstance(value, int):
                return z3.IntVal(value, self.context)
            case s.StringSort() if isinstance(value, str):
                return self.string(value)
            case s.EnumSort(members=members) if isinstance(value, Element):
                return self.sort(sort).constructor(members.index(value.name))()
            case s.DataSort(constructors=constructors) if isinstance(value, Data):
                index = next(k for k, c in enumerate(constructors) if c.name == value.constructor)
                parameters = constructors[index].parameters
                fields = [self.value(a, p) for a, p in zip(value.arguments, parameters, strict=True)]
                return self.sort(sort).constructor(index)(*fields)
            case s.TupleSort(items=items) if isinstance(value, tuple):
                return self.sort(sort).constructor(0)(
                    *(self.value(v, part) for v, part in zip(value, items, strict=True))
                )
            case s.SequenceSort(item=item) if isinstance(value, SequenceValue):
                return self.sequence([z3.Unit(self.value(v, item)) for v in value.items], sort)
            case s.OpaqueSort(name=name) if isinstance(value, Opaque):
                key = (name, value.index)
                if key not in self._opaque:
                    self._opaque[key] = z3.Const(f"{name}#{value.index}", self.sort(sort))
                return self._opaque[key]
        raise Unsupported(f"the value {value} of a {type(sort).__name__}")

    def add_elements(self, sort: s.OpaqueSort, more: int) -> None:
        """Name further elements of an unspecified sort: at least one in all, and `more` than the values did."""
        used = [index for name, index in self._opaque if name == sort.name]
        first = max(used, default=-1) + 1
        for index in range(first, first + more + (not used)):
            self.value(Opaque(sort.name, index), sort)

    def opaque_facts(self) -> list[Expr]:
        """The claim that the elements of unspecified sorts named by `value` are different, and the only ones.

        An unspecified sort may have any elements: a concrete situation determines which.
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

    def _table(self, value: FunctionValue, sort: s.FunctionSort) -> Callable[..., Expr]:
        points = [
            ([self.value(a, p) for a, p in zip(point, sort.parameters, strict=True)], self.value(result, sort.result))
            for point, result in value.table.items()
        ]
        default = self.value(value.default, sort.result)
        return self.table(points, default)

    def table(self, points: Sequence[tuple[Sequence[Expr], Expr]], default: Expr) -> Callable[..., Expr]:
        """The function with these results at these points (the first that matches) and the default elsewhere."""

        def function(*arguments: Expr) -> Expr:
            result = default
            for point, value in reversed(points):
                here = z3.And([a == p for a, p in zip(arguments, point, strict=True)])
                result = z3.If(here, value, result)
            return result

        return function

    def sequence(self, units: Sequence[Expr], sort: s.SequenceSort) -> Expr:
        if not units:
            return z3.Empty(self.sort(sort))
        return units[0] if len(units) == 1 else z3.Concat(*units)


def parts_of(exprs: Iterable[Expr]) -> Iterator[Expr]:
    """Every subexpression once, without quantifiers themselves."""
    seen: set[int] = set()
    stack = list(exprs)
    while stack:
        expr = stack.pop()
        if expr.get_id() in seen:
            continue
        seen.add(expr.get_id())
        if z3.is_quantifier(expr):
            stack.append(expr.body())
        else:
            yield expr
            stack.extend(expr.children())


def _among(root: Root, identities: set[int]) -> bool:
    return any(constant.get_id() in identities for constant in root.constants)
