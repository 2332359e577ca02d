"""Finds faults of a contract and a plan before any solver runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from avow.assurance.policy import read_policy
from avow.backend_kit import one_step
from avow.backend_kit.given import misshapen
from avow.backend_kit.protocol import COMMON_OPTIONS, asking
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.remembered import Shelf
from avow.base.workspace import plans_within
from avow.calculus.scenario import excluded
from avow.language.load import check_paths
from avow.pipeline.methods import method_backend, method_job
from avow.pipeline.work import ENGINES
from avow.system import code_ends, launched
from avow.system.driven import misused
from avow.system.faults import rest_of, without_followers
from avow.system.graph import dataflow
from avow.system.node_plan import never_read
from avow.system.parameters import with_parameters
from avow.system.plan import Located, Method, System
from avow.system.rosgraph import account
from avow.system.statements import expired, not_validated, requirement_sentences, without_words
from avow.system.topics import heard, several, turned, unknown_types


def diagnostics(
    system: System, clean: set[tuple[str, str]] | None = None, shelf: Shelf | None = None
) -> tuple[Diagnostic, ...]:
    """Lints of the contract and findings about the plan, without the warnings that the plan switches off. `clean`: each
    (node, method) without a finding; newly found ones are added. `shelf`: a cache of what the nodes' texts say and
    which options have the right shape."""
    found = check_paths(system.plan.contract_files, off=system.plan.off, shelf=shelf)[1]
    return (*found, *of_plan(system, clean, shelf))


def of_plan(
    system: System, clean: set[tuple[str, str]] | None = None, shelf: Shelf | None = None
) -> tuple[Diagnostic, ...]:
    """Findings about a plan that can be read: its account of the ROS graph, its requirements' sentences, and each
    method's options; without the warnings that the plan switches off. `clean` and `shelf`: as for `diagnostics`."""
    found = [
        *dataflow(system).findings,
        *launched.told(system),
        *unknown_types(system.plan, system.contract),
        *turned(system.plan, system.contract),
        *several(system.plan, system.contract),
        *code_ends.checked(system),
        *_model(system),
        *_policy(system),
        *requirement_sentences(system),
        *without_words(system),
        *expired(system),
        *not_validated(system),
        *left_out(system),
        *excluded(system),
        *never_read(system.plan),
        *misused(system.plan),
    ]
    for plan in system.plan.nodes:
        for method in plan.methods:
            name = plan.node, method.id
            if clean is None or name not in clean:
                said = tuple(_method(system, plan.node, method, shelf))
                found += said
                if clean is not None and not said:
                    clean.add(name)
    return tuple(
        d for d in without_followers(dict.fromkeys(found)) if d.is_error or d.code not in system.plan.lints_off
    )


def left_out(system: System) -> tuple[Diagnostic, ...]:
    """A warning for each plan in or below the system's folder that it does not include; none if the plan switches them
    off."""
    if "CLI021" in system.plan.lints_off:
        return ()
    taken_in = {path.resolve() for path in (system.plan.path, *system.plan.included)}
    below = (path for path in plans_within(system.plan.root) if path.resolve() not in taken_in)
    return tuple(not_verified(path, system.name, Severity.WARNING) for path in below)


def not_verified(path: Path, around: str = "", severity: Severity = Severity.ERROR) -> Diagnostic:
    """The warning about a plan that no run reads; `around`: the system whose folder it is in."""
    why = f"'{around}' does not take it in" if around else "its folder is not one of contracts/ itself"
    hint = "move its folder into contracts/, or take it in under `subsystems` of another plan"
    what = "contract" if path.suffix == ".rcl" else "plan"
    if what == "contract":
        why, hint = "there is no plan.yaml beside it", "write one, or move the contract to a system's folder"
    elif path.name != "plan.yaml":
        why, hint = "a plan's file is called plan.yaml", "rename it, or remove it"
    return Diagnostic("CLI021", f"this {what} is not verified: {why}", Span(str(path), 1, 1, 1, 1), severity, hint)


def of_rest(folder: Path) -> tuple[Diagnostic, ...]:
    """Findings about the policy and the methods' options of a system that cannot be loaded."""
    rest = rest_of(folder)
    if rest is None:
        return ()
    types = unknown_types(rest.system.plan, rest.system.contract)
    found = [*_policy(rest.system), *(d for d in types if not rest.may_follow(d))]
    plan, contract, _ = with_parameters(rest.system.plan, rest.system.contract)
    plan, contract, _ = heard(plan, contract)
    system = replace(rest.system, plan=plan, contract=contract)
    for node in rest.system.plan.nodes:
        for method in node.methods:
            try:
                found += _method(system, node.node, method, follows=partial(rest.may_follow, node=node.node))
            except Rejected as rejected:
                found += rejected.diagnostics
            except Exception:
                if rest.is_sound:
                    raise
    # a backend may fail on a contract that is read in part
    return tuple(d for d in found if d.is_error and (rest.is_sound or d.code != "BACKEND008"))


def _model(system: System) -> tuple[Diagnostic, ...]:
    """The paper's step 1: does the system model account for all of the ROS graph?"""
    try:
        told = account(system, dataflow(system))
    except Rejected as rejected:  # a graph that cannot be read is reported with all other faults
        return rejected.diagnostics
    return told.findings if told is not None else ()


def _policy(system: System) -> tuple[Diagnostic, ...]:
    try:
        read_policy(system.plan.policy)
    except Rejected as rejected:
        return rejected.diagnostics
    return ()


def _method(
    system: System,
    node: str,
    method: Method,
    shelf: Shelf | None = None,
    *,
    follows: Callable[[Diagnostic], bool] = lambda _: False,
) -> Iterable[Diagnostic]:
    """Faults of the options, and the backend's findings about the correct ones, without consequences of a fault that is
    reported already."""
    if method.id in ENGINES:
        yield Diagnostic("PLAN090", f"'{method.id}' is the name of an engine of Avow's own", method.options.span)
        return
    try:
        tool = method_backend(system, method)
    except Rejected as rejected:
        for d in rejected.diagnostics:
            severity = Severity.WARNING if d.code == "BACKEND005" else d.severity
            yield replace(d, severity=severity, span=method.options.key())
        return
    whole = f"nodes.{node}: {method.id}"
    with asking(tool.name, "options_schema"):
        wrong = tuple(misshapen(tool.options_schema, method.options, whole, shelf))
    yield from wrong
    without: tuple[Span, ...] = ()
    dropped: tuple[str, ...] = ()
    if any(d.is_error for d in wrong):
        options, without = _right(tool.options_schema, method.options)
        if (
            any(misshapen(tool.options_schema, options, whole))
            or tool.campaigns in method.options.data.keys() - options.data
        ):
            return  # without the faulty options the others mean nothing
        dropped = tuple(f"`{key}" for key in method.options.data if key not in options.data)
        method = replace(method, options=options)
    for known in (n for n in system.contract.nodes if n.name == node):
        named = {clause.name for clause in known.guarantees}  # others are reported where the plan names them
        method = replace(method, guarantees=tuple(name for name in method.guarantees if name in named))
        job = method_job(system, known, method)
        for d in one_step.check(tool, job):
            if not (follows(d) or d.span in without or any(key in d.message for key in dropped)):
                yield d


def _right(schema: Mapping[str, Any], options: Located) -> tuple[Located, tuple[Span, ...]]:
    """The options, and the entries of tables, that are correct by themselves; and the places of the others. What else
    an option has may mean something else beside a faulty part."""
    if not isinstance(options.data, Mapping):
        return options, ()
    properties = {"properties": schema.get("properties", {})}

    def fine(key: str, value: Any) -> bool:
        one = Located({key: value}, options.span)
        return key in COMMON_OPTIONS or (key in properties["properties"] and not any(misshapen(properties, one, "")))

    right: dict[str, Any] = {}
    without: list[Span] = []
    for key, value in options.data.items():
        table = isinstance(value, Mapping) and properties["properties"].get(key, {}).get("additionalProperties")
        parts = {part: {part: inner} for part, inner in value.items()} if table else {}
        kept = [part for part in parts.values() if fine(key, part)]
        if fine(key, value):
            right[key] = value
        elif kept:
            right[key] = {name: inner for part in kept for name, inner in part.items()}
            without += [options.at(key, name) for name, part in parts.items() if part not in kept]
    return replace(options, data=right), tuple(without)
