"""The backend: exports a configuration and an RML file for a node, and judges recorded traces with our own engine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avow.backend_kit.protocol import Backend, Job, JudgedRun, Limits, Report, Translated
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Severity
from avow.base.files import inside
from avow.base.tools import Tool
from avow.base.verdict import Link, Object, Verdict
from avow.ros.sources import message_files

from .codes import CODES
from .schema import SCHEMA

if TYPE_CHECKING:
    from avow.formulas.values import Value
    from avow.language.contract import Node
    from avow.system.plan import System


class RosMonitoringBackend(Backend):
    """See `docs/backends/rosmonitoring.md`."""

    name = "rosmonitoring"
    title = "runtime monitors, and recorded traces judged by them"
    version = "8"
    strength = Verdict.MONITORED
    link = Link.MAPPED
    of = Object.RECORDING
    uses_steps = False
    uses_upstream = True
    remembers = True
    records = True
    judges_runs = True
    options_schema = SCHEMA
    codes = CODES
    translations = {"rml": "an RML specification for each node, by the plan's mapping"}
    green_means = (
        "On the recorded events the guarantee held at every judgement, by exact evaluation. It shows nothing of other "
        "runs; that the mapping reads the messages rightly is a person's judgement."
    )

    def tools(self) -> tuple[Tool, ...]:
        try:
            version: str | None = metadata.version("rosbags")
        except metadata.PackageNotFoundError:
            version = None
        return (Tool("rosbags", version, None, "pip install 'avow[bags]'", package="rosbags"),)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from avow.formulas.formula import free_variables

        from .memory import unmonitored
        from .options import setup
        from .overhead import overheads
        from .told import readings, unholdable

        found, faults = setup(job.system, job.node, job.method.options)
        problems = [*faults, *readings(found, job.method.options.at("mapping")), *overheads(job)[1]]
        for at, name in enumerate(_traces(job)):
            path = inside(job.root, name)
            if path is None or not path.exists():
                span = job.method.options.at("traces", at)
                problems.append(Diagnostic("MON102", f"traces: there is no file {name!r} in the system's folder", span))
        for obligation in job.obligations:
            clause = job.clause(obligation)
            problems += unholdable(found, clause)
            if faults:
                continue
            spoken = {v.qualified for v in free_variables(clause.formula)}
            hidden = next((reason for name, reason in found.hidden.items() if name in spoken), "")
            if reason := unmonitored(found, clause):
                message = f"{clause.name} cannot be monitored: {reason}"
                problems.append(Diagnostic("MON103", message, clause.span, Severity.WARNING))
            elif hidden:
                span = job.method.options.at("mapping")
                message = f"{clause.name} cannot be monitored: {hidden}"
                problems.append(Diagnostic("MON103", message, span, Severity.WARNING))
        return tuple(problems)

    def files(self, job: Job) -> tuple[Path, ...]:
        found: list[Path] = []
        for name in (*_traces(job), *(entry["data"] for entry in job.options.get("overhead", ()))):
            path = inside(job.root, name)
            if path is not None and path.is_dir():
                found += sorted(p for p in path.rglob("*") if p.is_file())
            elif path is not None:
                found.append(path)
        found += message_files(job.system.plan.messages)
        scenario = job.system.plan.scenario
        found += [t.path for t in scenario.tables if t.path is not None] if scenario else []
        return tuple(found)

    def export(self, job: Job) -> Mapping[str, str]:
        from .configuration import configuration, identifier
        from .options import usable
        from .rml.translate import translate

        found = usable(job.system, job.node, job.method.options)
        made = translate(found, [job.clause(o) for o in job.obligations])
        stem = identifier("", job.node.name)
        report = {
            "node": job.node.name,
            "not_in_rml": made.refused,
            "not_observed": dict(found.hidden),
        }
        return {
            f"{stem}.yaml": configuration(found, job.options),
            f"{stem}.rml": made.text,
            f"{stem}_monitor.json": document(report) + "\n",
        }

    def translate(self, notation: str, system: System, node: Node) -> Translated:
        """The node's guarantees as one RML specification, by the mapping of the plan's first method of this backend."""
        from .configuration import identifier
        from .observing import method_of
        from .options import usable
        from .rml.translate import translate

        options = method_of(system, node.name)
        found = usable(system, node, options)
        made = translate(found, node.guarantees)
        hint = None if options else f"the plan has no method {self.name} for node {node.name}, whose `mapping` says how"
        missing = tuple(
            Diagnostic("MON105", f"{node.name}.{name}: {reason}", node.clause(name).span, Severity.WARNING, hint)
            for name, reason in made.refused.items()
        )
        if len(missing) == len(node.guarantees):
            return Translated({}, missing)
        return Translated({f"{identifier('', node.name)}.rml": made.text}, missing)

    def steps(self, job: Job) -> Iterator[tuple[Mapping[str, Value], ...]]:
        from .runs import steps

        return steps(job, _traces(job))

    def judge(self, job: Job) -> Callable[[Iterable[Mapping[str, Any]]], JudgedRun]:
        from .runs import judge

        return judge(job)

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .runs import discharge

        return discharge(job, _traces(job), limits)


def _traces(job: Job) -> list[str]:
    found = job.options.get("traces")
    return [t for t in found if isinstance(t, str)] if isinstance(found, list) else []
