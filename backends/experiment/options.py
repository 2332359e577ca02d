"""The options of an experiment in plan.yaml, read and checked; every problem has its place."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

from avow.backend_kit.given import existing_file, file, schema, text
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.records import dataclass
from avow.formulas.negation_normal_form import push_negations
from avow.language.bounds import constant
from avow.language.subterms import subterms
from avow.language.terms import Compare, In, Quantified, Quantifier, Role, Term, Variable

from .bound import Bound, upper_bound
from .expression import Expression, Malformed, parse
from .quantity import conversion, decimal, figure, show

SCHEMA = schema(
    {
        "data": file("CSV file, one row a run"),
        "summary": text("YAML file of printed figures, where the runs are not published"),
        "measure": text("a column, or an expression over columns; never negative"),
        "within": {
            "type": ["number", "string"],
            "description": "the greatest measure of a run that succeeds: the contract's number, as in the guarantee or "
            "as a constant's name",
        },
        "unit": text("the unit of the measure and of numbers without one"),
        "run_column": text("the column that names a run (default: run, or id)"),
        "confidence": {
            "type": ["number", "string"],
            "description": "of the statistical statement: 0.9 or more, default 0.95",
        },
        "at_least": {
            "type": ["number", "string"],
            "description": "the claimed probability of success, no less than the criticality asks for; without it no "
            "run at all may fail",
        },
        "protocol": text("how the runs were made, for the report"),
        "left_out": {
            "type": "object",
            "properties": {
                "runs": {"type": "array", "items": {"type": ["string", "integer"]}, "minItems": 1},
                "because": {"type": "string", "minLength": 1},
            },
            "required": ["runs", "because"],
            "additionalProperties": False,
            "description": "runs that failed before and are no longer among the data, by name, and why they do not "
            "count",
        },
    },
    "within",
    oneOf=[{"required": ["data", "measure"]}, {"required": ["summary"]}],
)

ID_COLUMNS = ("run", "id")
"""Where the names of runs are looked for, unless the plan says otherwise."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """The options in exact numbers. Either `data` and `measure`, or `summary`, is set."""

    data: Path | None
    summary: Path | None
    measure: Expression | None
    within: Fraction
    strict: bool
    """Whether a run that measures exactly `within` fails: the guarantee says `<`."""
    unit: str
    id_column: str | None
    confidence: Fraction
    at_least: Fraction | None
    floor: Fraction
    """The least success rate that the runs must show, whatever is claimed."""
    protocol: str
    supposed: str
    """That the tolerance is what the guarantee allows, where the contract has no number to say so; else empty."""
    left_out: tuple[str, ...] = ()
    """Failing runs that the plan says are rightly no longer among the data, and why."""
    because: str = ""


FLOORS = {"high": Fraction(9, 10), "medium": Fraction(4, 5), "low": Fraction(1, 2)}
"""Criticality of the node → the least success rate that may be claimed, or shown."""

LEAST_CONFIDENCE = Fraction(9, 10)


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
    unit = options.get("unit", "")
    measure = _measure(problems, "data" in options)
    within = _within(problems, unit)
    confidence = _probability(problems, "confidence", Fraction(95, 100))
    if confidence is not None and not LEAST_CONFIDENCE <= confidence < 1:
        problems.add("confidence", f"the confidence must be at least {float(LEAST_CONFIDENCE):g} and less than 1")
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
    if problems.found or within is None or confidence is None:
        return None, tuple(problems.found)
    left_out = options.get("left_out", {})
    supposed = "" if within.contracts else f"a tolerance of {within.text} is what the guarantee allows"
    return Experiment(
        data,
        summary,
        measure,
        within.value,
        within.strict,
        unit,
        options.get("run_column") or None,
        confidence,
        at_least,
        floor,
        " ".join(options.get("protocol", "").split()),
        supposed,
        tuple(str(name) for name in left_out.get("runs", ())),
        " ".join(left_out.get("because", "").split()),
    ), ()


def _path(problems: Problems, key: str) -> Path | None:
    if key not in problems.job.options:
        return None
    try:
        return existing_file(problems.job, key, problems.job.options[key], wrong="EXP101", absent="EXP102")
    except Rejected as rejected:
        problems.found.extend(rejected.diagnostics)
        return None


def _measure(problems: Problems, wanted: bool) -> Expression | None:
    text = problems.job.options.get("measure")
    if text is None:
        return None
    if not wanted:
        problems.add("measure", "'measure' goes with 'data'; a summary has its figures already")
    try:
        found = parse(text)
    except Malformed as error:
        problems.add("measure", f"character {error.position + 1} of the measure: {error.message}", code=error.code)
        return None
    for obligation in problems.job.obligations if found.halves else ():
        if not _centre_is_free(problems.job.node.clause(obligation.name).formula):
            message = f"half a width is no measure of {obligation.name}: it says of no place that there is one"
            hint = (
                "`x - mean(…)` goes with `exists(a in REAL | … a - T <= x <= a + T)`; elsewhere it halves the distance"
            )
            problems.add("measure", message, hint, "EXP106")
    return found


def _centre_is_free(formula: Term) -> bool:
    return any(
        isinstance(p, Quantified) and p.quantifier is Quantifier.EXISTS for p in subterms(push_negations(formula))
    )


@dataclass(frozen=True, slots=True)
class _Tolerance:
    value: Fraction
    """In the measure's unit."""
    text: str
    strict: bool
    contracts: bool
    """Whether each guarantee says it."""


def _within(problems: Problems, unit: str) -> _Tolerance | None:
    """The tolerance, held against the contract: where a guarantee compares with numbers it is one of them; where it
    names none, a person has to say that it is meant, also of a constant: it may be of something else."""
    written = problems.job.options.get("within", "")
    constants = {n: v for n, t in problems.job.contract.constants if (v := constant(t)) is not None}
    found = _read_tolerance(problems, written, unit, constants)
    if found is None:
        return None
    value, number = found
    if value < 0:
        problems.add("within", "the tolerance is negative: no run could succeed")
    if value != number:
        message = f"'{written}' is another number in {unit} than in the contract, so it is not its tolerance"
        hint = "the contract's numbers have no units: measure in the unit that they are meant in"
        problems.add("within", message, hint, "EXP107")
    formulas = [(o.name, problems.job.node.clause(o.name).formula) for o in problems.job.obligations]
    bounds = [(name, upper_bound(formula)) for name, formula in formulas if _numbers(formula)]
    for name, bound in bounds:
        match bound:
            case Bound(value=most) if most == number:
                continue
            case Bound(value=most):
                why = f"{name} allows no more than {show(most)}: {written} is not its tolerance"
            case reason:
                why = f"{written} is not its tolerance: of {name}, {reason}"
        hint = "a tolerance is the least number T for which the whole guarantee says `quantity <= T` or `< T`"
        problems.add("within", why, hint, "EXP107")
    strict = any(bound.strict for _, bound in bounds if isinstance(bound, Bound))
    return _Tolerance(value, f"{written}", strict, len(bounds) == len(formulas))


def _read_tolerance(
    problems: Problems, written: float | str, unit: str, constants: Mapping[str, Fraction]
) -> tuple[Fraction, Fraction] | None:
    """(in the measure's unit; as the contract would write it: without a unit of its own)."""
    number = _number(written)
    if number is not None:
        return number, number
    name, _, own = str(written).strip().partition(" ")
    given = figure(str(written))
    if name in constants and not own.strip():
        return constants[name], constants[name]
    if name in constants or given is not None:
        source = own.strip() if name in constants or given is None else given.unit
        factor = conversion(source, unit) if unit else None
        if factor is None:
            wanted = f"the measure is in {unit}" if unit else "the option 'unit' says nothing"
            problems.add("within", f"cannot compare with '{written}': {wanted}", code="EXP104")
            return None
        if name in constants or given is None:
            return constants[name] * factor, constants[name]
        return given.value * factor, given.value * factor
    if any(name == other for other, _ in problems.job.contract.constants):
        problems.add("within", f"the constant '{name}' is not a number")
        return None
    message = f"'{written}' is neither a number nor a constant of the contract"
    problems.add("within", message, f"constants: {', '.join(constants)}")
    return None


def _numbers(formula: Term) -> bool:
    """Whether a guarantee compares with numbers, constants by their values; what only inputs are compared with says
    when it applies."""
    for comparison in subterms(formula):
        if isinstance(comparison, Compare | In):
            parts = [*subterms(comparison)]
            roles = {part.role for part in parts if isinstance(part, Variable)}
            if roles != {Role.INPUT} and any(constant(part) is not None for part in parts):
                return True
    return False


def _probability(problems: Problems, key: str, default: Fraction | None) -> Fraction | None:
    if key not in problems.job.options:
        return default
    number = _number(problems.job.options[key])
    if number is None:
        problems.add(key, f"'{key}' must be a number")
    return number


def _number(value: float | str) -> Fraction | None:
    """Of a float what the person typed: the shortest decimal that reads as it."""
    return decimal(str(value))
