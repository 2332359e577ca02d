"""The options of an experiment in plan.yaml, read and checked; every problem has its place."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic
from avow.language.sorts import IntegerSort, NaturalSort, RealSort
from avow.language.terms import Literal, Negative, Term, Widen
from avow.system.paths import inside

from .expression import Expression, Malformed, parse
from .quantity import conversion, decimal, figure

SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "type": "object",
    "properties": {
        "data": {"type": "string", "description": "CSV file, one row a run, relative to the system's folder"},
        "summary": {"type": "string", "description": "YAML file of printed figures, where the runs are not published"},
        "measure": {"type": "string", "description": "a column, or an expression over columns; never negative"},
        "within": {
            "type": ["number", "string"],
            "description": "the greatest measure of a run that succeeds: a number, '25 cm', or a constant's name",
        },
        "unit": {"type": "string", "description": "the unit of the measure and of numbers without one"},
        "run_column": {"type": "string", "description": "the column that names a run (default: run, or id)"},
        "confidence": {"type": ["number", "string"], "description": "of the statistical statement, default 0.95"},
        "at_least": {
            "type": ["number", "string"],
            "description": "the claimed probability of success; without it no run at all may fail",
        },
        "protocol": {"type": "string", "description": "how the runs were made, for the report"},
    },
    "required": ["within"],
    "oneOf": [{"required": ["data", "measure"]}, {"required": ["summary"]}],
    "additionalProperties": False,
}

ID_COLUMNS = ("run", "id")
"""Where the names of runs are looked for, unless the plan says otherwise."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """The options in exact numbers. Either `data` and `measure`, or `summary`, is set."""

    data: Path | None
    summary: Path | None
    measure: Expression | None
    within: Fraction
    within_text: str
    unit: str
    id_column: str | None
    confidence: Fraction
    at_least: Fraction | None
    protocol: str


FLOORS = {"high": Fraction(9, 10), "medium": Fraction(4, 5), "low": Fraction(1, 2)}
"""Criticality of the node → the least success rate that may be claimed."""


@dataclass(slots=True)
class Problems:
    """Collects what is wrong, each with its place in the plan."""

    job: Job
    found: list[Diagnostic]

    def add(self, key: str | None, message: str, hint: str | None = None, code: str = "EXP101") -> None:
        options = self.job.method.options
        self.found.append(Diagnostic(code, message, options.at(key) if key else options.span, hint=hint))


def read(job: Job) -> tuple[Experiment | None, tuple[Diagnostic, ...]]:
    """The experiment, or None with what hinders it."""
    problems = Problems(job, [])
    options = job.options
    data, summary = _path(problems, "data"), _path(problems, "summary")
    if ("data" in options) == ("summary" in options):
        problems.add(None, "an experiment has either 'data' (the runs) or 'summary' (printed figures)")
    unit = _text(problems, "unit")
    measure = _measure(problems, "data" in options)
    within = _within(problems, unit)
    confidence = _probability(problems, "confidence", Fraction(95, 100))
    if confidence is not None and not Fraction(1, 2) <= confidence < 1:
        problems.add("confidence", "the confidence must be at least 0.5 and less than 1")
    at_least = _probability(problems, "at_least", None)
    if at_least is not None and not 0 < at_least < 1:
        problems.add(
            "at_least",
            "the claimed probability of success must lie between 0 and 1",
            "no finite number of runs shows a certainty; leave 'at_least' out to demand that no run fails",
        )
    floor = FLOORS[job.system.plan.node(job.node.name).criticality or "medium"]
    if at_least is not None and 0 < at_least < floor:
        problems.add(
            "at_least",
            f"a success rate of {float(at_least):g} is too little at this criticality: {float(floor):g} at least",
            code="EXP105",
        )
    id_column = _text(problems, "run_column") or None
    protocol = _text(problems, "protocol")
    if problems.found or within is None or confidence is None:
        return None, tuple(problems.found)
    text = f"{options['within']}"
    experiment = Experiment(
        data, summary, measure, within, text, unit, id_column, confidence, at_least, " ".join(protocol.split())
    )
    return experiment, ()


def _path(problems: Problems, key: str) -> Path | None:
    value = problems.job.options.get(key)
    if value is None:
        if key in problems.job.options:
            problems.add(key, f"'{key}' names no file")
        return None
    if not isinstance(value, str):
        problems.add(key, f"'{key}' must be the name of a file")
        return None
    path = inside(problems.job.root, value)
    if path is None:
        problems.add(key, f"'{value}' is not a file in the system's folder")
    elif not path.is_file():
        problems.add(key, f"there is no file '{value}' in {problems.job.root.name}/", code="EXP102")
    return path


def _text(problems: Problems, key: str) -> str:
    value = problems.job.options.get(key, "")
    if not isinstance(value, str):
        problems.add(key, f"'{key}' must be text")
        return ""
    return value


def _measure(problems: Problems, wanted: bool) -> Expression | None:
    text = problems.job.options.get("measure")
    if text is None:
        if wanted:
            problems.add("data", "an experiment with data needs 'measure': a column or an expression over columns")
        return None
    if not wanted:
        problems.add("measure", "'measure' goes with 'data'; a summary has its figures already")
    if not isinstance(text, str):
        problems.add("measure", "'measure' must be text")
        return None
    try:
        found = parse(text)
        if not found.columns:
            problems.add("measure", "the measure reads no column: it is the same for every run", code="EXP103")
        return found
    except Malformed as error:
        problems.add("measure", f"character {error.position + 1} of the measure: {error.message}", code="EXP103")
        return None


def _within(problems: Problems, unit: str) -> Fraction | None:
    value = problems.job.options.get("within")
    if value is None:
        problems.add(None, "an experiment needs 'within': the greatest measure of a run that succeeds")
        return None
    number = _number(value)
    if number is None and isinstance(value, str):
        for name, term in problems.job.contract.constants:
            if name == value:
                number = _constant(term)
                if number is None:
                    problems.add("within", f"the constant '{name}' is not a number")
                    return None
        written = figure(value)
        if number is None and written is not None:
            factor = conversion(written.unit, unit) if unit else None
            if factor is None:
                wanted = f"the measure is in {unit}" if unit else "the option 'unit' says nothing"
                problems.add("within", f"cannot compare with '{value}': {wanted}", code="EXP104")
                return None
            number = written.value * factor
    if number is None:
        names = ", ".join(n for n, t in problems.job.contract.constants if _constant(t) is not None)
        problems.add("within", f"'{value}' is neither a number nor a constant of the contract", f"constants: {names}")
    elif number < 0:
        problems.add("within", "the tolerance is negative: no run could succeed")
    return number


def _constant(term: Term) -> Fraction | None:
    match term:
        case Literal(value=value, sort=RealSort() | IntegerSort() | NaturalSort()) if not isinstance(value, str | bool):
            return Fraction(value)
        case Widen(term=inner):
            return _constant(inner)
        case Negative(term=inner):
            value_ = _constant(inner)
            return None if value_ is None else -value_
        case _:  # no number that is written down
            return None


def _probability(problems: Problems, key: str, default: Fraction | None) -> Fraction | None:
    if key not in problems.job.options:
        return default
    number = _number(problems.job.options[key])
    if number is None:
        problems.add(key, f"'{key}' must be a number")
    return number


def _number(value: object) -> Fraction | None:
    match value:
        case bool():
            return None
        case int():
            return Fraction(value)
        case float():
            # The shortest decimal that reads as this float is what the person typed.
            return decimal(repr(value))
        case str():
            return decimal(value)
        case _:  # no quantity: refused by the caller
            return None
