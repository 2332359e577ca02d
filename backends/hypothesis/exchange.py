"""The messages between Avow and the process that tests: the request, and the results of the cases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from avow.base.verdict import Isolation
from avow.formulas.values import Value
from avow.isolation.observed import Observed
from avow.language.contract import Clause, Port

from .subject import SubjectFile

QUESTION = "question.pickle"

Pairs = tuple[tuple[str, str], ...]
"""Qualified names and values, as shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """The unit under test, and how to test it. It is pickled: both processes are Avow's."""

    test: str
    """The file's name."""
    root: Path
    subject: SubjectFile
    constants: Mapping[str, Value]
    """The values of parameters that it takes as arguments."""
    cases: int
    length: int
    """Steps of a run."""
    numbers: str
    names: Mapping[str, str]
    """Input port → its name in the generated test."""
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    assumptions: tuple[Clause, ...]
    begins: tuple[Clause, ...]
    guarantees: tuple[Clause, ...]
    untranslated: frozenset[str]
    """Guarantees that the generated test does not assert."""
    kept: tuple[tuple[Any, ...], ...]
    """Cases that refuted some guarantee before: the inputs of each one's steps."""


class Met(NamedTuple):
    """How often a trigger was met: by cases, and in how many runs."""

    trigger: str
    cases: int
    in_runs: int


@dataclass(frozen=True, slots=True)
class Tried:
    """The results of the cases for one guarantee."""

    triggers: tuple[Met, ...]
    undecided: int
    failure: Pairs | None = None
    trace: tuple[Pairs, ...] = ()
    """The steps up to the failure, if there are several."""
    case: Any = None
    """The unit's inputs, to be kept."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The results."""

    valid: int
    replayed: int
    rejected: int
    undecided: int
    stopped: str
    left_out: tuple[str, ...]
    observed: tuple[Observed, ...]
    isolation: Isolation
    apart: tuple[tuple[Pairs, str], ...]
    unsteady: Pairs | None
    silent: str
    crash: tuple[Pairs, str] | None
    crash_trace: tuple[Pairs, ...] | None
    """For the node's own class, the steps before it raised."""
    runs: int | None
    """The number of runs if the contract remembers: then runs are counted."""
    guarantees: Mapping[str, Tried]
    fault: str = ""
