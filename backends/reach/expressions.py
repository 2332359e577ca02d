"""Terms of the plan: ``-a * v ** 2 + sin(p)``. They are read by Python's parser and never run by Python."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.base.suggestions import suggest

from .tuning import EXPONENT, LENGTH

OPERATORS: Mapping[type[ast.AST], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
FUNCTIONS = ("sqrt", "sin", "cos")


class Misread(Exception):  # noqa: N818 - it says what happened
    """Why a text is no term, in words."""


@dataclass(frozen=True, slots=True)
class Number:
    value: Fraction


@dataclass(frozen=True, slots=True)
class Name:
    name: str


@dataclass(frozen=True, slots=True)
class Power:
    base: Expression
    exponent: int


@dataclass(frozen=True, slots=True)
class Call:
    """`function` is one of `OPERATORS` or `FUNCTIONS`."""

    function: str
    arguments: tuple[Expression, ...]


Expression = Number | Name | Power | Call


def parse(text: str, known: Mapping[str, Expression]) -> Expression:
    """`known` gives the meaning of each name. Raises Misread."""
    if len(text) > LENGTH:
        raise Misread(f"it has more than {LENGTH} characters")
    try:
        return _expression(ast.parse(text.strip(), mode="eval").body, text.strip(), known)
    except SyntaxError as error:
        raise Misread(f"'{text}' is no term: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError):
        raise Misread("it is no term that can be read") from None


def _expression(tree: ast.expr, text: str, known: Mapping[str, Expression]) -> Expression:
    match tree:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return Number(Fraction(ast.get_source_segment(text, tree) or str(value)))  # all decimals as written
        case ast.Name(id=name):
            if name not in known:
                hint = suggest(name, known)
                raise Misread(f"'{name}' is no state, input or constant{f'; {hint}' if hint else ''}")
            return known[name]
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return Call("-", (Number(Fraction(0)), _expression(inner, text, known)))
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as exponent)) if exponent <= EXPONENT:
            return Power(_expression(left, text, known), int(exponent))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return Call(OPERATORS[type(op)], (_expression(left, text, known), _expression(right, text, known)))
        case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]) if name in FUNCTIONS:
            return Call(name, (_expression(inner, text, known),))
    part = ast.get_source_segment(text, tree) or text
    raise Misread(
        f"'{part}' is not supported: a term has + - * /, ** with an exponent from 0 to {EXPONENT}, "
        f"{', '.join(FUNCTIONS)}, numbers and names"
    )


def value(term: Expression, of: Mapping[str, Any], number: Callable[[Fraction], Any]) -> Any:
    """The term's value in any arithmetic: `of` has the names' values, and `number` makes one of a number."""
    match term:
        case Number(value=constant):
            return number(constant)
        case Name(name=name):
            return of[name]
        case Power(base=base, exponent=exponent):
            return value(base, of, number) ** exponent
        case Call(function=function, arguments=(inner,)):
            return getattr(value(inner, of, number), function)()
        case Call(function=function, arguments=(one, other)):
            left, right = value(one, of, number), value(other, of, number)
            match function:
                case "+":
                    return left + right
                case "-":
                    return left - right
                case "*":
                    return left * right
                case _:  # "/", by `OPERATORS`
                    return left / right
    raise AssertionError(term)
