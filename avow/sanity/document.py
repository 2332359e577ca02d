"""The output of ``avow sanity --json``; docs/schemas/sanity.schema.json is generated from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from avow.base.codec import called
from avow.base.diagnostics import Severity
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Verdict
from avow.sanity.claims import Property
from avow.sanity.results import SanityResult


@dataclass(frozen=True, slots=True)
class Shown:
    """Values: name of an input or output → its value, as RCL writes it. Text: values and explanation in one line."""

    values: Mapping[str, str]
    explanation: str
    text: str


@dataclass(frozen=True, slots=True)
class Conflict:
    """A minimal set of clauses that cannot be met together; of guarantees that can for some inputs, with an input for
    which they cannot."""

    clauses: tuple[str, ...]
    counterexample: Shown


@dataclass(frozen=True, slots=True)
class Place:
    """Line and column count from 1."""

    file: str
    line: int
    column: int


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one claim. Every claim states the good thing: `proved` is good and `refuted` bad, as its property
    says. assumptions-satisfiable: the assumptions can hold together. consistent: some allowed inputs and some outputs
    meet every guarantee. realizable: for all allowed inputs some output meets every guarantee. not-tautological: the
    clause rules something out. not-vacuous: what triggers the guarantee can happen. not-redundant: the clause does not
    follow from the others. constrained: the guarantees exclude some value of the output. determined: the inputs
    determine the output. needed: the assumption rules out inputs for which no output meets the guarantees. meetable:
    what the connected providers guarantee can meet the assumption."""

    node: str
    about: Property = field(metadata=called("property"))
    subject: str | None
    """The clause or output that the claim is about, if it is about one."""
    name: str
    claim: str
    verdict: Verdict
    """`error`: two solvers contradict each other."""
    severity: Severity
    """How bad it is if the claim is false."""
    clauses: tuple[str, ...]
    counterexample: Shown | None
    explanation: str
    conflicts: tuple[Conflict, ...]
    because: str | None
    engine: str
    seconds: float
    place: Place | None


@dataclass(frozen=True, slots=True)
class SanityDocument:
    """Is each node's contract worth verifying?"""

    results: tuple[Result, ...]


def to_document(result: SanityResult) -> Result:
    """The document for one result."""
    asked, shown, span = result.asked, result.counterexample, result.asked.span
    conflicts = tuple(Conflict(clauses, _shown(example)) for clauses, example in result.conflicts)
    return Result(
        *(result.node, asked.about, asked.subject, asked.name, asked.sentence, result.verdict, asked.severity),
        *(result.clauses, None if shown is None else _shown(shown), result.explanation, conflicts),
        *(result.because, result.engine, round(result.seconds, 3)),
        None if span is None else Place(span.file, span.line, span.column),
    )


def _shown(example: Counterexample) -> Shown:
    return Shown(dict(example.values), example.explanation, example.text())
