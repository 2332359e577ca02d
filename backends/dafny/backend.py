"""The Dafny backend: the contract as a specification that a hand-written implementation refines, verified by Dafny.

Imports stay light: listing the backends does not load the code that writes and reads Dafny.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from avow.backend_kit.given import existing_file, file, file_path, schema, summarized
from avow.backend_kit.one_step import unsaid
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, OutsideCheck, Report, Tool, Translated
from avow.base import process
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.files import read_regular
from avow.base.plain import one_line
from avow.base.verdict import Link, Outcome, Verdict
from avow.language.contract import Clause, Node
from avow.system.plan import System

from .dafny_tool import INSTALL, dafny
from .tuning import PROGRAM_BYTES

if TYPE_CHECKING:
    from .judge import Settled
    from .modules import Generated
    from .scanner import Scan


class DafnyBackend(Backend):
    """See `docs/backends/dafny.md`."""

    name = "dafny"
    title = "a Dafny implementation, verified against the contract"
    version = "7"
    strength = Verdict.PROVED
    uses_scenario = False
    uses_wiring = False
    remembers = True
    not_run = "a Dafny method would have to be compiled, which the Dafny that Debian has does for .NET alone"
    portable = True
    link = Link.GENERATED
    options_schema = schema(
        {"implementation": file("the Dafny file that refines the generated specification")}, "implementation"
    )
    codes = Catalogue("avow.backends.dafny")
    translations = {"dafny": "Dafny types, predicates, a specification and a skeleton for each node"}
    green_means = (
        "Dafny proved that the implementation's Step meets this guarantee for all inputs that meet the assumptions "
        "(and Env, where it says more), that it always ends, and that such inputs exist. "
        "That the robot runs this program is not shown."
    )

    def tools(self) -> tuple[Tool, ...]:
        return (dafny(),)

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        return unsaid(self.name, node, clause)

    def opens(self, job: Job) -> Opens:
        return Opens.INPUT

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .printer import NotExpressible

        try:
            path, text = _implementation(job)
        except Rejected as error:
            return error.diagnostics
        try:
            generated = _generate(job)
        except NotExpressible as problem:
            # The contract is valid, but this backend cannot handle it. The outcome reports this, too.
            message = f"node '{job.node.name}' cannot be put into Dafny: {problem.what}"
            return (Diagnostic("DFY104", message, problem.span or job.node.span, Severity.WARNING),)
        scanned = _scan(text, generated)
        return tuple(
            Diagnostic("DFY103", what, Span(str(path), line, 1, line + 1, 1), Severity.WARNING)
            for line, what in (*scanned.problems, *scanned.hypotheses)
        )

    def files(self, job: Job) -> tuple[Path, ...]:
        path = file_path(job, "implementation")
        return (path,) if path is not None else ()

    def export(self, job: Job) -> Mapping[str, str]:
        """Types, contract and specification, which the implementation includes."""
        from .printer import NotExpressible

        try:
            return _specification(_generate(job))
        except NotExpressible as problem:
            return {"NOT-COVERED.txt": f"{one_line(problem.what)}\n"}

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        """The implementation, which includes the specification from `folder`."""
        from .dafny_tool import has_commands
        from .modules import generate

        path = file_path(job, "implementation")
        if path is None or len(names) < 3:
            return
        tool = dafny()
        words = ("verify",) if has_commands(tool.version) or not tool.present else ("/compile:0",)
        covered = generate(job.node, job.method.guarantees).ensures
        yield OutsideCheck(path, ("dafny", *words, path), tuple(name for _, name in covered))

    def translate(self, notation: str, system: System, node: Node) -> Translated:
        """The files of `export`, for all the node's guarantees, and a skeleton beside them."""
        from .modules import generate
        from .printer import NotExpressible

        names = [clause.name for clause in node.guarantees if self.unsaid(node, clause) is None]
        try:
            generated = generate(node, names)
        except NotExpressible as problem:
            message = f"node '{node.name}' cannot be put into Dafny: {problem.what}"
            return Translated({}, (Diagnostic("DFY105", message, problem.span or node.span, Severity.WARNING),))
        missing = tuple(
            Diagnostic("DFY105", f"{node.name}.{name}: {reason}", node.clause(name).span, Severity.WARNING)
            for name, reason in generated.uncovered
        )
        if len(missing) == len(names):
            return Translated({}, missing)
        return Translated({**_specification(generated), generated.impl_file: generated.skeleton}, missing)

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from avow.isolation.outside import Outside

        from .judge import settle
        from .printer import NotExpressible

        tool = dafny()
        version = tool.version or ""

        def all_alike(verdict: Verdict, summary: str) -> Report:
            return Report.alike(job, verdict, summary, "dafny", version)

        try:
            path, text = _implementation(job)
            generated = _generate(job)
        except Rejected as error:
            return all_alike(Verdict.ERROR, summarized(job, error.diagnostics))
        except NotExpressible as problem:
            return all_alike(Verdict.UNKNOWN, f"not covered: Dafny's counterpart is missing for {problem.what}")
        if not tool.present:
            return all_alike(Verdict.NOT_RUN, f"dafny is not on this machine; install it with: {INSTALL}")
        scanned = _scan(text, generated)
        outside = Outside((tool,))
        try:
            settled = settle(generated, scanned, path.name, limits, outside)
        except (process.ToolMissing, OSError) as error:
            return Report.unanswered(job, Verdict.ERROR, f"dafny could not be run: {error}", "dafny", version)
        uncovered = dict(generated.uncovered)
        outcomes = []
        for obligation in job.obligations:
            reason = uncovered.get(obligation.name)
            if reason is not None:
                what = f"not covered: Dafny's counterpart is missing for {reason}"
                outcomes.append(Outcome(obligation.id, Verdict.UNKNOWN, what, link=Link.GENERATED))
            else:
                outcomes.append(_outcome(obligation.id, settled.verdicts[obligation.name]))
        return Report(tuple(outcomes), "dafny", version, settled.command, settled.logs, outside.observed())


def _outcome(obligation: str, settled: Settled) -> Outcome:
    return Outcome(
        obligation,
        settled.verdict,
        settled.summary,
        hypotheses=settled.hypotheses,
        details=dict(settled.details),
        link=Link.GENERATED,
        vacuous=settled.vacuous,
    )


def _implementation(job: Job) -> tuple[Path, str]:
    """The hand-written file. Raises Rejected."""
    name, place = job.options.get("implementation", ""), job.method.options.at("implementation")
    hint = f"for a skeleton to start from: avow translate --to dafny {job.system.name} --node {job.node.name} -o made"
    path = existing_file(job, "implementation", name, wrong="DFY101", absent="DFY102", hint=hint)
    try:
        data = read_regular(path)
        if len(data) > PROGRAM_BYTES:
            raise Rejected(
                Diagnostic("DFY102", f"'{name}' has {len(data)} bytes; at most {PROGRAM_BYTES} are read", place)
            )
        return path, data.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise Rejected(Diagnostic("DFY102", f"'{name}' cannot be read: {error}", place)) from None


def _generate(job: Job) -> Generated:
    from .modules import generate

    return generate(job.node, [o.name for o in job.obligations] or job.method.guarantees)


def _scan(text: str, generated: Generated) -> Scan:
    from .scanner import scan

    return scan(text, generated.spec_module, generated.impl_module, tuple(_specification(generated)), generated.lemmas)


def _specification(generated: Generated) -> dict[str, str]:
    return {
        generated.types_file: generated.types,
        generated.contract_file: generated.contract,
        generated.spec_file: generated.spec,
    }
