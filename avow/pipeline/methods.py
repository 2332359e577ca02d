"""A method of the plan: its backend, the job that the backend gets, and the outside tools that it can use."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from avow.backend_kit.further import Further, guarantees, of_plan
from avow.backend_kit.linked import models, sees_all, unrun
from avow.backend_kit.protocol import Backend, Job
from avow.backend_kit.registry import backend, names
from avow.base.files import sha256
from avow.base.remembered import by_identity
from avow.base.tools import package_digest, program_digest
from avow.evidence.obligation import Kind, Obligation, ProgramClaim
from avow.formulas.formula import digest, node_digest, sort_digest
from avow.language.contract import Node
from avow.language.definitions import show_clause
from avow.system.plan import Method, System

if TYPE_CHECKING:
    from avow.pipeline.slices import MethodSlice

Offered = Mapping[str, tuple[str, str]] | None
"""With a remote executor: tool → version and program's digest there."""


def tool_identities(tool: Backend, offered: Offered = None) -> tuple[tuple[str, str, str], ...]:
    """Name, version and program's digest of each outside tool that a backend can use; empty where it is missing. With
    `offered`, the tools of the remote workers for what can be sent there."""
    if offered is not None and is_portable(tool):
        return tuple((t.name, *offered.get(t.name, ("", ""))) for t in tool.tools())
    found = ((t, package_digest(t.package) if t.package else program_digest(t.places)) for t in tool.tools())
    return tuple((t.name, t.version or "", mark) for t, mark in found)


def is_portable(tool: Backend) -> bool:
    """Whether its jobs can run remotely: an installed backend whose answers depend on the request alone."""
    return tool.portable and tool.name in names()


def method_backend(system: System, method: Method) -> Backend:
    return backend(method.backend, system.plan.plugins)


def method_job(
    system: System,
    node: Node,
    method: Method,
    tool: Backend | None = None,
    cut: MethodSlice | None = None,
) -> Job:
    """`tool` is the method's backend, if given: a backend under test need not be installed. `cut`: the job's slice, if
    it is made from one."""
    tool = tool or method_backend(system, method)
    names = [c for c in tool.claims if _can_be_claimed(system, node, c)]
    claims = tuple(_program_claim(system, node, name) for name in names)
    obligations = tuple(guarantee(system, node, name) for name in method.guarantees)
    job = Job(system, node, method, obligations, claims)
    return replace(job, further=_further(tool, job) if cut is None else cut.further)


def _further(tool: Backend, job: Job) -> tuple[Further, ...] | None:
    """The other claims that a method's data may contradict: of recordings of any node, else of its own."""
    if not tool.compares(job):
        return None
    system, node = job.system, job.node
    planned = (each for each in of_plan(system) if sees_all(tool, job.method) or each.node == node.name)
    return (*guarantees(system, node, job.method.guarantees), *planned)


def _can_be_claimed(system: System, node: Node, name: ProgramClaim) -> bool:
    """A program agrees with its model if the plan has one; if none can be run, the answer says why."""
    return name is not ProgramClaim.LINKED or bool(models(system, node.name) or unrun(system, node.name))


_CLAIMED = {
    ProgramClaim.FAULTLESS: "runs without fault wherever its assumptions hold",
    ProgramClaim.LINKED: "answers as the model that was verified in its place",
}


@by_identity(50_000)
def _program_claim(system: System, node: Node, name: ProgramClaim) -> Obligation:
    """A claim about the node's program: its meaning depends on the node's ports and assumptions."""
    ports = sorted((p.declared, sort_digest(p.sort)) for p in (*node.inputs, *node.outputs))
    assumed = sorted(digest(clause.formula) for clause in node.assumptions)
    meaning = sha256(json.dumps([name, ports, assumed]))
    claim = f"The program of {node.name} {_CLAIMED[name]}"
    return Obligation(system.name, node.name, Kind.PROGRAM, name, claim, "", meaning, (), node.span)


@by_identity(50_000)
def guarantee(system: System, node: Node, name: str) -> Obligation:
    """This node's implementation or model meets this guarantee, whenever its assumptions hold."""
    clause = node.clause(name)
    sentence = clause.sentence or f"{node.name} meets guarantee {name}"
    return Obligation(
        system.name,
        node.name,
        Kind.GUARANTEE,
        name,
        sentence,
        show_clause(clause, node),
        node_digest(node, clause),
        (f"{node.name}.{name}",),
        clause.span,
    )
