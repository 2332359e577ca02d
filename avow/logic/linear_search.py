"""``exists(a, b in REAL | …)`` where a and b occur in linear inequalities only, and everything else has a value.

``exists(a in REAL | forall(x in REAL | in.p(x) -> a - 1 <= x and x <= a + 1))``: the inner quantifier is restricted to
the points of a table, so that the formula is a system of inequalities in a, which is decided exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import product

from avow.language.sorts import RealSort
from avow.language.terms import (
    And,
    Arithmetic,
    Compare,
    Implies,
    Negative,
    Not,
    Or,
    Quantified,
    Quantifier,
    Term,
    Variable,
)
from avow.logic.clausal import Part, conjunction
from avow.logic.evaluate import Code, Compiler, Env, NotEvaluable
from avow.logic.linear import Constraint, Linear, TooMany, satisfy
from avow.logic.renaming import bound_names

Alternatives = Callable[[Env], list[tuple[Constraint, ...]]]
"""The formula as a disjunction of systems, given the other variables' values."""

_LIMIT = 256


def linear_step(
    compiler: Compiler, parts: Sequence[Part], variables: Sequence[Variable]
) -> Callable[[Env], Iterable[object]] | None:
    """Binds the variables to values that meet every part, if there are any; None if the parts are not of this kind."""
    if any(not isinstance(v.sort, RealSort) or v.sort in compiler.domains for v in variables):
        return None
    names = tuple(v.name for v in variables)
    systems = _all([_formula(compiler, p.term, p.positive, frozenset(names)) for p in parts])
    if systems is None:
        return None
    slots = tuple(compiler.bind(v) for v in variables)

    def run(env: Env) -> Iterator[None]:
        for system in systems(env):
            try:
                values = satisfy(system, names)
            except TooMany:
                raise NotEvaluable("the inequalities are too many to solve") from None
            if values is not None:
                for slot, name in zip(slots, names, strict=True):
                    env[slot] = values[name]
                yield None

    return run


def _formula(compiler: Compiler, term: Term, positive: bool, unknown: frozenset[str]) -> Alternatives | None:
    if not bound_names(term) & unknown:
        code = compiler.code(term)
        return lambda env: [()] if code(env) is positive else []
    match term:
        case Not(body=body):
            return _formula(compiler, body, not positive, unknown)
        case And(items=items) | Or(items=items):
            sides = [_formula(compiler, item, positive, unknown) for item in items]
            return _all(sides) if isinstance(term, And) is positive else _any(sides)
        case Implies(left=left, right=right):
            return _formula(compiler, Or((Not(left), right)), positive, unknown)
        case Compare():
            return _comparison(compiler, term, positive, unknown)
        case Quantified(quantifier=Quantifier.FORALL) if positive:
            return _for_all(compiler, term, False, unknown)
        case Quantified(quantifier=Quantifier.EXISTS) if not positive:
            return _for_all(compiler, term, True, unknown)
        case _:
            return None


def _for_all(compiler: Compiler, term: Quantified, positive: bool, unknown: frozenset[str]) -> Alternatives | None:
    """No assignment makes the body `positive`: the parts without unknowns say which assignments could."""
    from avow.logic.saferange import Plan

    parts, inner = conjunction(term.body, positive)
    variables = (*term.variables, *inner)
    for variable in variables:
        compiler.bind(variable)
    known = [p for p in parts if not p.names & unknown]
    open_parts = [_formula(compiler, p.term, not p.positive, unknown) for p in parts if p.names & unknown]
    denial = _any(open_parts)
    if denial is None:
        return None
    plan = Plan(compiler, known, variables, frozenset(), complete=False)
    if any(v.name in p.names and v.name not in plan.bound for v in variables for p in parts):
        return None

    def run(env: Env) -> list[tuple[Constraint, ...]]:
        found: list[tuple[Constraint, ...]] = [()]
        for doubt in plan.solutions(env):
            if doubt is not None:
                raise doubt
            found = _product(found, denial(env))
        return found

    return run


def _comparison(compiler: Compiler, term: Compare, positive: bool, unknown: frozenset[str]) -> Alternatives | None:
    if not isinstance(term.left.sort, RealSort):
        return None
    left, right = _linear(compiler, term.left, unknown), _linear(compiler, term.right, unknown)
    if left is None or right is None:
        return None
    one, other = left, right
    operator = term.operator if positive else _NEGATED[term.operator]

    def run(env: Env) -> list[tuple[Constraint, ...]]:
        difference = one(env).plus(other(env), Fraction(-1))
        turned = difference.times(Fraction(-1))
        match operator:
            case "==" | "<" | "<=":
                return [(Constraint(difference, operator),)]
            case ">" | ">=":
                return [(Constraint(turned, operator.replace(">", "<")),)]
            case _:
                return [(Constraint(difference, "<"),), (Constraint(turned, "<"),)]

    return run


_NEGATED = {"==": "!=", "!=": "==", "<": ">=", "<=": ">", ">": "<=", ">=": "<"}


def _linear(compiler: Compiler, term: Term, unknown: frozenset[str]) -> Callable[[Env], Linear] | None:
    if not bound_names(term) & unknown:
        code = compiler.code(term)
        return lambda env: Linear((), Fraction(code(env)))
    match term:
        case Variable(name=name):
            itself = Linear(((name, Fraction(1)),), Fraction(0))
            return lambda env: itself
        case Negative(term=inside):
            inner = _linear(compiler, inside, unknown)
            return None if inner is None else _scaled(inner, lambda env: Fraction(-1))
        case Arithmetic(operator="+" | "-" as operator, left=left, right=right):
            one, other = _linear(compiler, left, unknown), _linear(compiler, right, unknown)
            if one is None or other is None:
                return None
            first, second, sign = one, other, Fraction(1 if operator == "+" else -1)
            return lambda env: first(env).plus(second(env), sign)
        case Arithmetic(operator="*", left=left, right=right):
            if bound_names(left) & unknown and bound_names(right) & unknown:
                return None
            variable, factor = (left, right) if bound_names(left) & unknown else (right, left)
            inner = _linear(compiler, variable, unknown)
            return None if inner is None else _scaled(inner, compiler.code(factor))
        case Arithmetic(operator="/", left=left, right=right) if not bound_names(right) & unknown:
            inner, divisor = _linear(compiler, left, unknown), compiler.code(right)
            return None if inner is None else _scaled(inner, lambda env: _inverse(divisor(env)))
        case _:
            return None


def _inverse(value: Fraction) -> Fraction:
    if value == 0:
        raise NotEvaluable("division by zero")
    return 1 / Fraction(value)


def _scaled(inner: Callable[[Env], Linear], factor: Code) -> Callable[[Env], Linear]:
    return lambda env: inner(env).times(Fraction(factor(env)))


def _all(sides: Sequence[Alternatives | None]) -> Alternatives | None:
    known = [side for side in sides if side is not None]
    if len(known) < len(sides):
        return None

    def run(env: Env) -> list[tuple[Constraint, ...]]:
        found: list[tuple[Constraint, ...]] = [()]
        for side in known:
            found = _product(found, side(env))
        return found

    return run


def _any(sides: Sequence[Alternatives | None]) -> Alternatives | None:
    known = [side for side in sides if side is not None]
    if len(known) < len(sides):
        return None
    return lambda env: [system for side in known for system in side(env)]


def _product(left: list[tuple[Constraint, ...]], right: list[tuple[Constraint, ...]]) -> list[tuple[Constraint, ...]]:
    if len(left) * len(right) > _LIMIT:
        raise NotEvaluable("the inequalities fall into too many cases")
    if right == [()]:
        return left
    return [(*one, *other) for one, other in product(left, right)]
