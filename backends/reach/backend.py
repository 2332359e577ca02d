from __future__ import annotations

from pathlib import Path

from avow.backend_kit.given import summarized
from avow.backend_kit.protocol import Backend, Job, Limits, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tools import package_tool
from avow.base.verdict import Link, Object, Verdict

from .options import SCHEMA, read

INSTALL = "pip install 'avow[motion]'"
_TRIAL = (
    "from codac import Interval, sqrt; third = Interval(1) / 3; assert third.lb() < third.ub() and sqrt(third).lb() > 0"
)


class ReachBackend(Backend):
    """See `docs/backends/reach.md`."""

    name = "reach"
    title = "Motion: enclosures of differential equations and affine maps"
    version = "1"
    strength = Verdict.PROVED
    link = Link.MAPPED
    of = Object.MODEL
    uses_scenario = False
    uses_wiring = False
    portable = True
    not_run = "a motion is a model of what the node moves, not of its program"
    options_schema = SCHEMA
    codes = Catalogue("avow.backends.reach")
    green_means = (
        "Every motion by the plan's equations, from the given first values and with inputs as assumed, meets the "
        "guarantee: at all times if proved, within the horizon if checked. It does not show that the equations are "
        "those of the robot."
    )

    def tools(self) -> tuple[Tool, ...]:
        return (package_tool("codac", INSTALL, _TRIAL),)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            read(job)
        except Rejected as rejected:
            return rejected.diagnostics
        return ()

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        (tool,) = self.tools()
        version = tool.version or self.version
        if not tool.present:
            return Report.alike(job, Verdict.NOT_RUN, f"codac is missing: {INSTALL}", self.name, version)
        try:
            given = read(job)
        except Rejected as rejected:
            why = f"the motion cannot be judged: {summarized(job, rejected.diagnostics)}"
            return Report.alike(job, Verdict.ERROR, why, self.name, version)
        from .settle import settle

        outcomes, logs = settle(job, given, limits)
        return Report(outcomes, self.name, f"codac {version}", logs=logs)
