"""What one job may see, as data: no more than its keys cover.

An engine gets its slice and nothing else, so that it cannot use what a key does not cover. A slice of a slice is the
slice, so a receiver can compute the keys again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from avow.backend_kit.further import Further
from avow.backend_kit.linked import beside, connected, reads_recordings, told_too
from avow.backend_kit.protocol import Backend, Job
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.calculus.providers import ProviderClaim, provider_claims
from avow.calculus.variables import Frame
from avow.formulas.finite import interpretation
from avow.formulas.values import Value
from avow.language.contract import Clause, Contract, Node
from avow.language.terms import TRUE, Variable
from avow.pipeline.evidence_keys import Named, method_options, upstream_of
from avow.pipeline.methods import is_portable
from avow.system.graph import dataflow
from avow.system.plan import NOWHERE, NodePlan, Plan, Ros, System


@dataclass(frozen=True, slots=True)
class SanitySlice:
    """A node, what the scenario gives its inputs, and what can meet its assumptions."""

    system: str
    node: Node
    given: Mapping[Variable, Value]
    linked: tuple[ProviderClaim, ...]


@dataclass(frozen=True, slots=True)
class ComposeSlice:
    """The whole contract, and the parts of the plan that affect the composition of its nodes."""

    system: System


@dataclass(frozen=True, slots=True)
class MethodSlice:
    """A node and one of its methods, with the contract's names that the method's options and files use."""

    system: System
    node: str
    method: str
    further: tuple[Further, ...] | None = None


Slice = SanitySlice | ComposeSlice | MethodSlice


def sanity_slice(whole: Frame, node: Node) -> SanitySlice:
    return SanitySlice(
        whole.system.name,
        node,
        interpretation(node, whole.system.plan.scenario),
        provider_claims(whole, node),
    )


def compose_slice(system: System) -> ComposeSlice:
    plan = replace(
        system.plan,
        title="",
        contract_files=(),
        model=NOWHERE,
        messages=(),
        requirements=tuple(replace(r, validation=None, linked="", source="") for r in system.plan.requirements),
        nodes=tuple(NodePlan(node.node, "", (), node.span) for node in system.plan.nodes),
        policy=NOWHERE,
        expected=None,
        accepted=(),
        plugins=(),
        lints_off=(),
        hazards=(),
        statements=(),
        launched=None,
        included=(),
        ends=(),
        records=(),
    )
    return ComposeSlice(System(plan, replace(system.contract, files=())))


def method_slice(
    tool: Backend, job: Job, files: Iterable[Path] | None = None, *, sentences: bool = False
) -> MethodSlice:
    """`files`: the method's, if available. `sentences`: include the clauses' sentences, which generated files show and
    no answer may depend on."""
    plan = job.system.plan
    named = Named.of(tool, job, method_options(job.method), tool.files(job) if files is None else files)
    graph, own = dataflow(job.system), job.node.name
    upstream = upstream_of(tool, job)
    looks = connected(tool, job)
    edges = graph.feeding(own) if looks else job.remembered if tool.uses_source else ()
    edges += tuple(edge for name in sorted(upstream - {own}) for edge in graph.feeding(name))
    sources = {edge.source.node for edge in edges}
    told_of_itself = told_too(tool, job) if own in sources else frozenset[str]()
    sources = (sources | upstream) - {own}
    contract = job.contract
    places = _places(contract)
    nodes = tuple(
        _own(job, named, upstream, sentences) if name == own else _other(contract.node(name), upstream)
        for name in sorted(places.keys() & {own, *sources}, key=places.__getitem__)
    )
    cut = replace(
        _bare(plan),
        nodes=(
            _planned(tool, plan.node(job.node.name), job, told_of_itself),
            *(_told(plan.node(name), told_too(tool, job)) for name in sorted(sources)),
        ),
        connections=tuple(replace(edge, implied=False, topic="") for edge in edges),
        messages=plan.messages if looks else (),
        ros=plan.ros if looks else Ros(),
        scenario=plan.scenario if tool.uses_scenario or reads_recordings(tool, job) else None,
        plugins=() if is_portable(tool) else plan.plugins,
    )
    told = named.definitions(contract.definitions)
    cut_contract = Contract((), named.types(contract), named.constants(contract), nodes, told)
    further = None if job.further is None else tuple(map(_bare_further, job.further))
    return MethodSlice(System(cut, cut_contract), job.node.name, job.method.id, further)


@by_identity(20)
def _places(contract: Contract) -> dict[str, int]:
    """Node → its place in the contract."""
    return {node.name: at for at, node in enumerate(contract.nodes)}


def _own(job: Job, named: Named, upstream: Collection[str], sentences: bool) -> Node:
    """The node with the guarantees that the method discharges; others that it names keep only their names. A node that
    is upstream of itself has all of them."""
    node, taken, others = job.node, {o.name for o in job.obligations}, named.others(job)
    if node.name in upstream:
        taken, others = {c.name for c in node.guarantees}, frozenset()

    def seen(clause: Clause) -> Clause:
        clause = replace(clause, formula=TRUE) if clause.name in others else clause
        return replace(_bare_clause(clause), sentence=clause.sentence if sentences else None)

    promised = (seen(c) for c in node.guarantees if c.name in taken | others)
    told = named.definitions(node.definitions)
    return replace(node, assumptions=tuple(map(seen, node.assumptions)), guarantees=tuple(promised), definitions=told)


@by_identity(20_000)
def whole_node(node: Node) -> Node:
    """The node as seen by a method that discharges all of it, with its sentences."""
    assumed, promised = (
        tuple(replace(_bare_clause(clause), sentence=clause.sentence) for clause in part)
        for part in (node.assumptions, node.guarantees)
    )
    told = tuple(replace(definition, text="") for definition in node.definitions)
    return replace(node, assumptions=assumed, guarantees=promised, definitions=told)


def _other(node: Node, upstream: Collection[str]) -> Node:
    """Another node, with its clauses if its data reaches the method's own node."""
    clauses = node if node.name in upstream else replace(node, assumptions=(), guarantees=())
    assumed, promised = (tuple(map(_bare_clause, part)) for part in (clauses.assumptions, clauses.guarantees))
    return replace(node, assumptions=assumed, guarantees=promised, definitions=())


def _bare_clause(clause: Clause) -> Clause:
    """Without its notation and source position."""
    return replace(clause, position=0, text="", sentence=None)


def _bare_further(one: Further) -> Further:
    return replace(one, clause=_bare_clause(one.clause))


def _planned(tool: Backend, node: NodePlan, job: Job, backends: Collection[str]) -> NodePlan:
    """With the methods whose models the program is compared with, those whose recordings it is run on, and, for a node
    that feeds itself, its options as a source (`_told`)."""
    told = tuple(m for m in node.methods if m.backend in backends)
    others = {m.id: replace(m, guarantees=()) for m in (*beside(tool, job), *told) if m.id != job.method.id}
    methods = (job.method, *others.values())
    if told:  # in the plan's order, in which the key has them
        methods = tuple(sorted(methods, key=lambda m: [each.id for each in node.methods].index(m.id)))
    level = node.criticality if tool.uses_criticality else ""
    return replace(node, criticality=level, methods=methods, source=node.source if tool.uses_source else None)


def _told(node: NodePlan, backends: Collection[str]) -> NodePlan:
    """A source, with the same backend's options for it."""
    return replace(node, criticality="", source=None, methods=tuple(m for m in node.methods if m.backend in backends))


def _bare(plan: Plan) -> Plan:
    """Only the plan's name and path."""
    return Plan(plan.system, "", plan.path, ())
