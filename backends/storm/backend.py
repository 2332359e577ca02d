from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from avow.backend_kit.given import file_path, summarized
from avow.backend_kit.protocol import Backend, Job, Limits, OutsideCheck, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tools import package_tool
from avow.base.verdict import Link, Object, Verdict

from .options import SCHEMA, read
from .settle import settle, written_of
from .writing import NoCounterpart

INSTALL = "pip install 'avow[chance]'"
_TRIAL = "import stormpy; assert str(stormpy.Rational('1/3') + stormpy.Rational('2/3')) == '1'"


class StormBackend(Backend):
    """See `docs/backends/storm.md`."""

    name = "storm"
    title = "Probabilistic models in PRISM, checked by Storm in exact arithmetic"
    version = "1"
    strength = Verdict.CHECKED
    link = Link.MAPPED
    of = Object.MODEL
    chances = True
    uses_scenario = False
    uses_wiring = False
    portable = True
    not_run = "a state of the model has several next states"
    options_schema = SCHEMA
    codes = Catalogue("avow.backends.storm")
    green_means = (
        "In every state that the model can reach, for every choice that it leaves open, the guarantee holds, or holds "
        "with its probability. It shows nothing of the node whose model it is, or of the model's probabilities."
    )

    def tools(self) -> tuple[Tool, ...]:
        return (package_tool("stormpy", INSTALL, _TRIAL),)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            read(job)
        except Rejected as rejected:
            return rejected.diagnostics
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        path = file_path(job, "model")
        return () if path is None else (path,)

    def export(self, job: Job) -> Mapping[str, str]:
        """The model with the contract's labels and rewards, and the properties; none if the input is at fault."""
        try:
            made = written_of(job, read(job))
        except (Rejected, NoCounterpart):
            return {}
        return {"node.prism": made.model, "node.props": made.props}

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        if names:
            command = ("storm", "--exact", "--prism", folder / "node.prism", "--prop", folder / "node.props")
            yield OutsideCheck(
                folder / "node.props", command, job.method.guarantees, "Result (for initial states): true"
            )

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        (tool,) = self.tools()
        if not tool.present:
            return Report.alike(job, Verdict.NOT_RUN, f"stormpy missing: {INSTALL}", self.name, self.version)
        version = f"stormpy {tool.version}"
        try:
            return settle(job, read(job), folder, limits, version)
        except Rejected as rejected:
            why = f"the model cannot be checked: {summarized(job, rejected.diagnostics)}"
            return Report.alike(job, Verdict.ERROR, why, self.name, version)
        except NoCounterpart as part:
            why = f"an assumption cannot be read: {part}"
            return Report.alike(job, Verdict.UNKNOWN, why, self.name, version)
