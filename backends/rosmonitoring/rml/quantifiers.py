"""A guarantee without its quantifiers, as an RML condition over the numbers that its equation carries.

The one-point rule: ``exists(x, y in REAL | in.at(x, y) and …)`` is what follows "and" at the one tuple of in.at,
``exists(x | out.command == move(x, 0) and …)`` what follows at the command's argument. If that does not bind every
variable, the guarantee is refused with the reason; nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from avow.base.tuning.bounds import ATOMS_MADE
from avow.evaluation.evaluate import finite_values
from avow.formulas.cases import TooManyCases, lifted
from avow.formulas.disjunctions import Part, alternatives, conjunction
from avow.formulas.formula import conjunction as every_of
from avow.formulas.formula import disjunction
from avow.formulas.one_point_rule import made_with, solved
from avow.formulas.renaming import bound_names, rename_apart
from avow.formulas.traversal import transform
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.operators import OPERATORS, Why

from ..tuning import COMPARISONS
from . import syntax as rml
from .symbols import Numbers, Points, Symbol, Table, Tracked, code, equal, made, numbers, places

_INFINITE = (s.RealSort, s.IntegerSort, s.NaturalSort)
_NOT_LIFTED = "it is in a quantified formula within a term"

Bound = Mapping[str, Numbers]


@dataclass(slots=True)
class Eliminator:
    """`symbols` are the inputs' and outputs', by qualified name."""

    symbols: Mapping[str, Symbol]
    _work: int = 0

    def condition(self, formula: t.Term) -> rml.Condition:
        """Raises NotRml with the reason if the formula is not expressible."""
        try:
            found = self._formula(rename_apart(lifted(self._in_values(formula))), {})
        except TooManyCases:
            raise rml.NotRml(
                f"its conditionals (`if`, `min`, `max`, `abs`) make more than {ATOMS_MADE} comparisons"
            ) from None
        except RecursionError:
            raise rml.NotRml("the formula is nested too deeply") from None
        if rml.size(found) > COMPARISONS:
            raise rml.NotRml(f"the condition without quantifiers has {rml.size(found)} parts, more than {COMPARISONS}")
        return found

    def _in_values(self, formula: t.Term) -> t.Term:
        """Replace each application of a relation by its known tuples, of a function with a result by a choice (at its
        known arguments, or elsewhere), and membership in a listed collection by equations."""
        known = dict(self.symbols)

        def part(name: str, value: Numbers, sort: s.Sort) -> t.Variable:
            variable = t.Variable(t.Role.INPUT, name, sort)
            known[variable.qualified] = value
            return variable

        def same(term: t.Apply, k: int, row: Sequence[Numbers]) -> Iterator[t.Term]:
            for n, (argument, value) in enumerate(zip(term.arguments, row, strict=True)):
                yield t.Compare("==", argument, part(f"{_name(term)} argument {k} {n}", value, argument.sort))

        def chosen(term: t.Term) -> t.Term:
            if isinstance(term, t.In) and isinstance(term.collection, t.SetTerm | t.SequenceTerm):
                return disjunction(t.Compare("==", term.item, each) for each in term.collection.items)
            if not isinstance(term, t.Apply):
                return term
            match self.symbols.get(of := _name(term)):
                case Points(tuples=tuples):
                    holds = (part(f"{of} holds {k}", (flag,), s.BOOL) for k, (flag, _) in enumerate(tuples))
                    rows = (same(term, k, row) for k, (_, row) in enumerate(tuples))
                    return disjunction(every_of((flag, *row)) for flag, row in zip(holds, rows, strict=True))
                case Table(points=points, elsewhere=elsewhere):
                    choice: t.Term = part(f"{of} elsewhere", elsewhere, term.sort)
                    for k, (row, result) in enumerate(points):
                        there = part(f"{of} value {k}", result, term.sort)
                        choice = t.Conditional(every_of(same(term, k, row)), there, choice, term.sort)
                    return choice
                case _:  # any other application stays as it is
                    return term

        changed = transform(formula, chosen)
        self.symbols = known
        return changed

    def _formula(self, term: t.Term, bound: Bound) -> rml.Condition:
        self._tick()
        match term:
            case t.Literal(value=bool() as value):
                return rml.every([]) if value else rml.some([])
            case t.Not(body=body):
                return rml.opposite(self._formula(body, bound))
            case t.And(items=items):
                return rml.every([self._formula(item, bound) for item in items])
            case t.Or(items=items):
                return rml.some([self._formula(item, bound) for item in items])
            case t.Implies(left=left, right=right):
                return rml.some([rml.opposite(self._formula(left, bound)), self._formula(right, bound)])
            case t.Iff(left=left, right=right):
                return self._iff(left, right, bound)
            case t.Compare():
                return self._compare(term, bound)
            case t.Apply():
                return self._apply(term, bound)
            case t.Variable(sort=s.BoolSort()):
                return rml.compare("==", self._number(term, bound), rml.ONE)
            case t.Quantified(quantifier=t.Quantifier.EXISTS):
                return self._exists(term.variables, term.body, True, bound)
            case t.Quantified(quantifier=t.Quantifier.FORALL):
                return rml.opposite(self._exists(term.variables, term.body, False, bound))
            case t.Quantified(quantifier=t.Quantifier.UNIQUE):
                return self._unique(term, bound)
            case _:
                raise rml.NotRml(f"a {type(term).__name__.lower()} is not expressible in RML")

    def _iff(self, left: t.Term, right: t.Term, bound: Bound) -> rml.Condition:
        one, other = self._formula(left, bound), self._formula(right, bound)
        return rml.every([rml.some([rml.opposite(one), other]), rml.some([one, rml.opposite(other)])])

    def _compare(self, term: t.Compare, bound: Bound) -> rml.Condition:
        constructor = made_with(term)
        if constructor is not None:
            assert isinstance(term.left.sort, s.DataSort)
            known = self._value(term.left, bound)[0]
            return rml.compare(term.operator, known, rml.literal(code(term.left.sort, constructor)))
        if term.left.sort == s.BOOL:
            same = self._iff(term.left, term.right, bound)
            return same if term.operator == "==" else rml.opposite(same)
        if term.operator in ("==", "!="):
            same = equal(self._value(term.left, bound), self._value(term.right, bound), term.left.sort)
            return same if term.operator == "==" else rml.opposite(same)
        return rml.compare(term.operator, self._number(term.left, bound), self._number(term.right, bound))

    def _apply(self, term: t.Apply, bound: Bound) -> rml.Condition:
        tracked = self.symbols.get(_name(term))
        if not isinstance(tracked, Tracked):
            raise rml.NotRml("an application of a function that is no relation")
        return tracked.flag(tuple(self._value(argument, bound) for argument in term.arguments))

    def _value(self, term: t.Term, bound: Bound) -> Numbers:
        self._tick()
        match term:
            case t.Variable(role=t.Role.BOUND, name=name):
                if name in bound:
                    return bound[name]
                raise rml.NotRml(f"nothing fixes {name}")
            case t.Variable():
                found = self.symbols[term.qualified]
                if not isinstance(found, tuple):
                    raise rml.NotRml("an equation between relations")
                return found
            case t.EnumValue(name=name, sort=sort):
                return (rml.literal(code(sort, name)),)
            case t.Construct(constructor=name, arguments=arguments, sort=sort):
                return made(sort, name, (self._value(argument, bound) for argument in arguments))
            case t.Argument(value=whole, constructor=name, position=position):
                assert isinstance(whole.sort, s.DataSort)
                return (self._value(whole, bound)[places(whole.sort, name)[position]],)
            case _:  # a number, or refused by name
                return (self._number(term, bound),)

    def _number(self, term: t.Term, bound: Bound) -> rml.Numeric:
        match term:
            case t.Literal(value=value) if not isinstance(value, str):
                return rml.literal(value)
            case t.Widen(term=inside):
                return self._number(inside, bound)
            case t.Negative(term=inside):
                return self._calculate("-", rml.ZERO, self._number(inside, bound), term)
            case t.Arithmetic(operator=operator, left=left, right=right):
                return self._calculate(operator, self._number(left, bound), self._number(right, bound), term)
            case t.Variable() | t.Argument():
                found = self._value(term, bound)
                if len(found) == 1:
                    return found[0]
            case t.Operation(operator=name):
                said = OPERATORS[name].rml
                raise rml.NotRml(f"`{name}`: {said.reason if isinstance(said, Why) else _NOT_LIFTED}")
            case t.Conditional():
                raise rml.NotRml(f"`if`: {_NOT_LIFTED}")
        raise rml.NotRml(f"{type(term).__name__.lower()} terms of this sort are not expressible in RML")

    def _calculate(self, operator: str, left: rml.Numeric, right: rml.Numeric, term: t.Term) -> rml.Numeric:
        found = rml.calculation(operator, left, right)
        if isinstance(found, t.Arithmetic) and (isinstance(term.sort, s.RealSort) or operator == "/"):
            raise rml.NotRml("it calculates with REAL numbers, which the RML monitor does in floating point")
        return found

    def _unique(self, term: t.Quantified, bound: Bound) -> rml.Condition:
        """Exactly one."""
        copy = rename_apart(t.And((term, term)))
        assert isinstance(copy, t.And)
        one, other = copy.items
        assert isinstance(one, t.Quantified)
        assert isinstance(other, t.Quantified)
        differ = t.Or(tuple(t.Compare("!=", a, b) for a, b in zip(one.variables, other.variables, strict=True)))
        two = t.And((one.body, other.body, differ))
        return rml.every(
            [
                self._exists(one.variables, one.body, True, bound),
                rml.opposite(self._exists((*one.variables, *other.variables), two, True, bound)),
            ]
        )

    def _exists(self, variables: Sequence[t.Variable], body: t.Term, positive: bool, bound: Bound) -> rml.Condition:
        parts, inner = conjunction(body, positive)
        return self._solve(parts, (*variables, *inner), bound, t.TRUE)

    def _solve(
        self, parts: Sequence[Part], variables: Sequence[t.Variable], bound: Bound, given: rml.Condition
    ) -> rml.Condition:
        """The condition that some values of the free variables meet all parts. `given`: the facts that hold around it;
        if they contradict the parts, no variable has to be fixed."""
        self._tick()
        free = {v.name: v for v in variables if v.name not in bound}
        ready = [p for p in parts if not p.names & free.keys()]
        pending = [p for p in parts if p.names & free.keys()]
        known = rml.every([self._part(p, bound) for p in ready])
        facts = rml.every([given, known])
        if facts == t.FALSE:
            return t.FALSE
        if not pending:
            return known
        for at, part in enumerate(pending):
            others = [*pending[:at], *pending[at + 1 :]]
            if (fixed := self._fixed(part, free, bound)) is not None:
                more, now = fixed
                return rml.every([known, self._solve([*more, *others], variables, now, facts)])
        for at, part in enumerate(pending):
            others = [*pending[:at], *pending[at + 1 :]]
            options = alternatives(part.term, part.positive)
            if options is not None:
                branches = []
                for option, truth in options:
                    new, inner = conjunction(option, truth)
                    branches.append(self._solve([*new, *others], (*variables, *inner), bound, facts))
                return rml.every([known, rml.some(branches)])
        for name, variable in free.items():
            finite = finite_values(variable.sort)
            if any(name in p.names for p in pending) and finite is not None:
                values = [numbers(v, variable.sort) for v in finite]
                found = [self._solve(pending, variables, {**bound, name: value}, facts) for value in values]
                return rml.every([known, rml.some(found)])
            if any(name in p.names for p in pending) and isinstance(variable.sort, _INFINITE):
                anything = rml.variable(f"{name}?{self._work}")
                open_ = self._solve(pending, variables, {**bound, name: (anything,)}, facts)
                left = rml.without_exclusions(open_, anything)
                if left is not None:
                    return rml.every([known, left])
        names = ", ".join(sorted(n for n in free if any(n in p.names for p in pending)))
        raise rml.NotRml(f"nothing fixes {names}")

    def _part(self, part: Part, bound: Bound) -> rml.Condition:
        found = self._formula(part.term, bound)
        return found if part.positive else rml.opposite(found)

    def _fixed(self, part: Part, free: Mapping[str, t.Variable], bound: Bound) -> tuple[list[Part], Bound] | None:
        """For an equation, the remaining parts, and the values with those of the variables that it fixes; None if the
        part fixes none."""
        term, operator = part.term, "==" if part.positive else "!="
        if not isinstance(term, t.Compare) or term.operator != operator or term.left.sort == s.BOOL:
            return None
        found = solved(t.Compare("==", term.left, term.right), free.values())
        if found is None:
            return None
        more = [Part(rest, True, bound_names(rest)) for rest in found.rest]
        return more, {**bound, **{v.name: self._value(value, bound) for v, value in found.values.items()}}

    def _tick(self) -> None:
        self._work += 1
        if self._work > 200_000:
            raise rml.NotRml("the quantifiers unfold into too many cases")


def _name(term: t.Apply) -> str:
    """The name of the variable that is applied; empty for another function."""
    return term.function.qualified if isinstance(term.function, t.Variable) else ""
