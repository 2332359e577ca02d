"""The output of ``avow compose --json``; docs/schemas/compose.schema.json is generated from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from typing import Any

from avow.base.codec import called
from avow.base.diagnostics import Severity
from avow.base.records import dataclass
from avow.base.verdict import Outcome, Verdict, in_words
from avow.calculus.composition import Composition
from avow.calculus.derivation import Goal
from avow.calculus.notation import Condition, write_goal
from avow.evidence.obligation import Obligation


@dataclass(frozen=True, slots=True)
class Edge:
    """An output that feeds an input. declared: by the plan, not by names."""

    source: str = field(metadata=called("from"))
    target: str = field(metadata=called("to"))
    delayed: bool
    declared: bool


@dataclass(frozen=True, slots=True)
class Finding:
    """What is to be said of the graph."""

    code: str
    severity: Severity
    message: str


@dataclass(frozen=True, slots=True)
class Graph:
    """environment: inputs that no node feeds; dangling: outputs that feed nothing."""

    nodes: tuple[str, ...]
    edges: tuple[Edge, ...]
    environment: tuple[str, ...]
    dangling: tuple[str, ...]
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Subsystem:
    """Nodes taken together as one; the derivation of the same name is theirs."""

    name: str
    nodes: tuple[str, ...]
    contract: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Derived:
    """A derivation. rule: premise, R1, R2, R3, R4 or all; premises: nodes, or names of other derivations; conditional:
    hypotheses of the conclusion."""

    name: str
    rule: str
    text: str
    conclusion: str
    premises: tuple[str, ...]
    side_conditions: tuple[Condition, ...]
    conditional: tuple[str, ...]
    findings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Settled:
    """An obligation and its answer. digest: of what is claimed, SHA-256; counterexample and run: name → value, as RCL
    writes it, a run a step an item."""

    id: str
    claim: str
    formula: str
    digest: str
    verdict: Verdict
    summary: str
    vacuous: bool
    hypotheses: tuple[str, ...]
    counterexample: Mapping[str, str] | None
    run: tuple[Mapping[str, str], ...]
    details: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ComposeDocument:
    """The derivations of a system's properties, and what became of their side conditions."""

    system: str
    graph: Graph
    subsystems: tuple[Subsystem, ...]
    derivations: tuple[Derived, ...]
    obligations: tuple[Settled, ...]


def to_document(
    composition: Composition, goals: Sequence[Goal], obligations: Sequence[Obligation], outcomes: Sequence[Outcome]
) -> ComposeDocument:
    """The document for a composition."""
    graph, plan = composition.frame.graph, composition.frame.system.plan
    written = [write_goal(goal, composition.known(goal)) for goal in goals]
    return ComposeDocument(
        composition.frame.system.name,
        Graph(
            graph.nodes,
            tuple(Edge(str(e.source), str(e.target), e.delayed, not e.implied) for e in graph.edges),
            tuple(map(str, graph.environment)),
            tuple(map(str, graph.dangling)),
            tuple(Finding(f.code, f.severity, f.message) for f in graph.findings),
        ),
        tuple(Subsystem(s.name, s.members, composition.goal(s.name).contract) for s in plan.subsystems),
        tuple(Derived(*(getattr(one, f.name) for f in fields(Derived))) for one in written),
        tuple(map(_settled, obligations, outcomes)),
    )


def _settled(obligation: Obligation, outcome: Outcome) -> Settled:
    shown = outcome.counterexample
    return Settled(
        *(obligation.local_id, obligation.claim, obligation.formula, obligation.digest),
        *(outcome.verdict, outcome.summary, outcome.vacuous, in_words(outcome.rests_on, outcome.hypotheses)),
        dict(shown.values) if shown else None,
        tuple(dict(step) for step in shown.trace) if shown else (),
        outcome.details,
    )
