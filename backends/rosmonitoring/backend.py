"""The backend: exports a configuration and an RML file for a node, and judges recorded traces with our own engine."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avow.backend_kit.box import box_files
from avow.backend_kit.further import unknown_outside
from avow.backend_kit.given import DURATION, READING, schema
from avow.backend_kit.protocol import Backend, Job, JudgedRun, Limits, Opens, OutsideCheck, Report, Translated
from avow.base.codec import document
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Severity
from avow.base.files import inside, read_text
from avow.base.suggestions import nearby
from avow.base.tools import Tool, works
from avow.base.verdict import Link, Object, Outcome, Verdict
from avow.ros.sources import message_files

if TYPE_CHECKING:
    from avow.formulas.values import Value
    from avow.language.contract import Node
    from avow.system.plan import System


_TRIAL = """from rosbags.typesys import Stores, get_typestore
get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(b"\\0\\1\\0\\0\\2\\0\\0\\0x\\0", "std_msgs/msg/String")"""

_OPTIONS = json.loads(read_text(Path(__file__).with_name("options.json"), "utf-8"))
"""The options of this backend alone; an option with a description only is a duration."""
_OPTIONS["fresh"]["additionalProperties"] = DURATION
_DURATIONS = {name: {**DURATION, **option} for name, option in _OPTIONS.items() if option.keys() == {"description"}}
SCHEMA = schema({**_OPTIONS, **_DURATIONS, **READING})


class RosMonitoringBackend(Backend):
    """See `docs/backends/rosmonitoring.md`."""

    name = "rosmonitoring"
    title = "runtime monitors, and recorded traces judged by them"
    version = "19"
    strength = Verdict.MONITORED
    link = Link.MAPPED
    of = Object.RECORDING
    uses_steps = False
    uses_upstream = True
    remembers = True
    records = True
    judges_runs = True
    options_schema = SCHEMA
    codes = Catalogue("avow.backends.rosmonitoring")
    translations = {"rml": "an RML specification for each node, by the plan's mapping"}
    green_means = (
        "On the recorded events the guarantee held at every judgement, by exact evaluation. It shows nothing of other "
        "runs; that the mapping reads the messages rightly is a person's judgement."
    )

    def tools(self) -> tuple[Tool, ...]:
        version, install = metadata.version("rosbags"), "pip install rosbags"
        return (Tool("rosbags", version, None, install, package="rosbags", trial=partial(works, _TRIAL)),)

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from avow.formulas.formula import free_variables
        from avow.ros.bags import digest_trace

        from .memory import unmonitored
        from .notes import readable, readings, unheard
        from .observing import outside
        from .options import origin, setup
        from .overhead import overheads

        found, faults = setup(job.system, job.node, job.method.options)
        problems = [*faults, *readings(found, job.method.options.at("mapping")), *overheads(job)[1]]
        for at, (name, digest) in enumerate(_traces(job).items()):
            path, span = inside(job.root, name), job.method.options.at("traces", at)
            hint = nearby(job.root / name, name)
            if path is None:
                message = f"traces: the path {name!r} leads out of the system's folder"
                problems.append(Diagnostic("MON102", message, span, hint="put the recording into the folder"))
            elif not path.exists() and (hint or not digest):  # of a bag with a digest, git has no copy
                message = f"traces: there is no file {name!r} in the system's folder"
                severity = Severity.WARNING if digest else Severity.ERROR
                problems.append(Diagnostic("MON102", message, span, severity, hint))
            elif digest and path.exists() and (there := digest_trace(path)) != digest:
                if path.is_dir() and not any(each.is_file() for each in path.rglob("*")):
                    message, hint = f"traces: {name!r} is an empty folder", "put the recording there"
                else:
                    message = f"traces: {name!r} is not the recording that the plan names: its digest is {there}"
                    hint = "put the recording there, or write this digest if it is the one that is meant"
                problems.append(Diagnostic("MON102", message, span, hint=hint))
            elif not faults:
                other = readable(found, path, origin(job.system))
                problems += [replace(d, span=d.span or span) for d in other] + [*unheard(found, path, job.system)]
            for _, wrong, hint in unknown_outside(job.node, outside(job.method.options, name)):
                problems.append(Diagnostic("MON101", f"traces: outside: {wrong}", span, hint=hint))
        bags = not any(name.endswith(".jsonl") for name in _traces(job))  # whose messages have their types' fields only
        for obligation in () if faults else job.obligations:
            clause = job.clause(obligation)
            spoken = {v.qualified for v in free_variables(clause.formula)}
            hidden = next((reason for name, reason in found.hidden.items() if name in spoken), "")
            if reason := unmonitored(found, clause) or found.unmarked(spoken, bags):
                message = f"{clause.name} cannot be monitored: {reason}"
                problems.append(Diagnostic("MON103", message, clause.span, Severity.WARNING))
            elif hidden:
                span = job.method.options.at("mapping")
                message = f"{clause.name} cannot be monitored: {hidden}"
                problems.append(Diagnostic("MON103", message, span, Severity.WARNING))
        return tuple(problems)

    def opens(self, job: Job) -> Opens:
        return Opens.ANY

    def compares(self, job: Job) -> bool:
        from .further import leads

        return any(leads(job, name) for name in _traces(job))

    def files(self, job: Job) -> tuple[Path, ...]:
        found: list[Path] = []
        for name in (*_traces(job), *(entry["data"] for entry in job.options.get("overhead", ()))):
            path = inside(job.root, name)
            if path is not None and path.is_dir():
                found += sorted(p for p in path.rglob("*") if p.is_file())
            elif path is not None:
                found.append(path)
        found += [*box_files(job.options, job.root), *message_files(job.system.plan.messages)]
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
        report = {"node": job.node.name, "not_in_rml": made.refused, "not_observed": dict(found.hidden)}
        return {
            f"{stem}.yaml": configuration(found, job.options),
            f"{stem}.rml": made.text,
            f"{stem}_monitor.json": document(report) + "\n",
        }

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        """RML's own compiler and monitor on each recording that is a file of JSON lines."""
        from .configuration import identifier

        rml = folder / f"{identifier('', job.node.name)}.rml"
        traces = [path for path in map(partial(inside, job.root), _traces(job)) if path and path.suffix == ".jsonl"]
        refused = {} if not names else json.loads(read_text(rml.with_name(f"{rml.stem}_monitor.json")))["not_in_rml"]
        said = tuple(name for name in job.method.guarantees if name not in refused)
        for trace in traces if said and names else ():
            compiled = rml.with_suffix(".pl")
            compiler = ("java -jar rml-compiler.jar --input", rml, "--output", compiled)
            words = (*compiler, "&& monitor.sh", compiled, trace, "--silent")
            yield OutsideCheck(rml, words, said, prints="Execution terminated correctly")

    def translate(self, notation: str, system: System, node: Node) -> Translated:
        """The node's guarantees as one RML specification, by the mapping of the plan's first method of this backend."""
        from .configuration import identifier
        from .observing import method_of
        from .options import usable
        from .rml.translate import translate

        options = method_of(system, node.name)
        made = translate(usable(system, node, options), node.guarantees)
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

    def judge(self, job: Job) -> Callable[[Iterable[Mapping[str, Any]] | Path], JudgedRun]:
        from .runs import judge

        return judge(job)

    def contradictions(self, job: Job, recording: Path, outside: Mapping[str, str]) -> tuple[Outcome, ...]:
        from .further import of_job

        name = recording.relative_to(job.root.resolve()).as_posix()
        return tuple(of_job(job, name, recording, math.inf, outside).refuted())

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .runs import discharge

        return discharge(job, _traces(job), limits)


def _traces(job: Job) -> dict[str, str]:
    from .observing import recordings

    return recordings(job.method.options)
