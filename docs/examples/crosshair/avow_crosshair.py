"""A backend of a third party: CrossHair looks for inputs on which a node's own Python class breaks a guarantee.

`checked` at most: CrossHair followed every path, with floats taken for real numbers. What it finds is given to CPython,
in isolation, and judged exactly; only that refutes.
"""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

from avow_crosshair_harness import Unsaid, written

from avow.backend_kit.given import summarized
from avow.backend_kit.programs.cpython import Subject, ask, case_of
from avow.backend_kit.programs.judging import Formula, meets, seen
from avow.backend_kit.protocol import Backend, Job, Limits, Report, Tool
from avow.base.codes import declare, register
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import inside
from avow.base.process import run
from avow.base.verdict import Counterexample, Isolation, Link, Object, Outcome, Verdict, bound
from avow.isolation.level import Unavailable, available, sealed
from avow.isolation.observed import Observed, recorded
from avow.system.node_plan import parameters
from avow.system.plan import Numbers

CODES = register(
    declare(
        "CROSS100",
        "no Python source",
        "The node has no `source:` with a Python file and a class, or one of its files cannot be read.",
        "Write `source: {python: src/node.py, class: Node}` for the node.",
    )
)
_INSTALL = "pip install crosshair-tool"
_REALS = "CrossHair takes floats for real numbers, and the contract's numbers for the floats next to them"


@dataclass(frozen=True, slots=True)
class Reading:
    """The node's class as the plan declares it."""

    file: Path
    name: str
    params: Mapping[str, Any]
    memory: Mapping[str, str]


class CrossHair(Backend):
    """`crosshair: {iterations: 20}`: so many paths in a row without anything new, and a search ends."""

    name = "crosshair"
    title = "CrossHair's symbolic execution of the node's own Python class"
    version = "1"
    strength = Verdict.CHECKED
    link = Link.GENERATED
    of = Object.SOURCE
    codes = CODES
    uses_scenario = False
    uses_wiring = False
    uses_source = True
    options_schema = {
        "type": "object",
        "properties": {"iterations": {"type": "integer", "minimum": 1, "maximum": 10_000, "default": 20}},
        "additionalProperties": False,
    }
    green_means = (
        "CrossHair followed every path through one step of the class and found none that breaks the guarantee, with "
        "floats taken for real numbers. It says nothing of rounding, of NaN, or of runs that memory does not tell of."
    )

    def tools(self) -> tuple[Tool, ...]:
        there = importlib.util.find_spec("crosshair") is not None
        version = metadata.version("crosshair-tool") if there else None
        return (Tool("crosshair", version, None, _INSTALL, optional=False),)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            read(job)
        except Rejected as rejected:
            return rejected.diagnostics
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        source = job.source
        named = (source.python, source.parameters) if source is not None else ()
        return tuple(path for name in named if name and (path := inside(job.root, name)) is not None)

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        (tool,) = self.tools()
        version = f"crosshair {tool.version}"
        try:
            level = available()
            reading = read(job)
        except Unavailable as missing:
            return Report.alike(job, Verdict.NOT_RUN, str(missing), "crosshair", version)
        except Rejected as rejected:
            return Report.alike(job, Verdict.ERROR, summarized(job, rejected.diagnostics), "crosshair", version)
        if not tool.present:
            return Report.alike(job, Verdict.NOT_RUN, f"crosshair is not here: {_INSTALL}", "crosshair", version)
        outcomes, observed, log = looked(job, reading, level, limits)
        numbers = job.source.numbers.value if job.source is not None else "exact"
        outcomes = tuple(replace(o, of=Object.SOURCE, numbers=numbers) for o in outcomes)
        return Report(outcomes, "crosshair", version, (), {"crosshair.log": log} if log else {}, observed, level)


def read(job: Job) -> Reading:
    """Raises Rejected."""
    source, place = job.source, job.method.options.span
    if source is None or not source.python:
        raise Rejected(Diagnostic("CROSS100", f"{job.node.name} has no Python source", place))
    if source.numbers is Numbers.FLOAT32:
        raise Rejected(Diagnostic("CROSS100", "Python's floats are float64, not float32", place))
    file = inside(job.root, source.python)
    params, faults = parameters(job.root, source, job.system.plan.ros.names.placed(job.node.name).name)
    try:
        assert file is not None
        ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError, AssertionError) as error:
        faults = (*faults, Diagnostic("CROSS100", f"`{source.python}` cannot be read: {error}", place))
    if faults or file is None:
        raise Rejected(*faults)
    return Reading(file.resolve(), source.class_name, params, dict(source.memory))


def looked(
    job: Job, reading: Reading, level: Isolation, limits: Limits
) -> tuple[tuple[Outcome, ...], tuple[Observed, ...], str]:
    """CrossHair's word on each guarantee, its findings shown by CPython; what was looked at; what CrossHair printed."""
    how = {"path": str(reading.file), "class": reading.name, "params": dict(reading.params), "memory": reading.memory}
    try:
        text, numbers = written(job.node, [job.clause(o) for o in job.obligations], how)
    except Unsaid as unsaid:
        return alike(job, Verdict.UNKNOWN, f"not translated: {unsaid}"), (), ""
    with tempfile.TemporaryDirectory(prefix="avow-crosshair-") as made:
        file = Path(made).resolve() / "harness.py"
        file.write_text(text, encoding="utf-8")
        iterations = str(job.options.get("iterations", 20))
        command = [sys.executable, "-P", "-B", "-m", "crosshair", "check", "--analysis_kind=asserts", "--report_all"]
        command += [f"--max_uninteresting_iterations={iterations}", str(file)]
        if level is Isolation.SEALED:
            command = sealed(command, file.parent)
        environment = {"PYTHONHASHSEED": "0", "PYTHONPATH": "", "COLUMNS": "1000"}
        done = run(command, cwd=file.parent, seconds=limits.seconds * 0.7, megabytes=limits.megabytes, env=environment)
        if done.timed_out:
            return alike(job, Verdict.UNKNOWN, "CrossHair did not end in the time given"), (), done.stdout
        said = answers(done.stdout, file, text)
    if isinstance(said, str):
        return alike(job, Verdict.ERROR, said), (), done.stdout + done.stderr
    outcomes, observed = [], dict.fromkeys(recorded([("read", str(path)) for path in CrossHair().files(job)]))
    for o in job.obligations:
        number = numbers.get(o.name)
        if number is None:
            outcomes.append(Outcome(o.id, Verdict.UNKNOWN, "not translated for CrossHair"))
            continue
        word, case = said.get(number, ("", None))
        if case is not None:
            found, seen_by = replayed(job, reading, o.name, case, limits)
            observed.update(dict.fromkeys(seen_by))
            outcomes.append(replace(found, obligation=o.id))
        elif word == "Confirmed over all paths.":
            rests = (bound("crosshair.reals", _REALS),)
            summary = "CrossHair followed every path, and none breaks it"
            limits_of = {"paths": "all", "iterations": int(iterations)}
            outcomes.append(Outcome(o.id, Verdict.CHECKED, summary, bound=limits_of, rests_on=rests))
        else:
            outcomes.append(Outcome(o.id, Verdict.UNKNOWN, f"CrossHair: {word or 'no answer'}"))
    return tuple(outcomes), tuple(observed), done.stdout.replace(str(file.parent) + os.sep, "")


def alike(job: Job, verdict: Verdict, summary: str) -> tuple[Outcome, ...]:
    return tuple(Outcome(o.id, verdict, summary) for o in job.obligations)


_LINE = re.compile(r"^(?P<file>.+):(?P<line>\d+): (?:error|warning|info): (?P<said>.+)$")
_CALL = re.compile(r"when calling (guarantee_\d+\(.*\))")


def answers(printed: str, file: Path, text: str) -> dict[int, tuple[str, dict[str, Any] | None]] | str:
    """Function's number → CrossHair's words, and the arguments that it found; or why none of it counts: a line that is
    not CrossHair's was printed by the class."""
    ranges = {
        int(part.name.removeprefix("guarantee_")): (part.lineno, part.end_lineno or part.lineno)
        for part in ast.parse(text).body
        if isinstance(part, ast.FunctionDef) and part.name.startswith("guarantee_")
    }
    found: dict[int, tuple[str, dict[str, Any] | None]] = {}
    for line in filter(None, map(str.strip, printed.splitlines())):
        match = _LINE.match(line)
        if match is None or Path(match["file"]) != file:
            return f"something else than CrossHair printed a line: {line[:120]}"
        at = int(match["line"])
        number = next((k for k, (first, last) in ranges.items() if first <= at <= last), None)
        call = _CALL.search(match["said"])
        if call is not None:
            number, case = _arguments(call[1])
        else:
            case = None
        if number is None:
            continue
        if number in found:
            return f"CrossHair answered twice: {line[:120]}"
        found[number] = (match["said"], case)
    return found


def _arguments(text: str) -> tuple[int | None, dict[str, Any] | None]:
    """``guarantee_1(1.45, [2.0])``: the function's number, and its arguments by position and name."""
    try:
        call = ast.parse(_whole(text), mode="eval").body
        assert isinstance(call, ast.Call)
        assert isinstance(call.func, ast.Name)
        case = {f"i{k}": _value(part) for k, part in enumerate(call.args)}
        case |= {str(word.arg): _value(word.value) for word in call.keywords}
        return int(call.func.id.removeprefix("guarantee_")), case
    except (SyntaxError, ValueError, AssertionError, RecursionError):
        return None, None


def _whole(text: str) -> str:
    """Up to the parenthesis that ends the call: more may be said after it."""
    for end in (k + 1 for k, c in enumerate(text) if c == ")"):
        try:
            ast.parse(text[:end], mode="eval")
            return text[:end]
        except SyntaxError:
            continue
    return text


def _value(part: ast.expr) -> Any:
    match part:
        case ast.Call(func=ast.Name(id="float"), args=[ast.Constant(value=str(word))]):
            return float(word)
        case ast.List(elts=items):
            return [_value(item) for item in items]
        case _:  # a constant, or one with a sign
            return ast.literal_eval(part)


def replayed(
    job: Job, reading: Reading, name: str, case: Mapping[str, Any], limits: Limits
) -> tuple[Outcome, tuple[Observed, ...]]:
    """What CPython makes of the inputs that CrossHair found."""
    node, memory = job.node, reading.memory
    clause = Formula.of(node.clause(name))
    unknown = Outcome("", Verdict.UNKNOWN, f"CrossHair shows {dict(case)}, of which CPython breaks nothing")
    try:
        inputs = {p.name: case[f"i{k}"] for k, p in enumerate(node.inputs)}
        allowed = meets(tuple(map(Formula.of, node.assumptions)))(inputs)
    except (KeyError, ValueError, TypeError, OverflowError):
        return unknown, ()
    if not allowed:
        return unknown, ()
    subject = Subject(job.root.resolve(), reading.file, reading.name, reading.params, memory, ())
    others = {n: v for n, v in inputs.items() if n not in memory}
    question = case_of(others, {n: v for n, v in inputs.items() if n in memory})
    answered = ask(subject, [question], seconds=max(2.0, limits.seconds * 0.2), megabytes=limits.megabytes)
    if answered.fault or len(answered.replies) != 1:
        return Outcome("", Verdict.ERROR, answered.fault or "the class did not answer"), answered.observed
    step = seen(node, memory, inputs, answered.replies[0])
    if step.wrong or clause.holds(step.values) is False:
        why = step.wrong or f"CrossHair found it, CPython answers so, and guarantee {name} does not hold of it"
        shown = Counterexample(step.pairs(), why)
        return Outcome("", Verdict.REFUTED, shown.text(), shown), answered.observed
    return unknown, answered.observed


BACKEND = CrossHair()
