"""What passes between Avow and the process that tests: the contract as data there, and back what came of the cases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from avow.base.codec import LATER
from avow.base.verdict import Isolation
from avow.isolation.observed import Observed

Pairs = tuple[tuple[str, str], ...]
"""Qualified names and values, as they are shown."""


@dataclass(frozen=True, slots=True)
class Typed:
    """A port."""

    name: str
    type: str
    """As RCL says it."""
    sort: Any
    """Of this and of `Stated.formula`, `wire` has the form."""


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
