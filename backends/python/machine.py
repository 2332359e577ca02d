"""The small program run as Python runs it: on doubles, whose every bit is compared with CPython's, or on fractions."""

from __future__ import annotations

import operator as operators
from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .program import (
    Assign,
    Binary,
    Choice,
    Comparison,
    Const,
    Convert,
    Expr,
    Extreme,
    For,
    Give,
    If,
    Inlined,
    Item,
    Junction,
    Leave,
    Length,
    Name,
    Statement,
    Step,
    Unary,
)


class Failed(Exception):  # noqa: N818 - it names what happened
    """The run ends in an exception; the text is its class, as Python calls it."""


class _Given(Exception):  # noqa: N818 - it is how a block is left
    def __init__(self, values: dict[str, Any]) -> None:
        self.values = values


class _Left(Exception):  # noqa: N818 - likewise
    def __init__(self, word: str) -> None:
        self.word = word


@dataclass(frozen=True, slots=True)
class Answer:
    """What a step gave: outputs and memory afterwards, or the class of the exception in which it ended."""

    outputs: Mapping[str, Any]
    memory: Mapping[str, Any]
    error: str = ""


_EXACT = "#exact"
"""Among the values: every float that the program writes down is the fraction that it is."""


def run(step: Step, inputs: Mapping[str, Any], memory: Mapping[str, Any], *, exact: bool = False) -> Answer:
    """One step, from that memory (port → value). `exact`: nothing is rounded; inputs and memory are fractions then."""
    values: dict[str, Any] = {f"self.{name}": value for name, value in step.start.items()}
    if exact:
        values = {name: fraction(value) for name, value in values.items()} | {_EXACT: True}
    values |= {f"self.{step.memory[port]}": value for port, value in memory.items()}
    values |= {f"in.{name}": value for name, value in inputs.items()}

    def held() -> dict[str, Any]:
        return {port: values[f"self.{attribute}"] for port, attribute in step.memory.items()}

    try:
        run_block(step.body, values)
    except _Given as given:
        return Answer(given.values, held())
    except Failed as failed:
        return Answer({}, held(), str(failed))
    raise AssertionError("a step that the translator took returns on every path")


def run_block(body: tuple[Statement, ...], values: MutableMapping[str, Any]) -> None:
    """Run statements, changing `values`. Raises Failed."""
    for statement in body:
        match statement:
            case Assign(name=name, value=value):
                values[name] = evaluate(value, values)
            case If(test=test, then=then, otherwise=otherwise):
                run_block(then if evaluate(test, values) else otherwise, values)
            case For(counter=counter, count=count, body=inner):
                for k in range(evaluate(count, values)):
                    values[counter] = k
                    try:
                        run_block(inner, values)
                    except _Left as left:
                        if left.word == "break":
                            break
            case Give(values=given):
                raise _Given({name: evaluate(value, values) for name, value in given})
            case Leave(word=word):
                raise _Left(word)


def evaluate(expression: Expr, values: MutableMapping[str, Any]) -> Any:
    """The value, by Python's own operators. Raises Failed."""
    try:
        return _value(expression, values)
    except (ArithmeticError, IndexError) as error:
        raise Failed(type(error).__name__) from None


def _value(expression: Expr, values: MutableMapping[str, Any]) -> Any:
    match expression:
        case Const(value=value):
            return fraction(value) if _EXACT in values else value
        case Name(name=name):
            return values[name]
        case Convert(body=body):
            inner = _value(body, values)
            return inner if isinstance(inner, Fraction) else float(inner)
        case Unary(operator="-", body=body):
            return -_value(body, values)
        case Unary(operator="abs", body=body):
            return abs(_value(body, values))
        case Unary(body=body):
            return not _value(body, values)
        case Binary(operator=operator, left=left, right=right):
            one, other = _value(left, values), _value(right, values)
            if operator == "/" and _EXACT in values:
                return Fraction(one) / other
            return _OPERATORS[operator](one, other)
        case Comparison(operator=operator, left=left, right=right):
            return bool(_OPERATORS[operator](_value(left, values), _value(right, values)))
        case Junction(operator="and", items=items):
            return all(_value(item, values) for item in items)
        case Junction(items=items):
            return any(_value(item, values) for item in items)
        case Choice(test=test, then=then, otherwise=otherwise):
            return _value(then if _value(test, values) else otherwise, values)
        case Extreme(operator=operator, items=items):
            found = [_value(item, values) for item in items]
            return min(found) if operator == "min" else max(found)
        case Length(view=view):
            return len(values[f"in.{view.sequence}"][view.start : view.stop])
        case Item(view=view, index=index):
            return values[f"in.{view.sequence}"][view.start : view.stop][_value(index, values)]
        case Inlined(body=body):
            try:
                run_block(body, values)
            except _Given as given:
                return given.values[""]
            raise AssertionError("a method that the translator took returns on every path")


def fraction(value: Any) -> Any:
    """A float as the number that it is; anything else as it is."""
    return Fraction(value) if isinstance(value, float) else value


_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "+": operators.add, "-": operators.sub, "*": operators.mul, "/": operators.truediv, "//": operators.floordiv,
    "%": operators.mod, "<": operators.lt, "<=": operators.le, ">": operators.gt, ">=": operators.ge,
    "==": operators.eq, "!=": operators.ne,
}  # fmt: skip


__all__ = ["Answer", "Failed", "evaluate", "fraction", "run", "run_block"]
