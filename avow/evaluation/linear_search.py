"""``exists(a, b in REAL | …)`` where a and b occur in linear inequalities only, and everything else has a value.

``exists(a in REAL | forall(x in REAL | in.p(x) -> a - 1 <= x and x <= a + 1))``: the inner quantifier is restricted to
the points of a table, so that the formula is a system of inequalities in a, which is decided exactly: over rationals,
by Fourier and Motzkin's elimination. Small systems only: monitors ask so over the few points that a message carries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product

from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.tuning.bounds import CONSTRAINTS, LINEAR_CASES
from avow.evaluation.compiler import Code, Compiler, Env, NotEvaluable
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


class _TooMany(Exception):  # noqa: N818 - it names what happened
    """The system grew past the limit."""


@dataclass(frozen=True, slots=True)
class Linear:
    """``sum of coefficient * variable + constant``; no coefficient is zero."""

    coefficients: tuple[tuple[str, Fraction], ...]
    constant: Fraction

    @staticmethod
    def of(coefficients: Mapping[str, Fraction], constant: Fraction) -> Linear:
        return Linear(tuple(sorted((n, c) for n, c in coefficients.items() if c)), constant)

    def plus(self, other: Linear, factor: Fraction = Fraction(1)) -> Linear:
        """``self + factor * other``."""
        total = dict(self.coefficients)
        for name, coefficient in other.coefficients:
            total[name] = total.get(name, Fraction(0)) + factor * coefficient
        return Linear.of(total, self.constant + factor * other.constant)

    def times(self, factor: Fraction) -> Linear:
        return Linear.of({n: c * factor for n, c in self.coefficients}, self.constant * factor)

    def coefficient(self, name: str) -> Fraction:
        return dict(self.coefficients).get(name, Fraction(0))

    def at(self, values: Mapping[str, Fraction]) -> Fraction:
        return self.constant + sum((c * values[n] for n, c in self.coefficients), Fraction(0))


@dataclass(frozen=True, slots=True)
class _Constraint:
    """``left < 0``, ``left <= 0`` or ``left == 0``."""

    left: Linear
    operator: str

    def holds(self, values: Mapping[str, Fraction]) -> bool:
        value = self.left.at(values)
        match self.operator:
            case "<":
                return value < 0
            case "<=":
                return value <= 0
            case _:  # ==
                return value == 0


def _satisfy(constraints: Sequence[_Constraint], names: Sequence[str]) -> dict[str, Fraction] | None:
    """Values of `names` that meet every constraint, or None if there are none. Raises _TooMany."""
    if all(len(c.left.coefficients) <= 1 for c in constraints):
        return _satisfy_box(constraints, names)
    current = list(dict.fromkeys(constraints))
    removed: list[tuple[str, list[_Constraint]]] = []
    for name in names:
        about = [c for c in current if c.left.coefficient(name)]
        others = [c for c in current if not c.left.coefficient(name)]
        removed.append((name, about))
        current = list(dict.fromkeys([*others, *_eliminate(name, about)]))
        if len(current) > CONSTRAINTS:
            raise _TooMany
    if not all(c.holds({}) for c in current):
        return None
    values: dict[str, Fraction] = {}
    for name, about in reversed(removed):
        values[name] = _choose(name, about, values)
    return values


def _satisfy_box(constraints: Sequence[_Constraint], names: Sequence[str]) -> dict[str, Fraction] | None:
    """As `_satisfy`, where no constraint connects two variables: each has a lower and an upper bound of its own."""
    about: dict[str, list[_Constraint]] = {name: [] for name in names}
    for constraint in constraints:
        if constraint.left.coefficients:
            about[constraint.left.coefficients[0][0]].append(constraint)
        elif not constraint.holds({}):
            return None
    values: dict[str, Fraction] = {}
    for name, own in about.items():
        values[name] = _choose(name, own, {})
        if not all(c.holds(values) for c in own):
            return None
    return values


def _eliminate(name: str, about: Sequence[_Constraint]) -> list[_Constraint]:
    """What the constraints on a variable say of the others: every lower bound lies below every upper one."""
    for equation in about:
        if equation.operator == "==":
            unit = equation.left.times(1 / equation.left.coefficient(name))
            return [
                _Constraint(c.left.plus(unit, -c.left.coefficient(name)), c.operator)
                for c in about
                if c is not equation
            ]
    lower = [c for c in about if c.left.coefficient(name) < 0]
    upper = [c for c in about if c.left.coefficient(name) > 0]
    if len(lower) * len(upper) > CONSTRAINTS:
        raise _TooMany
    found = []
    for low in lower:
        for high in upper:
            left = high.left.times(1 / high.left.coefficient(name)).plus(low.left, -1 / low.left.coefficient(name))
            found.append(_Constraint(left, "<" if "<" in (low.operator, high.operator) else "<="))
    return found


def _choose(name: str, about: Sequence[_Constraint], values: Mapping[str, Fraction]) -> Fraction:
    """A value that meets the constraints if any does: what an equation says, else within the bounds."""
    low: Fraction | None = None
    high: Fraction | None = None
    for constraint in about:
        rest, own = constraint.left.constant, Fraction(1)
        for other, coefficient in constraint.left.coefficients:
            if other == name:
                own = coefficient
            else:
                rest += coefficient * values[other]
        bound = -rest / own
        if constraint.operator == "==":
            return bound
        if own > 0:
            high = bound if high is None or bound < high else high
        else:
            low = bound if low is None or bound > low else low
    if low is None:
        return Fraction(0) if high is None else high - 1
    return low + 1 if high is None else (low + high) / 2


_System = tuple[_Constraint, ...]
_Alternatives = Callable[[Env], list[_System]]
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
                values = _satisfy(system, names)
            except _TooMany:
                raise NotEvaluable("the inequalities are too many to solve") from None
            if values is not None:
                for slot, name in zip(slots, names, strict=True):
                    env[slot] = values[name]
                yield None

    return run


def _formula(compiler: Compiler, term: Term, positive: bool, unknown: frozenset[str]) -> _Alternatives | None:
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


def _for_all(compiler: Compiler, term: Quantified, positive: bool, unknown: frozenset[str]) -> _Alternatives | None:
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

    def run(env: Env) -> list[_System]:
        found: list[_System] = [()]
        for doubt in plan.solutions(env):
            if doubt is not None:
                raise doubt
            found = _product(found, denial(env))
        return found

    return run


def _comparison(compiler: Compiler, term: Compare, positive: bool, unknown: frozenset[str]) -> _Alternatives | None:
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

    def run(env: Env) -> list[_System]:
        constant = Fraction(one(env) - other(env))
        if operator != "!=":
            return [(_Constraint(Linear(straight, constant), operator),)]
        below = _Constraint(Linear(straight, constant), "<")
        return [(below,), (_Constraint(Linear(turned, -constant), "<"),)]

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


def _all(sides: Sequence[_Alternatives | None]) -> _Alternatives | None:
    known = complete(sides)
    if known is None:
        return None

    def run(env: Env) -> list[_System]:
        found: list[_System] = [()]
        for side in known:
            found = _product(found, side(env))
        return found

    return run


def _any(sides: Sequence[_Alternatives | None]) -> _Alternatives | None:
    known = complete(sides)
    if known is None:
        return None
    return lambda env: [system for side in known for system in side(env)]


def _product(left: list[_System], right: list[_System]) -> list[_System]:
    if len(left) * len(right) > LINEAR_CASES:
        raise NotEvaluable("the inequalities fall into too many cases")
    if right == [()]:
        return left
    return [(*one, *other) for one, other in product(left, right)]
