"""What passes between Avow and the process that tests: the contract as data there, and back what came of the cases."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction
from typing import Any, NamedTuple

from avow.base.codec import LATER
from avow.base.diagnostics import Span
from avow.base.verdict import Isolation
from avow.isolation.observed import Observed
from avow.language import sorts, terms
from avow.language.sorts import Sort
from avow.language.terms import Past, Quantifier, Role, Term

from .tuning import WIRE_DEPTH

Pairs = tuple[tuple[str, str], ...]
"""Qualified names and values, as they are shown."""


@dataclass(frozen=True, slots=True)
class Typed:
    """A port."""

    name: str
    type: str
    """As RCL says it."""
    sort: Any
    """Of this and of `Stated.formula`, `encode` has the form."""


@dataclass(frozen=True, slots=True)
class Stated:
    """A clause."""

    name: str
    text: str
    formula: Any


@dataclass(frozen=True, slots=True)
class Subject:
    file: str
    function: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is tested, and how: ``contract.json``."""

    system: str
    folder: str
    node: str
    subject: Subject
    cases: int
    seed: int
    memory: tuple[str, ...]
    """Inputs that a driven class holds itself."""
    source: bool
    """The subject is the node's own class."""
    numbers: str
    inputs: tuple[Typed, ...]
    outputs: tuple[Typed, ...]
    left_out: tuple[str, ...] = field(default=(), metadata=LATER)
    """Ports of no plain type that no clause speaks of."""
    assumptions: tuple[Stated, ...]
    guarantees: tuple[Stated, ...]
    scenario: Mapping[str, tuple[tuple[str, ...], ...]]


class Met(NamedTuple):
    """How often a trigger was met: by drawn cases, by cases at thresholds, in how many runs."""

    trigger: str
    drawn: int
    at_edges: int
    in_runs: int


@dataclass(frozen=True, slots=True)
class Tried:
    """What the cases showed of one guarantee."""

    triggers: tuple[Met, ...]
    undecided: int
    failure: Pairs | None = None
    trace: tuple[Pairs, ...] = ()
    """The steps up to the failure, where they are more than one."""
    case: Any = None
    """What the subject was asked, to be kept."""
    asked: int = 0
    """How often the same had been asked before, where the case alone breaks nothing."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The judge's word."""

    valid: int
    edges: int
    replayed: int
    repeated: int
    """How often the same was asked of a subject that counts."""
    rejected: int
    undecided: int
    wanted: int
    stopped: str
    left_out: tuple[str, ...]
    observed: tuple[Observed, ...]
    isolation: Isolation
    apart: tuple[tuple[Pairs, str], ...]
    unsteady: Pairs | None
    silent: str
    crash: tuple[Pairs, str] | None
    crash_trace: tuple[Pairs, ...] | None
    """Of the node's own class, the steps before it raised."""
    runs: int | None
    """Drawn runs, where the contract remembers: then they are what is counted."""
    guarantees: Mapping[str, Tried]
    fault: str = ""


# -- sorts and terms: dataclasses by name and fields -------------------------------------------------------------------


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
    for name in (one.name for one in dataclasses.fields(value)):
        part = getattr(value, name)
        if part is not None and not isinstance(part, Span):
            made[name] = _encode(part, depth + 1)
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
