"""Hoare's logic, the tests by Hypothesis, the monitor, and Dafny against one brute-force oracle on generated contracts.

Each contract comes with a program, both of them right or with one small fault, printed for each translator from one
source. `proved` must go with no violation among the inputs at, below and above every constant; a counterexample must be
one; a monitor must say of every step what the oracle says. Seeds 0 to 1,050 were run when this was written (Hypothesis:
400, Dafny: 100); here are a few of them.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hoare.systems import make_job

from avow.backend_kit.protocol import Job, Limits
from avow.backends.dafny import BACKEND as DAFNY
from avow.backends.hoare import BACKEND as HOARE
from avow.backends.hypothesis import BACKEND as HYPOTHESIS
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.traces import parse_event
from avow.backends.rosmonitoring.watched import Fault
from avow.base.verdict import Verdict
from avow.language.load import check_text
from differential.contracts import Contract, Writer
from differential.inputs import grid
from differential.language import FIELDS, INPUTS, OUTPUTS, rcl
from differential.near_misses import near_miss
from differential.oracle import Stops, Table, run, truth

State = Mapping[str, Any]


def written(seed: int) -> Contract | None:
    """None where RCL cannot tell the type of an empty sequence."""
    made = Writer(seed).contract(spiced=seed % 2 == 1)
    _, faults = check_text(made.rcl, "n.rcl")
    errors = [f for f in faults if f.is_error]
    assert all(f.code == "RCL306" for f in errors), (made.rcl, errors)
    return None if errors else made


def allowed(made: Contract, inputs: State) -> bool | None:
    found = [truth(a, inputs) for a in made.assumptions.values()]
    return False if False in found else None if None in found else True


def judged(made: Contract, name: str, inputs: State) -> bool | None:
    """Whether the program keeps a guarantee; a run without an output keeps none. None: it has no truth value."""
    try:
        return truth(made.guarantees[name], {**inputs, **run(made.program, inputs, OUTPUTS)})
    except Stops:
        return False


def violations(made: Contract, seed: int, most: int = 150) -> set[str]:
    inputs = [i for i in grid(made, random.Random(seed), most) if allowed(made, i)]
    return {name for name in made.guarantees if any(judged(made, name, i) is False for i in inputs)}


# -- counterexamples, read back ----------------------------------------------------------------------------------------


def parts(text: str) -> list[str]:
    """What commas separate, outside brackets."""
    found, depth = [""], 0
    for c in text:
        depth += (c in "([{⟨<") - (c in ")]}⟩>")
        if c == "," and depth == 0:
            found.append("")
        else:
            found[-1] += c
    return [f.strip() for f in found if f.strip()]


def value(text: str, sort: str) -> Any:
    match sort:
        case "R" | "I" | "N":
            return Fraction(re.sub(r"[() ]", "", text))
        case "B":
            return text == "TRUE"
        case "C":
            return text
        case "D":
            name, _, rest = text.partition("(")
            return (name, *(value(a, s) for a, s in zip(parts(rest[:-1]), FIELDS[name], strict=True)))
        case "P":
            number, colour = parts(text[1:-1])
            return (value(number, "I"), colour)
        case "S":
            return tuple(value(a, "I") for a in parts(text[1:-1]))
    default: Any = False
    points: dict[int, Any] = {}
    for point in parts(text[1:-1]):
        key, colon, result = point.rpartition(":") if ":" in point else (point, "", "TRUE")
        found = value(result.strip(), "B" if sort == "M" else "I")
        if key.strip() == "else":
            default = found
        else:
            points[int(key.strip(" ()"))] = found
        del colon
    return Table(points, default)


def is_real(made: Contract, name: str, shown: tuple[tuple[str, str], ...]) -> bool:
    inputs = {n: value(text, INPUTS[n[3:]]) for n, text in shown if n.startswith("in.") and n[3:] in made.inputs}
    assert len(inputs) == len(made.inputs), shown
    return allowed(made, inputs) is True and judged(made, name, inputs) is False


# -- the translators ---------------------------------------------------------------------------------------------------


def hold(made: Contract, job: Job, tool: Any, seed: int, seconds: float = 30) -> dict[Verdict, int]:
    """Discharge, and compare with the oracle."""
    broken = violations(made, seed)
    counts: dict[Verdict, int] = {}
    for outcome in tool.discharge(job, job.root, Limits(seconds=seconds)).outcomes:
        name = outcome.obligation.rpartition("/")[2]
        counts[outcome.verdict] = counts.get(outcome.verdict, 0) + 1
        assert not (outcome.verdict.supports and name in broken), (seed, name, outcome.summary, made.rcl, made.imp)
        if outcome.verdict is Verdict.REFUTED:
            assert outcome.counterexample is not None
            shown = outcome.counterexample.values
            assert is_real(made, name, shown), (seed, name, shown, made.rcl, made.imp)
    return counts


def many(seeds: range, folder: Path, backend: str, tool: Any) -> dict[Verdict, int]:
    total: dict[Verdict, int] = {}
    for seed in seeds:
        made = written(seed)
        if made is None:
            continue
        example = next((i for i in grid(made, random.Random(seed), 150) if allowed(made, i)), None)
        if example is None:
            continue
        options, files = {
            "hoare": ({"program": "n.imp"}, {"n.imp": made.imp}),
            "hypothesis": ({"subject": "s.py:step"}, {"s.py": made.python}),
            "dafny": ({"implementation": "n.dfy"}, {"n.dfy": made.dafny(example)}),
        }[backend]
        job = make_job(folder / str(seed), made.rcl, "n", options, files, backend)
        assert not [d for d in tool.check(job) if d.is_error], made.rcl
        for verdict, count in hold(made, job, tool, seed).items():
            total[verdict] = total.get(verdict, 0) + count
    return total


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 48), marks=pytest.mark.nightly)])
def test_hoare_says_what_the_oracle_says(seeds: range, tmp_path: Path) -> None:
    found = many(seeds, tmp_path, "hoare", HOARE)
    assert found[Verdict.PROVED] > 10
    assert found[Verdict.REFUTED] > 2
    assert Verdict.ERROR not in found


@pytest.mark.nightly
def test_hypothesis_says_what_the_oracle_says(tmp_path: Path) -> None:
    """It may miss what is there; of these it misses none."""
    found = many(range(12), tmp_path, "hypothesis", HYPOTHESIS)
    assert found[Verdict.TESTED] > 10
    assert found[Verdict.REFUTED] > 2


@pytest.mark.nightly
@pytest.mark.needs_dafny
def test_dafny_proves_nothing_that_the_oracle_breaks(tmp_path: Path) -> None:
    found = many(range(3, 6), tmp_path, "dafny", DAFNY)
    assert found[Verdict.PROVED] > 2
    assert Verdict.ERROR not in found


@pytest.mark.nightly
def test_a_wrong_oracle_or_translator_would_be_caught(tmp_path: Path) -> None:
    """A program other than the one that the oracle runs."""
    caught = 0
    for seed in range(12):
        made = written(seed)
        if made is None:
            continue
        writer = Writer(seed + 1000)
        other = near_miss(made.program, writer.rng, writer.given)
        right = made.imp
        made.program = other
        job = make_job(tmp_path / str(seed), made.rcl, "n", {"program": "n.imp"}, {"n.imp": right}, "hoare")
        try:
            hold(made, job, HOARE, seed)
        except AssertionError:
            caught += 1
    assert caught > 1


# -- the monitor -------------------------------------------------------------------------------------------------------


def exact(number: Any) -> str:
    """As decimal digits. Raises ValueError where there are infinitely many."""
    found = Decimal(Fraction(number).numerator) / Decimal(Fraction(number).denominator)
    if Fraction(found) != number:
        raise ValueError
    return format(found, "f")


def fields(name: str, found: Any, sort: str) -> str:
    match sort:
        case "R" | "I" | "N":
            return f'"{name}": {exact(found)}'
        case "B" | "C":
            return f'"{name}": {json.dumps(found)}'
        case "D":
            arguments = [f'"{name}_{found[0]}_{k}": {exact(a)}' for k, a in enumerate(found[1:])]
            return ", ".join([f'"{name}": "{found[0]}"', *arguments])
        case "S":
            return f'"{name}": {json.dumps([int(n) for n in found])}'
        case "P":
            return f'"{name}_0": {exact(found[0])}, "{name}_1": "{found[1]}"'
    if found.default != 0:  # the plan says once and for all what a function is elsewhere
        raise ValueError
    points = ", ".join(f'{{"at": {k}, "value": {json.dumps(int(v))}}}' for k, v in found.items())
    return f'"{name}": [{points}]'


def mapping(name: str, sort: str) -> Any:
    match sort:
        case "D":
            return {"constructor": name, "move": [f"{name}_move_0", f"{name}_move_1"], "mark": [f"{name}_mark_0"]}
        case "M":
            return {"fields": ["at"], "each": name}
        case "L":
            return {"fields": ["at", "value"], "each": name, "elsewhere": 0}
        case "P":
            return [f"{name}_0", f"{name}_1"]
    return name


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(20), pytest.param(range(20, 120), marks=pytest.mark.nightly)])
def test_the_monitor_says_what_the_oracle_says(seeds: range, tmp_path: Path) -> None:
    seen = {True: 0, False: 0}
    for seed in seeds:
        made = written(seed)
        if made is None:
            continue
        rng = random.Random(seed)
        told = {f"in.{n}": mapping(n, INPUTS[n]) for n in made.inputs}
        told |= {f"out.{n}": mapping(n, OUTPUTS[n]) for n in made.outputs}
        job = make_job(tmp_path / str(seed), made.rcl, "n", {"mapping": told}, {}, "rosmonitoring")
        found, faults = setup(job.system, job.node, job.method.options)
        assert (faults, dict(found.hidden)) == ((), {})
        monitor = Monitor(found, list(made.guarantees))
        ends: list[dict[str, Any]] = []
        for inputs in rng.sample(every := grid(made, rng, 60), min(30, len(every))):
            try:
                ends.append(run(made.program, inputs, OUTPUTS))
                outputs = rng.choice(ends[-5:])  # now and then the answer to something else
                given = ", ".join(fields(n, inputs[f"in.{n}"], INPUTS[n]) for n in made.inputs)
                answer = ", ".join(fields(n, outputs[f"out.{n}"], OUTPUTS[n]) for n in made.outputs)
            except (Stops, ValueError):
                continue
            said = monitor.step(parse_event(f'{{"topic": "given", {given}}}'))
            said = [*said, *monitor.step(parse_event(f'{{"topic": "made", {answer}}}'))]
            blamed = {v.clause: v.fault for v in said}
            for name, formula in made.guarantees.items():
                held = truth(formula, {**inputs, **outputs})
                if held is None or "out." not in rcl(formula):
                    continue
                seen[held] += 1
                assert (name not in blamed) is held, (seed, name, rcl(formula), inputs, outputs)
                if not held and allowed(made, inputs) is not None:
                    right = Fault.GUARANTEE if allowed(made, inputs) else Fault.EXCUSED
                    assert blamed[name] is right, (seed, name, inputs)
    assert min(seen.values()) > 50, seen
