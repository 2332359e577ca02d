from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from avow.backend_kit.box import box_files
from avow.backend_kit.given import file_path, summarized
from avow.backend_kit.one_step import refusal
from avow.backend_kit.protocol import Backend, Job, Limits, OutsideCheck, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tools import PERCEPTION, onnxruntime_tool, package_tool
from avow.base.verdict import Link, Object, Verdict
from avow.language.contract import Clause, Node
from avow.language.subterms import histories

from .options import SCHEMA, read
from .two_steps import compares_steps
from .vnnlib import SCALED, queries

_MARABOU = (
    "from maraboupy import MarabouCore as m; q = m.InputQuery(); q.setNumberOfVariables(1); "
    "q.setLowerBound(0, 0); q.setUpperBound(0, 1); e = m.Equation(m.Equation.GE); e.addAddend(1, 0); e.setScalar(2); "
    "q.addEquation(e); assert m.solve(q, m.Options())[0] == 'unsat'"
)


class OnnxBackend(Backend):
    """See `docs/backends/onnx.md`."""

    name = "onnx"
    title = "Neural networks: interval bounds, Marabou, and runs in onnxruntime"
    version = "2"
    strength = Verdict.PROVED
    link = Link.MAPPED
    of = Object.MODEL
    uses_scenario = False
    uses_wiring = False
    remembers = True
    portable = True
    not_run = "a network's inputs and outputs are float32"
    options_schema = SCHEMA
    codes = Catalogue("avow.backends.onnx")
    green_means = (
        "For every input that the assumptions allow, the network's outputs in exact reals meet the guarantee. It shows "
        "nothing of the camera, of the code before and after the network, or of rounding in float32."
    )

    def tools(self) -> tuple[Tool, ...]:
        return (onnxruntime_tool(), package_tool("maraboupy", PERCEPTION, _MARABOU))

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        refused = next((a for a in node.assumptions if histories(a.formula)), None)
        if refused or compares_steps(clause.formula):
            return refusal(self.name, node, refused) if refused else None
        others = f"onnx compares a step with the one before, and {node.name}.{clause.name} speaks of others"
        return f"{others}: write `previous` of values of this step, without another operator on steps in or beside it"

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            read(job)
        except Rejected as rejected:
            return rejected.diagnostics
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        path = file_path(job, "network")
        return (*(() if path is None else (path,)), *box_files(job.options, job.root))

    def export(self, job: Job) -> Mapping[str, str]:
        """Each case of each denied guarantee, as a query in VNN-LIB; none if the input is at fault."""
        try:
            return {name: text for _, name, text in queries(job, read(job))}
        except Rejected:
            return {}

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        network = file_path(job, "network")
        assert network is not None
        for guarantee, name, text in queries(job, read(job)):
            if SCALED not in text:
                yield OutsideCheck(folder / name, ("Marabou", network, folder / name), (guarantee,), "unsat")

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        tools = self.tools()
        version = ", ".join(f"{tool.name} {tool.version}" for tool in tools if tool.present) or self.version
        if missing := [tool.name for tool in tools if not tool.present]:
            why = f"{' and '.join(missing)} missing: {PERCEPTION}"
            return Report.alike(job, Verdict.NOT_RUN, why, self.name, version)
        try:
            given = read(job)
        except Rejected as rejected:
            why = f"the network cannot be judged: {summarized(job, rejected.diagnostics)}"
            return Report.alike(job, Verdict.ERROR, why, self.name, version)
        from .settle import settle

        outcomes, logs = settle(job, given, limits)
        return Report(outcomes, self.name, version, logs=logs)
