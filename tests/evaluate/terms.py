"""Terms and values written shortly."""

from __future__ import annotations

from fractions import Fraction

from avow.formulas.values import FunctionValue
from avow.language import sorts as s
from avow.language import terms as t

COMMAND = s.DataSort("Command", (s.Constructor("move", (s.REAL, s.REAL)), s.Constructor("inspect", (s.NATURAL,))))


COLOUR = s.EnumSort("Colour", ("red", "orange", "green"))


PLACE = s.FunctionSort((s.REAL, s.REAL), s.BOOL)


MAP = s.FunctionSort((s.REAL, s.REAL, s.NATURAL), s.BOOL)


NUMBERS = s.FunctionSort((s.NATURAL,), s.BOOL)


HEIGHT = s.FunctionSort((s.REAL,), s.REAL)


def bound(name: str, sort: s.Sort = s.REAL) -> t.Variable:
    return t.Variable(t.Role.BOUND, name, sort)


def given(name: str, sort: s.Sort) -> t.Variable:
    return t.Variable(t.Role.INPUT, name, sort)


X, Y, A, B, N, M = bound("x"), bound("y"), bound("a"), bound("b"), bound("n", s.NATURAL), bound("m", s.NATURAL)


P, Q = given("p", PLACE), given("q", PLACE)


H, K = given("h", HEIGHT), given("k", NUMBERS)


C = given("c", COMMAND)


def real(value: int | str) -> t.Literal:
    return t.Literal(Fraction(value), s.REAL)


def nat(value: int) -> t.Literal:
    return t.Literal(value, s.NATURAL)


def forall(variables: tuple[t.Variable, ...], body: t.Term) -> t.Quantified:
    return t.Quantified(t.Quantifier.FORALL, variables, body)


def exists(variables: tuple[t.Variable, ...], body: t.Term) -> t.Quantified:
    return t.Quantified(t.Quantifier.EXISTS, variables, body)


def unique(variables: tuple[t.Variable, ...], body: t.Term) -> t.Quantified:
    return t.Quantified(t.Quantifier.UNIQUE, variables, body)


def holds(function: t.Variable, *arguments: t.Term) -> t.Apply:
    assert isinstance(function.sort, s.FunctionSort)
    return t.Apply(function, arguments, function.sort.result)


def points(*tuples: tuple[int, ...], default: bool = False) -> FunctionValue:
    return FunctionValue({tuple(map(Fraction, point)): not default for point in tuples}, default)


def eq(left: t.Term, right: t.Term) -> t.Compare:
    return t.Compare("==", left, right)


def plus(left: t.Term, right: t.Term) -> t.Arithmetic:
    return t.Arithmetic("+", left, right, left.sort)
