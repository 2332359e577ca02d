"""THE translation of typed terms to Z3: everything that asks Z3 a question goes through here.

Each `Translator` owns a `z3.Context`, so that threads do not meet. NATURAL is Int, relativised: a quantifier over it
(or over a sort that contains it) ranges over its members only, and `background` says so of free variables.
A free function-typed variable is an uninterpreted function; a bound one an array. What lies outside a partial
operation (division by zero, an element beyond a sequence's end) is unspecified: no interpretation of it is chosen
here, so that what is proved holds under each (`avow.solving.questions` takes care that satisfiability is judged
likewise).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, assert_never

from avow.base.diagnostics import Span
from avow.formulas.one_point_rule import made_with, without_points
from avow.formulas.traversal import Steps, run
from avow.language.operators import OPERATORS, implementation
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
    Sort,
    StringSort,
    TupleSort,
    components,
)
from avow.language.subterms import subterms
from avow.language.terms import (
    And,
    Apply,
    Argument,
    Arithmetic,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    History,
    Iff,
    Implies,
    In,
    Index,
    Item,
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
from avow.solving.z3_module import z3
from avow.solving.z3_sorts import Expr, Meaning, Sorts, Unsupported

__all__ = ["Expr", "Meaning", "Translator", "Unsupported", "translating_once"]


class Translator(Sorts):
    """Sorts, variables and terms in one Z3 context; the same variable always becomes the same Z3 symbol."""

    def __init__(self, beside: Sorts | None = None) -> None:
        super().__init__(beside)
        self._constants: dict[Variable, Expr] = {}
        self._functions: dict[Variable, Any] = {}
        self._whole: dict[int, tuple[Term, Expr]] = {}
        """By identity, as formulas are deep."""

    # -- variables -----------------------------------------------------------------------------------------------------

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
            signature = [*(self.field(p) for p in sort.parameters), self.field(sort.result)]
            self._functions[variable] = z3.Function(variable.qualified, *signature)
        return self._functions[variable]

    def background(
        self, variables: Iterable[Variable], meanings: Mapping[Variable, Meaning] | None = None
    ) -> list[Expr]:
        """What is true by typing of free variables: naturals are not negative, wherever they occur."""
        facts = []
        for variable in sorted(variables, key=lambda v: (v.qualified, repr(v.sort))):
            if isinstance(variable.sort, FunctionSort):
                fact = self.function_member(variable.sort, self._callable(variable, {}, meanings or {}))
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
        if bound or meanings:
            return run(self._term(without_points(term), dict(bound or {}), meanings or {}))
        if id(term) not in self._whole:
            copied = self._copied(term)
            self._whole[id(term)] = term, run(self._term(without_points(term), {}, {})) if copied is None else copied
        return self._whole[id(term)][1]

    def _copied(self, term: Term) -> Expr | None:
        """A copy of what a formula is elsewhere, with the sorts of this context; None where there is none."""
        known = _known.get()
        made = known.of(term) if known else None
        if made is None or any(self.sort(sort).name() != name for sort, name in made.sorts):
            return None
        return made.expr.translate(self.context)

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
                index, parameters = _place(data, name), data.constructor(name).parameters
                fitted = [self._fit(a, p) for a, p in zip(arguments, parameters, strict=True)]
                return self.sort(data).constructor(index)(*fitted)
            case TupleTerm(items=items, sort=tuple_sort):
                arguments = yield self._terms(items, bound, meanings)
                fitted = [self._fit(a, s) for a, s in zip(arguments, tuple_sort.items, strict=True)]
                return self.sort(tuple_sort).constructor(0)(*fitted)
            case Item(record=record, position=position):
                value = yield self._term(record, bound, meanings)
                return self.sort(record.sort).accessor(0, position)(value)
            case Argument(value=inner, constructor=name, position=position):
                value = yield self._term(inner, bound, meanings)
                return self.sort(inner.sort).accessor(_place(inner.sort, name), position)(value)
            case Widen(term=inner):
                value = yield self._term(inner, bound, meanings)
                return self._real(value)
            case Negative(term=inner):
                value = yield self._term(inner, bound, meanings)
                return -value
            case Operation(operator=name, arguments=terms):
                arguments = yield self._terms(terms, bound, meanings)
                return implementation(OPERATORS[name].z3)(z3, *(self._fit(a, term.sort) for a in arguments))
            case Conditional(sort=sort):
                condition, then, otherwise = yield self._terms(term.children, bound, meanings)
                return z3.If(condition, self._fit(then, sort), self._fit(otherwise, sort))
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
                return self.sequence(units, sequence)
            case Length(sequence=SequenceRange(low=low, high=high)):
                one, other = yield self._terms((low, high), bound, meanings)
                return z3.If(other >= one, other - one + 1, z3.IntVal(0, self.context))
            case Length(sequence=sequence_term):
                value = yield self._term(sequence_term, bound, meanings)
                return z3.Length(value)
            case Index(sequence=sequence_term, index=index_term):
                value, at = yield self._terms((sequence_term, index_term), bound, meanings)
                # Z3's element outside a sequence may be no value of the sort: a negative number for a natural.
                return self.clamped(value[at], term.sort)
            case SequenceRange(low=low, high=high, sort=sequence):
                return self._range(low, high, sequence, term.span)
            case SetTerm():
                raise Unsupported("a set outside the right-hand side of `in`", term.span)
            case History(operator=operator):
                raise Unsupported(f"`{operator}`, which speaks of other steps", term.span)
            case _:
                assert_never(term)

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
        for one, other in ((term.left, term.right), (term.right, term.left)):
            if isinstance(one, SequenceRange) and not _is_written_out(one):
                same = yield self._same_range(one, other, bound, meanings)
                return same if term.operator == "==" else z3.Not(same)
        made = made_with(term)
        if made is not None:
            value = yield self._term(term.left, bound, meanings)
            same = self.sort(term.left.sort).recognizer(_place(term.left.sort, made))(value)
            return same if term.operator == "==" else z3.Not(same)
        left, right = yield self._terms((term.left, term.right), bound, meanings)
        if left.sort() != right.sort():
            left, right = self._real(left), self._real(right)
        return implementation(OPERATORS[term.operator].z3)(z3, left, right)

    def _same_function(self, sort: FunctionSort, one: Callable[..., Expr], other: Callable[..., Expr]) -> Expr:
        arguments = [self.fresh("k", parameter) for parameter in sort.parameters]
        equal = one(*arguments) == other(*arguments)
        allowed = self.all_of(self.member(p, a) for p, a in zip(sort.parameters, arguments, strict=True))
        return z3.ForAll(arguments, equal if allowed is None else z3.Implies(allowed, equal))

    def _same_range(
        self, one: SequenceRange, other: Term, bound: Mapping[Variable, Expr], meanings: Mapping[Variable, Meaning]
    ) -> Steps[Expr]:
        """That a range, which is no value of its own for the solver, is another sequence: the same length, and the
        same number at every position."""
        low, high = yield self._terms((one.low, one.high), bound, meanings)
        if isinstance(other, SequenceRange):
            start, end = yield self._terms((other.low, other.high), bound, meanings)
            return z3.Or(z3.And(low == start, high == end), z3.And(high < low, end < start))
        sequence = yield self._term(other, bound, meanings)
        length, k = z3.Length(sequence), self.fresh("k", INTEGER)
        inside = z3.And(k >= 0, k < length)
        count = z3.If(high >= low, high - low + 1, z3.IntVal(0, self.context))
        return z3.And(length == count, z3.ForAll([k], z3.Implies(inside, sequence[k] == low + k)))

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
        allowed = [member for member in members if member is not None]
        if term.quantifier is Quantifier.FORALL:
            return z3.ForAll(constants, z3.Implies(self._every(allowed), body) if allowed else body)
        within = self._every([*allowed, body])
        if term.quantifier is Quantifier.EXISTS:
            return z3.Exists(constants, within)
        if any(isinstance(variable.sort, FunctionSort) for variable in term.variables):
            raise Unsupported("unique existence of a function", term.span)
        others = [self.fresh(variable.name, variable.sort) for variable in term.variables]
        again = z3.substitute(within, *zip(constants, others, strict=True))
        equal = z3.And([one == other for one, other in zip(constants, others, strict=True)])
        exists = z3.Exists(constants, within)
        return z3.And(exists, z3.ForAll([*constants, *others], z3.Implies(z3.And(within, again), equal)))

    def _every(self, parts: list[Expr]) -> Expr:
        return self.all_of(parts) if parts else self.true()

    def _range(self, low: Term, high: Term, sort: SequenceSort, span: Span | None) -> Expr:
        if not (isinstance(low, Literal) and isinstance(high, Literal)):
            raise Unsupported("a range between bounds that are not numbers, as a value", span)
        first, last = int(low.value), int(high.value)
        if last - first > 1000:
            raise Unsupported("a range of more than 1000 numbers, as a value", span)
        return self.sequence([z3.Unit(z3.IntVal(k, self.context)) for k in range(first, last + 1)], sort)

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
            case IntegerSort() | NaturalSort():
                return z3.IntVal(int(value), self.context)
            case sort:
                raise Unsupported(f"{value!r} as a value of a {type(sort).__name__}", literal.span)

    def _real(self, expr: Expr) -> Expr:
        return z3.simplify(z3.ToReal(expr)) if z3.is_int_value(expr) else z3.ToReal(expr) if z3.is_int(expr) else expr

    def _fit(self, expr: Expr, sort: Sort) -> Expr:
        return self._real(expr) if isinstance(sort, RealSort) else expr

    def _equal(self, left: Expr, right: Expr) -> Expr:
        return left == right if left.sort() == right.sort() else self._real(left) == self._real(right)

    def _arithmetic(self, operator: str, left: Expr, right: Expr) -> Expr:
        if operator == "/" or left.sort() != right.sort():
            left, right = self._real(left), self._real(right)
        return implementation(OPERATORS[operator].z3)(z3, left, right)


def _place(sort: Sort, constructor: str) -> int:
    assert isinstance(sort, DataSort)
    return sort.constructors.index(sort.constructor(constructor))


def _is_written_out(term: SequenceRange) -> bool:
    return isinstance(term.low, Literal) and isinstance(term.high, Literal)


@dataclass(frozen=True, slots=True)
class _Made:
    """A formula's expression in a context that is asked nothing, and the sorts that it names, by their names there."""

    term: Term
    expr: Expr
    sorts: tuple[tuple[Sort, str], ...]


@dataclass(slots=True)
class _Known:
    """Formulas translated once for many questions, each of which has a context of its own and gets copies.

    A copy is made of the formula's structure alone. So a question's answer, and the steps that it takes, do not depend
    on what else was asked before: what solvers and simplifiers do in one context depends on all that was built in it.
    """

    made: dict[int, _Made] = field(default_factory=dict)
    """By the formula's identity."""
    plain: Translator = field(default_factory=Translator)
    """For formulas of which nothing is simplified or numbered as they are translated; others have one of their own."""

    def of(self, term: Term) -> _Made:
        """Raises Unsupported."""
        if id(term) not in self.made:
            asked = without_points(term)
            parts = list(subterms(asked))
            bound = [v.sort for part in parts if isinstance(part, Quantified) for v in part.variables]
            sorts = tuple(dict.fromkeys(components(*(part.sort for part in parts), *bound)))
            plain = not bound and all(isinstance(sort, _PLAIN) for sort in sorts)
            translator = self.plain if plain else Translator()
            expr = run(translator._term(asked, {}, {}))
            named = [sort for sort in sorts if isinstance(sort, _NAMED)]
            self.made[id(term)] = _Made(term, expr, tuple((sort, translator.sort(sort).name()) for sort in named))
        return self.made[id(term)]


_PLAIN = BoolSort | IntegerSort | NaturalSort | RealSort | StringSort
_NAMED = DataSort | EnumSort | OpaqueSort | TupleSort

_known: ContextVar[_Known | None] = ContextVar("formulas translated once", default=None)


@contextmanager
def translating_once() -> Iterator[None]:
    """Within the block, a formula that several questions ask about is translated for the first of them only."""
    before = _known.set(_Known())
    try:
        yield
    finally:
        _known.reset(before)
