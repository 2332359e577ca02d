"""On what a method's answer depends beside the claim itself, the options, the plan's files and the tools.

A claim's digest covers its clause and the node's assumptions. A method may see more: the types of *all* the node's
ports (a program is run on inputs that the clause does not mention), the values of the contract's constants (an option
or a program may name one), the scenario, and what the node is wired to. What is left out here would make evidence look
current that is not; so a backend is taken to see all of it unless it says that it does not (`uses_scenario`,
`uses_steps`, `uses_wiring`), and a constant counts as soon as its name occurs anywhere in the options or files.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Backend, Job
from avow.base.diagnostics import Rejected
from avow.formulas.formula import digest, sort_digest
from avow.language.contract import Contract, Node
from avow.system.graph import dataflow
from avow.system.plan import System


def surroundings(tool: Backend, job: Job, options: str) -> str:
    """As text; `options` are the method's, as they enter its key."""
    parts: list[Any] = [_ports(job.node), list(_constants(job.contract, options, tool.files(job)))]
    scenario = job.system.plan.scenario
    if tool.uses_scenario and scenario:
        parts.append(scenario.digest if tool.uses_steps else scenario.content)
    if tool.uses_wiring:
        parts.append(_wiring(job.system, job.node, tool.name))
    return json.dumps(parts)


def _ports(node: Node) -> list[list[str]]:
    return sorted([p.variable.qualified, sort_digest(p.sort)] for p in (*node.inputs, *node.outputs))


def _constants(contract: Contract, options: str, files: Iterable[Path]) -> Iterable[list[str]]:
    texts = [options.encode(), *map(_read, files)]
    for name, value in sorted(contract.constants, key=lambda item: item[0]):
        word = re.compile(rb"(?<!\w)" + re.escape(name.encode()) + rb"(?!\w)")
        if any(word.search(text) for text in texts):
            yield [name, digest(value)]


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _wiring(system: System, node: Node, backend: str) -> list[Any]:
    """The node's topics, and for each edge that feeds it: the first value, the source's topics, and what the same
    backend is told of the source."""
    found: list[Any] = [_topics(node)]
    try:
        edges = dataflow(system).feeding(node.name)
    except Rejected as rejected:  # told elsewhere
        return [*found, str(rejected)]
    for edge in sorted(edges, key=lambda e: (str(e.target), str(e.source))):
        methods = [m for m in system.plan.node(edge.source.node).methods if m.backend == backend]
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


def _topics(node: Node) -> list[list[str]]:
    return sorted([t.ros_type, t.name, t.port.variable.qualified if t.port else ""] for t in node.topics)
