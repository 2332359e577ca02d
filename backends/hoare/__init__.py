"""Hoare logic for small programs: triples from the contract's guarantees, proved by weakest preconditions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from avow.backend_kit.one_step import unsaid
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, OutsideCheck, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.packaged import packaged
from avow.base.tools import z3_tool
from avow.base.verdict import Link, Verdict
from avow.formulas.values import Value
from avow.language.contract import Clause, Node


class Hoare(Backend):
    """See `docs/backends/hoare.md`."""

    name = "hoare"
    title = "Hoare triples from the guarantee, proved of an imperative program by weakest preconditions"
    version = "7"
    strength = Verdict.PROVED
    uses_scenario = False
    uses_wiring = False
    remembers = True
    portable = True
    runs_models = True
    link = Link.GENERATED
    options_schema = packaged("avow.backends.hoare", "options.json")
    codes = Catalogue("avow.backends.hoare")
    green_means = (
        "Every run of the program that starts in an input allowed by the assumptions ends in outputs that meet the "
        "guarantee. It is about the program as written in the imperative language, over exact numbers, and says "
        "nothing of how the robot's own code was made from it. Without a VARIANT for each loop, it is never given."
    )

    def tools(self) -> tuple[Tool, ...]:
        return (z3_tool(),)

    def model(self, job: Job) -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
        from .work import answering

        return answering(job)

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        return unsaid(self.name, node, clause, functions=True)

    def opens(self, job: Job) -> Opens:
        return Opens.INPUT

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .backend import problems

        return problems(job)

    def files(self, job: Job) -> tuple[Path, ...]:
        from .work import program_file

        try:
            return (program_file(job),)
        except Rejected:
            return ()

    def export(self, job: Job) -> Mapping[str, str]:
        from .backend import files

        return files(job)

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        """A verification condition each; what belongs to no single guarantee belongs to all."""
        from .backend import file_stem

        stems = {name: f"{file_stem(name)}." for name in job.method.guarantees}
        for path in (folder / name for name in names if name.endswith(".smt2")):
            of = tuple(name for name, stem in stems.items() if path.name.startswith(stem))
            yield OutsideCheck(path, ("z3", path), of or tuple(stems), prints="unsat")

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .backend import settle

        return settle(job, limits)


BACKEND = Hoare()
