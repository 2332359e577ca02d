"""The options in plan.yaml, or all faults."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.packaged import packaged
from avow.base.suggestions import suggest
from avow.language.bounds import constant
from avow.language.contract import Port
from avow.language.sorts import REAL

from .expressions import Expression, Misread, Name, Number, parse
from .maps import Map, NotAffine
from .truth import Span
from .tuning import STATES, STEPS

SCHEMA = packaged("avow.backends.reach", "options.json")


@dataclass(frozen=True, slots=True)
class Given:
    """The options. `inputs` has the qualified name of each input's port, `outputs` the term of each output port."""

    equations: Mapping[str, Expression]
    initial: Mapping[str, Span]
    inputs: Mapping[str, str]
    outputs: Mapping[str, Expression]
    initial_text: str
    map: Map | None
    steps: int
    """Of a map; 0 if the plan gives none."""
    horizon: Fraction
    step: Fraction


def read(job: Job) -> Given:
    """Raises Rejected with all faults."""
    options, faults = job.options, list[Diagnostic]()
    kind = "ode" if "ode" in options else "map"
    faults += _shape(job, kind)
    terms: Mapping[str, Any] = options.get(kind, {})
    known: dict[str, Expression] = {}
    for name, term in job.contract.constants:
        if (number := constant(term)) is not None:
            known[name] = Number(number)
    inputs: Mapping[str, str] = options.get("inputs", {})
    for option, names in ((kind, terms), ("inputs", inputs)):
        for name in names:
            if not name.isidentifier() or name in known:
                why = "has two meanings" if name in known else "is no name for a term"
                faults.append(_fault(job, "REACH102", f"'{name}' {why}", option, name))
            known[name] = Name(name)
    faults += _unconnected(job, "inputs", inputs, job.node.inputs)
    faults += _unconnected(job, "outputs", {name: name for name in options["outputs"]}, job.node.outputs)
    equations = _terms(job, kind, terms, known, faults)
    outputs = _terms(job, "outputs", options["outputs"], known, faults)
    initial = dict(_initial(job, terms, faults))
    affine = None
    if kind == "map" and not faults:
        try:
            affine = Map.of(equations, outputs, tuple(inputs))
        except NotAffine as which:
            faults.append(_fault(job, "REACH104", f"{which} is not affine in states and inputs", "map"))
    if faults:
        raise Rejected(*faults)
    shown = " and ".join(f"{name} in {options['initial'][name]}" for name in terms)
    horizon, step = (_exact(options.get(option, 0)) for option in ("horizon", "step"))
    return Given(equations, initial, inputs, outputs, shown, affine, options.get("steps", 0), horizon, step)


def _shape(job: Job, kind: str) -> Iterator[Diagnostic]:
    options = job.options
    if ("ode" in options) == ("map" in options):
        yield _fault(job, "REACH101", "a motion has either 'ode' or 'map'")
    needed, useless = (("horizon", "step"), ("steps",)) if kind == "ode" else ((), ("horizon", "step"))
    for option in needed:
        if option not in options:
            yield _fault(job, "REACH101", f"an ode needs '{option}', in seconds")
        elif not _is_finite(options[option]):
            yield _fault(job, "REACH101", f"'{option}' is no finite number", option)
    for option in useless:
        if option in options:
            yield _fault(job, "REACH101", f"'{option}' has no use for '{kind}'", option)
    if all(_is_finite(options.get(option, math.inf)) for option in ("horizon", "step")):
        number = _exact(options["horizon"]) / _exact(options["step"])
        if number > STEPS:
            yield _fault(job, "REACH101", f"more than {STEPS} steps in the horizon: give a longer 'step'", "step")
    for option in (kind, "inputs"):
        if len(options.get(option, ())) > STATES:
            yield _fault(job, "REACH101", f"'{option}' has more than {STATES} names", option)


def _initial(job: Job, states: Mapping[str, Any], faults: list[Diagnostic]) -> Iterator[tuple[str, Span]]:
    given = job.options["initial"]
    for name in states:
        if name not in given:
            faults.append(_fault(job, "REACH101", f"the state '{name}' has no first value", "initial"))
    for name, entry in given.items():
        low, high = entry if isinstance(entry, list) else (entry, entry)
        if name not in states:
            faults.append(_fault(job, "REACH101", f"'{name}' is no state", "initial", name, hint=suggest(name, states)))
        elif not (_is_finite(low) and _is_finite(high) and low <= high):
            faults.append(_fault(job, "REACH101", f"'{name}' has an interval without values", "initial", name))
        else:
            yield name, Span(_exact(low), _exact(high))


def _terms(
    job: Job, option: str, given: Mapping[str, Any], known: Mapping[str, Expression], faults: list[Diagnostic]
) -> dict[str, Expression]:
    found = {}
    for name, text in given.items():
        try:
            found[name] = parse(str(text), known)
        except Misread as why:
            faults.append(_fault(job, "REACH103", f"{name}: {why}", option, name))
    return found


def _unconnected(job: Job, option: str, given: Mapping[str, str], ports: tuple[Port, ...]) -> Iterator[Diagnostic]:
    """`given` has the port's name for each entry of the option."""
    sorts = {port.variable.qualified: port.sort for port in ports}
    taken = set[str]()
    for entry, name in given.items():
        if name not in sorts:
            message = f"'{name}' is none of {', '.join(sorts) or 'its ports: it has none'}"
            yield _fault(job, "REACH102", message, option, entry, hint=suggest(name, sorts))
        elif sorts[name] != REAL or name in taken:
            why = "is the port of two inputs" if name in taken else "is no REAL"
            yield _fault(job, "REACH102", f"{name} {why}", option, entry)
        taken.add(name)


def _is_finite(number: float) -> bool:
    return isinstance(number, int) or math.isfinite(number)  # which raises for a great int


def _exact(number: float) -> Fraction:
    """The decimal as the plan has it."""
    return Fraction(str(number))


def _fault(job: Job, code: str, message: str, *place: str, hint: str | None = None) -> Diagnostic:
    return Diagnostic(code, message, job.method.options.at(*place), hint=hint)
