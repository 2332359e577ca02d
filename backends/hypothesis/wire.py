"""Sorts and typed terms as JSON, for the judging process: dataclasses by name and fields, each sort written once."""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from fractions import Fraction
from typing import Any

from avow.base.diagnostics import Span
from avow.language import sorts, terms
from avow.language.sorts import Sort
from avow.language.terms import Past, Quantifier, Role, Term

from .tuning import WIRE_DEPTH

_CLASSES: dict[str, Any] = {
    c.__name__: c
    for module in (sorts, terms)
    for c in vars(module).values()
    if isinstance(c, type) and dataclasses.is_dataclass(c)
}


class TooDeep(Exception):  # noqa: N818 - it names what happened
    """A formula is nested beyond `WIRE_DEPTH`."""


def encode(value: Term | Sort) -> Any:
    """A term or sort as JSON data. Raises TooDeep."""
    return _encode(value, 0)


def _encode(value: Any, depth: int) -> Any:
    if depth > WIRE_DEPTH:
        raise TooDeep
    if isinstance(value, tuple):
        return [_encode(item, depth + 1) for item in value]
    if isinstance(value, Fraction):
        return {"fraction": [str(value.numerator), str(value.denominator)]}
    if isinstance(value, int) and not isinstance(value, bool):
        return {"integer": str(value)}
    if isinstance(value, StrEnum | str | bool):
        return value if isinstance(value, bool) else str(value)
    made: dict[str, Any] = {"is": type(value).__name__}
    for field in dataclasses.fields(value):
        part = getattr(value, field.name)
        if part is None or isinstance(part, Span):
            continue
        made[field.name] = _encode(part, depth + 1)
    return made


def decode(data: Any) -> Any:
    """What `encode` wrote."""
    match data:
        case list():
            return tuple(decode(item) for item in data)
        case {"fraction": [numerator, denominator]}:
            return Fraction(int(numerator), int(denominator))
        case {"integer": digits}:
            return int(digits)
        case {"is": name}:
            parts = {key: decode(value) for key, value in data.items() if key != "is"}
            if "role" in parts:
                parts["role"] = Role(parts["role"])
            if "quantifier" in parts:
                parts["quantifier"] = Quantifier(parts["quantifier"])
            if name == "History":
                parts["operator"] = Past(parts["operator"])
            return _CLASSES[name](**parts)
        case _:  # a value that is its own JSON
            return data
