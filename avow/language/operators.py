"""The table of operators: the notation, precedence, typing and meaning of each.

Every pass reads its column here: printers, the checker, evaluation, the translation to Z3 (whose printing is our
SMT-LIB), Dafny, RML, and programs proved by Hoare triples. An entry has every column or a `Why`. Forms that are
structure and not operators (quantifiers, application, membership, tuples, sequences) are handled by a `match` with
`assert_never` in each pass.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import IntEnum, StrEnum
from fractions import Fraction
from functools import reduce
from typing import Any, assert_never

from avow.base.diagnostics import Span
from avow.base.plain import count
from avow.base.records import dataclass
from avow.language.conversions import NUMERIC, WHOLE, common, joined, widen
from avow.language.enclosures import angle, cosine, sine
from avow.language.roots import quotient, root
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, FunctionSort, SetSort, Sort
from avow.language.terms import Builtin, Compare, Conditional, Iff, Literal, Negative, Not, Operation, Term

OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
"""The comparison that holds if and only if the given one does not."""
FLIPPED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
"""A comparison of order with its sides exchanged."""


class Level(IntEnum):
    """How tightly a form binds; a part is put in parentheses if it binds less tightly than its place demands."""

    LOOSEST = -1
    IFF = 0
    IMPLIES = 1
    OR = 2
    AND = 3
    LASTING = 4
    NOT = 5
    COMPARE = 6
    SUM = 7
    PRODUCT = 8
    UNARY = 9
    ATOM = 10


class Typing(StrEnum):
    """The argument and result types of an operator, as shown to people."""

    FORMULA = "formula → formula"
    FORMULAS = "formulas → formula"
    EQUALS = "terms of one type → formula"
    ORDER = "numbers → formula"
    NUMBER = "number → number"
    NUMBERS = "numbers → number"
    QUOTIENT = "numbers → REAL"
    ROOT = "number → REAL"
    WHOLE = "whole number, positive literal → whole number"
    BRANCHES = "formula, two terms of one type → that type"

    @property
    def takes_formulas(self) -> bool:
        """Whether all arguments are formulas."""
        return self in (Typing.FORMULA, Typing.FORMULAS)


@dataclass(frozen=True, slots=True)
class Why:
    """In place of an entry: the reason why there is none. A backend refuses the operator by name, with this reason."""

    reason: str


@dataclass(frozen=True, slots=True)
class Operator:
    """One operator. Infix signs include their spaces; an operator written like a function is given by its name."""

    name: str
    """The RCL name; the key in a table of operators."""
    level: Level
    typing: Typing
    rcl: str
    """The RCL notation between or before its operands."""
    unicode: str
    evaluate: Callable[..., Any] | Why
    """A function from values (`avow.formulas.values`) to a value."""
    z3: Callable[..., Any] | Why
    """A function from the module z3 and expressions to an expression; numbers are Python's (`z.If(a < 0, -a, a)`),
    because z3 creates its own numbers in another context."""
    smtlib: str
    """The head of its form in the scripts that Z3 prints."""
    dafny: str | Why
    """The infix sign, or the function of the generated module that it calls."""
    rml: str | Why
    """The sign in an RML condition; or `lifted`: conditions distinguish the cases."""
    program: str | Why
    """The notation in programs proved by Hoare triples."""
    definition: Callable[[Operation], Term] | Why
    """An equivalent in forms of the terms, for targets without the operator and for every pass that decomposes
    formulas."""
    takes: tuple[int, int | None] | Why
    """The least and greatest number of arguments, if it is written like a function."""


LIFTED = "lifted"
_IN_PARTS = Why("its parts are evaluated one after another, as far as they are needed")
_NO_WHOLE_DIVISION = Why("RML's conditions have neither whole division nor remainder")
_NO_ROOT_THERE = Why("its language has no square roots")
_NO_ANGLE_THERE = Why("its language has no sine, cosine or arc tangent")
_BOUNDED = Why("the translation names the value, and states bounds of it")
_NOT_COMPUTED = Why("programs say it with IF")
_A_FORM = Why("it is a form of the terms itself, of as many parts as the form has")
_ARITHMETIC = Why("it is arithmetic: no form of the terms says it")


def _infix(
    name: str,
    level: Level,
    typing: Typing,
    unicode: str,
    evaluate: Callable[..., Any] | Why,
    z3: Callable[..., Any],
    smtlib: str,
    dafny: str,
    rml: str,
) -> Operator:
    rcl, unicode = f" {name} ", f" {unicode} "
    return Operator(name, level, typing, rcl, unicode, evaluate, z3, smtlib, dafny, rml, name, _A_FORM, _A_FORM)


def _function(
    name: Builtin,
    typing: Typing,
    evaluate: Callable[..., Any],
    z3: Callable[..., Any] | Why,
    smtlib: str,
    dafny: str | Why,
    rml: str | Why,
    definition: Callable[[Operation], Term] | Why,
    takes: tuple[int, int | None],
) -> Operator:
    return Operator(
        name, Level.ATOM, typing, name, name, evaluate, z3, smtlib, dafny, rml, _NOT_COMPUTED, definition, takes
    )


def _differing(term: Operation) -> Term:
    left, right = term.arguments
    return Not(Iff(left, right), term.span)


def _without_sign(term: Operation) -> Term:
    (inner,) = term.arguments
    real = inner.sort == REAL
    zero = Literal(Fraction(0), REAL) if real else Literal(0, INTEGER)
    return Conditional(Compare("<", inner, zero), Negative(inner, REAL if real else INTEGER), inner, term.sort)


def _better(sign: str) -> Callable[[Operation], Term]:
    """The choice between two numbers by a comparison (the second if it compares so to the first), repeated over the
    rest."""

    def choice(term: Operation) -> Term:
        one, other, *rest = term.arguments
        first, second = (replace(term, arguments=(kept, *rest)) if rest else kept for kept in (other, one))
        return Conditional(Compare(sign, other, one), first, second, term.sort)

    return choice


_ROWS = (
    _infix("<=>", Level.IFF, Typing.FORMULAS, "↔", operator.eq,
           lambda z, a, b: a == b, "=", "<==>", LIFTED),
    _infix("->", Level.IMPLIES, Typing.FORMULAS, "→", _IN_PARTS,
           lambda z, a, b: z.Implies(a, b), "=>", "==>", LIFTED),
    _infix("or", Level.OR, Typing.FORMULAS, "∨", _IN_PARTS,
           lambda z, *parts: z.Or(parts), "or", "||", "||"),
    _infix("and", Level.AND, Typing.FORMULAS, "∧", _IN_PARTS,
           lambda z, *parts: z.And(parts), "and", "&&", "&&"),
    Operator("not", Level.NOT, Typing.FORMULA, "not ", "¬", operator.not_,
             lambda z, a: z.Not(a), "not", "!", LIFTED, "not", _A_FORM, _A_FORM),
    _infix("==", Level.COMPARE, Typing.EQUALS, "=", operator.eq,
           lambda z, a, b: a == b, "=", "==", "=="),
    _infix("!=", Level.COMPARE, Typing.EQUALS, "≠", operator.ne,
           lambda z, a, b: a != b, "distinct", "!=", "!="),
    _infix("<", Level.COMPARE, Typing.ORDER, "<", operator.lt, lambda z, a, b: a < b, "<", "<", "<"),
    _infix("<=", Level.COMPARE, Typing.ORDER, "≤", operator.le,
           lambda z, a, b: a <= b, "<=", "<=", "<="),
    _infix(">", Level.COMPARE, Typing.ORDER, ">", operator.gt, lambda z, a, b: a > b, ">", ">", ">"),
    _infix(">=", Level.COMPARE, Typing.ORDER, "≥", operator.ge,
           lambda z, a, b: a >= b, ">=", ">=", ">="),
    _infix("+", Level.SUM, Typing.NUMBERS, "+", operator.add, lambda z, a, b: a + b, "+", "+", "+"),
    _infix("-", Level.SUM, Typing.NUMBERS, "-", operator.sub, lambda z, a, b: a - b, "-", "-", "-"),
    _infix("*", Level.PRODUCT, Typing.NUMBERS, "·", operator.mul,
           lambda z, a, b: a * b, "*", "*", "*"),
    _infix("/", Level.PRODUCT, Typing.QUOTIENT, "/", quotient,
           lambda z, a, b: a / b, "/", "Types.Divide", "/"),
    _function(Builtin.XOR, Typing.FORMULAS, operator.ne, lambda z, a, b: z.Xor(a, b), "xor", "!=", LIFTED,
              _differing, (2, 2)),
    _function(Builtin.ABS, Typing.NUMBER, abs, lambda z, a: z.If(a < 0, -a, a), "ite", "Types.Abs", LIFTED,
              _without_sign, (1, 1)),
    _function(Builtin.MIN, Typing.NUMBERS, min, lambda z, *all: reduce(lambda a, b: z.If(b < a, b, a), all), "ite",
              "Types.Min", LIFTED, _better("<"), (2, None)),
    _function(Builtin.MAX, Typing.NUMBERS, max, lambda z, *all: reduce(lambda a, b: z.If(b > a, b, a), all), "ite",
              "Types.Max", LIFTED, _better(">"), (2, None)),
    _function(Builtin.MOD, Typing.WHOLE, operator.mod, lambda z, a, b: a % b, "mod", "%", _NO_WHOLE_DIVISION,
              _ARITHMETIC, (2, 2)),
    _function(Builtin.DIV, Typing.WHOLE, operator.floordiv, lambda z, a, b: a / b, "div", "/", _NO_WHOLE_DIVISION,
              _ARITHMETIC, (2, 2)),
    _function(Builtin.SQRT, Typing.ROOT, root, Why("the translation names the root, and states its square"), "*",
              _NO_ROOT_THERE, _NO_ROOT_THERE, _ARITHMETIC, (1, 1)),
    _function(Builtin.SIN, Typing.ROOT, sine, _BOUNDED, "*", _NO_ANGLE_THERE, _NO_ANGLE_THERE, _ARITHMETIC, (1, 1)),
    _function(Builtin.COS, Typing.ROOT, cosine, _BOUNDED, "*", _NO_ANGLE_THERE, _NO_ANGLE_THERE, _ARITHMETIC, (1, 1)),
    _function(Builtin.ATAN2, Typing.QUOTIENT, angle, _BOUNDED, "*", _NO_ANGLE_THERE, _NO_ANGLE_THERE, _ARITHMETIC,
              (2, 2)),
    Operator("if", Level.LOOSEST, Typing.BRANCHES, "if ", "if ", _IN_PARTS, lambda z, c, a, b: z.If(c, a, b),
             "ite", "if", LIFTED, _NOT_COMPUTED, _A_FORM, _A_FORM),
)  # fmt: skip
# Division and remainder are Euclid's, as in SMT-LIB and Dafny: with a positive divisor that is Python's floor division.

OPERATORS: Mapping[str, Operator] = {row.name: row for row in _ROWS}


def definition(term: Operation) -> Term | None:
    """The operation expressed by other forms, one level; None if it is arithmetic and not a choice or connective."""
    column = OPERATORS[term.operator].definition
    return None if isinstance(column, Why) else column(term)


def implementation(column: Callable[..., Any] | Why) -> Callable[..., Any]:
    """The function in a column, which must have one."""
    assert not isinstance(column, Why), column.reason
    return column


# --- typing ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Mistyped:
    """The reason why arguments do not fit: a code, a message, and the position of the argument (None: wrong number)."""

    code: str
    message: str
    at: int | None
    hint: str | None = None


def _wrong_count(name: Builtin, given: int) -> Mistyped | None:
    """The error for too few or too many arguments, if any."""
    counts = OPERATORS[name].takes
    assert not isinstance(counts, Why), counts.reason
    least, most = counts
    if given >= least and (most is None or given <= most):
        return None
    wanted = count(least, "argument") + ("" if most else " or more")
    return Mistyped("RCL305", f"`{name}` takes {wanted} and is given {given or 'none'}", None)


def operation(name: Builtin, arguments: Sequence[Term], span: Span | None) -> Term | Mistyped:
    """The operator applied to arguments, which are widened if necessary; or the type error."""
    counted = _wrong_count(name, len(arguments))
    if counted is not None:
        return counted
    typing = OPERATORS[name].typing
    match typing:
        case Typing.FORMULA | Typing.FORMULAS:
            for k, argument in enumerate(arguments):
                if argument.sort != BOOL:
                    return Mistyped("RCL301", f"`{name}` is of formulas, and this is of type {{}}", k)
            return Operation(name, tuple(arguments), BOOL, span)
        case Typing.NUMBER | Typing.NUMBERS | Typing.ROOT | Typing.QUOTIENT:
            for k, argument in enumerate(arguments):
                if not isinstance(argument.sort, NUMERIC):
                    return Mistyped("RCL308", f"`{name}` is of numbers, and this is of type {{}}", k)
            if typing in (Typing.ROOT, Typing.QUOTIENT):
                return Operation(name, tuple(map(widen, arguments)), REAL, span)
            made = common(list(arguments))
            assert made is not None, "numbers have a common sort"
            sort = joined(made)
            if name is Builtin.ABS:
                sort = REAL if sort == REAL else NATURAL
            return Operation(name, tuple(made), sort, span)
        case Typing.WHOLE:
            for k, argument in enumerate(arguments):
                if not isinstance(argument.sort, WHOLE):
                    return Mistyped("RCL308", f"`{name}` is of whole numbers, and this is of type {{}}", k)
            dividend, divisor = arguments
            if not (isinstance(divisor, Literal) and isinstance(divisor.value, int) and divisor.value > 0):
                hint = f"write a number that is known, as in `{name}(n, 3)`"
                return Mistyped("RCL311", f"`{name}` divides by a positive whole number that is written down", 1, hint)
            whole: Sort = NATURAL if name is Builtin.MOD or dividend.sort == NATURAL else INTEGER
            return Operation(name, (dividend, divisor), whole, span)
        case Typing.EQUALS | Typing.ORDER | Typing.BRANCHES:
            raise AssertionError(f"`{name}` is written like a function, and typed as no function is")
        case _:
            assert_never(typing)


def conditional(condition: Term, then: Term, otherwise: Term, span: Span | None) -> Term | None:
    """``if condition then … else …`` with branches converted to one sort; None if they have no common sort, or one that
    a conditional cannot have (functions, sets)."""
    made = common([then, otherwise])
    if made is None or isinstance(made[0].sort, FunctionSort | SetSort):
        return None
    return Conditional(condition, made[0], made[1], joined(made), span)
