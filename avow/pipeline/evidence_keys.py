"""What a method's answer depends on besides the claim itself, the options, the plan's files and the tools.

A claim's digest covers its clause and the node's assumptions. A method may see more: the other guarantees that it takes
on (it discharges them together), the types of *all* the node's ports (a program is run on
inputs that the clause does not mention), the values of the contract's constants (an option or a program may name one),
the scenario, and what the node is wired to. An omission here would make stale evidence look current, so a backend is
assumed to see all of it unless it declares otherwise (`uses_scenario`, `uses_steps`, `uses_wiring`). The contracts of
the nodes that feed it count if it declares `uses_upstream`; a constant or another guarantee of the node counts as soon
as its name occurs anywhere in the options or files. A method sees only the name of such a guarantee.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow.backend_kit.linked import connected, reads_recordings, sees_all, told_too
from avow.backend_kit.protocol import Backend, Job
from avow.base.diagnostics import Rejected
from avow.base.files import read_regular
from avow.base.records import dataclass
from avow.formulas.formula import digest, sort_digest
from avow.language.contract import Contract, Definition, Node
from avow.language.sorts import DataSort, EnumSort, Sort, components
from avow.language.terms import Term
from avow.system.graph import dataflow
from avow.system.plan import Driving, Method, Ros, System


@dataclass(frozen=True, slots=True)
class Named:
    """Which of the contract's words a method's options and files name."""

    texts: tuple[bytes, ...]

    @classmethod
    def of(cls, tool: Backend, job: Job, options: str, files: Iterable[Path]) -> Named:
        """With the first values of what the program keeps, where the method sees the program."""
        begins = (edge.initial or "" for edge in (job.remembered if tool.uses_source else ()))
        return cls((" ".join((options, *begins)).encode(), *map(_read, files)))

    def __call__(self, name: str) -> bool:
        word = re.compile(rb"(?<!\w)" + re.escape(name.encode()) + rb"(?!\w)")
        return any(word.search(text) for text in self.texts)

    def types(self, contract: Contract) -> tuple[tuple[str, Sort], ...]:
        """Those that are named, or that have a named element or constructor. (The ports' own are always included.)"""
        return tuple((name, sort) for name, sort in contract.types if any(map(self, (name, *_words(sort)))))

    def others(self, job: Job) -> frozenset[str]:
        """The node's guarantees that the method does not take on, but names."""
        taken = {o.name for o in job.obligations}
        return frozenset(c.name for c in job.node.guarantees if c.name not in taken and self(c.name))

    def definitions(self, given: Iterable[Definition]) -> tuple[Definition, ...]:
        """Those that are named, without how they are written."""
        return tuple(replace(definition, text="") for definition in given if self(definition.name))

    def constants(self, contract: Contract) -> tuple[tuple[str, Term], ...]:
        return tuple((name, value) for name, value in contract.constants if self(name))


def _words(sort: Sort) -> Iterable[str]:
    for part in components(sort):
        match part:
            case EnumSort(members=members):
                yield from members
            case DataSort(constructors=constructors):
                yield from (c.name for c in constructors)


def _read(path: Path) -> bytes:
    try:
        return read_regular(path)
    except OSError:
        return b""


def method_options(method: Method) -> str:
    """A method's options, as they enter its key."""
    options = method.options.data if isinstance(method.options.data, Mapping) else {}
    return json.dumps({k: v for k, v in options.items() if k not in {"id", "guarantees"}}, sort_keys=True, default=str)


def surroundings(tool: Backend, job: Job, options: str, files: Iterable[Path] | None = None) -> str:
    """As text; `options` are the method's, as they enter its key; `files` are its files, where they are at hand."""
    named = Named.of(tool, job, options, tool.files(job) if files is None else files)
    constants = sorted([name, digest(value)] for name, value in named.constants(job.contract))
    definitions = named.definitions((*job.contract.definitions, *job.node.definitions))
    constants += sorted(
        [d.name, digest(d.body), *(f"{p.name} {sort_digest(p.sort)}" for p in d.parameters)] for d in definitions
    )
    constants += sorted([f"in.{p.name}", digest(p.value)] for p in job.node.fixed if p.value is not None)
    types = sorted([name, sort_digest(sort)] for name, sort in named.types(job.contract))
    parts: list[Any] = [_ports(job.node), _settled_together(job), sorted(named.others(job)), constants, types]
    scenario = job.system.plan.scenario
    if (tool.uses_scenario or reads_recordings(tool, job)) and scenario:
        parts.append(scenario.digest if tool.uses_scenario and tool.uses_steps else scenario.content)
    if connected(tool, job):
        parts.append(_wiring(job.system, job.node, told_too(tool, job)))
    parts += [_upstream_node(job, name, told_too(tool, job)) for name in sorted(upstream_of(tool, job))]
    if tool.uses_source and job.source is not None:
        declared = job.source
        texts = (declared.python, declared.class_name, declared.cpp, declared.parameters, declared.numbers.value)
        kind = [] if declared.kind is Driving.STEP else [declared.kind.value, *declared.run.split()]
        parts.append(["source", *texts, *kind, sorted(declared.memory.items())])
        parts += [repr(sorted(declared.values.items()))] if declared.values else []
        parts += sorted([clause.name, digest(clause.formula)] for clause in job.begins)
    if job.further is not None:
        parts.append(sorted([f.node, f.claim, digest(f.clause.formula), f.at_least, *f.supports] for f in job.further))
    if tool.uses_criticality:
        parts.append(["criticality", job.system.plan.node(job.node.name).criticality])
    return json.dumps(parts)


def _settled_together(job: Job) -> list[list[str]]:
    """The clauses that the method sees, in any order."""
    assumed = [(clause, digest(clause.formula)) for clause in job.node.assumptions]
    taken = [(job.clause(o), o.digest) for o in job.obligations]
    return sorted([c.kind.value, c.name, meaning] for c, meaning in (*assumed, *taken))


def _ports(node: Node) -> list[list[str]]:
    return sorted([p.declared, sort_digest(p.sort)] for p in (*node.inputs, *node.outputs))


def _wiring(system: System, node: Node, backends: Collection[str]) -> list[Any]:
    """The node's topics, and for each edge that feeds it: the first value, the source's topics, and the options that
    the same backend has for the source."""
    ros = system.plan.ros
    found: list[Any] = [_topics(node)]
    if ros != Ros():
        found.append([ros.distro, repr(ros.names), *ros.shared])
    try:
        edges = dataflow(system).feeding(node.name)
    except Rejected as rejected:  # told elsewhere
        return [*found, str(rejected)]
    for edge in sorted(edges, key=lambda e: (str(e.target), str(e.source))):
        methods = [m for m in system.plan.node(edge.source.node).methods if m.backend in backends]
        told = [m.options.data for m in methods if isinstance(m.options.data, Mapping)]
        found.append(
            [
                str(edge.source),
                str(edge.target),
                edge.delayed,
                " ".join((edge.initial or "").split()),
                _topics(system.contract.node(edge.source.node)),
                json.dumps([options.get("mapping") for options in told], sort_keys=True, default=str),
            ]
        )
    return found


def upstream_of(tool: Backend, job: Job) -> frozenset[str]:
    """The nodes whose contracts the method may look at: any, where recordings are compared with all claims. Else those
    whose data reach its node, and none where that assumes nothing."""
    if not sees_all(tool, job.method) or (job.further is None and not job.node.assumptions):
        return frozenset()
    if job.further is not None:
        return frozenset(node.name for node in job.contract.nodes)
    try:
        return dataflow(job.system).upstream(job.node.name)
    except Rejected:  # told elsewhere
        return frozenset()


def _upstream_node(job: Job, name: str, backends: Collection[str]) -> list[Any]:
    """A node's clauses, what feeds it, and the options of these backends."""
    node, plan = job.contract.node(name), job.system.plan.node(name)
    clauses = sorted([c.kind.value, c.name, digest(c.formula)] for c in node.clauses)
    told = [method_options(m) for m in plan.methods if m.backend in backends and name != job.node.name]
    return [name, clauses, _ports(node), _wiring(job.system, node, backends), told]


def _topics(node: Node) -> list[list[str]]:
    port = {t: t.port.variable.qualified if t.port else "" for t in node.topics}
    return sorted([t.ros_type, t.name, port[t], *([t.frame] if t.frame else [])] for t in node.topics)
