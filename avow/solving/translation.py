"""THE translation of typed terms to Z3: every question to Z3 goes through here.

Threads share nothing: each has Z3 contexts of its own (`avow.solving.z3_sorts.Session`). NATURAL is Int, relativised: a
quantifier over it (or over a sort that contains it) ranges over its members only, and `background` asserts membership
of free variables. A free function-typed variable is an uninterpreted function; a bound one an array. Partial operations
outside their domain (division by zero, an element beyond a sequence's end) are unspecified: no interpretation is chosen
here, so that proofs hold under each (`avow.solving.questions` ensures the same for satisfiability).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from typing import Any, assert_never

from avow.base.diagnostics import Span
from avow.base.optional import complete
from avow.base.tuning.bounds import FORMULAS_KEPT, ROOTS_COMPARED
from avow.formulas.one_point_rule import made_with, without_points
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.enclosures import NotEvaluable, Number
from avow.language.facts import fact, known, together
from avow.language.operators import OPERATORS, implementation
from avow.solving.z3_module import z3
from avow.solving.z3_sorts import (
    Expr,
    Meaning,
    Root,
    Sorts,
    Unsupported,
    kept_session,
    new_session,
    parts_of,
    same_session,
)

__all__ = ["Expr", "Meaning", "Translator", "Unsupported", "kept_session", "new_session", "same_session"]


class Translator(Sorts):
    """Sorts, variables and terms of one session; the same variable always becomes the same Z3 symbol."""

    # -- variables -----------------------------------------------------------------------------------------------------

    def variable(self, variable: t.Variable) -> Expr:
        """The constant for a free variable that is not a function."""
        constants = self.session.constants
        if variable not in constants:
            constants[variable] = z3.Const(variable.qualified, self.sort(variable.sort))
        return constants[variable]

    def function(self, variable: t.Variable) -> Any:
        """The uninterpreted function for a free function-typed variable."""
        constants = self.session.constants
        if variable not in constants:
            sort = variable.sort
            assert isinstance(sort, s.FunctionSort)
            signature = [*(self.field(p) for p in sort.parameters), self.field(sort.result)]
            constants[variable] = z3.Function(variable.qualified, *signature)
        return constants[variable]

    def background(
        self, variables: Iterable[t.Variable], meanings: Mapping[t.Variable, Meaning] | None = None
    ) -> list[Expr]:
        """Facts from the types of free variables: naturals are not negative, wherever they occur."""
        facts = []
        for variable in sorted(variables, key=lambda v: (v.qualified, repr(v.sort))):
            if isinstance(variable.sort, s.FunctionSort):
                fact = self.function_member(variable.sort, self._callable(variable, {}, meanings or {}))
            else:
                fact = self.member(variable.sort, self._value_of(variable, {}, meanings or {}))
            if fact is not None:
                facts.append(fact)
        return facts

    # -- terms ---------------------------------------------------------------------------------------------------------

    def term(
        self,
        term: t.Term,
        meanings: Mapping[t.Variable, Meaning] | None = None,
        bound: Mapping[t.Variable, Expr] | None = None,
    ) -> Expr:
        """The Z3 expression of a term. `meanings` replaces free variables, `bound` gives bound variables of an outer
        quantifier. Raises Unsupported."""
        if bound or meanings:
            return self._term(without_points(term), dict(bound or {}), meanings or {})
        formulas = self.session.formulas
        if id(term) not in formulas:
            if len(formulas) >= FORMULAS_KEPT:
                formulas.clear()
            formulas[id(term)] = term, self._term(without_points(term), {}, {})
        return formulas[id(term)][1]

    def _term(self, term: t.Term, bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]) -> Expr:
        match term:
            case t.Variable():
                return self._value_of(term, bound, meanings)
            case t.Apply(function=function, arguments=terms):
                if not isinstance(function, t.Variable):
                    raise Unsupported("the application of something other than a variable", term.span)
                arguments = self._terms(terms, bound, meanings)
                apply = self._callable(function, bound, meanings)
                sort = function.sort
                assert isinstance(sort, s.FunctionSort)
                return apply(*(self._fit(a, p) for a, p in zip(arguments, sort.parameters, strict=True)))
            case t.Compare():
                return self._compare(term, bound, meanings)
            case t.In():
                return self._in(term, bound, meanings)
            case t.Quantified():
                return self._quantified(term, bound, meanings)
            case t.Length(sequence=t.SequenceRange(low=low, high=high)):
                one, other = self._terms((low, high), bound, meanings)
                return z3.If(other >= one, other - one + 1, z3.IntVal(0, self.context))
            case _:  # determined by its parts
                parts = self._terms(term.children, bound, meanings)
                return self._made(term, parts)

    def _made(self, term: t.Term, parts: list[Expr]) -> Expr:
        """A term's expression, from those of its children."""
        match term:
            case t.Literal():
                return self._literal(term)
            case t.EnumValue(name=name, sort=enum):
                return self.sort(enum).constructor(enum.members.index(name))()
            case t.Construct(constructor=name, sort=data):
                fitted = [self._fit(a, p) for a, p in zip(parts, data.constructor(name).parameters, strict=True)]
                return self.sort(data).constructor(_place(data, name))(*fitted)
            case t.TupleTerm(sort=tuple_sort):
                fitted = [self._fit(a, p) for a, p in zip(parts, tuple_sort.items, strict=True)]
                return self.sort(tuple_sort).constructor(0)(*fitted)
            case t.SequenceTerm(sort=sequence):
                return self.sequence([z3.Unit(self._fit(part, sequence.item)) for part in parts], sequence)
            case t.SequenceRange(low=low, high=high, sort=sequence):
                return self._range(low, high, sequence, term.span)
            case t.Item(record=record, position=position):
                return self.sort(record.sort).accessor(0, position)(*parts)
            case t.Argument(value=value, constructor=name, position=position):
                return self.sort(value.sort).accessor(_place(value.sort, name), position)(*parts)
            case t.Length():
                return z3.Length(*parts)
            case t.Index():
                # Z3's element outside a sequence may not be a value of the sort: a negative number for a natural.
                return self.clamped(parts[0][parts[1]], term.sort)
            case t.Widen():
                return self._real(*parts)
            case t.Negative():
                return -parts[0]
            case t.Operation(operator=t.Builtin.SQRT):
                return self.root(self._real(*parts))
            case t.Operation(operator=t.Builtin.SIN | t.Builtin.COS | t.Builtin.ATAN2 as name):
                return self._circular(name, tuple(map(self._real, parts))).constants[name is t.Builtin.COS]
            case t.Operation(operator=name):
                return implementation(OPERATORS[name].z3)(z3, *(self._fit(part, term.sort) for part in parts))
            case t.Conditional(sort=sort):
                condition, then, otherwise = parts
                return z3.If(condition, self._fit(then, sort), self._fit(otherwise, sort))
            case t.Arithmetic(operator=operator):
                return self._arithmetic(operator, *parts)
            case t.Not():
                return z3.Not(*parts)
            case t.And():
                return z3.And(parts) if parts else self.true()
            case t.Or():
                return z3.Or(parts) if parts else z3.Not(self.true())
            case t.Implies():
                return z3.Implies(*parts)
            case t.Iff():
                return parts[0] == parts[1]
            case t.SetTerm():
                raise Unsupported("a set outside the right-hand side of `in`", term.span)
            case t.History(operator=operator):
                raise Unsupported(f"`{operator}`, which speaks of other steps", term.span)
            case t.Variable() | t.Apply() | t.Compare() | t.In() | t.Quantified():
                raise AssertionError("its expression is more than those of its children")
            case _:
                assert_never(term)

    def _terms(
        self, terms: Iterable[t.Term], bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]
    ) -> list[Expr]:
        return [self._term(term, bound, meanings) for term in terms]

    def _value_of(
        self, variable: t.Variable, bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]
    ) -> Expr:
        if isinstance(variable.sort, s.FunctionSort) and variable not in bound:
            raise Unsupported("a function as a value", variable.span)
        for scope in (bound, meanings):
            if variable in scope:
                return scope[variable]
        return self.variable(variable)

    def _callable(
        self, variable: t.Variable, bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]
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
        self, term: t.Compare, bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]
    ) -> Expr:
        if isinstance(term.left.sort, s.FunctionSort):
            if not (isinstance(term.left, t.Variable) and isinstance(term.right, t.Variable)):
                raise Unsupported("the comparison of functions that are not variables", term.span)
            same = self._same_function(
                term.left.sort, *(self._callable(side, bound, meanings) for side in (term.left, term.right))
            )
            return same if term.operator == "==" else z3.Not(same)
        for one, other in ((term.left, term.right), (term.right, term.left)):
            if isinstance(one, t.SequenceRange) and not _is_written_out(one):
                same = self._same_range(one, other, bound, meanings)
                return same if term.operator == "==" else z3.Not(same)
        made = made_with(term)
        if made is not None:
            value = self._term(term.left, bound, meanings)
            same = self.sort(term.left.sort).recognizer(_place(term.left.sort, made))(value)
            return same if term.operator == "==" else z3.Not(same)
        left, right = self._terms((term.left, term.right), bound, meanings)
        if left.sort() != right.sort():
            left, right = self._real(left), self._real(right)
        return implementation(OPERATORS[term.operator].z3)(z3, left, right)

    def _same_function(self, sort: s.FunctionSort, one: Callable[..., Expr], other: Callable[..., Expr]) -> Expr:
        arguments = [self.fresh("k", parameter) for parameter in sort.parameters]
        equal = one(*arguments) == other(*arguments)
        allowed = self.all_of(self.member(p, a) for p, a in zip(sort.parameters, arguments, strict=True))
        return z3.ForAll(arguments, equal if allowed is None else z3.Implies(allowed, equal))

    def _same_range(
        self,
        one: t.SequenceRange,
        other: t.Term,
        bound: Mapping[t.Variable, Expr],
        meanings: Mapping[t.Variable, Meaning],
    ) -> Expr:
        """The equality of a range, which the solver has no value for, and another sequence: the same length, and the
        same number at every position."""
        low, high = self._terms((one.low, one.high), bound, meanings)
        if isinstance(other, t.SequenceRange):
            start, end = self._terms((other.low, other.high), bound, meanings)
            return z3.Or(z3.And(low == start, high == end), z3.And(high < low, end < start))
        sequence = self._term(other, bound, meanings)
        length, k = z3.Length(sequence), self.fresh("k", s.INTEGER)
        inside = z3.And(k >= 0, k < length)
        count = z3.If(high >= low, high - low + 1, z3.IntVal(0, self.context))
        return z3.And(length == count, z3.ForAll([k], z3.Implies(inside, sequence[k] == low + k)))

    def _in(self, term: t.In, bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]) -> Expr:
        item = self._term(term.item, bound, meanings)
        match term.collection:
            case t.SetTerm(items=items) | t.SequenceTerm(items=items):
                values = self._terms(items, bound, meanings)
                equal = [self._equal(item, value) for value in values]
                return z3.Or(equal) if equal else z3.Not(self.true())
            case t.SequenceRange(low=low, high=high):
                one, other = self._terms((low, high), bound, meanings)
                return z3.And(one <= item, item <= other)
            case collection:
                sequence = self._term(collection, bound, meanings)
                assert isinstance(collection.sort, s.SequenceSort)
                return z3.Contains(sequence, z3.Unit(self._fit(item, collection.sort.item)))

    def _quantified(
        self, term: t.Quantified, bound: Mapping[t.Variable, Expr], meanings: Mapping[t.Variable, Meaning]
    ) -> Expr:
        constants = [self.fresh(variable.name, variable.sort) for variable in term.variables]
        inner = {**bound, **dict(zip(term.variables, constants, strict=True))}
        body = self._term(term.body, inner, meanings)
        members = [self.member(v.sort, c) for v, c in zip(term.variables, constants, strict=True)]
        for root in self.root_facts([body]):
            if not {c.get_id() for c in constants}.isdisjoint(part.get_id() for part in parts_of([root.fact])):
                if root.is_bounded:  # bounds would weaken one quantifier, and strengthen another
                    raise Unsupported(f"`{root.operations[0]}` of what is quantified", term.span)
                constants += root.constants  # it is another number for other values of the variables
                members.append(root.fact)
        allowed = [member for member in members if member is not None]
        if term.quantifier is t.Quantifier.FORALL:
            return z3.ForAll(constants, z3.Implies(self._every(allowed), body) if allowed else body)
        within = self._every([*allowed, body])
        if term.quantifier is t.Quantifier.EXISTS:
            return z3.Exists(constants, within)
        if any(isinstance(variable.sort, s.FunctionSort) for variable in term.variables):
            raise Unsupported("unique existence of a function", term.span)
        if len(constants) > len(term.variables):
            raise Unsupported("a square root under `exists_unique`", term.span)
        others = [self.fresh(variable.name, variable.sort) for variable in term.variables]
        again = z3.substitute(within, *zip(constants, others, strict=True))
        equal = z3.And([one == other for one, other in zip(constants, others, strict=True)])
        exists = z3.Exists(constants, within)
        return z3.And(exists, z3.ForAll([*constants, *others], z3.Implies(z3.And(within, again), equal)))

    # -- values of which bounds are known ------------------------------------------------------------------------------

    def _circular(self, name: t.Builtin, arguments: tuple[Expr, ...]) -> Root:
        """Constants for a sine and a cosine, or for an angle; `facts_of` say what is known of them."""
        of = together(name)
        roots, key = self.session.roots, (of[0], *(a.get_id() for a in arguments))
        if key not in roots:
            made = tuple(z3.Real(f"{each}!{len(roots)}", self.context) for each in of)
            angles = (root.parts for root in roots.values() if t.Builtin.ATAN2 in root.operations)
            inner = next((parts for parts in angles if parts[-1].eq(arguments[0])), None) if of[1:] else None
            values = [self._value(each, arguments) for each in of]
            facts = itertools.starmap(self.term, known(of, (*arguments, *made), values, (), inner))
            roots[key] = Root(of, arguments, made, z3.And(list(facts)))
        return roots[key]

    def facts_of(self, roots: Sequence[Root]) -> list[Expr]:
        """What is known of the roots of a question, one by one and in pairs."""
        facts = [root.fact for root in roots]
        for operation in (t.Builtin.SIN, t.Builtin.ATAN2):
            alike = [root for root in roots if operation in root.operations][:ROOTS_COMPARED]
            facts += itertools.starmap(self._beside, itertools.combinations(alike, 2))
        self.session.stated.update(each.get_id() for each in facts)
        return facts

    def facts_near(self, exprs: Iterable[Expr], value: Callable[[Expr], Expr]) -> list[Expr]:
        """What is known of the roots that occur because of their exact values at one point."""
        facts = []
        for root in self.root_facts(exprs):
            point = tuple(map(value, root.arguments))
            if root.is_bounded and all(map(z3.is_rational_value, point)):
                at = self._circular(root.operations[0], point)
                facts += [at.fact, self._beside(root, at)]
        return facts

    def _beside(self, one: Root, other: Root) -> Expr:
        """What is known of two sines or angles together."""
        made, key = self.session.beside, (one.constants[0].get_id(), other.constants[0].get_id())
        if key not in made:
            names = ("vectors", "turned") if t.Builtin.ATAN2 in one.operations else ("angles",)
            fixed = any(all(map(z3.is_rational_value, root.arguments)) for root in (one, other))
            facts = [fact(name, *one.parts, *other.parts) for name in names[: 1 + fixed]]
            made[key] = z3.And(list(itertools.starmap(self.term, facts)))
        return made[key]

    def _number(self, expr: Expr) -> Number | None:
        """The value of an expression without variables; None for any other."""
        if z3.is_rational_value(expr) or z3.is_int_value(expr):
            return Fraction(expr.as_fraction() if z3.is_rational_value(expr) else expr.as_long())
        for root in self.session.roots.values():
            for constant, operation in zip(root.constants, root.operations, strict=True):
                if constant.eq(expr):
                    return self._value(operation, root.arguments)
        if z3.is_to_real(expr):
            return self._number(expr.arg(0))
        signs = {"+": z3.is_add, "-": z3.is_sub, "*": z3.is_mul, "/": z3.is_div}
        sign = next((sign for sign, is_so in signs.items() if is_so(expr)), None)
        return None if sign is None else self._value(sign, expr.children())

    def _value(self, operation: str, arguments: Iterable[Expr]) -> Number | None:
        numbers: list[Number] | None = complete(map(self._number, arguments))
        if numbers is None:
            return None
        act = implementation(OPERATORS[operation].evaluate)
        try:
            found: Number = reduce(act, numbers) if operation in "+-*/" else act(*numbers)
        except NotEvaluable:
            return None
        return found

    def _every(self, parts: list[Expr]) -> Expr:
        return self.all_of(parts) if parts else self.true()

    def _range(self, low: t.Term, high: t.Term, sort: s.SequenceSort, span: Span | None) -> Expr:
        if not (isinstance(low, t.Literal) and isinstance(high, t.Literal)):
            raise Unsupported("a range between bounds that are not numbers, as a value", span)
        first, last = int(low.value), int(high.value)
        if last - first > 1000:
            raise Unsupported("a range of more than 1000 numbers, as a value", span)
        return self.sequence([z3.Unit(z3.IntVal(k, self.context)) for k in range(first, last + 1)], sort)

    # -- atoms and arithmetic ------------------------------------------------------------------------------------------

    def _literal(self, literal: t.Literal) -> Expr:
        value = literal.value
        match literal.sort:
            case s.RealSort() if not isinstance(value, bool | str):
                return self.real(Fraction(value))
            case s.StringSort():
                return self.string(str(value), literal.span)
            case _ if isinstance(value, bool):
                return z3.BoolVal(value, self.context)
            case _ if isinstance(value, Fraction) and value.denominator != 1:
                return self.real(value)
            case s.IntegerSort() | s.NaturalSort():
                return z3.IntVal(int(value), self.context)
            case sort:
                raise Unsupported(f"{value!r} as a value of a {type(sort).__name__}", literal.span)

    def _real(self, expr: Expr) -> Expr:
        return z3.simplify(z3.ToReal(expr)) if z3.is_int_value(expr) else z3.ToReal(expr) if z3.is_int(expr) else expr

    def _fit(self, expr: Expr, sort: s.Sort) -> Expr:
        return self._real(expr) if isinstance(sort, s.RealSort) else expr

    def _equal(self, left: Expr, right: Expr) -> Expr:
        return left == right if left.sort() == right.sort() else self._real(left) == self._real(right)

    def _arithmetic(self, operator: str, left: Expr, right: Expr) -> Expr:
        if operator == "/" or left.sort() != right.sort():
            left, right = self._real(left), self._real(right)
        return implementation(OPERATORS[operator].z3)(z3, left, right)


def _place(sort: s.Sort, constructor: str) -> int:
    assert isinstance(sort, s.DataSort)
    return sort.constructors.index(sort.constructor(constructor))


def _is_written_out(term: t.SequenceRange) -> bool:
    return isinstance(term.low, t.Literal) and isinstance(term.high, t.Literal)
