"""Terms and values written shortly."""

from __future__ import annotations

from fractions import Fraction

from avow.formulas.values import FunctionValue
from avow.language.sorts import (
    BOOL,
    NATURAL,
    REAL,
    Constructor,
    DataSort,
    EnumSort,
    FunctionSort,
    Sort,
)
from avow.language.terms import (
    Apply,
    Arithmetic,
    Compare,
    Literal,
    Quantified,
    Quantifier,
    Role,
    Term,
    Variable,
)

COMMAND = DataSort("Command", (Constructor("move", (REAL, REAL)), Constructor("inspect", (NATURAL,))))


COLOUR = EnumSort("Colour", ("red", "orange", "green"))


PLACE = FunctionSort((REAL, REAL), BOOL)


MAP = FunctionSort((REAL, REAL, NATURAL), BOOL)


NUMBERS = FunctionSort((NATURAL,), BOOL)


HEIGHT = FunctionSort((REAL,), REAL)


def bound(name: str, sort: Sort = REAL) -> Variable:
    return Variable(Role.BOUND, name, sort)


def given(name: str, sort: Sort) -> Variable:
    return Variable(Role.INPUT, name, sort)


X, Y, A, B, N, M = bound("x"), bound("y"), bound("a"), bound("b"), bound("n", NATURAL), bound("m", NATURAL)


P, Q = given("p", PLACE), given("q", PLACE)


H, K = given("h", HEIGHT), given("k", NUMBERS)


C = given("c", COMMAND)


def real(value: int | str) -> Literal:
    return Literal(Fraction(value), REAL)


def nat(value: int) -> Literal:
    return Literal(value, NATURAL)


def forall(variables: tuple[Variable, ...], body: Term) -> Quantified:
    return Quantified(Quantifier.FORALL, variables, body)


def exists(variables: tuple[Variable, ...], body: Term) -> Quantified:
    return Quantified(Quantifier.EXISTS, variables, body)


def unique(variables: tuple[Variable, ...], body: Term) -> Quantified:
    return Quantified(Quantifier.UNIQUE, variables, body)


def holds(function: Variable, *arguments: Term) -> Apply:
    assert isinstance(function.sort, FunctionSort)
    return Apply(function, arguments, function.sort.result)


def points(*tuples: tuple[int, ...], default: bool = False) -> FunctionValue:
    return FunctionValue({tuple(map(Fraction, t)): not default for t in tuples}, default)


def eq(left: Term, right: Term) -> Compare:
    return Compare("==", left, right)


def plus(left: Term, right: Term) -> Arithmetic:
    return Arithmetic("+", left, right, left.sort)
