"""The declared class, read: its file, its parameters, and its step as a small program, or why there is none."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from avow.backend_kit.programs.cpython import Subject
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.files import inside, read_regular
from avow.system.node_plan import parameters
from avow.system.plan import Driving, Numbers, Source

from .program import Step
from .translate import Translator
from .whole_file import Refusal, read


@dataclass(frozen=True, slots=True)
class Reading:
    """A job's class. `step` is None where something is refused."""

    job: Job
    source: Source
    file: Path
    text: str
    params: Mapping[str, Any]
    step: Step | None
    refused: tuple[Refusal, ...]

    @property
    def subject(self) -> Subject:
        return Subject(
            self.job.root.resolve(),
            self.file.resolve(),
            self.source.class_name,
            self.params,
            dict(self.source.memory),
            tuple(self.step.start) if self.step is not None else (),
        )

    @property
    def exact(self) -> bool:
        return self.source.numbers is Numbers.EXACT

    def remarks(self) -> tuple[Diagnostic, ...]:
        """A warning for everything that is refused."""
        return tuple(self._remark(refusal) for refusal in self.refused)

    def _remark(self, refusal: Refusal) -> Diagnostic:
        """At the part, or at its line without the indentation."""
        text = (self.text.splitlines()[refusal.line - 1 : refusal.line] or [""])[0].rstrip()
        line, part = refusal.line, refusal.part
        span = Span(str(self.file), line, len(text) - len(text.lstrip()) + 1, line, len(text) + 1)
        if part is not None:
            end = part.end_col_offset if part.end_lineno == line else None
            span = replace(span, column=part.col_offset + 1, end_column=len(text) + 1 if end is None else end + 1)
        hint = f"{refusal.instead}, or " if refusal.instead else "rewrite it (docs/backends/python.md), or "
        hint += f"test the class: nodes: {{{self.job.node.name}: {{methods: [hypothesis]}}}}"
        return Diagnostic("PYTHON200", refusal.why, span, Severity.WARNING, hint)


def files(job: Job) -> tuple[Path, ...]:
    """The source's files, also where they are not there."""
    source = job.source
    named = (source.python, source.parameters) if source is not None else ()
    return tuple(path for name in named if name and (path := inside(job.root, name)) is not None)


def load(job: Job) -> Reading:
    """Raises Rejected with everything that is wrong with the declaration."""
    source, place = job.source, job.method.options.span
    if source is None or not source.python:
        hint = "source: {python: src/node.py, class: Node}"
        message = f"{job.node.name} has no Python source: the plan does not say which program it is"
        raise Rejected(Diagnostic("PYTHON100", message, place, hint=hint))
    faults: list[Diagnostic] = []
    if source.numbers is Numbers.FLOAT32:
        message = "Python's floats are float64: numbers: float32 is not what this source computes with"
        faults.append(Diagnostic("PYTHON100", message, source.place.at("numbers")))
    if source.kind is not Driving.STEP:
        message = f"kind is {source.kind}: {source.class_name} has callbacks, and this method proves a method `step`"
        hint = "leave this method out: `hypothesis` tests callbacks"
        faults.append(Diagnostic("PYTHON100", message, place, hint=hint))
    path = inside(job.root, source.python)
    text, encoding, tree = "", "", None
    try:
        assert path is not None
        data = read_regular(path)
        tree = ast.parse(data, filename=path.name)  # of the bytes, as CPython reads them
        encoding, _ = tokenize.detect_encoding(io.BytesIO(data).readline)
        text = data.decode(encoding)
    except SyntaxError as error:
        at = error.lineno or 1
        faults.append(Diagnostic("PYTHON100", f"this is no Python: {error.msg}", Span(str(path), at, 1, at, 2)))
    except (OSError, ValueError, RecursionError, MemoryError, AssertionError) as error:
        message = f"`{source.python}` cannot be read: {error}"
        faults.append(Diagnostic("PYTHON100", message, source.place.at("source", "python")))
    params, wrong = parameters(job.root, source, job.system.plan.ros.names.placed(job.node.name).name)
    faults += wrong
    if faults or tree is None or path is None:
        raise Rejected(*faults)
    step, refused = _step(job, source, tree, path, text, encoding, params)
    return Reading(job, source, path, text, params, step, refused)


def _step(
    job: Job, source: Source, tree: ast.Module, path: Path, text: str, encoding: str, params: Mapping[str, Any]
) -> tuple[Step | None, tuple[Refusal, ...]]:
    try:
        if encoding not in ("utf-8", "utf-8-sig"):
            return None, (Refusal(1, f"the file is written in {encoding}: its text hides what it says"),)
        parts, refused = read(tree, source.class_name, path)
        if parts is None or refused:
            return None, refused
        return Translator(parts, job.node, source.memory, params, text).step(), ()
    except Refusal as refusal:
        return None, (refusal,)
    except RecursionError:
        return None, (Refusal(1, "the program is nested too deeply"),)
