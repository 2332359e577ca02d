"""The AJPF backend: a node's guarantees as temporal properties of the Gwendolen program that implements it.

Imports stay light: whoever lists the backends does not load a parser and a model checker.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from avow.backend_kit.given import file_path
from avow.backend_kit.protocol import Backend, Job, Limits, Report, Tool
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.verdict import Link, Verdict
from avow.language.contract import Clause, Node

from .codes import CODES
from .schema import SCHEMA


class AjpfBackend(Backend):
    """See `docs/backends/ajpf.md`."""

    name = "ajpf"
    title = "agent programs (Gwendolen), model-checked against properties instantiated from the contract"
    version = "9"
    strength = Verdict.CHECKED
    uses_steps = False
    uses_wiring = False
    remembers = True
    not_run = (
        "an agent takes as many of its own steps as it likes for one of the contract's, and the plan's table says what "
        "formulas mean to it, not which percepts an input is"
    )
    link = Link.MAPPED
    options_schema = SCHEMA
    codes = CODES
    green_means = (
        "Every property that the guarantee became, through the plan's table and for the plan's instances, holds in "
        "every run of the agent program in the stated environment, explored exhaustively. It shows nothing of other "
        "instances, of other environments, or of the robot that carries out the agent's actions."
    )

    def tools(self) -> tuple[Tool, ...]:
        from . import ajpf_tool, spin_tool

        return (ajpf_tool.tool(), spin_tool.tool())

    def suits(self, node: Node) -> bool:
        from .suits import looks_like_an_agent

        return looks_like_an_agent(node)

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        from .timing import unsaid

        return unsaid(self.name, node, clause)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .instances import diagnose, instances
        from .options import read
        from .vocabulary import unknown_words

        try:
            setup = read(job)
        except Rejected as error:
            return error.diagnostics
        return (*diagnose(job, setup, instances(job, setup)), *unknown_words(job, setup))

    def files(self, job: Job) -> tuple[Path, ...]:
        return tuple(path for key in ("program", "environment") if (path := file_path(job, key)) is not None)

    def export(self, job: Job) -> Mapping[str, str]:
        from .files import export_files
        from .instances import instances
        from .options import read

        setup = read(job)
        return export_files(job, setup, instances(job, setup))

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .run import settle

        return settle(job, folder, limits, self.version)
