"""Formulas without quantifiers that are equivalent to given ones, and Z3's expressions read back as terms.

Elimination works for linear arithmetic, enumerations and truth values; not for functions or strings.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from avow.base.tuning.effort import ELIMINATION_SECONDS, ELIMINATION_STEPS, STEPS
from avow.formulas.formula import conjunction, disjunction, free_variables, negation
from avow.formulas.negation_normal_form import push_negations
from avow.language import terms as t
from avow.language.operators import FLIPPED
from avow.language.sorts import BOOL, INTEGER, REAL, BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort
from avow.solving.checking import charge, put
from avow.solving.translation import Expr, Translator, Unsupported
from avow.solving.z3_module import z3

ELIMINABLE = (BoolSort, RealSort, IntegerSort, NaturalSort, EnumSort)


def eliminable(term: t.Term) -> bool:
    """Whether all the term's free variables have sorts that `eliminated` supports."""
    return all(isinstance(v.sort, ELIMINABLE) for v in free_variables(term))


def eliminated(formula: t.Term) -> t.Term | None:
    """A formula without quantifiers that should be equivalent; None if none is found. The caller has to confirm that:
    Z3's tactics have lost parts of a formula before."""
    try:
        return _eliminate(formula)
    except (Unsupported, z3.Z3Exception, RecursionError):  # terms too deep to be read back
        return None


def _eliminate(formula: t.Term) -> t.Term | None:
    translator = Translator()
    goal = z3.Goal(ctx=translator.context)
    goal.add(translator.term(formula))
    chain = z3.Then(
        z3.Tactic("simplify", ctx=translator.context),
        z3.Tactic("qe", ctx=translator.context),
        z3.Tactic("ctx-simplify", ctx=translator.context),
        ctx=translator.context,
    )
    solver, before = chain.solver(), translator.session.steps
    solver.add(goal.as_expr())
    put(translator, solver, ELIMINATION_STEPS / STEPS, None)  # applying it has no limit of its own
    if translator.session.steps - before >= ELIMINATION_STEPS:
        return None
    result = z3.TryFor(chain, 1000 * ELIMINATION_SECONDS, ctx=translator.context).apply(goal)
    charge(translator)
    free = {v.qualified: v for v in free_variables(formula)}
    reader = TermReader(translator, free)
    options = [conjunction(reader.formula(expr) for expr in subgoal) for subgoal in result]
    return push_negations(disjunction(options))


class TermReader:
    """Z3 expressions, back to terms. Raises Unsupported for an expression without counterpart."""

    def __init__(self, translator: Translator, free: Mapping[str, t.Variable]) -> None:
        self.free = free
        self.members: dict[str, t.EnumValue] = {}
        for variable in free.values():
            if isinstance(variable.sort, EnumSort):
                datatype = translator.sort(variable.sort)
                for k, member in enumerate(variable.sort.members):
                    self.members[datatype.constructor(k).name()] = t.EnumValue(member, variable.sort)

    def formula(self, expr: Expr) -> t.Term:
        parts = expr.children() if z3.is_app(expr) else []
        if z3.is_true(expr):
            return t.TRUE
        if z3.is_false(expr):
            return t.FALSE
        if z3.is_not(expr):
            return negation(self.formula(parts[0]))
        if z3.is_and(expr):
            return conjunction(map(self.formula, parts))
        if z3.is_or(expr):
            return disjunction(map(self.formula, parts))
        if z3.is_implies(expr):
            return t.Implies(self.formula(parts[0]), self.formula(parts[1]))
        if z3.is_eq(expr) or z3.is_distinct(expr):
            if z3.is_bool(parts[0]):
                same: t.Term = t.Iff(self.formula(parts[0]), self.formula(parts[1]))
                return same if z3.is_eq(expr) else negation(same)
            return self._compare("==" if z3.is_eq(expr) else "!=", expr)
        for test, operator in ((z3.is_le, "<="), (z3.is_lt, "<"), (z3.is_ge, ">="), (z3.is_gt, ">")):
            if test(expr):
                return self._compare(operator, expr)
        if z3.is_app_of(expr, z3.Z3_OP_DT_IS):
            member = self.members.get(expr.decl().params()[0].name())
            if member is not None:
                return t.Compare("==", self.term(parts[0]), member)
        if z3.is_const(expr) and z3.is_bool(expr) and expr.decl().name() in self.free:
            return self.free[expr.decl().name()]
        raise Unsupported(f"the condition {expr}")

    def _compare(self, operator: str, expr: Expr) -> t.Term:
        left, right = (self.term(part) for part in expr.children())
        if isinstance(left.sort, RealSort) != isinstance(right.sort, RealSort):
            left, right = _widened(left), _widened(right)
        if isinstance(right, t.Variable) and not isinstance(left, t.Variable):
            left, right, operator = right, left, FLIPPED.get(operator, operator)
        return t.Compare(operator, left, right)

    def term(self, expr: Expr) -> t.Term:
        if z3.is_int_value(expr):
            return t.Literal(int(expr.as_long()), INTEGER)
        if z3.is_rational_value(expr):
            return t.Literal(Fraction(expr.numerator_as_long(), expr.denominator_as_long()), REAL)
        if z3.is_const(expr):
            name = expr.decl().name()
            if name in self.free:
                return self.free[name]
            if name in self.members:
                return self.members[name]
        if z3.is_to_real(expr):
            return _widened(self.term(expr.children()[0]))
        if z3.is_app_of(expr, z3.Z3_OP_ITE) and z3.is_arith(expr):
            condition, *branches = expr.children()
            then, otherwise = map(self.term, branches)
            sort = REAL if z3.is_real(expr) else INTEGER
            if sort == REAL:
                then, otherwise = _widened(then), _widened(otherwise)
            return t.Conditional(self.formula(condition), then, otherwise, sort)
        for test, operator in ((z3.is_add, "+"), (z3.is_sub, "-"), (z3.is_mul, "*")):
            if test(expr):
                first, *rest = (self.term(part) for part in expr.children())
                sort = REAL if z3.is_real(expr) else INTEGER
                for part in rest:
                    first = _arithmetic(operator, first, part, sort)
                return first
        raise Unsupported(f"the term {expr}")


def _arithmetic(operator: str, left: t.Term, right: t.Term, sort: RealSort | IntegerSort) -> t.Term:
    if operator == "+" and isinstance(right, t.Arithmetic) and right.operator == "*" and _is_minus_one(right.left):
        return t.Arithmetic("-", left, right.right, sort)
    return t.Arithmetic(operator, left, right, sort)


def _is_minus_one(term: t.Term) -> bool:
    return isinstance(term, t.Literal) and term.sort != BOOL and term.value == -1


def _widened(term: t.Term) -> t.Term:
    if isinstance(term.sort, RealSort):
        return term
    if isinstance(term, t.Literal) and not isinstance(term.value, str):
        return t.Literal(Fraction(term.value), REAL)
    return t.Widen(term, REAL)
