"""The AJPF backend: a node's guarantees as temporal properties of the Gwendolen program that implements it.

Imports stay light: listing the backends does not load a parser and a model checker.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from avow.backend_kit.given import file_path
from avow.backend_kit.protocol import Backend, Job, Limits, OutsideCheck, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_text
from avow.base.packaged import packaged
from avow.base.verdict import Link, Verdict
from avow.language.contract import Clause, Node
from avow.language.sorts import DataSort, EnumSort, FunctionSort, RealSort, Sort
from avow.language.subterms import subterms
from avow.language.terms import Arithmetic, Compare, Negative, Operation, Term


class AjpfBackend(Backend):
    """See `docs/backends/ajpf.md`."""

    name = "ajpf"
    title = "agent programs (Gwendolen), model-checked against properties instantiated from the contract"
    version = "13"
    strength = Verdict.CHECKED
    uses_steps = False
    uses_wiring = False
    remembers = True
    not_run = (
        "an agent takes as many of its own steps as it likes for one of the contract's, and the plan's table says what "
        "formulas mean to it, not which percepts an input is"
    )
    link = Link.MAPPED
    options_schema = packaged("avow.backends.ajpf", "options.json")
    codes = Catalogue("avow.backends.ajpf")
    green_means = (
        "Every property that the guarantee became, through the plan's table and for the plan's instances, holds in "
        "every run of the agent program in the stated environment, explored exhaustively. It shows nothing of other "
        "instances, of other environments, or of the robot that carries out the agent's actions."
    )

    def tools(self) -> tuple[Tool, ...]:
        from . import ajpf_tool

        return (ajpf_tool.tool(),)

    def suits(self, node: Node) -> bool:
        """Agents decide: some output is a choice, none is a number or a table of numbers, and no clause measures.
        Comparing or computing measured values is left to programs, and Gwendolen has no arithmetic for it."""
        sorts = [port.sort for port in node.outputs]
        decides = any(
            isinstance(sort, DataSort) or (isinstance(sort, EnumSort) and len(sort.members) > 1) for sort in sorts
        )
        return decides and not any(map(_is_measured, sorts)) and not any(_measures(c.formula) for c in node.clauses)

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        from .timing import unsaid

        return unsaid(self.name, node, clause)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .instances import diagnose, instances
        from .options import read

        try:
            setup = read(job)
        except Rejected as error:
            return error.diagnostics
        return tuple(diagnose(job, setup, instances(job, setup)))

    def files(self, job: Job) -> tuple[Path, ...]:
        return tuple(path for key in ("program", "environment") if (path := file_path(job, key)) is not None)

    def export(self, job: Job) -> Mapping[str, str]:
        from .files import export_files
        from .instances import instances
        from .options import read

        setup = read(job)
        return export_files(job, setup, instances(job, setup))

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        """A run of AJPF for each property that counts for a guarantee."""
        from .files import CLAIMS

        made = json.loads(read_text(folder / CLAIMS))
        properties = [(name, key) for name, claim in made["guarantees"].items() for key in claim["properties"]]
        counting = [extra for extra in made["further properties"].values() if extra["counts"]]
        properties += [(extra["guarantee"], key) for extra in counting for key in extra["properties"]]
        java = 'java -cp ".:$AJPF_HOME/bin:$AJPF_HOME/lib/3rdparty/*" gov.nasa.jpf.tool.RunJPF +site=site.properties'
        for guarantee, key in properties:
            command = ("cd", folder, "&&", java, "+classpath+=.", f"jpf/{key}.jpf")
            yield OutsideCheck(folder / "jpf" / f"{key}.jpf", command, (guarantee,), prints="no errors detected")

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .run import settle

        return settle(job, limits, self.version)


def _is_measured(sort: Sort) -> bool:
    return isinstance(sort, RealSort) or (isinstance(sort, FunctionSort) and isinstance(sort.result, RealSort))


def _measures(formula: Term) -> bool:
    for term in subterms(formula):
        match term:
            case Arithmetic(sort=RealSort()) | Negative(sort=RealSort()) | Operation(sort=RealSort()):
                return True
            case Compare(operator="<" | "<=" | ">" | ">=", left=left) if isinstance(left.sort, RealSort):
                return True
    return False
