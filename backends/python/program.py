"""The step of a class as a small typed program: what is run in doubles beside CPython, and what conditions are made of.

Both readers take it from here, so that what is validated is what is proved. It is run on doubles, whose every
bit is compared with CPython's, or on fractions. Every expression has a kind; conversions from int to float are written
out; methods that a step calls are inlined.
"""

from __future__ import annotations

import operator as operators
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import Any


class Kind(StrEnum):
    """The type of a value, as Python has it."""

    BOOL = "bool"
    INT = "int"
    FLOAT = "float"
    TEXT = "str"
    """An element of an enumeration."""


Scalar = bool | int | float | str


@dataclass(frozen=True, slots=True)
class Const:
    value: Scalar
    kind: Kind


@dataclass(frozen=True, slots=True)
class Name:
    """A local (``x``; of an inlined method ``x@2``), an attribute (``self.x``), or an input (``in.x``)."""

    name: str
    kind: Kind


@dataclass(frozen=True, slots=True)
class Convert:
    """An int where a float is computed with: the nearest double."""

    body: Expr
    line: int
    kind: Kind = Kind.FLOAT


@dataclass(frozen=True, slots=True)
class Unary:
    """``-``, ``abs`` or ``not``."""

    operator: str
    body: Expr
    kind: Kind


@dataclass(frozen=True, slots=True)
class Binary:
    """``+ - * /`` of two ints or two floats, ``// %`` of two ints; ``/`` gives a float."""

    operator: str
    left: Expr
    right: Expr
    kind: Kind
    line: int


@dataclass(frozen=True, slots=True)
class Comparison:
    operator: str
    left: Expr
    right: Expr
    kind: Kind = Kind.BOOL


@dataclass(frozen=True, slots=True)
class Junction:
    """``and`` or ``or`` of truth values, cut short."""

    operator: str
    items: tuple[Expr, ...]
    kind: Kind = Kind.BOOL


@dataclass(frozen=True, slots=True)
class Choice:
    """``then if test else otherwise``."""

    test: Expr
    then: Expr
    otherwise: Expr
    kind: Kind


@dataclass(frozen=True, slots=True)
class Extreme:
    """``min`` or ``max``: the first of the items that no later one is below (above)."""

    operator: str
    items: tuple[Expr, ...]
    kind: Kind


@dataclass(frozen=True, slots=True)
class View:
    """An input that is a sequence, or its part ``[start:stop]``."""

    sequence: str
    start: int = 0
    stop: int | None = None


@dataclass(frozen=True, slots=True)
class Length:
    view: View
    kind: Kind = Kind.INT


@dataclass(frozen=True, slots=True)
class Item:
    """``s[i]``; conditions want 0 <= i < length, though Python counts negative ones from the end."""

    view: View
    index: Expr
    kind: Kind
    line: int


@dataclass(frozen=True, slots=True)
class Inlined:
    """A method's body in the place of its call: statements that end in `Give`, whose value this is."""

    body: tuple[Statement, ...]
    kind: Kind


Expr = Const | Name | Convert | Unary | Binary | Comparison | Junction | Choice | Extreme | Length | Item | Inlined


@dataclass(frozen=True, slots=True)
class Assign:
    name: str
    value: Expr
    line: int


@dataclass(frozen=True, slots=True)
class If:
    test: Expr
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]
    line: int


@dataclass(frozen=True, slots=True)
class For:
    """`body` for `counter` from 0 below `count`, which is found once, before. `invariants` are comments' texts."""

    counter: str
    count: Expr
    body: tuple[Statement, ...]
    line: int
    invariants: tuple[tuple[int, str], ...] = ()
    position: Name | None = None
    """The loop's own name of its position, where it has one; its value is the counter's above `first`."""


@dataclass(frozen=True, slots=True)
class Give:
    """``return``: of a step the outputs by name, of an inlined method the one value, whose name is empty."""

    values: tuple[tuple[str, Expr], ...]
    line: int


@dataclass(frozen=True, slots=True)
class Leave:
    """``break`` or ``continue``."""

    word: str
    line: int


Statement = Assign | If | For | Give | Leave


@dataclass(frozen=True, slots=True)
class Step:
    """A class, read: its step, what its attributes are once it is made, and its memory (port → attribute)."""

    body: tuple[Statement, ...]
    start: dict[str, Scalar]
    memory: dict[str, str]
    sequences: dict[str, Kind]
    """Inputs that are sequences, and of what."""
    lines: tuple[str, ...]


def assigned(body: tuple[Statement, ...]) -> Iterator[str]:
    """The names that some statement changes, those of inlined methods among them."""
    for statement in body:
        match statement:
            case Assign(name=name, value=value):
                yield name
                yield from _inside(value)
            case If(test=test, then=then, otherwise=otherwise):
                yield from _inside(test)
                yield from assigned(then)
                yield from assigned(otherwise)
            case For(count=count, body=inner):
                yield from _inside(count)
                yield from assigned(inner)
            case Give(values=values):
                for _, value in values:
                    yield from _inside(value)
            case Leave():
                pass


def _inside(expression: Expr) -> Iterator[str]:
    for part in parts(expression):
        if isinstance(part, Inlined):
            yield from assigned(part.body)


def parts(expression: Expr) -> Iterator[Expr]:
    """The expression and those in it, without the bodies of inlined methods."""
    stack: list[Expr] = [expression]
    while stack:
        current = stack.pop()
        yield current
        match current:
            case Convert(body=body) | Unary(body=body):
                stack.append(body)
            case Binary(left=left, right=right) | Comparison(left=left, right=right):
                stack += [left, right]
            case Junction(items=items) | Extreme(items=items):
                stack += items
            case Choice(test=test, then=then, otherwise=otherwise):
                stack += [test, then, otherwise]
            case Item(index=index):
                stack.append(index)
            case Const() | Name() | Length() | Inlined():
                pass


# -- run as Python runs it ---------------------------------------------------------------------------------------------


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
