"""A node's own Python class: verification conditions of its step, proved in the numbers that it computes with."""

from __future__ import annotations

from pathlib import Path

from avow.backend_kit.given import NAN, schema
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tools import z3_tool
from avow.base.verdict import Link, Object, Verdict
from avow.evidence.obligation import ProgramClaim


class PythonBackend(Backend):
    """See `docs/backends/python.md`."""

    name = "python"
    title = "Verification conditions of the node's own Python class, in doubles"
    version = "1"
    strength = Verdict.PROVED
    link = Link.GENERATED
    of = Object.SOURCE
    uses_scenario = False
    uses_wiring = False
    uses_source = True
    needs_source = "python"
    claims = (ProgramClaim.LINKED,)
    options_schema = schema({"nan": NAN})
    codes = Catalogue("avow.backends.python")
    green_means = (
        "Every call of this file's `step`, from any state that its assumptions allow and on any finite inputs, gives "
        "outputs that meet the guarantee, in the meaning that CPython gives the text; REAL is what the plan's "
        "`numbers` says. It says nothing of threads, of what else the robot's process does, or of other files."
    )

    def tools(self) -> tuple[Tool, ...]:
        return (z3_tool(),)

    def opens(self, job: Job) -> Opens:
        return Opens.VALUES

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .reading import load

        try:
            return load(job).remarks()
        except Rejected as rejected:
            return rejected.diagnostics

    def files(self, job: Job) -> tuple[Path, ...]:
        from .reading import files

        return files(job)

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .settle import settle

        return settle(job, limits)


BACKEND = PythonBackend()
