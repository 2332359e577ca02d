"""Another system's folder as a subsystem: its nodes are included, connected among themselves as there.

Their names are prefixed with the subsystem's name (`left_camera`), so that one folder may be included more than once.
The assumptions of its plan about the environment are assumed here for inputs that stay open; for an input that is
provided here, the assumptions of its nodes have to be shown. Methods, scenario, requirements and policy are not
included: they belong to the other system.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.language.contract import Contract
from avow.ros.names import Placed, Resolver
from avow.system.folding import holders, outermost
from avow.system.graph import Graph, dataflow
from avow.system.plan import Endpoint, EnvironmentInput, Plan, Statement, Subsystem, System

Load = Callable[[Path], System]


def include(plan: Plan, contract: Contract, load: Load) -> tuple[Plan, Contract, tuple[Diagnostic, ...]]:
    """Plan and contract with the systems included that the plan's subsystems name; the faults found."""
    faults: list[Diagnostic] = []
    groups: list[Subsystem] = []
    for subsystem in plan.subsystems:
        if subsystem.folder is None:
            groups.append(subsystem)
            continue
        try:
            part = load(subsystem.folder)
        except Rejected as rejected:
            span = subsystem.options.at("system")
            faults.append(Diagnostic("PLAN110", f"subsystems.{subsystem.name}: that system cannot be taken in", span))
            faults += rejected.diagnostics
            continue
        clashes = _clashes(subsystem, contract, part.contract)
        faults += clashes
        if not clashes:
            plan, contract, inner = _taken_in(plan, contract, subsystem, part)
            groups += inner
    return replace(plan, subsystems=tuple(groups)), contract, tuple(faults)


def still_open(system: System, graph: Graph) -> System:
    """For inputs that are provided here, the included plan's assumptions are dropped."""
    kept = tuple(
        entry
        for entry in system.plan.environment
        if not entry.taken_in or any(endpoint in graph.environment for endpoint in holders(system, graph, entry))
    )
    return replace(system, plan=replace(system.plan, environment=kept))


def _clashes(subsystem: Subsystem, contract: Contract, part: Contract) -> list[Diagnostic]:
    span = subsystem.options.at("system")
    found: list[Diagnostic] = []
    for what, mine, theirs in (
        ("type", dict(contract.types), dict(part.types)),
        ("constant", dict(contract.constants), dict(part.constants)),
    ):
        for name in theirs:
            if name in mine and mine[name] != theirs[name]:
                message = f"subsystems.{subsystem.name}: the {what} {name!r} is another one there"
                found.append(Diagnostic("PLAN110", message, span, hint="give one of them another name"))
    known = {node.name for node in contract.nodes}
    for node in part.nodes:
        if f"{subsystem.name}_{node.name}" in known:
            message = f"subsystems.{subsystem.name}: its node {node.name!r} would be called as a node that is here"
            found.append(Diagnostic("PLAN110", message, span, hint="give the subsystem another name"))
    return found


def _taken_in(
    plan: Plan, contract: Contract, subsystem: Subsystem, part: System
) -> tuple[Plan, Contract, tuple[Subsystem, ...]]:
    def called(name: str) -> str:
        return f"{subsystem.name}_{name}"

    graph = dataflow(part)
    connections = tuple(
        replace(
            e,
            source=Endpoint(called(e.source.node), e.source.port),
            target=Endpoint(called(e.target.node), e.target.port),
            implied=False,
            topic="",
            span=subsystem.span,
        )
        for e in graph.edges
    )
    said = [replace(entry, port=_entry(subsystem.name, entry.port), taken_in=True) for entry in part.plan.environment]
    covered = {entry.port for entry in said}
    for at in graph.environment:
        name = f"{subsystem.name}.{at.port}"
        if name not in covered and f"{called(at.node)}.{at.port}" not in covered:
            covered.add(name)  # different from the input of that name here: nothing declares them to be one
            said.append(EnvironmentInput(name, None, None, subsystem.span, taken_in=True))
    inner = tuple(
        replace(group, name=called(group.name), members=tuple(map(called, group.members)), span=subsystem.span)
        for group in part.plan.subsystems
    )
    whole = replace(subsystem, members=tuple(called(name) for name in outermost(part)))
    nodes = tuple(replace(node, name=called(node.name)) for node in part.contract.nodes)
    merged = replace(
        contract,
        types=tuple({**dict(part.contract.types), **dict(contract.types)}.items()),
        constants=tuple({**dict(part.contract.constants), **dict(contract.constants)}.items()),
        nodes=contract.nodes + nodes,
    )
    files = [path for path in (part.plan.path, *part.plan.contract_files) if path.is_file()]
    larger = replace(
        plan,
        ros=replace(plan.ros, names=_names(plan, subsystem, part)),
        connections=plan.connections + connections,
        environment=plan.environment + tuple(said),
        statements=(*plan.statements, *_statements(subsystem.name, part.plan)),
        included=tuple(dict.fromkeys((*plan.included, *files, *part.plan.included))),
    )
    return larger, merged, (*inner, whole)


def _names(plan: Plan, subsystem: Subsystem, part: System) -> Resolver:
    """How the included nodes run: as there, within the subsystem's namespace, unless the plan here overrides it."""
    data = subsystem.options.data
    namespace = str(data.get("namespace", "")).strip("/") if isinstance(data, dict) else ""
    said = dict(plan.ros.names.nodes)
    for node in part.contract.nodes:
        there = part.plan.ros.names.placed(node.name)
        whole = f"/{namespace}{there.name}" if namespace else there.name
        said.setdefault(f"{subsystem.name}_{node.name}", Placed(whole, there.remaps, subsystem.span, there.named))
    return Resolver(tuple(said.items()))


def _statements(subsystem: str, plan: Plan) -> Iterator[Statement]:
    """The other plan's assumptions about its environment, under the names that its inputs have here."""
    for statement in plan.statements:
        place, _, port = statement.place.partition(".")
        if place == "environment":
            yield replace(statement, place=f"environment.{_entry(subsystem, port)}")


def _entry(subsystem: str, port: str) -> str:
    owner, _, name = port.partition(".")
    return f"{subsystem}.{name}" if owner == "in" else f"{subsystem}_{owner}.{name}"
