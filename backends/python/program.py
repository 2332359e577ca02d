"""The step of a class as a small typed program: what is run in doubles beside CPython, and what conditions are made of.

Both readers take it from here, so that what is validated is what is proved. Every expression has a kind; conversions
from int to float are written out; methods that a step calls stand in its place.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum


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
