"""What one work may see, as data: no more than its keys cover.

An engine gets its slice and nothing else, so that it cannot use what a key does not say. A slice of a slice is the
slice: whoever receives one computes the keys from it again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from avow.backend_kit.protocol import Backend, Job
from avow.base.diagnostics import Span
from avow.calculus.interpretation import interpretation, ranges
from avow.calculus.providers import ProviderClaim, provider_claims
from avow.calculus.variables import Frame
from avow.formulas.finite import Ranges
from avow.formulas.values import Value
from avow.language.contract import Clause, Contract, Node
from avow.language.terms import TRUE, Variable
from avow.pipeline.evidence_keys import Named, method_options
from avow.pipeline.work import is_portable
from avow.system.graph import Edge, dataflow
from avow.system.plan import Connection, Located, Method, NodePlan, Plan, Ros, System


@dataclass(frozen=True, slots=True)
class SanitySlice:
    """A node, what the scenario gives its inputs, and what can meet its assumptions."""

    system: str
    node: Node
    given: Mapping[Variable, Value]
    ranges: Ranges
    linked: tuple[ProviderClaim, ...]


@dataclass(frozen=True, slots=True)
class ComposeSlice:
    """The whole contract, and what of the plan bears on how its nodes are composed."""

    system: System


@dataclass(frozen=True, slots=True)
class MethodSlice:
    """A node and one method of it, with what the method's options and files name of the contract's words."""

    system: System
    node: str
    method: str


Slice = SanitySlice | ComposeSlice | MethodSlice


def sanity_slice(whole: Frame, node: Node) -> SanitySlice:
    return SanitySlice(
        whole.system.name,
        node,
        interpretation(node, whole.system.plan.scenario),
        ranges(whole, node),
        provider_claims(whole, node),
    )


def compose_slice(system: System) -> ComposeSlice:
    plan = replace(
        system.plan,
        title="",
        contract_files=(),
        model=_NOTHING,
        messages=(),
        requirements=tuple(replace(r, confirmed=None, linked="") for r in system.plan.requirements),
        nodes=tuple(replace(node, methods=(), source=None) for node in system.plan.nodes),
        policy=_NOTHING,
        expected=None,
        accepted=(),
        plugins=(),
        lints_off=(),
        pictures=(),
        launched=None,
        included=(),
    )
    return ComposeSlice(System(plan, replace(system.contract, files=())))


def method_slice(tool: Backend, job: Job, *, sentences: bool = False) -> MethodSlice:
    """`sentences`: with those of the clauses, which no answer may depend on; generated files show them."""
    plan = job.system.plan
    named = Named.of(method_options(job.method), tool.files(job))
    edges = dataflow(job.system).feeding(job.node.name) if tool.uses_wiring else ()
    sources = {edge.source.node for edge in edges} - {job.node.name}
    contract = job.contract
    nodes = tuple(
        _own(job, named, sentences) if n.name == job.node.name else replace(n, assumptions=(), guarantees=())
        for n in contract.nodes
        if n.name == job.node.name or n.name in sources
    )
    cut = replace(
        _bare(plan),
        nodes=(
            _planned(tool, plan.node(job.node.name), job.method),
            *(_told(plan.node(name), tool.name) for name in sorted(sources)),
        ),
        connections=tuple(_connection(edge) for edge in edges),
        messages=plan.messages if tool.uses_wiring else (),
        ros=plan.ros if tool.uses_wiring else Ros(),
        scenario=plan.scenario if tool.uses_scenario else None,
        plugins=() if is_portable(tool) else plan.plugins,
    )
    cut_contract = Contract((), named.types(contract), named.constants(contract), nodes)
    return MethodSlice(System(cut, cut_contract), job.node.name, job.method.id)


def _own(job: Job, named: Named, sentences: bool) -> Node:
    """The node with the guarantees that the method takes on; of others that it names there is the name only."""
    taken, others = {o.name for o in job.obligations}, named.others(job)

    def seen(clause: Clause) -> Clause:
        """Without how it is written and where it stands."""
        formula = TRUE if clause.name in others else clause.formula
        return replace(clause, formula=formula, position=0, text="", sentence=clause.sentence if sentences else None)

    assumed = map(seen, job.node.assumptions)
    promised = (seen(c) for c in job.node.guarantees if c.name in taken | others)
    return replace(job.node, assumptions=tuple(assumed), guarantees=tuple(promised))


def _planned(tool: Backend, node: NodePlan, method: Method) -> NodePlan:
    return replace(node, methods=(method,), source=node.source if tool.uses_source else None)


def _told(node: NodePlan, backend: str) -> NodePlan:
    """A source: what the same backend is told of it."""
    return replace(node, criticality="", source=None, methods=tuple(m for m in node.methods if m.backend == backend))


def _connection(edge: Edge) -> Connection:
    return Connection(edge.source, edge.target, edge.delayed, edge.initial, edge.span, edge.initial_span)


_NOTHING = Located({}, Span("", 1, 1, 1, 1))


def _bare(plan: Plan) -> Plan:
    """Nothing but the plan's name and place."""
    return Plan(
        plan.system,
        "",
        plan.path,
        (),
        _NOTHING,
        (),
        (),
        (),
        None,
        (),
        (),
        (),
        _NOTHING,
        None,
        (),
        (),
        (),
    )
