"""The plan's subject, looked at without running it: the file, the function, the names of its arguments."""

from __future__ import annotations

import ast
import difflib
from dataclasses import dataclass
from pathlib import Path

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.system.paths import inside


@dataclass(frozen=True, slots=True)
class SubjectFile:
    """``models/sensor.py:step``."""

    name: str
    path: Path
    function: str


def subject(job: Job) -> SubjectFile:
    """Raises Rejected (codes ``HYPO1…``): no such option, file or function, or arguments that are no inputs."""
    found = locate(job)
    place = job.method.options.at("subject")
    try:
        tree = ast.parse(found.path.read_bytes(), filename=found.path.name)
    except SyntaxError as error:
        line, column = error.lineno or 1, error.offset or 1
        span = Span(str(found.path), line, column, line, column + 1)
        raise Rejected(Diagnostic("HYPO103", f"this is no Python: {error.msg}", span)) from error
    except (OSError, ValueError, RecursionError) as error:
        raise Rejected(Diagnostic("HYPO103", f"`{found.name}` cannot be read: {error}", place)) from error
    defined = _top_level(tree)
    if found.function not in defined:
        near = difflib.get_close_matches(found.function, [*defined], 1)
        hint = f"did you mean `{near[0]}`?" if near else None
        raise Rejected(
            Diagnostic("HYPO102", f"`{found.name}` defines no function `{found.function}`", place, hint=hint)
        )
    definition = defined[found.function]
    if isinstance(definition, ast.FunctionDef | ast.AsyncFunctionDef):
        problems = _arguments(definition, found, job)
        if problems:
            raise Rejected(*problems)
    return found


def locate(job: Job) -> SubjectFile:
    """The file and the function's name, if there is such a file. Raises Rejected."""
    text = job.options.get("subject")
    options = job.method.options
    if not isinstance(text, str):
        message = "the method needs a subject: `subject: models/….py:function`"
        raise Rejected(Diagnostic("HYPO100", message, options.span))
    name, colon, function = text.rpartition(":")
    if not colon or not name or not function.isidentifier():
        message = f"`{text}` is not of the form file.py:function"
        raise Rejected(Diagnostic("HYPO100", message, options.at("subject")))
    path = inside(job.root, name)
    if path is None:
        raise Rejected(Diagnostic("HYPO101", f"`{name}` is outside the system's folder", options.at("subject")))
    if not path.is_file():
        raise Rejected(
            Diagnostic("HYPO101", f"there is no file `{name}` in the system's folder", options.at("subject"))
        )
    return SubjectFile(name, path, function)


def modules(path: Path) -> tuple[Path, ...]:
    """The subject's file and the files beside it that it imports, directly or not: what its answers depend on."""
    found: dict[Path, None] = {}
    stack = [path]
    while stack:
        file = stack.pop()
        if file in found:
            continue
        found[file] = None
        try:
            tree = ast.parse(file.read_bytes())
        except (OSError, ValueError, SyntaxError, RecursionError):
            continue
        for node in ast.walk(tree):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            heads = {name.partition(".")[0] for name in names} - {""}
            for head in sorted(heads):
                beside = (path.parent / f"{head}.py", path.parent / head / "__init__.py")
                stack.extend(candidate for candidate in beside if candidate.is_file())
    return tuple(sorted(found))


def _top_level(tree: ast.Module) -> dict[str, ast.stmt]:
    found: dict[str, ast.stmt] = {}
    for statement in tree.body:
        match statement:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                found[name] = statement
            case ast.Assign(targets=targets):
                found.update((t.id, statement) for t in targets if isinstance(t, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                found[name] = statement
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                found.update(((a.asname or a.name).partition(".")[0], statement) for a in names)
            case _:  # imports nothing
                pass
    return found


def _arguments(definition: ast.FunctionDef | ast.AsyncFunctionDef, found: SubjectFile, job: Job) -> list[Diagnostic]:
    """Arguments that no input fills; an async function. Inputs that it does not take are simply not given."""
    problems: list[Diagnostic] = []
    file = str(found.path)
    if isinstance(definition, ast.AsyncFunctionDef):
        message = f"`{definition.name}` is async; a subject is a plain function"
        problems.append(Diagnostic("HYPO104", message, _span(definition, file)))
    inputs = [port.name for port in job.node.inputs]
    arguments = definition.args
    optional = len(arguments.defaults)
    positional = [*arguments.posonlyargs, *arguments.args]
    required = positional[: len(positional) - optional] if optional else positional
    required += [a for a, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if default is None]
    for argument in required:
        if argument in arguments.posonlyargs:
            message = f"`{argument.arg}` can only be given by position; inputs are given by name"
            problems.append(Diagnostic("HYPO104", message, _span(argument, file)))
        elif argument.arg not in inputs:
            near = difflib.get_close_matches(argument.arg, inputs, 1)
            hint = f"did you mean `{near[0]}`?" if near else f"inputs: {', '.join(inputs) or 'none'}"
            message = f"node {job.node.name} has no input `{argument.arg}`"
            problems.append(Diagnostic("HYPO104", message, _span(argument, file), hint=hint))
    return problems


def _span(node: ast.stmt | ast.arg, file: str) -> Span:
    line, column = node.lineno, node.col_offset + 1
    return Span(file, line, column, line, column + 1)
