"""A guarantee without its quantifiers, as an RML condition over the numbers that its equation carries.

The one-point rule: ``exists(x, y in REAL | in.at(x, y) and …)`` is what follows "and" at the one tuple of in.at,
``exists(x | out.command == move(x, 0) and …)`` what follows at the command's argument. Where that does not bind every
variable, the guarantee is refused with the reason; nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from avow.base.tuning.bounds import ATOMS_MADE
from avow.evaluation.evaluate import finite_values
from avow.formulas.cases import TooManyCases, lifted
from avow.formulas.disjunctions import Part, alternatives, conjunction
from avow.formulas.one_point_rule import made_with, solved
from avow.formulas.renaming import bound_names, rename_apart
from avow.language.operators import OPERATORS, Why
from avow.language.sorts import BOOL, BoolSort, DataSort, FunctionSort, RealSort, TupleSort
from avow.language.terms import (
    And,
    Apply,
    Argument,
    Arithmetic,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Role,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
)

from ..tuning import COMPARISONS
from .symbols import Points, Scalar, Symbol, Tracked, Variant, code, constant, equal
from .syntax import FALSE, TRUE, Calculation, Condition, NotRml, Number, Numeric, compare, every, opposite, size, some

_NOT_LIFTED = "it stands in a quantified formula within a term"

Bound = Mapping[str, Symbol]

_Case = tuple[Condition, list[Part], Bound]
"""One way in which a part can hold: what says so, what has to hold besides, and what it fixes."""


@dataclass(slots=True)
class Eliminator:
    """`symbols` are the inputs' and outputs', by qualified name."""

    symbols: Mapping[str, Symbol]
    _work: int = 0

    def condition(self, formula: Term) -> Condition:
        """Raises NotRml with the reason why the formula is none."""
        try:
            found = self._formula(rename_apart(lifted(formula)), {})
        except TooManyCases:
            raise NotRml(
                f"its conditionals (`if`, `min`, `max`, `abs`) make more than {ATOMS_MADE} comparisons"
            ) from None
        except RecursionError:
            raise NotRml("the formula is nested too deeply") from None
        if size(found) > COMPARISONS:
            raise NotRml(f"the condition without quantifiers has {size(found)} parts, more than {COMPARISONS}")
        return found

    def _formula(self, term: Term, bound: Bound) -> Condition:
        self._tick()
        match term:
            case Literal(value=bool() as value):
                return every([]) if value else some([])
            case Not(body=body):
                return opposite(self._formula(body, bound))
            case And(items=items):
                return every([self._formula(item, bound) for item in items])
            case Or(items=items):
                return some([self._formula(item, bound) for item in items])
            case Implies(left=left, right=right):
                return some([opposite(self._formula(left, bound)), self._formula(right, bound)])
            case Iff(left=left, right=right):
                return self._iff(left, right, bound)
            case Compare():
                return self._compare(term, bound)
            case In(item=item, collection=SetTerm(items=items) | SequenceTerm(items=items)):
                left_side = self._value(item, bound)
                return some([equal(left_side, self._value(each, bound)) for each in items])
            case Apply():
                return self._apply(term, bound)
            case Variable(sort=BoolSort()):
                return compare("==", self._number(term, bound), Number(Fraction(1)))
            case Quantified(quantifier=Quantifier.EXISTS):
                return self._exists(term.variables, term.body, True, bound)
            case Quantified(quantifier=Quantifier.FORALL):
                return opposite(self._exists(term.variables, term.body, False, bound))
            case Quantified(quantifier=Quantifier.UNIQUE):
                return self._unique(term, bound)
            case _:
                raise NotRml(f"a {type(term).__name__.lower()} is not expressible in RML")

    def _iff(self, left: Term, right: Term, bound: Bound) -> Condition:
        one, other = self._formula(left, bound), self._formula(right, bound)
        return every([some([opposite(one), other]), some([one, opposite(other)])])

    def _compare(self, term: Compare, bound: Bound) -> Condition:
        made = made_with(term)
        if made is not None:
            known = self._value(term.left, bound)
            assert isinstance(known, Variant)
            assert isinstance(term.left.sort, DataSort)
            return compare(term.operator, known.tag, Number(Fraction(code(term.left.sort, made))))
        if term.left.sort == BOOL:
            same = self._iff(term.left, term.right, bound)
            return same if term.operator == "==" else opposite(same)
        if term.operator in ("==", "!="):
            same = equal(self._value(term.left, bound), self._value(term.right, bound))
            return same if term.operator == "==" else opposite(same)
        return compare(term.operator, self._number(term.left, bound), self._number(term.right, bound))

    def _apply(self, term: Apply, bound: Bound) -> Condition:
        arguments = [self._value(a, bound) for a in term.arguments]
        tracked = self._tracked(term)
        if tracked is not None:
            return tracked.flag(tuple(arguments))
        points = self._points(term)
        return some(
            [
                every([holds, *(equal(a, p) for a, p in zip(arguments, parts, strict=True))])
                for holds, parts in points.tuples
            ]
        )

    def _tracked(self, term: Apply) -> Tracked | None:
        found = self.symbols.get(term.function.qualified) if isinstance(term.function, Variable) else None
        return found if isinstance(found, Tracked) else None

    def _points(self, term: Apply) -> Points:
        if isinstance(term.function, Variable):
            found = self.symbols.get(term.function.qualified)
            if isinstance(found, Points):
                return found
        raise NotRml("an application of a function that is no relation")

    def _value(self, term: Term, bound: Bound) -> Symbol:
        self._tick()
        match term:
            case Variable(role=Role.BOUND, name=name):
                if name in bound:
                    return bound[name]
                raise NotRml(f"nothing fixes {name}")
            case Variable():
                return self.symbols[term.qualified]
            case EnumValue(name=name, sort=sort):
                return Scalar(Number(Fraction(code(sort, name))))
            case Construct(constructor=name, arguments=arguments, sort=sort):
                given = tuple(self._value(a, bound) for a in arguments)
                rows = tuple(
                    given if c.name == name else tuple(Scalar(Number(Fraction(0))) for _ in c.parameters)
                    for c in sort.constructors
                )
                return Variant(Number(Fraction(code(sort, name))), rows)
            case Argument(value=whole, constructor=name, position=position):
                known = self._value(whole, bound)
                assert isinstance(known, Variant)
                assert isinstance(whole.sort, DataSort)
                return known.arguments[code(whole.sort, name) - 1][position]
            case _:  # a number, or refused by name
                return Scalar(self._number(term, bound))

    def _number(self, term: Term, bound: Bound) -> Numeric:
        match term:
            case Literal(value=value) if not isinstance(value, str):
                return Number(Fraction(value))
            case Widen(term=inside):
                return self._number(inside, bound)
            case Negative(term=inside):
                return self._calculate("-", Number(Fraction(0)), self._number(inside, bound), term)
            case Arithmetic(operator=operator, left=left, right=right):
                return self._calculate(operator, self._number(left, bound), self._number(right, bound), term)
            case Variable() | Argument():
                found = self._value(term, bound)
                if isinstance(found, Scalar):
                    return found.number
            case Operation(operator=name):
                said = OPERATORS[name].rml
                raise NotRml(f"`{name}`: {said.reason if isinstance(said, Why) else _NOT_LIFTED}")
            case Conditional():
                raise NotRml(f"`if`: {_NOT_LIFTED}")
        raise NotRml(f"{type(term).__name__.lower()} terms of this sort are not expressible in RML")

    def _calculate(self, operator: str, left: Numeric, right: Numeric, term: Term) -> Numeric:
        if isinstance(left, Number) and isinstance(right, Number):
            match operator:
                case "+":
                    return Number(left.value + right.value)
                case "-":
                    return Number(left.value - right.value)
                case "*":
                    return Number(left.value * right.value)
                case "/" if right.value:
                    return Number(left.value / right.value)
        if isinstance(term.sort, RealSort) or operator == "/":
            raise NotRml("it calculates with REAL numbers, which the RML monitor does in floating point")
        return Calculation(operator, left, right)

    def _unique(self, term: Quantified, bound: Bound) -> Condition:
        """One, and no other."""
        copy = rename_apart(And((term, term)))
        assert isinstance(copy, And)
        one, other = copy.items
        assert isinstance(one, Quantified)
        assert isinstance(other, Quantified)
        differ = Or(tuple(Compare("!=", a, b) for a, b in zip(one.variables, other.variables, strict=True)))
        two = And((one.body, other.body, differ))
        return every(
            [
                self._exists(one.variables, one.body, True, bound),
                opposite(self._exists((*one.variables, *other.variables), two, True, bound)),
            ]
        )

    def _exists(self, variables: Sequence[Variable], body: Term, positive: bool, bound: Bound) -> Condition:
        parts, inner = conjunction(body, positive)
        if len(parts) == 1:
            options = alternatives(parts[0].term, parts[0].positive)
            if options is not None:
                own = (*variables, *inner)
                return some([self._exists(own, option, truth, bound) for option, truth in options])
        return self._solve(parts, (*variables, *inner), bound)

    def _solve(self, parts: Sequence[Part], variables: Sequence[Variable], bound: Bound) -> Condition:
        self._tick()
        free = {v.name: v for v in variables if v.name not in bound}
        ready = [p for p in parts if not p.names & free.keys()]
        pending = [p for p in parts if p.names & free.keys()]
        known = every([self._part(p, bound) for p in ready])
        if not pending or known == FALSE:
            return known
        for at, part in enumerate(pending):
            others = [*pending[:at], *pending[at + 1 :]]
            cases = self._binders(part, free, bound)
            if cases is not None:
                found = [every([holds, self._solve([*more, *others], variables, now)]) for holds, more, now in cases]
                return every([known, some(found)])
        for at, part in enumerate(pending):
            others = [*pending[:at], *pending[at + 1 :]]
            options = alternatives(part.term, part.positive)
            if options is not None:
                branches = []
                for option, truth in options:
                    new, inner = conjunction(option, truth)
                    branches.append(self._solve([*new, *others], (*variables, *inner), bound))
                return every([known, some(branches)])
        for name, variable in free.items():
            finite = finite_values(variable.sort)
            if finite is not None and any(name in p.names for p in pending):
                found = [self._solve(pending, variables, {**bound, name: constant(v, variable.sort)}) for v in finite]
                return every([known, some(found)])
        names = ", ".join(sorted(n for n in free if any(n in p.names for p in pending)))
        raise NotRml(f"nothing fixes {names}")

    def _part(self, part: Part, bound: Bound) -> Condition:
        found = self._formula(part.term, bound)
        return found if part.positive else opposite(found)

    def _binders(self, part: Part, free: Mapping[str, Variable], bound: Bound) -> list[_Case] | None:
        """The ways in which a part can hold, each with what it fixes; None if the part fixes nothing."""
        match part.term:
            case Apply(
                function=Variable(role=Role.INPUT | Role.OUTPUT, sort=FunctionSort(parameters=sorts)) as relation,
                arguments=arguments,
            ) if part.positive:
                if self._tracked(part.term) is not None:
                    return None
                cases = []
                for k, (holds, row) in enumerate(self._points(part.term).tuples):
                    names = (f"{relation.qualified} row {k} {n}" for n in range(len(row)))
                    point = tuple(Variable(Role.BOUND, name, sort) for name, sort in zip(names, sorts, strict=True))
                    here = {**bound, **{v.name: symbol for v, symbol in zip(point, row, strict=True)}}
                    sort = TupleSort(sorts)
                    cases.append(self._case(TupleTerm(arguments, sort), TupleTerm(point, sort), free, here, holds))
            case Compare(operator=operator, left=left, right=right) if left.sort != BOOL and operator == (
                "==" if part.positive else "!="
            ):
                cases = [self._case(left, right, free, bound)]
            case In(item=item, collection=SetTerm(items=items) | SequenceTerm(items=items)) if part.positive:
                cases = [self._case(item, each, free, bound) for each in items]
            case _:  # fixes no variable
                return None
        found = [case for case in cases if case is not None]
        return found if len(found) == len(cases) else None

    def _case(
        self, left: Term, right: Term, free: Mapping[str, Variable], bound: Bound, holds: Condition = TRUE
    ) -> _Case | None:
        """That both sides are the same, where that fixes a variable."""
        found = solved(Compare("==", left, right), free.values())
        if found is None:
            return None
        more = [Part(term, True, bound_names(term)) for term in found.rest]
        return holds, more, {**bound, **{v.name: self._value(term, bound) for v, term in found.values.items()}}

    def _tick(self) -> None:
        self._work += 1
        if self._work > 200_000:
            raise NotRml("the quantifiers unfold into too many cases")
