"""Linear inequalities over exact rationals: satisfiable, and by which values (Fourier and Motzkin's elimination).

Small systems only: monitors ask ``exists(a, b in REAL | …)`` over the few points that a message carries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from avow.base.records import dataclass
from avow.base.tuning.bounds import CONSTRAINTS


class TooMany(Exception):  # noqa: N818 - it names what happened
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
class Constraint:
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


def satisfy(constraints: Sequence[Constraint], names: Sequence[str]) -> dict[str, Fraction] | None:
    """Values of `names` that meet every constraint, or None if there are none. Raises TooMany."""
    if all(len(c.left.coefficients) <= 1 for c in constraints):
        return _satisfy_box(constraints, names)
    current = list(dict.fromkeys(constraints))
    removed: list[tuple[str, list[Constraint]]] = []
    for name in names:
        about = [c for c in current if c.left.coefficient(name)]
        others = [c for c in current if not c.left.coefficient(name)]
        removed.append((name, about))
        current = list(dict.fromkeys([*others, *_eliminate(name, about)]))
        if len(current) > CONSTRAINTS:
            raise TooMany
    if not all(c.holds({}) for c in current):
        return None
    values: dict[str, Fraction] = {}
    for name, about in reversed(removed):
        values[name] = _choose(name, about, values)
    return values


def _satisfy_box(constraints: Sequence[Constraint], names: Sequence[str]) -> dict[str, Fraction] | None:
    """As `satisfy`, where no constraint connects two variables: each has a lower and an upper bound of its own."""
    about: dict[str, list[Constraint]] = {name: [] for name in names}
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


def _eliminate(name: str, about: Sequence[Constraint]) -> list[Constraint]:
    """What the constraints on a variable say of the others: every lower bound lies below every upper one."""
    for equation in about:
        if equation.operator == "==":
            unit = equation.left.times(1 / equation.left.coefficient(name))
            return [
                Constraint(c.left.plus(unit, -c.left.coefficient(name)), c.operator) for c in about if c is not equation
            ]
    lower = [c for c in about if c.left.coefficient(name) < 0]
    upper = [c for c in about if c.left.coefficient(name) > 0]
    if len(lower) * len(upper) > CONSTRAINTS:
        raise TooMany
    found = []
    for low in lower:
        for high in upper:
            left = high.left.times(1 / high.left.coefficient(name)).plus(low.left, -1 / low.left.coefficient(name))
            found.append(Constraint(left, "<" if "<" in (low.operator, high.operator) else "<="))
    return found


def _choose(name: str, about: Sequence[Constraint], values: Mapping[str, Fraction]) -> Fraction:
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
