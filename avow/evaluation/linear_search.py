"""``exists(a, b in REAL | …)`` where a and b occur in linear inequalities only, and everything else has a value.

``exists(a in REAL | forall(x in REAL | in.p(x) -> a - 1 <= x and x <= a + 1))``: the inner quantifier is restricted to
the points of a table, so that the formula is a system of inequalities in a, which is decided exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import product

from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.tuning.bounds import LINEAR_CASES
from avow.evaluation.compiler import Code, Compiler, Env, NotEvaluable
from avow.evaluation.linear import Constraint, Linear, TooMany, satisfy
from avow.formulas.disjunctions import Part, conjunction
from avow.formulas.renaming import bound_names, has_variables
from avow.language.operators import OPPOSITE
from avow.language.sorts import RealSort
from avow.language.subterms import subterms
from avow.language.terms import (
    And,
    Arithmetic,
    Compare,
    Conditional,
    Implies,
    Negative,
    Not,
    Or,
    Quantified,
    Quantifier,
    Term,
    Variable,
)

Alternatives = Callable[[Env], list[tuple[Constraint, ...]]]
"""The formula as a disjunction of systems, given the other variables' values."""


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
        case Conditional(condition=condition, then=then, otherwise=otherwise):
            if any(isinstance(part, Conditional) for part in subterms(condition)):
                return None  # the condition is read twice: of conditions within conditions, that would be too often
            cases = (And((condition, then)), And((Not(condition), otherwise)))
            if not positive:
                cases = (And((condition, Not(then))), And((Not(condition), Not(otherwise))))
            return _formula(compiler, Or(cases), True, unknown)
        case Quantified(quantifier=Quantifier.FORALL) if positive:
            return _for_all(compiler, term, False, unknown)
        case Quantified(quantifier=Quantifier.EXISTS) if not positive:
            return _for_all(compiler, term, True, unknown)
        case _:  # not a system of inequalities: searched in another way
            return None


def _for_all(compiler: Compiler, term: Quantified, positive: bool, unknown: frozenset[str]) -> Alternatives | None:
    """No assignment makes the body `positive`: the parts without unknowns say which assignments could."""
    parts, inner = conjunction(term.body, positive)
    variables = (*term.variables, *inner)
    for variable in variables:
        compiler.bind(variable)
    known = [p for p in parts if not p.names & unknown]
    open_parts = [_formula(compiler, p.term, not p.positive, unknown) for p in parts if p.names & unknown]
    denial = _any(open_parts)
    if denial is None:
        return None
    plan = compiler.quantifiers.candidates(compiler, known, variables)
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
    operator = term.operator if positive else OPPOSITE[term.operator]
    if operator in (">", ">="):
        left, right, operator = right, left, operator.replace(">", "<")
    one, other = left.constant, right.constant
    coefficients = _sum(left.coefficients, right.coefficients, Fraction(-1))
    straight = Linear.of(coefficients, Fraction(0)).coefficients
    turned = Linear.of({n: -c for n, c in coefficients.items()}, Fraction(0)).coefficients

    def run(env: Env) -> list[tuple[Constraint, ...]]:
        constant = Fraction(one(env) - other(env))
        if operator != "!=":
            return [(Constraint(Linear(straight, constant), operator),)]
        below = Constraint(Linear(straight, constant), "<")
        return [(below,), (Constraint(Linear(turned, -constant), "<"),)]

    return run


@dataclass(frozen=True, slots=True)
class _Sum:
    """``sum of coefficient * unknown + constant``; the coefficients are known when the formula is compiled."""

    coefficients: dict[str, Fraction]
    constant: Code


def _linear(compiler: Compiler, term: Term, unknown: frozenset[str]) -> _Sum | None:
    if not bound_names(term) & unknown:
        return _Sum({}, compiler.code(term))
    match term:
        case Variable(name=name):
            return _Sum({name: Fraction(1)}, lambda env: Fraction(0))
        case Negative(term=inside):
            return _scaled(_linear(compiler, inside, unknown), Fraction(-1))
        case Arithmetic(operator="+" | "-" as operator, left=left, right=right):
            one, other = _linear(compiler, left, unknown), _linear(compiler, right, unknown)
            if one is None or other is None:
                return None
            first, second = one.constant, other.constant
            if operator == "+":
                return _Sum(
                    _sum(one.coefficients, other.coefficients, Fraction(1)), lambda env: first(env) + second(env)
                )
            return _Sum(_sum(one.coefficients, other.coefficients, Fraction(-1)), lambda env: first(env) - second(env))
        case Arithmetic(operator="*", left=left, right=right):
            for side, factor in ((left, right), (right, left)):
                known = _known(compiler, factor)
                if known is not None:
                    return _scaled(_linear(compiler, side, unknown), known)
            return None
        case Arithmetic(operator="/", left=left, right=right):
            divisor = _known(compiler, right)
            return _scaled(_linear(compiler, left, unknown), 1 / divisor) if divisor else None
        case _:  # not linear: searched in another way
            return None


def _known(compiler: Compiler, term: Term) -> Fraction | None:
    """The value of a term without variables."""
    if has_variables(term):
        return None
    try:
        return Fraction(compiler.code(term)([]))
    except NotEvaluable:
        return None


def _scaled(inner: _Sum | None, factor: Fraction) -> _Sum | None:
    if inner is None:
        return None
    constant = inner.constant
    return _Sum({n: c * factor for n, c in inner.coefficients.items()}, lambda env: constant(env) * factor)


def _sum(left: dict[str, Fraction], right: dict[str, Fraction], factor: Fraction) -> dict[str, Fraction]:
    return {n: left.get(n, Fraction(0)) + factor * right.get(n, Fraction(0)) for n in {**left, **right}}


def _all(sides: Sequence[Alternatives | None]) -> Alternatives | None:
    known = complete(sides)
    if known is None:
        return None

    def run(env: Env) -> list[tuple[Constraint, ...]]:
        found: list[tuple[Constraint, ...]] = [()]
        for side in known:
            found = _product(found, side(env))
        return found

    return run


def _any(sides: Sequence[Alternatives | None]) -> Alternatives | None:
    known = complete(sides)
    if known is None:
        return None
    return lambda env: [system for side in known for system in side(env)]


def _product(left: list[tuple[Constraint, ...]], right: list[tuple[Constraint, ...]]) -> list[tuple[Constraint, ...]]:
    if len(left) * len(right) > LINEAR_CASES:
        raise NotEvaluable("the inequalities fall into too many cases")
    if right == [()]:
        return left
    return [(*one, *other) for one, other in product(left, right)]
