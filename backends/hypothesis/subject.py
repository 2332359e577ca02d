"""The plan's program under test, read without running it: the file, the function, the names of its arguments."""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from avow.backend_kit.given import existing_file
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Span, refuse
from avow.base.files import inside, read_regular
from avow.base.python_names import imported, inherited, method_of, top_level
from avow.base.suggestions import did_you_mean
from avow.drive.steps import coded
from avow.formulas.formula import free_variables
from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    SequenceSort,
    Sort,
    TupleSort,
)
from avow.system.driven import source_faults
from avow.system.node_plan import parameters
from avow.system.plan import Driving, Numbers, Source


@dataclass(frozen=True, slots=True)
class SubjectFile:
    """``models/sensor.py:step``."""

    name: str
    path: Path
    function: str
    """The function; for a driven class, how to drive it, as JSON (`avow.drive.steps`)."""
    held: Mapping[str, str] = field(default_factory=dict)
    """For a driven class, the attribute that holds each port of its memory."""
    driven: bool = False
    source: bool = False
    """Whether it is the node's own class."""
    class_name: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    wants_parameters: bool = False
    accepted: frozenset[str] | None = None
    """The inputs that it takes by name; None: all."""
    left_out: frozenset[str] = frozenset()
    """Qualified names of ports in no clause: inputs that the class is not given, outputs that are not read."""

    @property
    def memory(self) -> tuple[str, ...]:
        return tuple(sorted(self.held))

    def takes(self, name: str) -> bool:
        return self.accepted is None or name in self.accepted


def subject(job: Job) -> SubjectFile:
    """Raises Rejected (codes ``HYPO1…``): no such option, file or function, or arguments that are not inputs."""
    found = locate(job)
    place = job.method.options.at("subject")
    try:
        tree = ast.parse(read_regular(found.path), filename=found.path.name)
    except SyntaxError as error:
        line, column = error.lineno or 1, error.offset or 1
        span = Span(str(found.path), line, column, line, column + 1)
        raise Rejected(Diagnostic("HYPO103", f"this is no Python: {error.msg}", span)) from error
    except (OSError, ValueError, RecursionError) as error:
        raise Rejected(Diagnostic("HYPO103", f"`{found.name}` cannot be read: {error}", place)) from error
    defined = top_level(tree)
    if found.driven:
        assert job.source is not None
        refuse(source_faults(job.source, tree))
        if job.source.kind is not Driving.STEP:
            return found
        declared = defined[job.source.class_name]
        assert isinstance(declared, ast.ClassDef)
        begun = method_of(declared, "__init__")
        found = replace(found, wants_parameters=begun is not None and len(begun.args.args) > 1)
        return _without(found, method_of(declared, "step"), job)
    if found.function not in defined:
        message = f"`{found.name}` defines no function `{found.function}`"
        raise Rejected(Diagnostic("HYPO102", message, place, hint=did_you_mean(found.function, defined)))
    definition = defined[found.function]
    if isinstance(definition, ast.FunctionDef | ast.AsyncFunctionDef):
        problems = _arguments(definition, found, job)
        if problems:
            raise Rejected(*problems)
        return replace(found, accepted=_accepted(definition.args))
    if isinstance(definition, ast.ClassDef) and (step := inherited(definition, "step", defined)) is not None:
        return _step_class(found, definition, step, job)
    return found


def _step_class(found: SubjectFile, definition: ast.ClassDef, step: ast.FunctionDef, job: Job) -> SubjectFile:
    """A class with a method `step` that the option names: constructed without arguments, once for each run. Raises
    Rejected."""
    begun = method_of(definition, "__init__")
    problems = _arguments(step, found, job, method=True)
    if begun is not None and len(begun.args.args) - len(begun.args.defaults) > 1:
        message = f"`{definition.name}` is made without arguments"
        problems.append(Diagnostic("HYPO104", message, _span(begun, str(found.path))))
    accepted = _accepted(step.args)
    for port in (*job.node.inputs, *job.node.fixed):
        if accepted is not None and port.name not in accepted:
            message = f"`step` does not take the input `{port.name}`"
            problems.append(Diagnostic("HYPO104", message, _span(step, str(found.path))))
    unfit = [port.name for port in (*job.node.inputs, *job.node.outputs) if not _plain(port.sort)]
    if unfit:
        place = job.method.options.at("subject")
        problems.append(Diagnostic("HYPO106", f"a step class is not given what {unfit[0]} is", place))
    if problems:
        raise Rejected(*problems)
    function = _driving(definition.name, {}, {})
    return SubjectFile(found.name, found.path, function, driven=True, class_name=definition.name)


def _driving(class_name: str, parameters: Mapping[str, Any], memory: Mapping[str, str]) -> str:
    """How to drive a class, as JSON (`avow.drive.steps`)."""
    spec = {"class": class_name, "params": coded(dict(parameters)), "memory": dict(memory), "attributes": []}
    return json.dumps(spec)


def _without(found: SubjectFile, step: ast.FunctionDef | None, job: Job) -> SubjectFile:
    """The node's own class, without the ports of other than plain types that no clause mentions; an input only if
    `step` does not take it. Raises Rejected."""
    clauses = (*job.node.assumptions, *map(job.clause, job.obligations))
    spoken = {v.qualified for clause in clauses for v in free_variables(clause.formula)}
    accepted = _accepted(step.args) if step is not None else None
    left: set[str] = set()
    for port in (*job.node.inputs, *job.node.outputs):
        called = port.variable.qualified
        needed = port in job.node.inputs and (accepted is None or port.name in accepted)
        if _plain(port.sort):
            continue
        if called in spoken or needed or port.name in found.memory:
            place = job.source.place.at("source") if job.source is not None else None
            raise Rejected(Diagnostic("HYPO106", f"a step class is not given what {port.name} is", place))
        left.add(called)
    return replace(found, left_out=frozenset(left))


def _accepted(arguments: ast.arguments) -> frozenset[str] | None:
    return None if arguments.kwarg is not None else frozenset(a.arg for a in (*arguments.args, *arguments.kwonlyargs))


def locate(job: Job) -> SubjectFile:
    """The file and the function's name, if there is such a file. Raises Rejected."""
    text = job.options.get("subject")
    options = job.method.options
    if text is None and job.source is not None and job.source.python:
        return _declared(job, job.source)
    if text is None:
        message = "the method needs a subject: `subject: models/….py:function`, or a node with a Python source"
        raise Rejected(Diagnostic("HYPO100", message, options.span))
    name, colon, function = text.rpartition(":")
    if not colon or not name or not function.isidentifier():
        message = f"`{text}` is not of the form file.py:function"
        raise Rejected(Diagnostic("HYPO100", message, options.at("subject")))
    return SubjectFile(name, existing_file(job, "subject", name, wrong="HYPO101", absent="HYPO101"), function)


def _declared(job: Job, source: Source) -> SubjectFile:
    """The node's own class, driven. Raises Rejected."""
    place = source.place.at("source")
    path = inside(job.root, source.python)
    if path is None or not path.is_file():
        raise Rejected(Diagnostic("HYPO101", f"there is no file `{source.python}` in the system's folder", place))
    params, faults = parameters(job.root, source, job.system.plan.ros.names.placed(job.node.name).name)
    if source.numbers is Numbers.FLOAT32:
        faults += (Diagnostic("HYPO106", "a Python class computes with float64, not float32", place),)
    if faults:
        raise Rejected(*faults)
    function = _driving(source.class_name, params, source.memory)
    return SubjectFile(source.python, path, function, dict(source.memory), True, True, source.class_name, dict(params))


def parameter_files(job: Job) -> tuple[Path, ...]:
    """The parameters of a driven class."""
    source = job.source if job.options.get("subject") is None else None
    path = inside(job.root, source.parameters) if source is not None and source.parameters else None
    return (path,) if path is not None else ()


def _plain(sort: Sort) -> bool:
    """Whether values of the sort can be given to a step class."""
    match sort:
        case SequenceSort(item=item):
            return isinstance(item, _PLAIN)
        case DataSort(constructors=constructors):
            return all(isinstance(part, _PLAIN) for each in constructors for part in each.parameters)
        case TupleSort(items=items):
            return all(isinstance(item, _PLAIN) for item in items)
        case _:  # one value
            return isinstance(sort, _PLAIN)


_PLAIN = (BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort)


def modules(path: Path) -> tuple[Path, ...]:
    """The program's file and the files beside it that it imports, directly or not: its answers depend on them."""
    found: dict[Path, None] = {}
    stack = [path]
    while stack:
        file = stack.pop()
        if file in found:
            continue
        found[file] = None
        try:
            tree = ast.parse(read_regular(file))
        except (OSError, ValueError, SyntaxError, RecursionError):
            continue
        for head in sorted(imported(tree)):
            beside = (path.parent / f"{head}.py", path.parent / head / "__init__.py")
            stack.extend(candidate for candidate in beside if candidate.is_file())
    return tuple(sorted(found))


def _arguments(
    definition: ast.FunctionDef | ast.AsyncFunctionDef, found: SubjectFile, job: Job, *, method: bool = False
) -> list[Diagnostic]:
    """Arguments that no input fills; an async function. Inputs that it does not take are simply not given."""
    problems: list[Diagnostic] = []
    file = str(found.path)
    if isinstance(definition, ast.AsyncFunctionDef):
        message = f"`{definition.name}` is async; a subject is a plain function"
        problems.append(Diagnostic("HYPO104", message, _span(definition, file)))
    inputs = [port.name for port in (*job.node.inputs, *job.node.fixed)]
    arguments = definition.args
    positional = [*arguments.posonlyargs, *arguments.args]
    required = positional[: len(positional) - len(arguments.defaults)][method:]
    required += [a for a, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if default is None]
    for argument in required:
        if argument in arguments.posonlyargs:
            message = f"`{argument.arg}` can only be given by position; inputs are given by name"
            problems.append(Diagnostic("HYPO104", message, _span(argument, file)))
        elif argument.arg not in inputs:
            hint = did_you_mean(argument.arg, inputs) or f"inputs: {', '.join(inputs) or 'none'}"
            message = f"node {job.node.name} has no input `{argument.arg}`"
            problems.append(Diagnostic("HYPO104", message, _span(argument, file), hint=hint))
    return problems


def _span(node: ast.stmt | ast.arg, file: str) -> Span:
    line, column = node.lineno, node.col_offset + 1
    return Span(file, line, column, line, column + 1)
