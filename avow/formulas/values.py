"""Concrete values of each sort, shared by all code that computes with them (evaluation, tests, monitors, simulation).

BOOL is bool; INTEGER and NATURAL are int; REAL is `Fraction` (exact); STRING is str; an enumeration's element is an
`Element`; an algebraic value is a `Data`; a tuple is a tuple; a sequence is a `SequenceValue`; a
function is a `FunctionValue`; an element of an unspecified sort is an `Opaque`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from fractions import Fraction

from avow.base.plain import decimal
from avow.base.records import dataclass


@dataclass(frozen=True, slots=True)
class Element:
    """An element of an enumeration."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Data:
    """A value of an algebraic data type: ``move(1, 2)``."""

    constructor: str
    arguments: tuple[Value, ...] = ()

    def __str__(self) -> str:
        return f"{self.constructor}({', '.join(map(show, self.arguments))})" if self.arguments else self.constructor


@dataclass(frozen=True, slots=True)
class SequenceValue:
    items: tuple[Value, ...]

    def __str__(self) -> str:
        return f"<{', '.join(map(show, self.items))}>"


@dataclass(frozen=True, slots=True)
class Opaque:
    """The k-th known element of an unspecified sort."""

    sort: str
    index: int

    def __str__(self) -> str:
        return f"{self.sort}#{self.index}"


@dataclass(frozen=True, slots=True)
class FunctionValue:
    """A total function given by finitely many points and a default."""

    table: Mapping[tuple[Value, ...], Value] = field(hash=False)
    default: Value

    def __call__(self, *arguments: Value) -> Value:
        return self.table.get(arguments, self.default)

    def __str__(self) -> str:
        if self.default is False:
            return "{" + ", ".join(_point(k) for k, v in self.table.items() if v is True) + "}"
        points = [f"{_point(k)}: {show(v)}" for k, v in self.table.items() if v != self.default]
        return "{" + ", ".join([*points, f"else: {show(self.default)}"]) + "}"


class Binary(Fraction):
    """The exact value of a float32 or float64; shown by the shortest digits that denote it in that format."""

    __slots__ = ("_hash", "digits")
    digits: str
    _hash: int

    @classmethod
    def held(cls, value: Fraction, digits: str) -> Binary:
        found = cls(value)
        found.digits = digits
        found._hash = Fraction.__hash__(found)
        return found

    def __hash__(self) -> int:  # type: ignore[override]
        return self._hash


Value = bool | int | Fraction | str | Element | Data | SequenceValue | Opaque | FunctionValue | tuple["Value", ...]


def show(value: Value) -> str:
    """A value as RCL writes it; a relation as the set of its tuples."""
    match value:
        case bool():
            return "TRUE" if value else "FALSE"
        case Binary(digits=digits):
            return digits
        case Fraction():
            return (decimal(value) if value.denominator <= 10**9 else None) or str(value)
        case str():
            return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        case tuple():
            return f"({', '.join(map(show, value))})"
        case _:  # the others define `__str__`
            return str(value)


def _point(arguments: tuple[Value, ...]) -> str:
    return show(arguments[0]) if len(arguments) == 1 else show(arguments)
