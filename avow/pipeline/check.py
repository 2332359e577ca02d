"""The check stage: what is wrong with contract and plan, before any solver is asked."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from doit.exceptions import TaskError

from avow.backend_kit import one_step
from avow.backend_kit.protocol import COMMON_OPTIONS
from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.files import digest_file
from avow.base.notes import read_note, write_note
from avow.base.plain import count
from avow.base.workspace import Workspace
from avow.pipeline import export as exporting
from avow.pipeline.work import ENGINES, Work, is_portable, method_backend, method_job, planned_method
from avow.pipeline.workload import Survey
from avow.system.plan import Located, Method, System
from avow.tuning.shown import WARNINGS


def is_current(workspace: Workspace, surveyed: Survey) -> bool:
    stamp = read_note(_stamp(workspace, surveyed))
    return stamp is not None and stamp.get("key") == _key(surveyed)


def check(workspace: Workspace, surveyed: Survey) -> None:
    """Raises Rejected with all errors; warnings go into the report, the first few also to the terminal. A method of
    which there was nothing to say is not asked about again while its slice is the same."""
    keys = {(w.node, w.method): exporting.key(w) for w in surveyed.catalogue.works if _depends_on_slice(w)}
    known = set((read_note(_stamp(workspace, surveyed)) or {}).get("clean", ()))
    clean = {name for name, key in keys.items() if key in known}
    found = diagnostics(surveyed.system, clean)
    errors = tuple(d for d in found if d.is_error)
    if errors:
        raise Rejected(*found)
    warnings = [f"{d.span}: {d.message} [{d.code}]" for d in found if d.severity is Severity.WARNING]
    _tell(workspace, surveyed.system.name, found)
    kept = sorted(keys[name] for name in clean if name in keys)
    write_note(_stamp(workspace, surveyed), {"key": _key(surveyed), "warnings": warnings, "clean": kept})


def _depends_on_slice(work: Work) -> bool:
    """Whether what its check says depends on nothing else."""
    return not work.is_engine and is_portable(method_backend(work.system, planned_method(work)))


def diagnostics(system: System, clean: set[tuple[str, str]] | None = None) -> tuple[Diagnostic, ...]:
    """Lints of the contract, and what is to be said of the plan; without the warnings that the plan switches off.
    `clean`: (node, method) of which nothing is to be said; those found to be so are added."""
    from avow.language.load import check_paths

    off = frozenset(system.plan.lints_off)
    return (*check_paths(system.plan.contract_files, off=off)[1], *of_plan(system, clean))


def of_plan(system: System, clean: set[tuple[str, str]] | None = None) -> tuple[Diagnostic, ...]:
    """What is to be said of a plan that can be read: its account of the ROS graph, its requirements' sentences, and
    what each backend says of its options; without the warnings that the plan switches off. `clean`: as for
    `diagnostics`."""
    from avow.system.graph import dataflow
    from avow.system.launched import told as launched
    from avow.system.sentences import requirement_sentences
    from avow.system.statements import unconfirmed, without_words

    found = [
        *(d for d in dataflow(system).findings if d.code.startswith("ROS")),
        *launched(system),
        *_model(system),
        *_policy(system),
        *requirement_sentences(system),
        *without_words(system),
        *unconfirmed(system),
    ]
    for plan in system.plan.nodes:
        for method in plan.methods:
            name = plan.node, method.id
            if clean is None or name not in clean:
                said = tuple(_method(system, plan.node, method))
                found += said
                if clean is not None and not said:
                    clean.add(name)
    return tuple(d for d in found if d.is_error or d.code not in system.plan.lints_off)


def of_rest(folder: Path) -> tuple[Diagnostic, ...]:
    """What is to be said of the policy and of the methods' options of a system that cannot be loaded."""
    from avow.system.faults import rest_of

    rest = rest_of(folder)
    if rest is None:
        return ()
    found = [*_policy(rest.system)]
    for plan in rest.system.plan.nodes:
        for method in plan.methods:
            try:
                found += _method(rest.system, plan.node, method, asks=rest.is_sound)
            except Rejected as rejected:
                found += rejected.diagnostics
    return tuple(d for d in found if d.is_error)


def _model(system: System) -> tuple[Diagnostic, ...]:
    """The paper's step 1: does the system model account for all of the ROS graph?"""
    from avow.system.graph import dataflow
    from avow.system.rosgraph import account

    try:
        told = account(system, dataflow(system))
    except Rejected as rejected:  # a graph that cannot be read: said with everything else that is wrong
        return rejected.diagnostics
    return told.findings if told is not None else ()


def _policy(system: System) -> tuple[Diagnostic, ...]:
    from avow.assurance.policy import read_policy

    try:
        read_policy(system.plan.policy)
    except Rejected as rejected:
        return rejected.diagnostics
    return ()


def _method(system: System, node: str, method: Method, *, asks: bool = True) -> Iterable[Diagnostic]:
    """`asks`: whether the backend is asked, too, and not its schema alone."""
    if method.id in ENGINES:
        yield Diagnostic("PLAN090", f"'{method.id}' is the name of an engine of Avow's own", method.options.span)
        return
    try:
        tool = method_backend(system, method)
    except Rejected as rejected:
        if any(d.code != "BACKEND005" for d in rejected.diagnostics):
            raise
        yield from (replace(d, severity=Severity.WARNING, span=method.options.span) for d in rejected.diagnostics)
        return
    wrong = tuple(_schema(tool.options_schema, method.options, f"nodes.{node}: {method.id}"))
    yield from wrong
    if asks and node in [n.name for n in system.contract.nodes] and not any(d.is_error for d in wrong):
        yield from one_step.check(tool, method_job(system, system.contract.node(node), method))


def _schema(schema: Mapping[str, Any], options: Located, whole: str) -> Iterable[Diagnostic]:
    from avow.system.schema import violations

    data = options.data
    if isinstance(data, Mapping):
        own = {k: v for k, v in data.items() if k not in COMMON_OPTIONS}
        options = Located(own, options.span, options.spans)
    yield from violations(options, schema, whole)


def _tell(workspace: Workspace, system: str, found: Iterable[Diagnostic]) -> None:
    """The first few warnings, a line each: `avow check` shows all of it, with the source."""
    from avow.base.rendering import printable

    warned = [d for d in found if d.severity is Severity.WARNING]
    for d in warned[:WARNINGS]:
        place = f"{workspace.relative(Path(d.span.file))}:{d.span.line}: " if d.span else ""
        print(printable(f"warning[{d.code}]: {place}{d.message}"), file=sys.stderr)
    if len(warned) > WARNINGS:
        print(f"and {count(len(warned) - WARNINGS, 'more warning')}: `avow check {system}`", file=sys.stderr)


def show(found: Iterable[Diagnostic]) -> None:
    from avow.base.rendering import render

    text = render(tuple(found))
    if text:
        print(text, file=sys.stderr)


def refuse(rejected: Rejected) -> TaskError:
    show(rejected.diagnostics)
    errors = sum(d.is_error for d in rejected.diagnostics)
    return TaskError(f"{errors} error(s) in the input")


def refuse_quietly(name: str) -> TaskError:
    return TaskError(f"{name} cannot be read; see check:{name}")


def _stamp(workspace: Workspace, surveyed: Survey) -> Any:
    return workspace.artifacts / surveyed.system.name / "check.json"


def _key(surveyed: Survey) -> str:
    keys = sorted(key for work in surveyed.catalogue.works for key in work.keys.values())
    plan = surveyed.system.plan
    graph = plan.model.data.get("graph") if isinstance(plan.model.data, dict) else None
    # No obligation depends on the ROS graph: only this stage reads it.
    return json.dumps([surveyed.digest, digest_file(plan.root / str(graph)) if graph else "", keys])
