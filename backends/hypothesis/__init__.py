"""Property-based tests of a Python function, generated from a node's contract and run with Hypothesis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from importlib import metadata
from pathlib import Path

from avow.backend_kit.given import READING, file, schema, whole_number
from avow.backend_kit.one_step import unsaid
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, OutsideCheck, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tools import works
from avow.base.verdict import Link, Verdict
from avow.language.contract import Clause, Node

_SUBJECT = {**file("file.py:function, or file.py:Class with a method `step`"), "pattern": "^.+:[^:]+$"}
_CASES = whole_number("how many cases", 1_000_000, 500)
_NUMBERS = {
    "enum": ["exact", "float64", "float64-with-nan"],
    "default": "exact",
    "description": "what a REAL is given as: a fraction; a double; a double, NaN and infinity among them",
}


class HypothesisBackend(Backend):
    """See `docs/backends/hypothesis.md`."""

    name = "hypothesis"
    title = "Property-based tests of a Python function, or of the node's own class, generated from the contract"
    version = "15"
    strength = Verdict.TESTED
    uses_steps = False
    uses_wiring = False
    remembers = True
    uses_source = True
    link = Link.GENERATED
    options_schema = schema({"subject": _SUBJECT, "cases": _CASES, "numbers": _NUMBERS, **READING})
    codes = Catalogue("avow.backends.hypothesis")
    green_means = (
        "On so many generated inputs that meet the assumptions the function returned outputs that meet the guarantee, "
        "and the guarantee's condition was met in some of them. It says nothing certain of other inputs; the bound on "
        "failures is about inputs drawn as these were."
    )

    def tools(self) -> tuple[Tool, ...]:
        version = metadata.version("hypothesis")
        install, line = (
            "pip install hypothesis",
            "from hypothesis import find, strategies as st; find(st.integers(), bool)",
        )
        trial = partial(works, line)
        return (Tool("hypothesis", version, None, install, optional=False, package="hypothesis", trial=trial),)

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        return unsaid(self.name, node, clause)

    def answers_itself(self, job: Job) -> bool:
        from .callbacks import wanted

        return wanted(job)

    def opens(self, job: Job) -> Opens:
        return Opens.VALUES if job.options.get("subject") is None else Opens.ANY

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .backend import problems

        return problems(job)

    def files(self, job: Job) -> tuple[Path, ...]:
        from . import callbacks
        from .subject import locate, modules, parameter_files

        try:
            found = (*modules(locate(job).path), *parameter_files(job))
            return (*found, *callbacks.files(job)) if callbacks.wanted(job) else found
        except Rejected:
            return ()

    def export(self, job: Job) -> Mapping[str, str]:
        from .backend import files

        return files(job)

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        for name in names:
            if name.endswith(".py"):
                yield OutsideCheck(folder / name, ("pytest", folder / name), job.method.guarantees)

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .backend import settle

        return settle(job, folder, limits)


BACKEND = HypothesisBackend()
